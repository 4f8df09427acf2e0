"""Fits, suspects and diagnoses made by hand, and a fitter whose answers are known: the search without the filter."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import TABLE_3, Effect, Plant
from identification.diagnosis.gap_change import GapChange
from identification.diagnosis.naming.fits import FitRequest
from identification.diagnosis.naming.found import FoundEffect, Naming
from identification.diagnosis.naming.scores import Score
from identification.diagnosis.naming.search import Search
from identification.diagnosis.naming.suspects import Ranking, Suspect, price
from identification.diagnosis.outcome import Diagnosis
from identification.diagnosis.policy import DecisionPolicy
from identification.discrepancy.dependence import Channel, Variable
from identification.kalman.coordinates import Coordinate, Zeros
from identification.kalman.noise_model import Noise
from identification.kalman.record import Record
from identification.logs.log import Log
from identification.validation.closed_fraction import ClosedFraction
from identification.validation.gap import Gap
from tests.identification.diagnosis.silence import NoRest, names_found

SAMPLES = 1000
POLICY = DecisionPolicy()
NOISE = Noise((1.0, 1.0))
PER_PARAMETER = 0.5 * math.log(SAMPLES)
"""Price [nats] of a parameter in a toy fit."""


def _record() -> Record:
    t = np.arange(200) * 0.005
    return Record.from_log(Log(t, np.sin(t), np.cos(3.0 * t), np.sin(7.0 * t), encoder_counts=(4096, 4096)))


RECORD = _record()


@dataclass(frozen=True, eq=False)
class ToyFit:
    """What the search asks of a `Fit`."""

    plant: Plant
    noise: Noise
    value: float
    converged: bool = True
    samples: int = SAMPLES
    records: tuple[Record, ...] = (RECORD,)
    zeros: Zeros = field(default_factory=dict)
    coordinates: tuple[Coordinate, ...] = ()
    promised: float = math.inf
    strain: float = math.inf

    @property
    def optimum(self) -> Any:
        return SimpleNamespace(value=self.value, converged=self.converged)


def a_fit(*effects: str | Effect, value: float = 0.0, x: float = 0.0) -> Any:
    """A fit of Table 3 with effects (names: of their default sizes) and ln θ9 changed by x, of a known value."""
    added = (TABLE_3.default_effect(e) if isinstance(e, str) else e for e in effects)
    plant = TABLE_3.replace(theta=TABLE_3.theta * np.exp([*8 * [0.0], x])).with_effects(*added)
    return ToyFit(plant, NOISE, value)


def suspect(name: str, gain: float, *beside: str, nominal: float = 0.0) -> Suspect:
    """A suspect of a gain over a model of value `nominal`, fitted beside other effects."""
    return Suspect(name, gain, gain - price(name, SAMPLES), a_fit(*beside, name, value=nominal - gain))


def ranked(*suspects: tuple[str, float], fit: Any) -> Ranking:
    """A ranking by hand, one fit for all."""
    return tuple(Suspect(name, gain, gain - price(name, SAMPLES), fit) for name, gain in suspects)


@dataclass(frozen=True)
class Bowl:
    """A local minimum of V [nats]: `value` where ln θ9 is changed by x and effects have `sizes` (times their default's,
    1 where not given). rate: share of the way there that an iteration leaves. seen: share of V above the minimum that
    derivatives promise."""

    value: float
    x: float = 0.0
    sizes: Mapping[str, float] = field(default_factory=dict)
    rate: float = 0.1
    seen: float = 1.0

    def bottom(self, names: Sequence[str]) -> NDArray[np.float64]:
        return np.array([self.x, *(self.sizes.get(name, 1.0) for name in names)])


@dataclass(frozen=True)
class Bowls:
    """In place of `fit`: V is the lowest of some bowls of one steepness, and a descent ends in the one it starts in.

    by_effects: the bowls of a set of effects, by their names with spaces between. A set that is not there gains nothing
    over the best set within it. still(plant) [nats]: a part of V that no descent lowers.
    """

    by_effects: Mapping[str, Bowl | float | Sequence[Bowl]]
    still: Callable[[Plant], float] = lambda plant: 0.0
    steepness: float = 100.0

    def bowls(self, names: Sequence[str]) -> list[Bowl]:
        found: list[list[Bowl]] = []
        for key, given in self.by_effects.items():
            if set(key.split()) == set(names):
                return _bowls(given)
            if set(key.split()) <= set(names):
                found.append(_bowls(given))
        return min(found, key=lambda bowls: min(bowl.value for bowl in bowls))

    def __call__(self, request: FitRequest) -> Any:
        plant = request.plant
        names = [e.name for e in plant.effects]
        place = np.array([math.log(plant.theta[8] / TABLE_3.theta[8]), *(_size(plant, name) for name in names)])

        def v(bowl: Bowl, at: NDArray[np.float64]) -> float:
            return bowl.value + self.steepness * float(np.sum((at - bowl.bottom(names)) ** 2))

        bowl = min(self.bowls(names), key=lambda bowl: v(bowl, place))
        bottom = bowl.bottom(names)
        at = bottom + bowl.rate ** (request.iterations or 40) * (place - bottom)
        theta = TABLE_3.theta * np.exp([*8 * [0.0], at[0]])
        effects = [_sized(plant, name, size) for name, size in zip(names, at[1:], strict=True)]
        ended = plant.replace(theta=theta).with_effects(*effects)
        left = v(bowl, at) - bowl.value
        return ToyFit(ended, request.noise, v(bowl, at) + self.still(ended), left < 0.05, promised=bowl.seen * left)


def _bowls(given: Bowl | float | Sequence[Bowl]) -> list[Bowl]:
    if isinstance(given, Bowl):
        return [given]
    return [Bowl(given)] if isinstance(given, int | float) else list(given)


def _moving(effect: Effect) -> str | None:
    """The size that the toy's descent moves."""
    return next((p.name for p in effect.type.parameters if p.role == "size" and not p.integer and not p.rough), None)


