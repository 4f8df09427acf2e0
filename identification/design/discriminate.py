"""Which experiment tells suspects apart: the evidence left when the truth is one effect and the fit another.

Every experiment of a small menu is simulated with each suspect as the truth, and every other suspect is fitted to the
log, θ and the noise intensities free. What its log-likelihood stays short of the truth's is the separation, in nats:
the Kullback–Leibler distance that is left once θ and the other effect have absorbed what they can (Hunter & Reiner
1965, with estimated nuisances). The experiment with the largest worst case is chosen. More amplitude is not better:
many look-alikes part only near zero speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import EFFECTS, Effect, Plant
from furuta_gym.plant.effects import where_to_look
from furuta_gym.simulation import Policy

from ..estimation.optimise import minimise
from ..estimation.pool import shared_pool
from ..estimation.prediction_error import PredictionError
from ..kalman.coordinates import noise_coordinates, plant_coordinates, zero_coordinates
from ..kalman.noise_model import Noise
from ..kalman.record import Record
from .setup import Limits, Setup, within_limits
from .signals import Prbs, Scaled, Signal, Sines, SquareWave, Sum, paper_signal

DURATION = 10.0  # s of each simulated experiment; the evidence grows in proportion
_ANCHOR_STD = 0.5  # of ln θ: how far earlier logs leave θ open
_SIZES = (1.0, 0.3, -0.3, -1.0)  # of its given size, where a suspect's fit may start
_RESTLESS = 30.0  # times the torque noise, where a fit starts: a wrong suspect needs it
_ITERATIONS = 12
_SMALLER = 3  # sizes tried where the pendulum falls with a suspect, each 0.6 times the last
_TOLERANCE = 0.5  # nats
CLEAR = 10.0  # nats, beyond which two suspects count as told apart


@dataclass(frozen=True)
class Entry:
    """An experiment of the menu. limits: what to scale it to, beside the user's. most: largest factor, in units of
    `Setup.size`."""

    name: str
    signal: Signal | None
    limits: Limits
    most: float = math.inf
    hanging: bool = False
    offset: float = 0.0
    advice: str = ""


def menu(hanging_only: bool = False) -> tuple[Entry, ...]:
    """The experiments considered; without a controller only those that need none."""
    sweep = Sines((1.0,), (0.15,), (0.0,))
    swept = Sum((sweep, paper_signal(scale=0.1)))
    calm = Sum((Sines((1.0, 0.5), (0.4, 0.9), (0.0, 0.3)), Prbs(0.15, 0.05, 10, 1)))
    hanging = (
        Entry(
            "hanging free decay",
            None,
            Limits(q2=2.5),
            1.0,
            True,
            1.2,
            "lift the hanging pendulum by 1.2 rad, let go, no command; to be read beside other logs",
        ),
        Entry("hanging slow sweep", sweep, Limits(1.2, 2.5), hanging=True, advice="a slow sine while it hangs"),
        Entry("hanging fast prbs", Prbs(1.0, 0.05, 10, 1), Limits(1.5, 2.5), hanging=True, advice="while it hangs"),
    )
    upright = (
        Entry("standard", paper_signal(), Limits(2.0, 0.5), 1.0, advice="the paper's d(t)"),
        Entry(
            "slow arm sweep",
            swept,
            Limits(1.2, 0.3),
            advice="the arm wide and slow, a little of the paper's d(t) added",
        ),
        Entry("dither about rest", calm, Limits(0.25, 0.06), advice="small and slow, much time near zero speed"),
        Entry("fast prbs", Prbs(1.0, 0.03, 10, 1), Limits(1.0, 0.2), advice="quick switching of the command"),
        Entry("large steps", SquareWave(1.0, 2.5), Limits(2.0, 0.4), advice="large square waves"),
    )
    return hanging[1:] + hanging[:1] if hanging_only else (*upright, hanging[0])


@dataclass(frozen=True)
class Trial:
    """One experiment tried: separations {(truth, fitted): nats}, none where it cannot be run (`problem` says why).

    Where a pair is told apart no better than by another experiment's worst, the pairs after it are not tried."""

    entry: Entry
    setup: Setup
    signal: Scaled | None
    separations: dict[tuple[str, str], float]
    problem: str = ""

    @property
    def worst(self) -> float:
        """The smallest separation, −inf where the experiment cannot be run."""
        return min(self.separations.values(), default=-math.inf)


