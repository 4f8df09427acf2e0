"""The estimator's coordinates: which numbers are free, on what scale, and how they fill a bank of filters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import THETA_NAMES, Plant
from furuta_gym.plant.effects.declaration import Parameter
from furuta_gym.plant.layout import SHARPNESS_NAMES as _SHARPNESS
from furuta_gym.plant.layout import SHARPNESS_ROWS, THETA_ROWS

from .noise_model import NOISE_NAMES, Noise
from .record import Record

ARM_ZERO_STD = 1.0
"""Prior standard deviation [rad] of the arm's zero in a log, relative to the first log's."""
PENDULUM_ZERO_STD = 1.5
"""The same of the pendulum's zero, in counts."""
_ZERO_LIMIT = 3.0, 4e-3
"""Counts, and radians where these are more: what a pendulum at rest may be off. Beyond it a zero is an effect."""

_STEP = 1e-6
"""Of differences for derivatives. Short: where parameters imitate each other their answers cancel to a thousandth, and
what is left must not be the differences' error. Not shorter: then it would be rounding's."""
_JUMP_STEP = 1e-4
"""The same of what the readings answer in jumps."""
_NOISE_STEP = 1e-4

SHARPNESS_NAMES = ("r", *_SHARPNESS)
"""Of coordinates that are a sharpness of friction; "r" is that of both axes."""


@dataclass(frozen=True)
class Coordinate:
    """One free number. `log` works on its logarithm (it stays positive), else on value / scale.

    row: its row in P (of "r" the first), in the packed noise, or the axis of an encoder's zero; zero_of: the log whose
    zero it is, None for anything else. low, high: bounds of the value. step: difference used for derivatives, in the
    coordinate. prior: (mean, std) of the value, or None. weak_prior: (centre, std) of the
    coordinate itself, for a log coordinate a log-normal prior. relative_to: the entry of θ that the value is compared
    with in that prior, "" for none; the prior moves with it.
    """

    name: str
    row: int
    log: bool
    scale: float = 1.0
    low: float = -math.inf
    high: float = math.inf
    step: float = _STEP
    noise: bool = False
    prior: tuple[float, float] | None = None
    weak_prior: tuple[float, float] | None = None
    relative_to: str = ""
    zero_of: int | None = None

    @property
    def of_plant(self) -> bool:
        """Whether it is a number of the plant: neither noise nor the zero of a log's encoder."""
        return not self.noise and self.zero_of is None

    def to_value(self, z: float) -> float:
        return math.exp(min(z, 700.0)) if self.log else z * self.scale

    def to_z(self, value: float) -> float:
        """The coordinate of a value; a value that is not positive goes to the lower bound of a log coordinate."""
        if self.log:
            return math.log(value) if value > 0 else self.z_bounds[0]
        return value / self.scale

    @property
    def z_bounds(self) -> tuple[float, float]:
        if self.log:
            return (math.log(self.low) if self.low > 0 else -60.0), (math.log(self.high) if self.high < 1e300 else 60.0)
        return self.low / self.scale, self.high / self.scale

    def slope(self, z: float) -> float:
        """d value / d z."""
        return self.to_value(z) if self.log else self.scale