def _size(plant: Plant, name: str) -> float:
    effect, p = plant.effect(name), _moving(TABLE_3.default_effect(name))
    assert effect is not None
    return effect.parameters[p] / TABLE_3.default_effect(name).parameters[p] if p else 1.0


def _sized(plant: Plant, name: str, size: float) -> Effect:
    effect, p = plant.effect(name), _moving(TABLE_3.default_effect(name))
    assert effect is not None
    usual = TABLE_3.default_effect(name).parameters
    return Effect(name, {**effect.parameters, p: float(size * usual[p])}) if p else effect


@dataclass(frozen=True)
class Scores:
    """In place of `scores`: these gains, `gain` for any other name in `names`; each start is the default effect.

    quiet: the gains at less noise, where they differ. absorbed: shares, 0 where not given.
    """

    gains: Mapping[str, float]
    quiet: Mapping[str, float] = field(default_factory=dict)
    absorbed: Mapping[str, float] = field(default_factory=dict)

    def __call__(
        self, current: Any, names: Sequence[str] | None = None, quieter: float = 1.0, policy: Any = None
    ) -> dict[str, Score]:
        gains = dict(self.gains) | (dict(self.quiet) if quieter > 1.0 else {})
        return {
            name: Score(name, gain, TABLE_3.default_effect(name), self.absorbed.get(name, 0.0))
            for name, gain in gains.items()
            if current.plant.effect(name) is None and (names is None or name in names)
        }


def search(
    by_effects: Mapping[str, Any],
    *names: str,
    policy: DecisionPolicy | None = None,
    anchor: Plant = TABLE_3,
    still: Callable[[Plant], float] = lambda plant: 0.0,
) -> Search:
    """A search over bowls; every name has a score that is worth a fit."""
    fitter = Bowls(by_effects, still)
    scorer = Scores(dict.fromkeys(names, 500.0))
    return Search(anchor, None, policy or DecisionPolicy(), fitter=fitter, scorer=scorer)


def constancy(p: float) -> Any:
    return SimpleNamespace(joint_p=p)


def rest(
    evidence: float = -4.0, p: float = 0.5, channel: str = "arm", variable: str = "arm angle", counts: float = 3.0
) -> Any:
    """What a final model leaves: a torque where its evidence is positive and large, a drift where p is small."""
    found, negligible = evidence > 8.0, counts < POLICY.negligible
    matters, changing = found and not negligible, p < POLICY.constant
    return SimpleNamespace(
        found=found,
        evidence=evidence,
        counts=np.array([counts, 0.0]),
        negligible=negligible,
        matters=matters,
        changing=changing,
        structured=matters or changing,
        channel=Channel(channel),
        variable=Variable(variable),
        constancy=constancy(p),
        sentence="left",
    )


def naming(
    *found: Suspect,
    equals: tuple[tuple[str, ...], ...] = (),
    rivals: tuple[tuple[Suspect, ...], ...] = (),
    refused: Suspect | None = None,
    **more: Any,
) -> Any:
    """What a search ends with. equals, rivals: of each effect found, what else may be its name, and what it was
    compared with."""
    none = tuple(() for _ in found)
    effects = tuple(
        FoundEffect((s, *compared), names)
        for s, compared, names in zip(found, rivals or none, equals or none, strict=True)
    )
    given = {"final": found[-1].fit if found else a_fit(), "rejected": (), "absorbed": {}}
    return Naming(nominal=a_fit(), found=effects, refused=refused, **(given | more))