@dataclass(frozen=True)
class Separation:
    """The experiment that tells the suspects apart best, and all that were tried."""

    names: tuple[str, ...]
    best: Trial
    trials: tuple[Trial, ...]

    @property
    def nats(self) -> float:
        """Predicted smallest separation of the best experiment [nats]."""
        return self.best.worst

    @property
    def sentence(self) -> str:
        """Advice in one sentence."""
        entry, duration = self.best.entry, self.best.setup.duration
        suspects = " and ".join(self.names)
        if self.nats < CLEAR:
            return (
                f"no experiment tried separates {suspects}: the best ({entry.name}, {duration:g} s) separates them by "
                f"{self.nats:.1f} nats; run it longer, or change the rig"
            )
        return (
            f"to separate {suspects}, run the experiment “{entry.name}” ({entry.advice}) for {duration:g} s; expected "
            f"separation: {self.nats:.3g} nats"
        )

    @property
    def whole_command(self) -> bool:
        """Whether the excitation is the whole command; else it is added to the controller's."""
        return self.best.setup.policy is None

    @property
    def facts(self) -> dict[str, str]:
        """What a command file should say of itself."""
        start = {"start_from_hanging_rad": f"{self.best.entry.offset:g}"} if self.best.entry.offset else {}
        return (
            {"excitation": self.best.entry.name, "between": " ".join(self.names)}
            | start
            | {"predicted_separation_nats": f"{self.nats:.4g}"}
        )

    def samples(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """t (n,) [s] and the excitation (n,) at the samples."""
        setup, signal = self.best.setup, self.best.signal
        t = np.arange(round(setup.duration / setup.sample_time), dtype=float) * float(setup.sample_time)
        return t, np.zeros_like(t) if signal is None else np.asarray(signal(t), dtype=float)

    def to_dict(self) -> dict[str, Any]:
        def trial(t: Trial) -> dict[str, Any]:
            pairs = [{"truth": a, "fitted": b, "nats": v} for (a, b), v in t.separations.items()]
            return {"experiment": t.entry.name, "separations": pairs, "problem": t.problem or None}

        return {
            "suspects": list(self.names),
            "experiment": self.best.entry.name,
            "whole_command": self.whole_command,
            "separation_nats": self.nats,
            "sentence": self.sentence,
            "tried": [trial(t) for t in self.trials],
        }

    def __str__(self) -> str:
        lines = [self.sentence[0].upper() + self.sentence[1:] + "."]
        for t in sorted(self.trials, key=lambda t: -t.worst):
            pairs = ", ".join(f"{a} fitted by {b} {v:.3g}" for (a, b), v in t.separations.items())
            lines.append(f"  {t.entry.name:<20} {pairs + ' nats' if pairs else t.problem}")
        return "\n".join(lines)


def between(
    plant: Plant,
    names: Sequence[str | Effect],
    policy: Policy | None = None,
    limits: Limits | None = None,
    *,
    duration: float = DURATION,
    sample_time: float | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Separation:
    """Choose the experiment with the largest predicted separation of its worst pair of suspects.

    plant: identified. names: two or more effects, with their values or by name: the plant's own value where it has the
    effect, as plants that a diagnosis wrote do, else a noticeable size. policy: the rig's controller; without one only
    experiments with a hanging pendulum are considered. Raises ValueError for unknown effects, or where no experiment
    of the menu can be run.
    """
    suspects = _suspects(plant, names)
    plant = plant.without(*(suspect.name for suspect in suspects))
    tell = progress or (lambda text: None)
    trials = []
    for entry in menu(policy is None):
        tell(f"trying: {entry.name}")
        setup = Setup.of(plant, None if entry.hanging else policy, duration, sample_time)
        so_far = max((t.worst for t in trials), default=-math.inf)
        setup = replace(setup, offset=entry.offset or setup.offset)
        given = limits
        if limits is not None and entry.hanging and policy is not None:  # a |q2| is about where the rig's loop rests
            given = replace(limits, q2=math.inf)
        trials.append(_try(setup, entry, given, suspects, seed, so_far))
    best = max(trials, key=lambda t: t.worst)
    if not best.separations:
        raise ValueError("no experiment can be run: " + "; ".join(f"{t.entry.name}: {t.problem}" for t in trials))
    return Separation(tuple(e.name for e in suspects), best, tuple(trials))


def _suspects(plant: Plant, names: Sequence[str | Effect]) -> list[Effect]:
    given = [n if isinstance(n, str) else n.name for n in names]
    if strange := [n for n in given if n not in EFFECTS]:
        raise ValueError(f"between {','.join(strange)}: no such effect{where_to_look(strange)}")
    if len(set(given)) < 2 or len(set(given)) < len(given):
        raise ValueError(f"expected two or more different effects to tell apart, got {', '.join(given) or 'none'}")
    return [(plant.effect(n) or plant.default_effect(n)) if isinstance(n, str) else n for n in names]


def _try(
    setup: Setup, entry: Entry, limits: Limits | None, suspects: Sequence[Effect], seed: int, so_far: float
) -> Trial:
    """limits: those that are given, about the rest of this entry."""
    allowed = entry.limits.within(setup.rig_limits)
    if limits is not None:
        allowed = allowed.within(limits)
    signal = None
    if entry.signal is not None:
        try:
            signal = within_limits(setup, entry.signal, allowed, seed, entry.most * setup.size)
        except ValueError as error:
            return Trial(entry, setup, None, {}, str(error))
    elif (run := setup.run(None, seed)).excess(allowed) > 1.0:
        return Trial(entry, setup, None, {}, run.beyond(allowed))
    trial = _separations(setup, entry, signal, suspects, seed, so_far)
    for _ in range(_SMALLER - 1):
        if not trial.problem or signal is None:
            break
        signal = Scaled(signal.signal, 0.6 * signal.factor)
        trial = _separations(setup, entry, signal, suspects, seed, so_far)
    return trial


def _separations(
    setup: Setup, entry: Entry, signal: Scaled | None, suspects: Sequence[Effect], seed: int, so_far: float
) -> Trial:
    """Each suspect in turn as the truth, every other one fitted to its log, until a pair is no further apart than
    `so_far` [nats]."""
    plants = [setup.plant.with_effects(e) for e in suspects]
    runs = [setup.run(signal, seed, plant) for plant in plants]
    for truth, run in zip(suspects, runs, strict=True):
        if run.fell is not None:
            return Trial(entry, setup, signal, {}, f"the pendulum falls after {run.fell:.2f} s with {truth.name}")
    found: dict[tuple[str, str], float] = {}
    for truth, plant, run in zip(suspects, plants, runs, strict=True):
        record = setup.record(run)
        right = _value(setup, plant, record)
        for other in suspects:
            if other is not truth:
                nats = max(float(_fitted(setup, other, record) - right), 0.0)
                found[truth.name, other.name] = nats
                if nats <= so_far:
                    return Trial(entry, setup, signal, found)
    return Trial(entry, setup, signal, found)


def _problem(setup: Setup, plant: Plant, record: Record, restless: float) -> PredictionError:
    coordinates = plant_coordinates(plant, free_sharpness=False, weak_prior_std=_ANCHOR_STD)
    coordinates += zero_coordinates(plant, [record]) + noise_coordinates()
    noise = Noise(np.maximum(setup.torque_noise, 1e-18)).louder(restless)
    return PredictionError(plant, [record], coordinates, noise, pool=shared_pool())


def _value(setup: Setup, plant: Plant, record: Record) -> float:
    """V that a fit of the truth would reach on average: V at the truth, less half a nat for each free coordinate."""
    problem = _problem(setup, plant, record, 1.0)
    return problem.value(problem.start()) - 0.5 * len(problem.coordinates)


def _fitted(setup: Setup, effect: Effect, record: Record) -> float:
    """V of the plant with `effect` fitted to the record, from the most promising of some sizes."""
    problems = [_problem(setup, setup.plant.with_effects(e), record, _RESTLESS) for e in _sizes(effect)]
    values = [p.value(p.start()) for p in problems]
    problem = problems[int(np.argmin(values))]
    return minimise(problem, problem.start(), _ITERATIONS, _TOLERANCE, exact=False).value


def _sizes(effect: Effect) -> list[Effect]:
    found = []
    for factor in _SIZES:
        values = dict(effect.parameters)
        for p in effect.type.parameters:
            if p.role == "size" and math.isfinite(p.neutral) and not p.integer:
                values[p.name] = p.neutral + factor * (values[p.name] - p.neutral)
        if all(p.lower <= values[p.name] <= p.upper for p in effect.type.parameters):
            found.append(Effect(effect.name, values))
    return found
