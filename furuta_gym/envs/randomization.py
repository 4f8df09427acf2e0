"""Plants drawn at each reset: from the covariance of their parameters, and effects switched on by chance.

A draw is a column of P (see `plant.integration`). `Randomization` turns a plant's covariance and the effects'
probabilities into tables, and `draws.draw_parameters` is the compiled twin of `sampling.sampled_plants`: the same
normal distribution, truncated in the same way, drawn from the env's own stream.
"""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..plant.effects import EFFECTS, Effect
from ..plant.effects.declaration import Parameter
from ..plant.integration_step import friction_rate, rest_slopes
from ..plant.layout import BASE_NAMES, FRICTION_ROWS, SHARPNESS_ROWS, THETA_ROWS, ParameterLayout
from ..plant.plant import Plant
from ..plant.sampling import Spread, sampled_plants, spread_of
from . import ranges as rg
from .draws import (
    CHANCE,
    DEFAULT,
    FROM,
    INVERSE,
    KIND,
    LEAST,
    LOWER,
    MOST,
    N_COLUMNS,
    NOMINAL,
    OFF,
    TARGET,
    TO,
    UPPER,
    A,
    B,
    vary,
)

# Sizes up to which an effect is drawn where only its chance is given and what is worth noticing is less than rigs have.
_WIDEST = {"input_delay.d": 0.025}  # s


@dataclass(frozen=True)
class Randomization:
    """How a plant is drawn.

    plant: with every effect that can act, in the order of P. table (7, n): per row of P its nominal value, bounds,
    value with the effect off (NaN: tells `draw_ranges` to draw none), and range of sizes when it is switched on (NaN:
    the nominal value). root (n, m): maps m standard normal numbers to shifts of P. switches (s, 3): first row, number
    of rows and probability of each effect that acts by chance. ranges (m, 10): see the columns in `draws`. told: a
    sentence on parameters that are not drawn from the covariance, see `sampling.spread_of`; empty where all are.
    """

    plant: Plant
    table: NDArray[np.float64]
    root: NDArray[np.float64]
    switches: NDArray[np.float64]
    ranges: NDArray[np.float64]
    told: str = ""

    @property
    def tables(self) -> tuple[NDArray[np.float64], ...]:
        """What `draw_parameters` and `draw_ranges` take: table, root, switches, ranges."""
        return self.table, self.root, self.switches, self.ranges

    @property
    def active(self) -> bool:
        """Whether resets differ in their plant at all."""
        return self.root.shape[1] > 0 or self.switches.shape[0] > 0 or self.ranges.shape[0] > 0

    @property
    def physical(self) -> float:
        """Share by which theta=physical varies masses, lengths, …; 0 without."""
        return float(self.ranges[self.ranges[:, KIND] == rg.PHYSICAL, A].sum())

    def largest(self, name: str, own: float) -> float:
        """The largest value of an entry of `ranges.RIG` or of an "effect.parameter": `own`, or what its range draws."""
        rows = self.ranges[:, TARGET] == _target(name, self.plant.layout)
        return float(self.ranges[rows, MOST].max(initial=own))

    @property
    def longest_delay(self) -> float:
        """Of `input_delay` in any episode [s]."""
        delay = self.plant.effect("input_delay")
        if delay is None:
            return 0.0
        row = self.plant.layout.row("input_delay.d")
        if self.root[row].any():
            return float(self.table[UPPER, row])
        chance = self.table[TO, row]
        return self.largest("input_delay.d", max(delay.parameters["d"], 0.0 if math.isnan(chance) else float(chance)))

    @property
    def friction_rate(self) -> float:
        """λ [1/s]: how fast friction stops a slow motion near upright, the largest in any episode as far as effects and
        theta=physical go. An effect may lower it, so each is also taken as it is where it does not act."""
        p, codes, rows = self.plant.packed()
        for row, neutral, chance in self._switched_sizes():
            if chance == 0.0:
                p[row] = neutral
        largest = _largest_rate(p, codes, rows, self.physical)
        for row, value in self._other_values():
            before, p[row] = p[row], value
            rate = _largest_rate(p, codes, rows, self.physical)
            if rate > largest:
                largest = rate
            else:
                p[row] = before
        return largest

    def _other_values(self) -> Iterator[tuple[int, float]]:
        """(row of P, value) that a parameter of an effect may have beside its own: neutral, or a range's upper end."""
        yield from ((row, neutral) for row, neutral, _ in self._switched_sizes())
        for drawn in self.ranges[self.ranges[:, TARGET] >= len(BASE_NAMES)]:
            yield int(drawn[TARGET]), float(drawn[MOST])
            if drawn[CHANCE] < 1.0:
                yield int(drawn[TARGET]), float(drawn[DEFAULT])

    def _switched_sizes(self) -> Iterator[tuple[int, float, float]]:
        """(row of P, neutral value, chance to act) of every size of the effects that act by chance."""
        chances = {int(first): float(chance) for first, _, chance in self.switches}
        for effect in self.plant.effects:
            own = self.plant.layout.rows_of(effect.name)
            if own.start in chances:
                sizes = zip(own, effect.type.parameters, strict=True)
                yield from ((row, p.neutral, chances[own.start]) for row, p in sizes if p.role == "size")

    def narrowed(self, level: float, rig: NDArray[np.float64]) -> "Randomization":
        """The same with every range drawn in: `level` in [0, 1] is how far it reaches from the plant's own value.

        rig (8,): the rig's own values, `numbers[kernels.RIG:]`. 0 draws the plant itself (or the end of a range that
        is next to it), 1 what was asked for. Chances of effects and of ranges and the covariance's standard deviations
        are multiplied by `level`; of an effect that the plant carries, the chance to be without it is. Raises
        ValueError for a level outside [0, 1].
        """
        if not 0.0 <= level <= 1.0:
            raise ValueError(f"level must lie in [0, 1], got {level!r}")
        ranges, switches = self.ranges.copy(), self.switches.copy()
        for switch in switches:
            first, count, chance = int(switch[0]), int(switch[1]), switch[2]
            carried = np.isnan(self.table[TO, first : first + count]).all()
            switch[2] = 1.0 - level * (1.0 - chance) if carried and chance > 0.0 else level * chance
        for row in ranges:
            if row[KIND] == rg.PHYSICAL:
                row[A] *= level
                continue
            target = int(row[TARGET])
            if row[CHANCE] < 1.0:
                carried = target >= 0 and self.table[NOMINAL, target] != row[DEFAULT]
                row[CHANCE] = 1.0 - level * (1.0 - row[CHANCE]) if carried else level * row[CHANCE]
            own = float(self.table[NOMINAL, target] if target >= 0 else rig[-1 - target])
            if row[KIND] == rg.NORMAL:
                own = own if math.isfinite(own) else row[A]
                row[[A, LEAST, MOST]] = own + level * (row[[A, LEAST, MOST]] - own)
                row[B] *= level
                continue
            own = min(max(own, row[A]), row[B])
            if row[KIND] == rg.LOG_UNIFORM:
                row[A], row[B] = own * (row[A] / own) ** level, own * (row[B] / own) ** level
            else:
                row[A], row[B] = own + level * (row[A] - own), own + level * (row[B] - own)
        return replace(self, root=level * self.root, switches=switches, ranges=ranges)

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


