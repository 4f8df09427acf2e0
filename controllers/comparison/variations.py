"""Rigs that differ from a plant: later, weaker, noisier, built a little differently, or with another θ."""

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from furuta_gym.plant import EFFECTS, Effect, Plant, sampled_plants
from furuta_gym.plant.sampling import spread_of
from furuta_gym.sensors import Sensors

from .trials import built_plants, plants_off_by


def built_name(percent: float, ms: float) -> str:
    """Name of rigs whose parts differ by so much, with a delay."""
    return f"built ±{percent:g} %" + (f", {ms:g} ms late" if ms else "")


def built_later(plant: Plant, percent: float, ms: float, n: int, seed: int) -> list[Plant]:
    """n rigs whose masses, lengths, inertias, frictions and gain differ by up to `percent`, `ms` later than `plant`."""
    rigs = built_plants(percent / 100, plant, n, seed) if percent else [plant] * n
    return [later(rig, ms) for rig in rigs] if ms else rigs


def later(plant: Plant, ms: float) -> Plant:
    """The plant with a delay of the command that is so much longer. Raises ValueError where no plant can be so late."""
    return plant.with_effects(Effect("input_delay", {"d": round(delay_of(plant) + ms * 1e-3, 9)}))


def possible(plant: Plant, delays: Sequence[int]) -> list[int]:
    """Those of `delays` [ms] that `later` can add to the plant's own."""
    return [ms for ms in delays if delay_of(plant) + ms * 1e-3 <= longest_delay() + 1e-9]


def longest_delay() -> float:
    """The longest delay [s] that a plant may have."""
    return EFFECTS["input_delay"].parameters[0].upper


def delay_of(plant: Plant) -> float:
    """The delay [s] of a plant's command."""
    own = plant.effect("input_delay")
    return own.parameters["d"] if own else 0.0


def weaker(plant: Plant, percent: float) -> Plant:
    """The plant whose motor gets so much of its supply."""
    return plant.replace(u_max=percent / 100 * plant.supply)


def noisier(sensors: Sensors, mrad: float) -> Sensors:
    """The sensors with white noise of so many mrad in addition to their own."""
    noise = np.hypot(sensors.noise_std, 1e-3 * mrad)
    return replace(sensors, noise_std=(float(noise[0]), float(noise[1])))


def other_plants(plant: Plant, n: int, seed: int) -> list[tuple[str, list[Plant]]]:
    """Plants whose θ is each off by a random factor, and plants from the identified covariance where there is one.

    A covariance so wide that hardly any draw is a plant gives none, and a warning; so do parameters that are drawn
    otherwise, see `spread_of`."""
    found = []
    for percent in (10, 20):
        rng = np.random.default_rng([seed, 2])
        found.append((f"θ ±{percent} %", plants_off_by(percent / 100, plant, n, rng)))
    if plant.covariance is not None:
        name, rng = "θ as uncertain as identified", np.random.default_rng([seed, 3])
        try:
            found.append((name, list(sampled_plants(plant, n, rng))))
            if told := spread_of(plant).told:
                warnings.warn(f"row {name!r}: {told}", stacklevel=2)
        except ValueError as error:
            warnings.warn(f"the comparison goes without its row {name!r}: {error}", stacklevel=2)
    return found
