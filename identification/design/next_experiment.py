"""The next experiment: most informative about a plant, or best at telling effects apart."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace

from furuta_gym.plant import Effect, Plant
from furuta_gym.simulation import Policy

from .d_optimal import Design, design
from .discriminate import DURATION, Separation
from .discriminate import between as separate
from .setup import Limits, Setup

_DESIGN_DURATION = 20.0  # s


def excite(
    plant: Plant | str | os.PathLike[str],
    between: str | Sequence[str | Effect] | None = None,
    policy: Policy | None = None,
    *,
    limits: Mapping[str, float] | None = None,
    duration: float | None = None,
    sample_time: float | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Design | Separation:
    """Design the next experiment on a rig, with the precision or the separation to expect.

    plant: identified (a Plant, a known set or a file). between: two or more effects to tell apart, with their values
    or by name, or "EFFECT,EFFECT"; None looks for the excitation that is D-optimal for θ. policy: the rig's balancing
    controller, called with readings (2,) [rad] once a sample (`controllers.usual_controller(plant)` is one); without
    one the pendulum hangs and the excitation is the whole command. limits: of |q1| [rad], |q2| [rad] from rest, the
    command u [{u}] and its change u_rate [{u}/s], those that differ from the usual ones. duration [s]: 20, or 10 with
    `between`. sample_time [s]: the controller's, else the plant's, else 0.002. progress is told each step.

    The result prints itself; `samples()` gives t (n,) [s] and the excitation (n,) [{u}] to play. Raises ValueError for
    unknown effects or limits, or where no experiment keeps the limits. Source: Goodwin & Payne 1977, chapter 6
    (D-optimal); Hunter & Reiner 1965 (between effects).
    """
    plant = Plant.resolve(plant)
    given = dict(limits or {})
    names = [field.name for field in fields(Limits)]
    if strange := [name for name in given if name not in names]:
        raise ValueError(f"limits: {', '.join(strange)} is none; expected {', '.join(names)}")
    if duration is not None and not 0 < duration <= 600:
        raise ValueError(f"duration = {duration!r}: expected seconds, above 0 and at most 600")
    if between is None:
        setup = Setup.of(plant, policy, duration or _DESIGN_DURATION, sample_time)
        return design(setup, replace(setup.usual_limits, **given), seed, progress=progress)
    suspects = [name.strip() for name in between.split(",")] if isinstance(between, str) else list(between)
    return separate(
        plant,
        suspects,
        policy,
        Limits(**given) if given else None,
        duration=duration or DURATION,
        sample_time=sample_time,
        seed=seed,
        progress=progress,
    )