def randomization(
    plant: Plant,
    from_covariance: bool,
    probabilities: Mapping[str, float],
    physical: float = 0.0,
    ranges: Mapping[str, rg.Range] | None = None,
) -> Randomization:
    """Tables for `draw_parameters` and `draw_ranges`; physical and ranges as `ranges.Draws` has them.

    from_covariance: draw θ, r and the carried effects' parameters as `sampling.spread_of` has them. probabilities: for
    each named effect the chance to act in an episode. An effect that the plant carries then acts at its own size;
    another one acts at a size drawn uniformly up to what `Plant.default_effect` calls worth noticing (in either
    direction where both make sense), `input_delay` up to 25 ms. A size that has a range is drawn from it in place of
    that, and is neutral where the effect does not act. Raises ValueError on unknown names, probabilities outside
    [0, 1], a missing covariance or one that allows no plant.
    """
    for name, p in probabilities.items():
        Effect(name)  # an unknown name is refused with the library's list
        if name not in EFFECTS and plant.effect(name) is None:
            raise ValueError(
                f"effect_probabilities: the plant has no {name}, and chance does not make what was learned of a rig"
            )
        if not (isinstance(p, Real) and 0.0 <= p <= 1.0):
            raise ValueError(f"effect_probabilities: {name} must have a probability in [0, 1], got {p!r}")
    carried = {effect.name for effect in plant.effects}
    whole = plant.with_effects(*(plant.default_effect(name) for name in probabilities if name not in carried))
    packed = whole.packed()
    table = np.full((7, packed.p.size), np.nan)
    table[NOMINAL] = packed.p
    table[LOWER], table[UPPER], table[INVERSE] = -np.inf, np.inf, 0.0
    table[LOWER, FRICTION_ROWS] = np.where(packed.p[FRICTION_ROWS] >= 0, 0.0, -np.inf)
    table[LOWER, SHARPNESS_ROWS] = np.finfo(float).tiny
    switches, switched = [], []
    for effect in whole.effects:
        own = whole.layout.rows_of(effect.name)
        for row, parameter in zip(own, effect.type.parameters, strict=True):
            table[LOWER, row], table[UPPER, row] = parameter.lower, parameter.upper
            table[OFF, row] = parameter.neutral if parameter.role == "size" else packed.p[row]
            if effect.name not in carried and parameter.role == "size":
                table[NOMINAL, row] = parameter.neutral
                table[FROM : INVERSE + 1, row] = _sizes(whole, effect, parameter)
            if effect.name in probabilities and parameter.role == "size":
                switched.append(row)
        if effect.name in probabilities:
            switches.append((own.start, len(own), float(probabilities[effect.name])))
    spread = spread_of(plant) if from_covariance else None
    drawn = np.vstack([_evenly(spread, whole.layout), _ranges(physical, ranges or {}, whole, table)])
    table[OFF, np.intersect1d(switched, drawn[:, TARGET]).astype(int)] = np.nan
    return Randomization(
        whole,
        table,
        _root(plant, whole.layout, spread),
        np.array(switches, dtype=float).reshape(-1, 3),
        drawn,
        "" if spread is None else spread.told,
    )


