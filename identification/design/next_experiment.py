"""The next experiment: most informative about a plant, or best at telling effects apart."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace

from furuta_gym.plant import THETA_NAMES, Effect, Plant
from furuta_gym.simulation import Policy

from .d_optimal import Design, design
from .discriminate import DURATION, Separation
from .discriminate import between as separate
from .setup import MARGIN, Limits, Setup

_DESIGN_DURATION = 20.0  # s

_MOVING = ("theta1", "theta3", "theta4", "theta5", "theta8")
"""What decides how far a rig moves. With θ2, θ6, θ7 or θ9 wrong by a quarter a run stays within its limits."""
_KNOWN = 1.0 - MARGIN
"""Relative standard deviation up to which a design can be trusted: what it leaves of its limits for a rig that is not
quite the plant. One of `_MOVING` wrong by 5 % brings the paper's d(t) to 0.97 of the limits at most on the sets qube
and large, and to 1.13 on table3. Wrong by twice that, table3 falls."""


def doubt(plant: Plant) -> str:
    """What it means for a design that its plant is poorly known, and what to do; "" where it is known well enough."""
    again = "Play it at half its size first. Then identify the rig from that log, and design again with the new plant."
    if plant.covariance is None:
        return (
            "this plant has no error bars, so the limits and predictions hold for the plant and perhaps not for your "
            f"rig. {again}"
        )
    theta = dict(zip(THETA_NAMES, plant.theta, strict=True))
    stds = plant.covariance.std_of(_MOVING).items()
    poor = [
        f"{name} not identified" if name in plant.not_identified else f"{name} ± {100 * std / abs(theta[name]):.2g} %"
        for name, std in stds
        if name in plant.not_identified or std > _KNOWN * abs(theta[name])
    ]
    if not poor:
        return ""
    return (
        f"the plant is poorly known ({', '.join(poor)}; expected at most {100 * _KNOWN:.0f} %), so the rig may pass "
        f"the limits, and the predictions are rough. {again}"
    )


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
        Limits(**(dict.fromkeys(names, math.inf) | given)) if given else None,
        duration=duration or DURATION,
        sample_time=sample_time,
        seed=seed,
        progress=progress,
    )