def plant_coordinates(
    plant: Plant,
    fixed: Iterable[str] = (),
    priors: Mapping[str, tuple[float, float]] | None = None,
    free_sharpness: bool = True,
    negative_friction: bool = False,
    weak_prior_std: float | None = None,
) -> list[Coordinate]:
    """Coordinates of θ, r and the parameters of the plant's effects, those of `fixed` left out.

    θ1 … θ5 and r are positive: their logarithms (one that starts negative or zero is linear and keeps no sign).
    Friction is linear, so that it can be zero, and not negative unless asked for. Whole-number parameters, infinite
    ones (an effect switched off), what was learned, and what only a wider law has, stay as they
    are. A shape that mechanics limit has a log-normal prior around its default. Names are theta1 … theta9, r (or r1,
    r2) and effect.parameter. priors: name: (mean, std). weak_prior_std: a
    log-normal prior of this width around the plant's values on every log coordinate. What stays as it is may be in
    `fixed` too. Raises ValueError for an unknown name or an impossible prior.
    """
    fixed, priors = set(fixed), dict(priors or {})
    coordinates = _theta_coordinates(plant, negative_friction)
    if free_sharpness:
        names = _SHARPNESS if isinstance(plant.friction_sharpness, tuple) else ("r",)
        rows = [plant.layout.rows(name)[0] for name in names]
        coordinates += [
            Coordinate(name, row, log=True, low=1.0, high=1e4) for name, row in zip(names, rows, strict=True)
        ]
    for effect in plant.effects:
        if effect.type.learned:
            continue
        defaults = plant.default_effect(effect.name).parameters
        for p in effect.type.in_play(effect.parameters):
            value = effect.parameters[p.name]
            if not p.integer and math.isfinite(value):
                usual = max(abs(defaults[p.name]), abs(value)) if p.role == "size" else abs(defaults[p.name])
                name = f"{effect.name}.{p.name}"
                coordinates.append(_effect_coordinate(name, p, usual, plant.layout.row(name)))
    known = {c.name for c in coordinates}
    still = {f"{effect.name}.{name}" for effect in plant.effects for name in effect.parameters} - known
    if strange := (fixed | set(priors)) - known - still:
        free = ", ".join(sorted(known))
        raise ValueError(f"cannot fix or put a prior on {', '.join(sorted(strange))}; the parameters are {free}")
    if held := set(priors) & still:
        raise ValueError(
            f"cannot put a prior on {', '.join(sorted(held))}, which no descent moves: a whole number, or a part of an "
            "effect that is switched off. Fix its value, or leave the prior out"
        )
    if both := fixed & set(priors):
        raise ValueError(f"{sorted(both)} cannot be fixed and have a prior; give one of the two")
    p0 = plant.packed().p
    weak = [(c.to_z(p0[c.row]), weak_prior_std) if weak_prior_std and c.log else None for c in coordinates]
    return [
        replace(
            c,
            prior=_checked_prior(c.name, priors.get(c.name)),
            weak_prior=w or c.weak_prior,
            relative_to="" if w else c.relative_to,
        )
        for c, w in zip(coordinates, weak, strict=True)
        if c.name not in fixed
    ]


def _theta_coordinates(plant: Plant, negative_friction: bool) -> list[Coordinate]:
    theta = plant.theta
    # where friction starts near zero: what slows a joint by these many rad/s², or 1/s of its speed
    least = {5: 0.2 * theta[0], 6: 0.1 * theta[3], 7: 1.0 * theta[0], 8: 0.3 * theta[3]}
    lowest = -math.inf if negative_friction else 0.0
    coordinates = []
    for i, name in enumerate(THETA_NAMES):
        if i >= 5:
            scale = float(max(abs(theta[i]), least[i]))
            coordinates.append(Coordinate(name, i, log=False, scale=scale, low=lowest))
        elif theta[i] > 0:
            coordinates.append(Coordinate(name, i, log=True))
        else:
            scale = float(max(abs(theta[i]), 0.01 * math.sqrt(theta[0] * theta[3])))
            coordinates.append(Coordinate(name, i, log=False, scale=scale))
    return coordinates


def _effect_coordinate(name: str, p: Parameter, usual: float, row: int) -> Coordinate:
    step = _JUMP_STEP if p.jumps else _STEP
    if p.logarithmic and not p.spread:
        return Coordinate(name, row, log=True, low=p.lower, high=p.upper, step=step)
    if p.spread and usual > 0:
        of_theta = p.relative_to if p.relative_to and p.relative_to in THETA_NAMES else ""
        weak = (math.log(p.default if of_theta else usual), p.spread)
        low, high = max(p.lower, 1e-3 * usual), min(p.upper, 1e3 * usual)
        return Coordinate(name, row, True, low=low, high=high, step=step, weak_prior=weak, relative_to=of_theta)
    scale = usual if usual and math.isfinite(usual) else 1.0
    weak = (p.default / scale, p.spread / scale) if p.spread else None
    return Coordinate(name, row, log=False, scale=scale, low=p.lower, high=p.upper, step=step, weak_prior=weak)


def _checked_prior(name: str, prior: tuple[float, float] | None) -> tuple[float, float] | None:
    if prior is None:
        return None
    mean, std = prior
    if not (math.isfinite(mean) and math.isfinite(std) and std > 0):
        raise ValueError(f"a prior is mean ± standard deviation > 0, got {mean:g} ± {std:g} for {name}")
    return float(mean), float(std)


def noise_coordinates(least: Sequence[float] | NDArray[np.float64] = (1e-22, 1e-22)) -> list[Coordinate]:
    """Torque noise intensities of the rows, at least `least`, and factors on the variances of the readings."""
    return [
        Coordinate(
            name, i, log=True, low=least[i] if i < 2 else 0.05, high=1e6 if i < 2 else 1e4, step=_NOISE_STEP, noise=True
        )
        for i, name in enumerate(NOISE_NAMES)
    ]


