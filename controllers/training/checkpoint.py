"""Checkpoints of a training run: the last two, each a folder that is whole or not there, with a checksum of each file.

000007/state.json             what the run is, how far it is, and the checksums
000007/<name>.safetensors     arrays, see `learning_state`
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from furuta_gym.files import read_json, stale, sync_folder, temporary_name, write_whole

from ..learned import tensors
from .learning_state import Arrays

KEPT = 2
_STATE = "state.json"
_NEW = "new"


def write_checkpoint(folder: Path, state: Mapping[str, Any], arrays: Mapping[str, Arrays]) -> Path:
    """Add a checkpoint to `folder` and remove all but the last two."""
    there = _numbered(folder)
    place = folder / f"{1 + max(there, default=0):06}"
    new = folder / _NEW
    shutil.rmtree(new, ignore_errors=True)
    sums = {}
    for name, some in arrays.items():
        raw = tensors.to_bytes(some)
        write_whole(new / f"{name}.safetensors", raw)
        sums[name] = hashlib.sha256(raw).hexdigest()
    write_whole(new / _STATE, json.dumps(dict(state) | {"sha256": sums}, allow_nan=False) + "\n")
    os.replace(new, place)
    sync_folder(folder)
    for number in sorted(there)[: 1 - KEPT]:
        shutil.rmtree(there[number], ignore_errors=True)
    return place


def read_checkpoint(folder: Path) -> tuple[dict[str, Any], dict[str, Arrays]] | None:
    """State and arrays of the newest checkpoint that is whole; None where there has been none.

    A broken one is warned about and removed if the one before it is whole. Raises ValueError if all are broken, or if
    the folder holds something else.
    """
    there = _numbered(folder)
    broken: dict[Path, str] = {}
    for number in sorted(there, reverse=True):
        try:
            state, arrays = _read(there[number])
        except (ValueError, OSError, KeyError) as error:
            broken[there[number]] = str(error)
            continue
        for place, reason in broken.items():
            warnings.warn(f"checkpoint {place} is broken ({reason}); going on from {there[number]}", stacklevel=2)
            shutil.rmtree(place)
        return state, arrays
    if broken:
        reasons = "; ".join(f"{place}: {reason}" for place, reason in broken.items())
        raise ValueError(f"no checkpoint is whole: {reasons}. Remove {folder} and train anew")
    if (folder / _STATE).exists():
        raise ValueError(
            f"{folder} was written by an earlier version, in files that run code when they are read; remove it and "
            "train anew"
        )
    return None


def has_checkpoint(folder: Path) -> bool:
    """Whether there is anything to go on from."""
    return bool(_numbered(folder)) or (folder / _STATE).exists()


def only_remains(folder: Path, policy: str) -> bool:
    """Whether `folder` holds no more than what a run that was killed before its first checkpoint was writing there.

    policy: name of the file that it was to write.
    """
    if not folder.is_dir() or has_checkpoint(folder):
        return False
    return all(entry.name == _NEW or policy in entry.name for entry in folder.iterdir())


def remove_checkpoints(folder: Path) -> None:
    """Remove the folder in one step, as far as a reader can see; what a killed removal left goes too."""
    for left in stale(folder, "old"):
        shutil.rmtree(left, ignore_errors=True)
    if folder.exists():
        gone = temporary_name(folder, "old")
        os.rename(folder, gone)
        shutil.rmtree(gone)


def _numbered(folder: Path) -> dict[int, Path]:
    found = folder.iterdir() if folder.is_dir() else ()
    return {int(path.name): path for path in found if path.name.isdecimal() and path.name.isascii()}


def _read(place: Path) -> tuple[dict[str, Any], dict[str, Arrays]]:
    state = read_json((place / _STATE).read_bytes())
    sums = state.pop("sha256", None) if isinstance(state, dict) else None
    if not isinstance(sums, dict) or not all(str(name).isidentifier() for name in sums):
        raise ValueError(f"{_STATE} has no checksums")
    arrays = {}
    for name, expected in sums.items():
        raw = (place / f"{name}.safetensors").read_bytes()
        if hashlib.sha256(raw).hexdigest() != expected:
            raise ValueError(f"{name}.safetensors does not have its checksum")
        arrays[name] = tensors.from_bytes(raw)
    return state, arrays
