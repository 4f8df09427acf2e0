"""What the what-if view moves: a plant whose θ and effects are numbers with ranges. No page in here."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Any

from furuta_gym.plant import EFFECTS, THETA_NAMES, Effect, EffectType, Parameter, Plant
from identification import Log, PredictionWindow, identify
from identification.estimation.zeros import moved
from identification.kalman.coordinates import Zeros


@dataclass(frozen=True)
class Range:
    """Where a slider goes: from low to high in steps, and whether only whole numbers count."""

    low: float
    high: float
    step: float


@dataclass
class Choice:
    """The plant that is tried. base: a fit, where it starts and which Reset goes back to. origin: what the hand moves
    away from, the base or a plant taken since. theta: θ1 … θ9. effects: parameters by effect; off: those not acting.
    ranges stay as they were when the effect was added, so that a slider does not move under the hand."""

    base: Plant
    origin: Plant = field(init=False)
    theta: list[float] = field(default_factory=list)
    effects: dict[str, dict[str, float]] = field(default_factory=dict)
    off: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.take(self.base)

    def take(self, plant: Plant) -> None:
        """Start from this plant."""
        self.origin = plant
        self.theta = [float(v) for v in plant.theta]
        self.effects = {e.name: dict(e.parameters) for e in plant.effects}
        self.off = set()

    def reset(self) -> None:
        self.take(self.base)

    def add(self, name: str) -> None:
        """Let an effect act, at a size worth noticing."""
        self.effects[name] = dict(self.base.default_effect(name).parameters)
        self.off.discard(name)

    def remove(self, name: str) -> None:
        self.effects.pop(name, None)
        self.off.discard(name)

    def acting(self) -> list[Effect]:
        return [Effect(name, values) for name, values in self.effects.items() if name not in self.off]

    def plant(self) -> Plant:
        """The plant as the sliders stand, as it was fitted where nothing is moved. Raises ValueError where no plant can
        have these numbers."""
        now = _numbers(self.theta, self.acting())
        for fit in (self.origin, self.base):
            if now == _numbers(fit.theta, fit.effects):
                return fit
        return self.origin.replace(
            theta=self.theta,
            effects=tuple(self.acting()),
            covariance=None,
            checks={},
            provenance=_by_hand(self.origin, now),
        )

    def theta_range(self, i: int) -> Range:
        """From a quarter to four times the start; friction from nothing."""
        centre = abs(float(self.origin.theta[i])) or abs(float(self.origin.theta[0])) * 0.1
        low = 0.0 if i >= 5 else 0.25 * centre
        return Range(low, (4.0 if i < 5 else 3.0) * centre, 0.002 * centre)

    def effect_range(self, name: str, parameter: Parameter) -> Range:
        """Around the size worth noticing, and twice as far as the plant has it where it starts, within what is
        allowed."""
        default = abs(self.base.default_effect(name).parameters[parameter.name])
        if parameter.integer:
            return Range(max(parameter.lower, 1.0), min(parameter.upper, 36.0), 1.0)
        if isinstance(parameter.grid, tuple) and parameter.grid and parameter.role != "size":
            low, high = min(parameter.grid), max(parameter.grid)
            if parameter.spread:  # two standard deviations of what mechanics allow
                reach = 2.0 * parameter.spread
                low, high = (
                    (low * math.exp(-reach), high * math.exp(reach)) if parameter.logarithmic else (low, high + reach)
                )
        else:
            reach = 4.0 * default if default > 0 and math.isfinite(default) else math.pi
            there = self.origin.effect(name)
            reach = max(reach, 2.0 * abs(there.parameters[parameter.name]) if there is not None else 0.0)
            low, high = (0.0 if parameter.positive else -reach), reach
        low, high = max(low, parameter.lower), min(high, parameter.upper)
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            low, high = 0.0, max(1.0, 4.0 * default)
        return Range(low, high, (high - low) / 400.0)


def _numbers(theta: Iterable[float], effects: Iterable[Effect]) -> dict[str, float]:
    """What sliders move, by name: theta1 …, and EFFECT.PARAMETER."""
    own = {f"{effect.name}.{name}": value for effect in effects for name, value in effect.parameters.items()}
    return dict(zip(THETA_NAMES, map(float, theta), strict=True)) | own


def _by_hand(origin: Plant, now: Mapping[str, float]) -> dict[str, Any]:
    """Where a plant comes from that was moved away from `origin`: what was moved, and no likelihood of a fit."""
    known = origin.provenance
    before: dict[str, float | None] = {**_numbers(origin.theta, origin.effects), **known.get("moved", {})}
    names = [name for name in {**before, **now} if before.get(name) != now.get(name)]
    method = str(known.get("method", "a plant given"))
    return {name: value for name, value in known.items() if name != "log_likelihood"} | {
        "method": method if "moved" in known else f"moved by hand from {method}",
        "moved": {n: v if (v := before.get(n)) is not None and math.isfinite(v) else None for n in names},
    }


@dataclass(frozen=True)
class Start:
    """A window and the plant that it was measured with, and the plant's own log-likelihood there."""

    window: PredictionWindow
    log_likelihood: float


def prepare(plant: Plant, logs: Sequence[Log], zeros: Zeros, which: int, at: float) -> Start:
    """The window of a log that starts `at` seconds in. Raises ValueError."""
    log = moved(logs, zeros)[which]
    window = PredictionWindow.of(log, plant, at)
    return Start(window, window.predict(plant, settle=True).log_likelihood)


def fitted(logs: Sequence[Log], choice: Choice, pool: Executor | None = None) -> Plant:
    """θ and the effects that act, estimated together from all logs, starting where the sliders stand. pool: as for
    `identify`."""
    start = choice.plant().without_fit().replace(effects=())
    return identify(logs, start, effects=choice.acting(), pool=pool).plant


def moved_by_hand(kind: EffectType, values: Mapping[str, float]) -> list[Parameter]:
    """Parameters of an effect that a slider moves: none of what was learned, and none that is infinite (switched
    off)."""
    return [p for p in kind.parameters if not kind.learned and math.isfinite(values[p.name])]


def addable(choice: Choice) -> dict[str, str]:
    """Titles of the effects that are not there yet, by name."""
    return {name: f"{kind.title} ({name})" for name, kind in EFFECTS.items() if name not in choice.effects}


NAMES = THETA_NAMES
