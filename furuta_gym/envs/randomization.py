"""Plants drawn at each reset: from the covariance of their parameters, and effects switched on by chance.

A draw is a column of P (see `plant.dynamics`). `Randomization` turns a plant's covariance and the effects'
probabilities into tables, and `draw_parameters` is the compiled twin of `Covariance.draw`: the same normal
distribution, truncated in the same way, drawn from the env's own stream.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..plant.compiled import compiled
from ..plant.effects import EFFECTS, Effect
from ..plant.effects.declaration import Parameter
from ..plant.layout import FRICTION_ROWS, SHARPNESS_ROWS, THETA_ROWS, ParameterLayout
from ..plant.plant import Plant
from ..plant.sampling import sampled_plants
from .streams import normal_pair, uniform

_TRIES = 10_000  # draws until a possible plant; construction has shown that one in 1000 is

# Rows of Randomization.table, one column for each row of P.
_NOMINAL, _LOWER, _UPPER, _OFF, _FROM, _TO, _INVERSE = range(7)


@dataclass(frozen=True)
class Randomization:
    """How a plant is drawn.

    plant: with every effect that can act, in the order of P. table (7, n): per row of P its nominal value, bounds,
    value with the effect off, and range of sizes when it is switched on (NaN: the nominal value). root (n, m): maps m
    standard normal numbers to shifts of P. switches (s, 3): first row, number of rows and probability of each effect
    that acts by chance.
    """

    plant: Plant
    table: NDArray[np.float64]
    root: NDArray[np.float64]
    switches: NDArray[np.float64]

    @property
    def active(self) -> bool:
        """Whether resets differ in their plant at all."""
        return self.root.shape[1] > 0 or self.switches.shape[0] > 0

    def describe(self, P: NDArray[np.float64]) -> dict[str, Any]:
        """What was drawn, from P (n,) or (n, N): theta, friction_sharpness, and each effect's parameters."""
        return {
            "theta": np.ascontiguousarray(P[THETA_ROWS].T),
            "friction_sharpness": np.ascontiguousarray(P[SHARPNESS_ROWS].T),
            "effects": self.plant.layout.of_effects(P.copy()),
        }

    def drawn_plant(self, p: NDArray[np.float64]) -> Plant:
        """The plant with parameters p (n,), as a value."""
        effects = tuple(Effect(name, values) for name, values in self.plant.layout.of_effects(p).items())
        r1, r2 = p[SHARPNESS_ROWS].tolist()
        return self.plant.replace(
            theta=p[THETA_ROWS], friction_sharpness=r1 if r1 == r2 else (r1, r2), effects=effects, covariance=None
        )


def randomization(plant: Plant, from_covariance: bool, probabilities: Mapping[str, float]) -> Randomization:
    """Tables for `draw_parameters`.

    from_covariance: draw θ, r and the carried effects' parameters from `plant.covariance`. probabilities: for each
    named effect the chance to act in an episode. An effect that the plant carries then acts at its own size; another
    one acts at a size drawn uniformly up to what `Plant.default_effect` calls worth noticing (in either direction
    where both make sense). Raises ValueError on unknown names, probabilities outside [0, 1], a missing covariance or
    one that allows no plant.
    """
    for name, p in probabilities.items():
        Effect(name)  # an unknown name is refused with the library's list
        if not (isinstance(p, Real) and 0.0 <= p <= 1.0):
            raise ValueError(f"effect_probabilities: {name} must have a probability in [0, 1], got {p!r}")
    carried = {effect.name for effect in plant.effects}
    whole = plant.with_effects(*(plant.default_effect(name) for name in probabilities if name not in carried))
    packed = whole.packed()
    table = np.full((7, packed.p.size), np.nan)
    table[_NOMINAL] = packed.p
    table[_LOWER], table[_UPPER], table[_INVERSE] = -np.inf, np.inf, 0.0
    table[_LOWER, FRICTION_ROWS] = np.where(packed.p[FRICTION_ROWS] >= 0, 0.0, -np.inf)
    table[_LOWER, SHARPNESS_ROWS] = np.finfo(float).tiny
    switches = []
    for effect in whole.effects:
        own = whole.layout.rows_of(effect.name)
        for row, parameter in zip(own, EFFECTS[effect.name].parameters, strict=True):
            table[_LOWER, row], table[_UPPER, row] = parameter.lower, parameter.upper
            table[_OFF, row] = parameter.neutral if parameter.role == "size" else packed.p[row]
            if effect.name not in carried and parameter.role == "size":
                table[_FROM : _INVERSE + 1, row] = _sizes(whole, effect, parameter)
        if effect.name in probabilities:
            switches.append((own.start, len(own), float(probabilities[effect.name])))
    return Randomization(
        whole, table, _root(plant, whole.layout, from_covariance), np.array(switches, dtype=float).reshape(-1, 3)
    )


