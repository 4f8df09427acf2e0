"""Plants drawn from the covariance of an identified one."""

from collections.abc import Iterable, Mapping

import numpy as np

from .covariance import Covariance
from .effects.effect import Effect
from .parameters import THETA_NAMES
from .plant import Plant

_TRIES = 1000


def sampled_plants(plant: Plant, n: int, rng: np.random.Generator) -> Iterable[Plant]:
    """n plants from the normal distribution around an identified one, kept where M > 0, friction ≥ 0 and bounds hold.

    Draws outside are drawn again (a truncated normal). Raises ValueError without a covariance, and, while drawing, if
    none of a thousand draws is possible.
    """
    covariance = plant.covariance
    if covariance is None:
        raise ValueError(
            "this plant has no covariance to draw from; identify it from a log (`furuta identify`), "
            "which stores one, or switch randomisation off"
        )
    return (_drawn(plant, covariance, rng) for _ in range(n))


def _drawn(plant: Plant, covariance: Covariance, rng: np.random.Generator) -> Plant:
    names = covariance.names
    values, vectors = np.linalg.eigh(covariance.matrix)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    for _ in range(_TRIES):
        shift = dict(zip(names, root @ rng.standard_normal(len(names)), strict=True))
        drawn = _shifted(plant, shift)
        if drawn is not None:
            return drawn
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
