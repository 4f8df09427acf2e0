"""What a training run that goes on with another must hold against it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, Struct

from furuta_gym.declared import checked

from .checkpoint import only_remains
from .curriculum import Evaluation
from .setup import Training
from .spent import Spent

Steps = Annotated[int, Meta(ge=0)]


class Progress(Struct):
    """How far a run is, as its checkpoint or its record says.

    resumed_at: steps at which earlier sittings ended. seed: None where it is not known; earlier_seeds: of the finished
    trainings that it goes on from. spent: in all sittings.
    """

    steps: Steps = 0
    best_return: float | None = None
    resumed_at: list[Steps] = []
    evaluations: list[Evaluation] = []
    seed: int | None = None
    earlier_seeds: list[int] = []
    spent: Spent = Spent()


_BEFORE_IT_WAS_KEPT = {"recipe": "plain", "reward_weights": {}, "arm_margin": 0.0}  # of records that do not say it


def check_same(training: Training, known: Mapping[str, Any], source: Path, mend: str) -> None:
    """Raises ValueError where `source`, whose record is `known`, is of another training than the one asked for.

    mend: what to do then."""
    asked = training.identity
    asked |= asked.pop("env")
    env = known.get("env") or {}
    if not isinstance(env, Mapping):
        raise ValueError(f'{source}: "env" of its record must be a mapping, got {env!r}; {mend}')
    had = {**_BEFORE_IT_WAS_KEPT, **known, **env}
    for key, wanted in asked.items():
        if had.get(key) != wanted:
            raise ValueError(
                f"{source} was trained with {key} = {had.get(key)!r}, and now {wanted!r} is asked for; {mend}"
            )


def progress_of(known: Mapping[str, Any], source: Path) -> Progress:
    """What a record says. Raises ValueError where it has no steps, or values that cannot be."""
    try:
        if "steps" not in known:
            raise ValueError("its record has no steps")
        return checked(known, Progress, "its record")
    except ValueError as error:
        raise ValueError(f"--resume: {source}: {error}; train anew under another name") from error


def check_output(path: Path, checkpoint: Path, resume: bool) -> None:
    """Raises ValueError where a policy cannot be written to `path`, or would replace something."""
    if path.suffix != ".zip":
        raise ValueError(f"output {path}: expected a name that ends in .zip")
    if path.is_dir() or (checkpoint.exists() and not checkpoint.is_dir()):
        raise ValueError(f"output {path}: there is a folder, or a file {checkpoint}, in the way; choose another name")
    if resume:
        return
    for found in (path, path.with_suffix(".json"), checkpoint):
        if found.exists() and not (found == checkpoint and only_remains(found, path.name)):
            raise ValueError(f"output {found} exists; go on with it by --resume, remove it, or choose another name")
