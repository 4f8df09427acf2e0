"""What is known before a fit: fixed values and effects in the plant that it starts from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from furuta_gym.plant import THETA_NAMES, Effect, Plant

from ..kalman.noise_model import Noise


def known_values(
    fixed: Mapping[str, float | None], start: Plant | None, effects: Sequence[str | Effect]
) -> dict[str, float]:
    """Fixed values, None replaced by those of the start plant or of effects given with values. Raises ValueError where
    there are none."""
    given = {f"{e.name}.{p}": v for e in effects if isinstance(e, Effect) for p, v in e.parameters.items()}
    known = {}
    for name, value in fixed.items():
        if value is None:
            value = given.get(name, math.nan if start is None else value_of(start, name))
            if math.isnan(value):
                raise ValueError(f"{name} is to stay at the start plant's value, and there is no start; give its value")
        known[name] = value
    return known


def with_known(plant: Plant, known: Mapping[str, float], effects: Sequence[str | Effect] = ()) -> Plant:
    """The start, with `effects` added and the fixed values in it; what is free gives way so that the mass matrix stays
    positive."""
    plant = plant.with_effects(*_started(plant, effects))
    of_effects: dict[str, dict[str, float]] = {}
    theta, r = plant.theta.copy(), list(plant.sharpness)
    for name, value in known.items():
        if not math.isfinite(value):
            raise ValueError(f"a fixed value must be a finite number, got {name} = {value!r}")
        if name in THETA_NAMES:
            theta[THETA_NAMES.index(name)] = value
        elif name in ("r", "r1"):
            r[0] = value
        if name in ("r", "r2"):
            r[1] = value
        effect, dot, parameter = name.partition(".")
        if dot:
            of_effects.setdefault(effect, {})[parameter] = value
    for name, i, least in (
        ("theta1", 0, 1.3 * theta[2] ** 2 / theta[3]),
        ("theta4", 3, 1.3 * theta[2] ** 2 / theta[0]),
    ):
        if theta[0] * theta[3] <= theta[2] ** 2 and name not in known:
            theta[i] = least
    if theta[0] * theta[3] <= theta[2] ** 2 and "theta3" not in known:
        theta[2] = 0.8 * math.sqrt(theta[0] * theta[3])
    pair = isinstance(plant.friction_sharpness, tuple) and "r" not in known
    held = [Effect(e.name, {**e.parameters, **of_effects[e.name]}) for e in plant.effects if e.name in of_effects]
    plant = plant.replace(theta=theta, friction_sharpness=(r[0], r[1]) if pair else r[0])
    return plant.with_effects(*held)


def _started(plant: Plant, effects: Iterable[str | Effect]) -> list[Effect]:
    """Effects at a tenth of a noticeable size, those given with values as they are."""
    started = []
    for effect in effects:
        if isinstance(effect, Effect):
            started.append(effect)
            continue
        default = plant.default_effect(effect)
        values = {}
        for p in default.type.parameters:
            full = default.parameters[p.name]
            small = p.role == "size" and math.isfinite(p.neutral)
            values[p.name] = p.neutral + 0.1 * (full - p.neutral) if small else full
        started.append(Effect(default.name, values))
    return started


def restless(plant: Plant) -> Noise:
    """Noise for a start plant: accelerations of 3 rad/s² for 10 ms that the model does not know of."""
    return Noise((0.1 * plant.theta[0] ** 2, 0.1 * plant.theta[3] ** 2))


def value_of(plant: Plant, name: str) -> float:
    if name in THETA_NAMES:
        return float(plant.theta[THETA_NAMES.index(name)])
    if name in ("r", "r1"):
        return plant.sharpness[0]
    if name == "r2":
        return plant.sharpness[1]
    effect, _, parameter = name.partition(".")
    found = plant.effect(effect)
    if found is None:
        return math.nan
    if parameter not in found.parameters:
        raise ValueError(f"{effect} has no parameter {parameter!r}; it has {', '.join(found.parameters)}")
    return float(found.parameters[parameter])
