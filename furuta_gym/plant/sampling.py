"""Plants drawn from the covariance of an identified one, and what is drawn where the log showed nothing."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from .covariance import Covariance
from .effects.effect import Effect
from .parameters import THETA_NAMES
from .plant import Plant

_TRIES = 1000
_SHARE = 0.25
"""Largest standard deviation of a parameter that is not identified, over its value: 95 % of draws within about half."""


@dataclass(frozen=True)
class Spread:
    """How plants are drawn around an identified one.

    covariance: of a normal distribution, cut off where no plant is possible. ranges: the θ that are drawn evenly
    between two values instead. told: a sentence on what is not identified; empty where all is.
    """

    covariance: Covariance
    ranges: Mapping[str, tuple[float, float]]
    told: str = ""


def spread_of(plant: Plant) -> Spread:
    """What to draw from. The covariance of the plant, but for the parameters that its log did not show.

    Their standard deviations say only that the log is silent, and draws from them are mostly no rigs. So θ2 is drawn
    evenly between θ3²/θ1 and θ4, where a rigid body has it. Any other one has a standard deviation of a quarter of its
    value at most, or of a size worth noticing if that is larger; its correlations stay.
    Raises ValueError without a covariance.
    """
    covariance = plant.covariance
    if covariance is None:
        raise ValueError(
            "this plant has no covariance to draw from; identify it from a log (`furuta identify`), "
            "which stores one, or switch randomisation off"
        )
    lost = [name for name in plant.not_identified if name in covariance.names]
    if not lost:
        return Spread(covariance, {})
    ranges = {}
    if "theta2" in lost:
        ranges["theta2"] = (float(plant.theta[2] ** 2 / plant.theta[0]), float(plant.theta[3]))
        covariance = covariance.without("theta2")
    others = [name for name in lost if name not in ranges]
    factor = np.ones(len(covariance.names))
    for name, std in covariance.std_of(others).items():
        factor[covariance.names.index(name)] = min(1.0, _SHARE * plant.noticeable(name) / max(std, 1e-300))
    covariance = Covariance(covariance.names, covariance.matrix * np.outer(factor, factor))
    return Spread(covariance, ranges, _told(ranges, others))


def _told(ranges: Mapping[str, tuple[float, float]], others: Iterable[str]) -> str:
    found = [f"θ2 evenly between {low:.3g} and {high:.3g}, as a rigid body has it" for low, high in ranges.values()]
    if others:
        found.append(f"{', '.join(n.replace('theta', 'θ') for n in others)} within about half of the value")
    return f"The log did not show every parameter. These are drawn otherwise: {'; '.join(found)}."


def sampled_plants(plant: Plant, n: int, rng: np.random.Generator) -> Iterable[Plant]:
    """n plants as `spread_of` has them, kept where M > 0, friction ≥ 0 and bounds hold.

    Draws outside are drawn again (a truncated normal). Raises ValueError without a covariance, and, while drawing, if
    none of a thousand draws is possible.
    """
    spread = spread_of(plant)
    return (_drawn(plant, spread, rng) for _ in range(n))


def _drawn(plant: Plant, spread: Spread, rng: np.random.Generator) -> Plant:
    names = spread.covariance.names
    values, vectors = np.linalg.eigh(spread.covariance.matrix)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    for _ in range(_TRIES):
        shift = dict(zip(names, root @ rng.standard_normal(len(names)), strict=True))
        drawn = _shifted(plant, shift)
        if drawn is not None:
            theta = dict(zip(THETA_NAMES, drawn.theta.tolist(), strict=True))
            evenly = {name: rng.uniform(*ends) for name, ends in spread.ranges.items()}
            return drawn.replace(theta=theta | evenly) if evenly else drawn
    raise ValueError(
        f"none of {_TRIES} draws from the covariance gives a possible plant (M > 0, friction ≥ 0). The parameters "
        "are too uncertain to randomise over; identify them from a log with more motion"
    )


def _shifted(plant: Plant, shift: Mapping[str, float]) -> Plant | None:
    theta = np.array([v + shift.get(name, 0.0) for name, v in zip(THETA_NAMES, plant.theta, strict=True)])
    # friction that the fit itself put below zero may stay; a draw may not make it negative
    if np.any((theta[5:] < 0) & (plant.theta[5:] >= 0)):
        return None
    common = shift.get("r", 0.0)
    r = tuple(v + common + shift.get(f"r{i + 1}", 0.0) for i, v in enumerate(plant.sharpness))
    try:
        effects = tuple(
            Effect(e.name, {k: v + shift.get(f"{e.name}.{k}", 0.0) for k, v in e.parameters.items()}, e.std)
            for e in plant.effects
        )
        sharpness = r if isinstance(plant.friction_sharpness, tuple) or r[0] != r[1] else r[0]
        return plant.replace(theta=theta, friction_sharpness=sharpness, effects=effects)
    except ValueError:
        return None