def filled_parameters(
    coordinates: Sequence[Coordinate], z: NDArray[np.float64], p: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Packed parameters p (copied) with the coordinates' values in place; a single r sets both axes."""
    p = p.copy()
    for c, zi in zip(coordinates, z, strict=True):
        if c.of_plant:
            p[SHARPNESS_ROWS if c.name == "r" else c.row] = c.to_value(zi)
    return p


Zeros = Mapping[int, tuple[float, float]]
"""Zeros [rad] of the two encoders by number of the log: what they read where the angles are zero. Zero where absent."""


def filled_zeros(
    coordinates: Sequence[Coordinate], z: NDArray[np.float64], log: int, zeros: Zeros
) -> NDArray[np.float64]:
    """Zeros (2,) [rad] of the encoders in one log, those that are coordinates with their values."""
    found = np.array(zeros.get(log, (0.0, 0.0)))
    for c, zi in zip(coordinates, z, strict=True):
        if c.zero_of == log:
            found[c.row] = c.to_value(zi)
    return found


def filled_noise(coordinates: Sequence[Coordinate], z: NDArray[np.float64], noise: Noise) -> Noise:
    """The noise with the coordinates' values in it."""
    numbers = noise.packed()
    for c, zi in zip(coordinates, z, strict=True):
        if c.noise:
            numbers[c.row] = c.to_value(zi)
    return Noise.unpacked(numbers)


def filled_plant(plant: Plant, coordinates: Sequence[Coordinate], z: NDArray[np.float64]) -> Plant:
    """The plant with the coordinates' values in it (noise coordinates are passed over).

    Raises ValueError where the values make no plant (M not positive definite, an effect out of bounds).
    """
    p = filled_parameters(coordinates, z, plant.packed().p)
    effects, values = [], plant.layout.of_effects(p)
    for effect in plant.effects:
        own = values[effect.name]
        bounded = {q.name: min(max(float(own[q.name]), q.lower), q.upper) for q in effect.type.parameters}
        effects.append(type(effect)(effect.name, bounded, effect.std))
    r1, r2 = p[SHARPNESS_ROWS].tolist()
    r = (r1, r2) if isinstance(plant.friction_sharpness, tuple) else r1
    return plant.replace(theta=p[THETA_ROWS], friction_sharpness=r, effects=tuple(effects))


def zero_coordinates(plant: Plant, records: Sequence[Record], free: Iterable[int] | None = None) -> list[Coordinate]:
    """Zeros of the encoders in each log, with priors.

    An incremental encoder counts from where it was switched on, so logs of one rig may count from different zeros. The
    arm's zero is free within about a radian, where an effect depends on the arm's angle (nothing else shows it); the
    first log's is the plant's own. The pendulum's is set by hand at rest, where gravity has its zero: it is free within
    a count or two in every log, and never beyond three, unless an effect stands for it in the first.
    free: logs whose zeros are free, both of them; default as said.
    """
    logs = sorted({r.log for r in records})
    found = []
    for log in logs if free is None else free:
        record = next(r for r in records if r.log == log)
        count = np.maximum(record.quantum, np.sqrt(12.0 * record.variance))
        first = free is None and log == logs[0]
        if placed(plant) and not first:
            # a descent moves by a scale at most: it must reach a zero a radian away in a few steps
            found.append(_zero(log, 0, ARM_ZERO_STD, 0.3 * ARM_ZERO_STD))
        if not (first and tells_the_zero(plant)):
            found.append(_pendulum_zero(log, float(count[1])))
    return found


def tells_the_zero(plant: Plant) -> bool:
    """Whether an effect of the plant stands for a wrong zero of the pendulum."""
    return any(effect.type.wrong_zero == "pendulum" for effect in plant.effects)


def placed(plant: Plant) -> bool:
    """Whether something on the plant depends on where the arm stands."""
    return any(effect.type.of_arm_angle for effect in plant.effects)


def _pendulum_zero(log: int, count: float) -> Coordinate:
    limit = max(_ZERO_LIMIT[0] * count, _ZERO_LIMIT[1])
    return replace(_zero(log, 1, PENDULUM_ZERO_STD * count, count), low=-limit, high=limit)


def _zero(log: int, axis: int, std: float, scale: float) -> Coordinate:
    name = f"log{log + 1}.zero{axis + 1}"
    return Coordinate(name, axis, log=False, scale=scale, prior=(0.0, std), zero_of=log)