def _sizes(plant: Plant, effect: Effect, parameter: Parameter) -> tuple[float, float, float]:
    """(from, to, inverse) of a size drawn by chance: uniform, or to / uniform where infinity is neutral."""
    default = effect.parameters[parameter.name]
    if math.isinf(parameter.neutral):
        return 0.0, default, 1.0
    if effect.name == "friction_sharpness":  # its neutral 0 stands for the plant's own r
        return plant.sharpness[int(parameter.name[1:]) - 1], default, 0.0
    return (0.0 if parameter.positive else -default), default, 0.0


def _root(plant: Plant, layout: ParameterLayout, wanted: bool) -> NDArray[np.float64]:
    if not wanted:
        return np.zeros((layout.size, 0))
    next(iter(sampled_plants(plant, 1, np.random.default_rng(0))))  # complains if nothing can be drawn
    assert plant.covariance is not None
    values, vectors = np.linalg.eigh(plant.covariance.matrix)
    factor = vectors * np.sqrt(np.maximum(values, 0.0))
    root = np.zeros((layout.size, len(values)))
    for name, row in zip(plant.covariance.names, factor, strict=True):
        for i in layout.rows(name):
            root[i] += row
    return root


@compiled(forceinline=True)
def _possible(P, k, table):
    """M > 0 for every q2 (see `parameters.theta_vector`) and every row inside its bounds."""
    for row in range(P.shape[0]):
        if not (table[_LOWER, row] <= P[row, k] <= table[_UPPER, row]):
            return False
    th1, th2, th3, th4 = P[0, k], P[1, k], P[2, k], P[3, k]
    return th1 > 0.0 and th4 > 0.0 and th1 + th2 > 0.0 and th1 * th4 > th3 * th3


@compiled
def draw_parameters(P, k, streams, i, table, root, switches):
    """Fill column k of P (n, L) with a plant drawn from stream i."""
    tries = _TRIES if root.shape[1] > 0 else 0
    for attempt in range(tries + 1):
        for row in range(P.shape[0]):
            P[row, k] = table[_NOMINAL, row]
        if attempt == tries:
            break
        for j in range(root.shape[1]):
            z, _ = normal_pair(streams, i)
            for row in range(P.shape[0]):
                if root[row, j] != 0.0:  # also keeps 0 · z from turning an infinite parameter into NaN
                    P[row, k] += root[row, j] * z
        if _possible(P, k, table):
            break
    for s in range(switches.shape[0]):
        first, count = int(switches[s, 0]), int(switches[s, 1])
        on = uniform(streams, i) < switches[s, 2]
        for row in range(first, first + count):
            share = 1.0 - uniform(streams, i)
            low, high = table[_FROM, row], table[_TO, row]
            if not on:
                P[row, k] = table[_OFF, row]
            elif table[_INVERSE, row] > 0.0:
                P[row, k] = high / share
            elif not math.isnan(high):
                P[row, k] = low + share * (high - low)
