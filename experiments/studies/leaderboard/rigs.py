"""The rigs that swing-ups are tried on, none of which a controller knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from controllers.comparison.conditions import SWING_UP_PUSH, Condition
from controllers.comparison.variations import built_later, later, noisier, weaker
from controllers.design import choose_sensors
from furuta_gym.plant import Effect, Plant

DURATION = 15.0  # s
CABLE = 0.05  # u_max per rad, 0.5 V/rad on qube
SEED = 60_000  # of rigs, starts and noise; no training has it


def with_cable(plant: Plant, share: float) -> Plant:
    """A plant whose arm is drawn to 0.3 rad by a cable of `share` u_max per rad."""
    return plant.with_effects(Effect("arm_spring", {"k": share * plant.u_max, "q1n": 0.3}))


def swing_up(name: str, plants: Plant | Sequence[Plant], trials: int, plant: Plant) -> Condition:
    """A condition with the sensors of the nominal plant."""
    return Condition(name, "swing_up", "swing_up", plants, choose_sensors(plant, None), trials, DURATION)


def robust_conditions(plant: Plant, trials: int) -> list[Condition]:
    """Delays of 0 to 24 ms, rigs whose parts differ by 20 %, cables."""
    found = [swing_up(f"{ms} ms late", later(plant, ms) if ms else plant, trials, plant) for ms in range(0, 25, 4)]
    for ms in (0, 8):
        rigs = built_later(plant, 20, ms, trials, SEED)
        found.append(swing_up("built ±20 %" + (f", {ms} ms late" if ms else ""), rigs, trials, plant))
    for share in (0.5 * CABLE, CABLE):
        found.append(
            swing_up(f"cable {share * plant.u_max:g} {plant.unit}/rad", with_cable(plant, share), trials, plant)
        )
    return found


def leaderboard_conditions(plant: Plant, trials: int) -> list[Condition]:
    """What most rigs have: delays, other parts, a cable, a weak supply, noise, a push."""
    wanted = ("0 ms late", "8 ms late", "16 ms late", "24 ms late", "built ±20 %, 8 ms late")
    found = [c for c in robust_conditions(plant, trials) if c.name in wanted or c.name.startswith("cable")]
    plain = found[0]
    return [
        *found,
        swing_up("supply 60 %", weaker(plant, 60), trials, plant),
        replace(plain, name="noise 3 mrad", sensors=noisier(plain.sensors, 3)),
        replace(plain, name="pushed", tap=SWING_UP_PUSH),
    ]


def sizes(values: np.ndarray) -> list[float]:
    """Numbers for a file: six digits, None-free."""
    return [float(f"{x:.6g}") for x in values]
