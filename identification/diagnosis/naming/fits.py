"""One structure fitted to the records of a rig: θ, the parameters of its effects and the noise, together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from furuta_gym.plant import EFFECTS, Effect, Parameter, Plant

from ...estimation.optimise import Optimum, minimise, promised
from ...estimation.pool import shared_pool
from ...estimation.prediction_error import PredictionError, quietest
from ...estimation.priors import Priors
from ...estimation.restarts import restarted
from ...kalman.coordinates import (
    Coordinate,
    Zeros,
    noise_coordinates,
    plant_coordinates,
    tells_the_zero,
    zero_coordinates,
)
from ...kalman.noise_model import Noise
from ...kalman.record import Record
from ...normal_equations import ScaledGram
from ..policy import DecisionPolicy

COARSER = 2.0  # times the longest integration step, where samples are that long
_LEAST, _UNSEEN = 1e-9, 1e-6  # of the information: what the data do not show
_TOLERANCE = 0.05  # nats, of the optimum
_ROUGH = 1.0  # nats, where a gain is large
_MANY, _FEW = 40, 10  # iterations

Effort = Literal["coarse", "quick", "full", "restarted"]
"""coarse: longer integration steps and frozen gains, on one thread: within a nat or so, for a multi-start.
quick: frozen gains, stopped early: within some nats, where hundreds are at stake.
full: to the optimum. restarted: and again from elsewhere, where it may have stalled."""


@dataclass(frozen=True)
class Fit:
    """A plant fitted to records: the structure, where the optimiser ended, and V there."""

    plant: Plant
    noise: Noise
    coordinates: tuple[Coordinate, ...]
    optimum: Optimum
    records: tuple[Record, ...]
    zeros: Zeros = field(default_factory=dict)

    @property
    def value(self) -> float:
        """V [nats], the negative log-likelihood with the priors."""
        return self.optimum.value

    @property
    def samples(self) -> int:
        """Number of readings."""
        return sum(2 * len(r.t) for r in self.records)

    def problem(self) -> PredictionError:
        """The objective whose optimum this is."""
        return PredictionError(self.plant, self.records, self.coordinates, self.noise, zeros=self.zeros)

    @property
    def promised(self) -> float:
        """What the derivatives promise further iterations [nats]."""
        return promised(self.problem(), self.optimum) if math.isfinite(self.value) else math.inf

    @property
    def strain(self) -> float:
        """What the derivatives promise [nats] if the search's prior on θ1 … θ5 were not there (see `anchored`)."""
        held = tuple(c if _is_anchored(c) else replace(c, prior=None, weak_prior=None) for c in self.coordinates)
        if not any(map(_is_anchored, held)) or not math.isfinite(self.value):
            return 0.0
        _, pull, curvature = Priors(held, np.empty(0), False).at(self.optimum.z)
        return ScaledGram.of(self.optimum.expansion.information - curvature, _LEAST).gain(pull, _UNSEEN).gain

    @property
    def moved(self) -> tuple[Record, ...]:
        """The records with the zeros of their encoders taken off."""
        return tuple(r.moved(self.zeros[r.log]) if r.log in self.zeros else r for r in self.records)


@dataclass(frozen=True)
class FitRequest:
    """A structure to fit: θ, effect parameters and noise jointly, from the values in `plant` and `noise`.

    anchor: plant for a weak prior on θ1 … θ5 (see `anchored`). iterations: at most (None: as the effort has it).
    effort: how well (see `Effort`). zeros: of the encoders, to start from.
    """

    plant: Plant
    noise: Noise
    records: Sequence[Record]
    anchor: Plant | None = None
    policy: DecisionPolicy = field(default_factory=DecisionPolicy)
    iterations: int | None = None
    effort: Effort = "restarted"
    zeros: Zeros = field(default_factory=dict)

    @property
    def rough(self) -> bool:
        """Whether the fit is stopped early."""
        return self.effort in ("coarse", "quick")

    def problem(self) -> PredictionError:
        """What the fit minimises."""
        plant, records, anchor = self.plant, self.records, self.anchor
        zeros = dict(self.zeros)
        if tells_the_zero(plant) and (first := min(r.log for r in records)) in zeros:
            zeros[first] = zeros[first][0], 0.0  # or it would be told twice
        coordinates = plant_coordinates(plant, free_sharpness=False)
        coordinates += noise_coordinates(quietest(anchor or plant, records))
        coordinates += zero_coordinates(plant, records)
        if anchor is not None:
            coordinates = [anchored(c, anchor, self.policy.anchor_std) for c in coordinates]
        coordinates = [repeating(c, max(r.duration for r in records), self.policy.periods) for c in coordinates]
        coordinates = [turned_over(c, plant, self.policy.turned) for c in coordinates]
        step, pool = (COARSER, None) if self.effort == "coarse" else (1.0, shared_pool())
        return PredictionError(plant, records, coordinates, self.noise, step, pool, zeros=zeros)


