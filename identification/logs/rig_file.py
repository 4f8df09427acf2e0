"""rig.toml: how the logs of a rig are read, written once by `furuta init` and read by every command."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from furuta_gym.files import write_whole

from .checks import LogError
from .rig_mapping import RigMapping

NAME = "rig.toml"
SCHEMA = "furuta-rig/1"
_LAYOUT = {
    "columns": {"t": "t", "q1": "q1", "q2": "q2", "u": "u"},
    "units": {"time": "time_unit", "q1": "unit_q1", "q2": "unit_q2", "u": "input_unit", "u_scale": "input_scale"},
    "pendulum": {"zero": "pendulum_zero"},
    "signs": {"flip": "flip"},
    "encoders": {"counts": "encoder_counts"},
    "start": {"skip": "skip"},
    "samples": {"cut": "cut"},
}
"""Table and key of the file → field of `RigMapping`."""


def save_mapping(
    path: str | os.PathLike[str], mapping: RigMapping, reasons: Mapping[str, str] | None = None, about: str = ""
) -> Path:
    """Write a rig.toml, whole or not at all. reasons: by field, kept as comments. about: its first lines."""
    import tomlkit

    document = tomlkit.document()
    for line in about.splitlines():
        document.add(tomlkit.comment(line))
    document["schema"] = SCHEMA
    said = mapping.to_dict()
    for title, keys in _LAYOUT.items():
        present = {key: field for key, field in keys.items() if field in said}
        if not present:
            continue
        table = tomlkit.table()
        for key, field in present.items():
            item = tomlkit.item(said[field])
            if reason := (reasons or {}).get(field):
                item.comment(" ".join(reason.split()))
            table[key] = item
        document[title] = table
    return write_whole(path, tomlkit.dumps(document))


def load_mapping(path: str | os.PathLike[str]) -> RigMapping:
    """Read a rig.toml. Raises LogError, naming the file, for anything that is not one."""
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise LogError(f"{path} is not there. Make it with `furuta init LOG`.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise LogError(f"{path}: not a TOML file ({error}). Make it anew with `furuta init LOG --yes`.") from None
    if data.pop("schema", None) != SCHEMA:
        raise LogError(f'{path}: expected schema = "{SCHEMA}" in its first lines, as `furuta init LOG` writes it.')
    values: dict[str, Any] = {}
    for title, table in data.items():
        if title not in _LAYOUT or not isinstance(table, dict):
            raise LogError(f"{path}: {title!r} is not known. Expected of {', '.join(_LAYOUT)}.")
        for key, value in table.items():
            if key not in _LAYOUT[title]:
                raise LogError(f"{path}: [{title}] {key!r} is not known. Expected of {', '.join(_LAYOUT[title])}.")
            values[_LAYOUT[title][key]] = value
    try:
        return RigMapping.from_dict(values)
    except LogError as error:
        raise LogError(f"{path}: {error}") from None


def mapping_beside(log: str | os.PathLike[str]) -> Path | None:
    """The rig.toml beside a log, else None."""
    place = Path(log).parent / NAME
    return place if place.is_file() else None


def find_mapping(log: str | os.PathLike[str]) -> Path | None:
    """The rig.toml beside a log, else the one of the working folder, else None."""
    return mapping_beside(log) or (Path(NAME) if Path(NAME).is_file() else None)