def _target(name: str, layout: ParameterLayout) -> int:
    """Where a range draws to: the row of P, or −1 − the row of the rig's, which are in the order of `ranges.RIG`."""
    if name not in rg.RIG:
        return layout.row(name)
    names = list(rg.RIG)
    return -1 - sum(rg.RIG[before].values for before in names[: names.index(name)])


def _ranges(
    physical: float, ranges: Mapping[str, rg.Range], plant: Plant, table: NDArray[np.float64]
) -> NDArray[np.float64]:
    layout = plant.layout
    found: list[tuple[float, ...]] = []
    if physical:
        found.append((0.0, rg.PHYSICAL, physical, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    for name, entry in rg.RIG.items():
        if name in ranges:
            made = ranges[name]
            most = plant.supply if name == "u_max" else entry.high
            low, high = max(made.bounds[0], entry.low), min(made.bounds[1], most)
            numbers = (made.kind, made.a, made.b, made.chance, math.nan, low, high, 0.0)
            found += [(_target(name, layout) - i, *numbers, float(i > 0)) for i in range(entry.values)]
    for name, made in ranges.items():
        if name not in rg.RIG:
            row = _target(name, layout)
            low, high = max(made.bounds[0], table[LOWER, row]), min(made.bounds[1], table[UPPER, row])
            # so that the first and the last whole number are as frequent as those between
            beyond = 0.5 if made.whole and made.kind != rg.NORMAL else 0.0
            a, b = made.a - beyond, made.b + beyond
            found.append((row, made.kind, a, b, made.chance, table[OFF, row], low, high, made.whole, 0.0))
    return np.array(found, dtype=float).reshape(-1, N_COLUMNS)


def _sizes(plant: Plant, effect: Effect, parameter: Parameter) -> tuple[float, float, float]:
    """(from, to, inverse) of a size drawn by chance: uniform, or to / uniform where infinity is neutral."""
    default = _WIDEST.get(f"{effect.name}.{parameter.name}", effect.parameters[parameter.name])
    if math.isinf(parameter.neutral):
        return 0.0, default, 1.0
    if effect.type.sharpens:  # its neutral 0 stands for the plant's own r
        return plant.sharpness[int(parameter.name[1:]) - 1], default, 0.0
    return (0.0 if parameter.positive else -default), default, 0.0


def _evenly(spread: Spread | None, layout: ParameterLayout) -> NDArray[np.float64]:
    """Rows of `Randomization.ranges` for what the spread draws evenly."""
    found = [
        (layout.row(name), rg.UNIFORM, low, high, 1.0, math.nan, low, high, 0.0, 0.0)
        for name, (low, high) in (spread.ranges if spread else {}).items()
    ]
    return np.array(found, dtype=float).reshape(-1, N_COLUMNS)


def _root(plant: Plant, layout: ParameterLayout, spread: Spread | None) -> NDArray[np.float64]:
    if spread is None:
        return np.zeros((layout.size, 0))
    next(iter(sampled_plants(plant, 1, np.random.default_rng(0))))  # complains if nothing can be drawn
    values, vectors = np.linalg.eigh(spread.covariance.matrix)
    factor = vectors * np.sqrt(np.maximum(values, 0.0))
    root = np.zeros((layout.size, len(values)))
    for name, row in zip(spread.covariance.names, factor, strict=True):
        for i in layout.rows(name):
            root[i] += row
    return root


def _largest_rate(p: NDArray[np.float64], codes: NDArray[np.int64], rows: int, share: float) -> float:
    """`friction_rate` [1/s] of parameters p (n,), of theta=physical:share the largest that it draws.

    It grows with friction and falls with every mass and inertia; of the two lengths either end may be the worse. What
    effects add does not go with the gain, so a small one makes that the larger."""
    light, heavy = 1.0 - share, 1.0 + share
    found = 0.0
    for length, arm in itertools.product((light, heavy), repeat=2):
        P = p[:, None].copy()
        vary(P, 0, light, length, arm, light, light, light)
        P[FRICTION_ROWS] *= light * heavy
        found = max(found, friction_rate(rest_slopes(P[:, 0].copy(), codes, rows), 1.0, 1.0))
    return found