Fitter = Callable[[FitRequest], Fit]
"""What fits a structure: `fit`, or a stand-in in tests."""


def fit(request: FitRequest) -> Fit:
    """Fit a structure as well as the request asks for."""
    problem, effort = request.problem(), request.effort
    exact = not request.rough
    tolerance = _TOLERANCE if exact else request.policy.stands if effort == "coarse" else _ROUGH
    iterations = request.iterations or (_FEW if effort == "quick" else _MANY)
    optimum = minimise(problem, problem.start(), iterations, tolerance, exact=exact)
    if effort == "restarted":
        optimum = restarted(problem, optimum, iterations, tolerance, exact=True)
    return fit_at(problem, optimum)


def fit_at(problem: PredictionError, optimum: Optimum) -> Fit:
    """The fit that ended at an optimum of its problem."""
    z = optimum.z
    return Fit(
        problem.plant_at(z),
        problem.noise_at(z),
        tuple(problem.coordinates),
        optimum,
        tuple(problem.records),
        problem.zeros_at(z),
    )


def known_fit(optimum: Optimum, request: FitRequest) -> Fit | None:
    """What `fit` gave for a request, from its optimum alone; None if the two do not belong together."""
    problem, z = request.problem(), optimum.z
    if z.shape != problem.low.shape or not np.all((problem.low <= z) & (z <= problem.high)):
        return None
    return fit_at(problem, optimum)


def anchored(c: Coordinate, anchor: Plant, std: float) -> Coordinate:
    """θ1 … θ5 with a weak log-normal prior (a factor e^std) around the anchor's.

    The pendulum's row has no input: θ3, θ4, θ5, θ7, θ9 share a scale that only the reaction on the arm fixes, and a
    missing effect leaks into that direction until nothing can be named any more.
    """
    if not _of_masses(c) or anchor.theta[c.row] <= 0.0:
        return c
    return replace(c, weak_prior=(math.log(anchor.theta[c.row]), std))


def _of_masses(c: Coordinate) -> bool:
    """Whether it is one of ln θ1 … ln θ5."""
    return c.of_plant and c.row <= 4 and c.log


def _is_anchored(c: Coordinate) -> bool:
    return _of_masses(c) and c.weak_prior is not None


def repeating(c: Coordinate, duration: float, periods: float) -> Coordinate:
    """A frequency [Hz] kept to `periods` within a log of some duration [s]; any other coordinate as it is.

    Slower than that is a drift, of which no log can say that it repeats."""
    declared = _declared(c)
    return replace(c, low=max(c.low, periods / duration)) if declared is not None and declared.repeats else c


def turned_over(c: Coordinate, plant: Plant, turned: float) -> Coordinate:
    """A speed [rad/s] of friction near rest kept to what is beyond turned/r; any other coordinate as it is.

    There the joint's dry friction of sharpness r [s/rad] has turned over. Nearer to rest any change of it is another
    sharpness."""
    declared = _declared(c)
    if declared is None or not declared.near_rest:
        return c
    return replace(c, low=max(c.low, turning_speed(plant, c.name.partition(".")[0], turned)))


def turning_speed(plant: Plant, name: str, turned: float) -> float:
    """turned/r [rad/s] of the joint on which an effect acts."""
    return turned / plant.sharpest[EFFECTS[name].place == "pendulum"]


def _declared(c: Coordinate) -> Parameter | None:
    """The declaration of an effect's parameter; None of any other coordinate."""
    effect, _, parameter = c.name.partition(".")
    return next((p for p in EFFECTS[effect].parameters if p.name == parameter), None) if effect in EFFECTS else None


def added(fitted: Fit, current: Fit) -> Effect:
    """The effect of `fitted` that `current` does not have (a plant keeps its effects in the library's order)."""
    return further(fitted, current)[0]


def further(fitted: Fit, current: Fit) -> tuple[Effect, ...]:
    """All effects of `fitted` that `current` does not have."""
    had = {e.name for e in current.plant.effects}
    return tuple(e for e in fitted.plant.effects if e.name not in had)


def without_further(fitted: Fit, current: Fit) -> Plant:
    """The plant of `fitted` with only the effects of `current`."""
    return fitted.plant.keeping(lambda effect: current.plant.effect(effect.name) is not None)