def an_estimate(plant: Plant) -> Any:
    """What a diagnosis asks of an `Estimate`."""
    return SimpleNamespace(plant=plant, zeros={}, zeros_by_log={}, zeros_told=[], gain_changes=(), noise=None)


def a_diagnosis(*names: str, verdict: str = "named", **more: Any) -> Diagnosis:
    """A diagnosis that found some effects of 200 nats each, not verified yet."""
    found = [suspect(name, 200.0) for name in names]
    with_them = TABLE_3.with_effects(*(TABLE_3.default_effect(name) for name in names))
    given: dict[str, Any] = {
        "before": an_estimate(TABLE_3),
        "after": an_estimate(with_them),
        "naming": naming(*found),
        "rest": rest(),
        "left_over": 0.0,
        "command_rms": 1.0,
        "runtime_s": 1.0,
    }
    return Diagnosis(verdict, "the model misses something", **(given | more))


def a_gap(times_floor: float = 1.0, cost: float = 0.0) -> Gap:
    """Prediction errors of so many times the floor of 0.01 rad, and −ln likelihood [nats]."""
    floor = np.array([0.01, 0.01])
    rms, ends = times_floor * floor, np.arange(20) * 0.1
    return Gap(
        horizon=0.3,
        rms=rms,
        floor=floor,
        reading_floor=floor,
        fit_percent=np.zeros(2),
        whiteness=0.0,
        counts=np.zeros(2),
        repeats=False,
        curve=np.concatenate([[0.3], rms, floor])[None],
        tests=(),
        errors=np.tile(rms, (20, 1)),
        floors=np.tile(floor**2, (20, 1)),
        reading_floors=np.tile(floor**2, (20, 1)),
        times=ends,
        log=np.zeros(20, dtype=int),
        still=np.zeros((20, 2), dtype=bool),
        surprise=np.array([[0.0, 1.0, cost]]),
    )


def a_change(
    closed: tuple[float, float] = (0.3, 0.9), likelier: float = 500.0, after: float = 1.0, **more: Any
) -> GapChange:
    """A change of the gap: the interval of the closed share, the gain on these data [nats], error over floor after."""
    given = {"logs": (), "tail": None}
    gaps = a_gap(5.0, likelier), a_gap(after)
    return GapChange(*gaps, ClosedFraction(float(np.mean(closed)), closed), **(given | more))


@dataclass(frozen=True)
class Told:
    """A `Witness` by its answers. needed: effects that held-out data ask for; false: those that they speak against.
    a_little_off: worse than an adequate plant, though not far off. by [nats]: what they gain with what they need.
    elsewhere: effects of which they cannot judge. spoilt: an effect with which they speak against none."""

    far_off: bool = True
    needed: tuple[str, ...] = ()
    false: tuple[str, ...] = ()
    a_little_off: bool = False
    by: float = 10.0
    elsewhere: tuple[str, ...] = ()
    same_clock: bool = True
    spoilt: str | None = None

    def hears(self, fits: Any) -> None:
        pass

    def far(self, fitted: Any) -> bool:
        return self.far_off

    def off(self, fitted: Any) -> bool:
        return self.far_off or self.a_little_off

    def confirms(self, without: Any, fitted: Any) -> bool:
        return self._newest(without, fitted) in self.needed

    def prefers(self, fitted: Any, other: Any) -> bool:
        return self.confirms(fitted, other) and other.value - fitted.value < self.by

    def denies(self, without: Any, fitted: Any) -> bool:
        if self.spoilt in {e.name for e in fitted.plant.effects}:
            return False
        return self._newest(without, fitted) in self.false

    def excuses(self, without: Any, fitted: Any) -> bool:
        return self._newest(without, fitted) in self.elsewhere

    def _newest(self, without: Any, fitted: Any) -> str:
        (name,) = {e.name for e in fitted.plant.effects} - {e.name for e in without.plant.effects}
        return name


def named(values: dict[str, object], *names: str, witness: Any = None, **rest: Any) -> Naming:
    """Forward selection over bowls. rest: answers of a `Rest`; besides, what `name_effects` takes."""
    by, answers = search({"": 0.0, **values}, *names), NoRest()
    more = {key: rest.pop(key) for key in ("most", "joined") if key in rest}
    for question, answer in rest.items():
        assert hasattr(answers, question)
        setattr(answers, question, answer)
    return names_found(a_fit(), by, rest=answers, witness=witness, **more)
