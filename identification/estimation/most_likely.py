"""Maximum likelihood through a Kalman filter's innovations: from logs and a start to an Estimate."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from furuta_gym.plant import THETA_NAMES, Effect, Plant
from furuta_gym.plant.parameters import FRICTION_SHARPNESS

from ..kalman.coordinates import (
    SHARPNESS_NAMES,
    Coordinate,
    Zeros,
    filled_noise,
    filled_plant,
    noise_coordinates,
    plant_coordinates,
    zero_coordinates,
)
from ..kalman.noise_model import STRONG, Noise, unexplained_torque
from ..kalman.record import Record, stretches
from ..logs.log import Log
from ..logs.signs import motion_signs
from .estimate import Estimate, NoiseReport
from .grids import from_grids
from .identifiability import Motion, judge, spoken
from .known import known_values, restless, value_of, with_known
from .long_logs import begin
from .memories import MEMORIES, remembering
from .methods import DEFAULT
from .optimise import TOLERANCE, Optimum, minimise
from .pool import shared_pool
from .prediction_error import PredictionError, quietest
from .restarts import restarted
from .start import NoMotion, Start, candidates, race
from .uncertainty import fit_covariance, inverse_information, recommended
from .zeros import bounded_zeros

_COARSER = 2.0  # times the integration step, for a first look
_TWICE = 2.0  # times the noise that counts and smoothness say
_R_RANGE = (3.0, 2000.0)  # s/rad
R_PRIOR = (math.log(FRICTION_SHARPNESS), 1.0)
"""Log-normal prior of r: where the noise hides friction near rest, r is of no consequence."""


def _most_likely(
    logs: Sequence[Log],
    template: Plant,
    start: Plant | None,
    /,
    *,
    fixed: Mapping[str, float | None],
    priors: Mapping[str, tuple[float, float]],
    effects: Sequence[str | Effect],
    physical: bool,
    sharpness: float | None,
    negative_friction: bool,
    iterations: int,
    noise: Noise | None,
    zeros: Zeros | None,
    pool: Executor | None,
    polished: bool,
) -> Estimate:
    fixed, priors = dict(fixed), dict(priors)
    if sharpness is not None:
        if twice := [name for name in SHARPNESS_NAMES if name in {*fixed, *priors}]:
            raise ValueError(f"sharpness = {sharpness:g} is r, and {spoken(twice)} is given too; give one of them")
        fixed |= {"r": float(sharpness)}
    if not (noise is None or isinstance(noise, Noise)):
        raise ValueError(
            f"noise must be a Noise of an earlier fit, got {type(noise).__name__}; make one by Noise(torque)"
        )
    if noise is not None and start is None:
        raise ValueError(
            "noise is that of an earlier fit, and there is no start for it to belong to. Expected both: "
            "identify(logs, estimate.plant, noise=Noise(estimate.noise.torque)); or leave noise out"
        )
    pool = pool or shared_pool()
    used = stretches(logs)
    records = [stretch.record for stretch in used]
    if fixed.get("r", 0.0) is None and isinstance(template.friction_sharpness, tuple):
        del fixed["r"]
        fixed |= {"r1": None, "r2": None}
    if {"r1", "r2"} & {*fixed, *priors}:
        template = template.replace(friction_sharpness=template.sharpness)
    known = known_values(fixed, template if start is not None else None, effects)

    def free(plant: Plant) -> list[Coordinate]:
        return _coordinates(plant, fixed, priors, negative_friction, records)

    def freely(plant: Plant) -> list[Coordinate]:
        """Without what is said of effects that come later."""
        later = {n for n in {*fixed, *priors} if "." in n and plant.effect(n.partition(".")[0]) is None}
        said = [n for n in fixed if n not in later], {n: v for n, v in priors.items() if n not in later}
        return _coordinates(plant, *said, negative_friction, records)

    free(with_known(template, known, effects))  # names that are none are told before any work

    if start is not None and noise is not None:
        winner = Start(with_known(template, known, effects), noise)
    else:
        told = known | {n: m for n, (m, _) in priors.items()}
        given = [] if start is None else [Start(template, restless(template))]
        try:
            starts = [*given, *candidates([stretch.piece for stretch in used], template, told)]
        except NoMotion:  # a regression needs longer stretches than a filter
            if not given:
                raise
            starts = given
        starts = [Start(with_known(s.plant, known), s.noise) for s in starts]
        winner, _ = race(records, starts, freely(starts[0].plant), physical=physical, pool=pool)
    plant = with_known(winner.plant, known, effects)

    def quickly(plant: Plant, records: Sequence[Record]) -> PredictionError:
        return PredictionError(plant, records, freely(plant), winner.noise, _COARSER, physical=physical, zeros=zeros)

    named = {effect for effect in effects if isinstance(effect, str)}
    pieces = [stretch.piece for stretch in used]
    regressed = [found for name in MEMORIES if name in named for found in remembering(pieces, plant, name).starts]
    further = [with_known(found.plant, known) for found in regressed]
    plant = from_grids(quickly, plant, records, named, {*fixed, *priors}, pool, further)
    problem = PredictionError(plant, records, free(plant), winner.noise, physical=physical, pool=pool, zeros=zeros)
    optimum = minimise(problem, begin(problem, iterations), iterations, exact=polished)
    if noise is None:  # an earlier fit that goes on has been restarted already
        optimum = restarted(problem, optimum, iterations, TOLERANCE, exact=polished)
    return _estimate(logs, problem, optimum, plant, fixed)


class PredictionErrorMethod:
    """Maximum likelihood through the innovations of extended Kalman filters; uses every option of `identify`."""

    estimate = staticmethod(_most_likely)


def _coordinates(
    plant: Plant,
    fixed: Iterable[str],
    priors: Mapping[str, tuple[float, float]],
    negative_friction: bool,
    records: Sequence[Record],
) -> list[Coordinate]:
    found = plant_coordinates(plant, fixed, priors, negative_friction=negative_friction)
    limited = [
        replace(c, low=_R_RANGE[0], high=_R_RANGE[1], weak_prior=R_PRIOR) if c.name in SHARPNESS_NAMES else c
        for c in found
    ]
    return limited + zero_coordinates(plant, records) + noise_coordinates(quietest(plant, records))


def _estimate(
    logs: Sequence[Log],
    problem: PredictionError,
    optimum: Optimum,
    start: Plant,
    fixed: Mapping[str, float | None],
) -> Estimate:
    if not math.isfinite(optimum.value):
        raise ValueError(
            f"the fit found no plant that follows these logs ({optimum.message}). Check the columns, the signs and "
            "the zero of q2 (upright), or give a start plant"
        )
    coordinates = problem.coordinates
    expansion = problem.expand(optimum.z, exact=True, scores=True, central=True)
    data = replace(expansion, information=expansion.information - problem.priors.of_rigid_body(optimum.z))
    spread = fit_covariance(problem, data)
    own = [i for i, c in enumerate(coordinates) if c.of_plant]
    slopes = np.array([coordinates[i].slope(optimum.z[i]) for i in own])
    names = tuple(coordinates[i].name for i in own)
    values = np.array([coordinates[i].to_value(optimum.z[i]) for i in own])
    classical = spread.classical[np.ix_(own, own)] * np.outer(slopes, slopes)
    sandwich = spread.sandwich[np.ix_(own, own)] * np.outer(slopes, slopes)
    covariance = recommended(classical, sandwich)
    at_bound = tuple(
        c.name
        for c, z, low, high in zip(coordinates, optimum.z, problem.low, problem.high, strict=True)
        if c.of_plant and (z <= low + 1e-9 or z >= high - 1e-9)
    )
    motion = Motion.of(logs)
    std = np.sqrt(np.diag(covariance))
    verdict = judge(names, values, inverse_information(covariance), motion, std, _noticeable(start))
    noise = filled_noise(coordinates, optimum.z, problem.noise)
    reading = tuple(tuple(np.sqrt(noise.on(r).variance).tolist()) for r in problem.records)  # rounding included
    plant = filled_plant(start, coordinates, optimum.z)
    return Estimate(
        plant=plant,
        method=DEFAULT,
        names=names,
        values=values,
        covariance=covariance,
        identifiability=verdict,
        classical=classical,
        sandwich=sandwich,
        noise=NoiseReport(tuple(noise.torque.tolist()), reading),  # type: ignore[arg-type]
        log_likelihood=problem.prior_cost(optimum.z)
        - optimum.value
        - sum(len(r.t) for r in problem.records) * math.log(2 * math.pi),
        samples=sum(len(r.t) for r in problem.records),
        converged=optimum.converged,
        message=optimum.message,
        iterations=optimum.iterations,
        at_bound=at_bound,
        fixed={n: value_of(plant, n) for n in fixed},
        warnings=(*_warnings(logs, plant, at_bound, noise, problem.records), *bounded_zeros(logs, problem, optimum.z)),
        zeros=problem.zeros_at(optimum.z),
        problem=problem,
        optimum=optimum,
    )


def _noticeable(plant: Plant) -> dict[str, float]:
    """ "effect.parameter" → a size worth noticing; 1 where the declaration has none, as for a phase [rad]."""
    return {
        f"{effect.name}.{name}": abs(value) if value and math.isfinite(value) else 1.0
        for effect in plant.effects
        for name, value in plant.default_effect(effect.name).parameters.items()
    }


def _warnings(
    logs: Sequence[Log], plant: Plant, at_bound: Sequence[str], noise: Noise, records: Sequence[Record]
) -> Iterable[str]:
    signs = [(log.source, motion_signs(log.t, log.q1, log.q2, log.u)) for log in logs]
    doubted = any(found.wrong for _, found in signs)
    if frictions := [name for name in at_bound if name in THETA_NAMES[5:]]:
        ends = "ends at zero, its bound" if len(frictions) == 1 else "end at zero, their bound"
        cause = "as a wrong sign does, see below" if doubted else "so an effect is probably missing"
        yield (
            f"{spoken(frictions)} {ends}: this log asks for negative friction, which no rig has; "
            f"{cause} (`furuta diagnose` looks for it)"
        )
    for name in (name for name in at_bound if name not in frictions):
        if name in SHARPNESS_NAMES:
            value = value_of(plant, name)
            yield f"{name} ends at its bound {value:.3g} s/rad: the logs do not show friction near rest; fix r"
        else:
            yield f"{spoken([name])} ends at its bound; give a prior, or question the log"
    for source, found in signs:
        if wrong := found.wrong:
            yield f"{source}: as read, {wrong}; check --pendulum-zero and --flip, about which reading it says more"
    missing = unexplained_torque(noise.torque[0])
    driven = [log.u for log in logs if np.ptp(log.u) > 0] or [log.u for log in logs]  # a free decay has no command
    command = float(np.sqrt(np.mean(np.concatenate(driven) ** 2)))
    if missing > STRONG * command:
        share = f"{missing:.2g} {plant.unit} ({100 * missing / command:.0f} % of the command)"
        if missing > command:
            advice = "more than the command itself: check its sign first (--flip u), then run `furuta diagnose`"
        else:
            advice = "something acts that model (5) does not hold; run `furuta diagnose`"
        yield f"the model misses torques of about {share}: {advice}"
    least = [np.maximum(r.variance, np.square(logs[r.log].noise_std)) for r in records]
    if any((noise.on(r).variance > _TWICE**2 * low).any() for r, low in zip(records, least, strict=True)):
        yield "the readings are at least twice as noisy as their counts and smoothness say; check the encoder counts"
