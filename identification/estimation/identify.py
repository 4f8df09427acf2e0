"""Logs in, Estimate out: the one entry to every identification method."""

from __future__ import annotations

import datetime
import math
import platform
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from furuta_gym.plant import THETA_NAMES, Effect, Plant
from furuta_gym.plant.covariance import Covariance
from furuta_gym.plant.parameters import physical_consistency
from furuta_gym.sensors import Sensors

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
from ..kalman.noise_model import Noise
from ..kalman.record import Record, stretches
from ..logs.log import Log
from ..logs.signs import motion_signs
from .estimate import Estimate, NoiseReport
from .identifiability import Motion, NotIdentifiable, gate, judge, spoken
from .informative import informative
from .long_logs import begin
from .methods import DEFAULT, method_named
from .optimise import TOLERANCE, Optimum, minimise
from .pool import one_blas_thread, shared_pool
from .prediction_error import PredictionError, quietest
from .restarts import restarted
from .start import Start, candidates, race
from .uncertainty import fit_covariance, inverse_information, recommended
from .zeros import warn_about_zeros

_ITERATIONS = 60
_ABSENT: dict[str, Any] = {
    "fixed": {},
    "priors": {},
    "effects": (),
    "physical": False,
    "sharpness": None,
    "negative_friction": False,
    "iterations": _ITERATIONS,
    "noise": None,
    "zeros": None,
    "pool": None,
}
"""The options that belong to a method, as they are where the user gives none."""
_R_RANGE = (3.0, 2000.0)  # s/rad
_R_PRIOR = (math.log(100.0), 1.0)  # log-normal: where the noise hides friction near rest, r is of no consequence


@one_blas_thread
def identify(
    logs: Log | Sequence[Log],
    start: Plant | str | None = None,
    method: str = DEFAULT,
    *,
    fixed: Mapping[str, float | None] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    effects: Iterable[str | Effect] = (),
    physical: bool = False,
    sharpness: float | None = None,
    negative_friction: bool = False,
    iterations: int = _ITERATIONS,
    noise: Noise | None = None,
    zeros: Zeros | None = None,
    u_max: float | None = None,
    pool: Executor | None = None,
    every_sample: bool = False,
) -> Estimate:
    """Estimate θ (and r, and effect parameters) from one log or several of one rig, jointly.

    start: a plant to start from (a Plant, a known set or a file); by default the logs alone give the start.
    fixed: {name: value} of what is known, None for the start plant's value. priors: {name: (mean, std)}.
    effects: names of effects to estimate along with θ, or Effects with start values. physical: keep θ to what a
    rigid arm and pendulum can have. sharpness: r [s/rad], estimated by default. negative_friction: let friction go
    below zero (a sign that something is missing). noise: of an earlier fit, whose plant is `start`: the fit goes on
    from there and no other start is tried. zeros: of the logs' encoders, to start from (see `estimation.zeros`).
    u_max [{u}]: largest command that the rig can give; by default the start
    plant's, else a guess from the largest command. pool: where filters run side by side (default: `shared_pool`;
    inside a task of that one, bring another). every_sample: else "prediction-error" takes of logs with more than
    `informative.BUDGET` samples together the stretches that say most about θ.
    method: one of `methods.METHODS`. All options above but u_max and every_sample belong to "prediction-error".

    Logs may differ in sensors, sample time and experiment; uneven stamps are used as they are, gaps cut a log.
    Raises ValueError for bad arguments, among them an option that the method does not use, and NotIdentifiable (a
    ValueError) where the logs cannot tell a parameter.
    """
    logs = (logs,) if isinstance(logs, Log) else tuple(logs)
    chosen = method_named(method)
    _check(logs, u_max)
    options: dict[str, Any] = {
        "fixed": dict(fixed or {}),
        "priors": dict(priors or {}),
        "effects": tuple(effects),
        "physical": physical,
        "sharpness": sharpness,
        "negative_friction": negative_friction,
        "iterations": iterations,
        "noise": noise,
        "zeros": zeros,
        "pool": pool,
    }
    used = [name for name in chosen.options() if name in options]
    if ignored := [n for n, v in options.items() if n not in used and _is_given(v, _ABSENT[n])]:
        raise ValueError(f"method {method!r} does not use {', '.join(ignored)}; leave it out, or use {DEFAULT!r}")
    if verdict := gate(logs, known={*options["fixed"], *options["priors"], *(["r"] if sharpness is not None else [])}):
        raise NotIdentifiable(verdict)
    template = _template(logs, start)
    best = informative(logs) if method == DEFAULT and not every_sample else None
    estimator = chosen.load()
    given = {name: options[name] for name in used}
    fitted = logs if best is None else best.logs
    estimate = estimator.estimate(fitted, template, None if start is None else template, **given)
    if best is not None:
        estimate = replace(estimate, stretches=best.spans)
    warn_about_zeros(estimate.plant, logs, estimate.zeros)
    return with_plant(estimate, logs, start, u_max)


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
) -> Estimate:
    fixed, priors = dict(fixed), dict(priors)
    if sharpness is not None:
        fixed |= {"r": float(sharpness)}
    if not (noise is None or isinstance(noise, Noise)):
        raise ValueError(
            f"noise must be a Noise of an earlier fit, got {type(noise).__name__}; make one by Noise(torque)"
        )
    pool = pool or shared_pool()
    used = stretches(logs)
    records = [stretch.record for stretch in used]
    if fixed.get("r", 0.0) is None and isinstance(template.friction_sharpness, tuple):
        del fixed["r"]
        fixed |= {"r1": None, "r2": None}
    if {"r1", "r2"} & {*fixed, *priors}:
        template = template.replace(friction_sharpness=template.sharpness)
    known = _known(fixed, template if start is not None else None, effects)

    def free(plant: Plant) -> list[Coordinate]:
        return _coordinates(plant, fixed, priors, negative_friction, records)

    def freely(plant: Plant) -> list[Coordinate]:
        """Without what is said of effects that come later."""
        later = {n for n in {*fixed, *priors} if "." in n and plant.effect(n.partition(".")[0]) is None}
        said = [n for n in fixed if n not in later], {n: v for n, v in priors.items() if n not in later}
        return _coordinates(plant, *said, negative_friction, records)

    free(_with_known(template, known, effects))  # names that are none are told before any work

    if start is not None and noise is not None:
        winner = Start(_with_known(template, known, effects), noise)
    else:
        told = known | {n: m for n, (m, _) in priors.items()}
        starts = candidates([stretch.piece for stretch in used], template, told)
        if start is not None:
            starts = [Start(template, _restless(template)), *starts]
        starts = [Start(_with_known(s.plant, known), s.noise) for s in starts]
        winner, _ = race(records, starts, freely(starts[0].plant), physical=physical, pool=pool)
    plant = _with_known(winner.plant, known, effects)
    problem = PredictionError(plant, records, free(plant), winner.noise, physical=physical, pool=pool, zeros=zeros)
    optimum = minimise(problem, begin(problem, iterations), iterations)
    if noise is None:  # an earlier fit that goes on has been restarted already
        optimum = restarted(problem, optimum, iterations, TOLERANCE, exact=True)
    return _estimate(logs, problem, optimum, plant, fixed)


class PredictionErrorMethod:
    """Maximum likelihood through the innovations of extended Kalman filters; uses every option of `identify`."""

    estimate = staticmethod(_most_likely)


def _known(fixed: Mapping[str, float | None], start: Plant | None, effects: Sequence[str | Effect]) -> dict[str, float]:
    """Fixed values, None replaced by those of the start plant or of effects given with values. Raises ValueError where
    there are none."""
    given = {f"{e.name}.{p}": v for e in effects if isinstance(e, Effect) for p, v in e.parameters.items()}
    known = {}
    for name, value in fixed.items():
        if value is None:
            value = given.get(name, math.nan if start is None else _value_of(start, name))
            if math.isnan(value):
                raise ValueError(f"{name} is to stay at the start plant's value, and there is no start; give its value")
        known[name] = value
    return known


def _is_given(value: Any, absent: Any) -> bool:
    return value is not None if absent is None else value != absent


def _check(logs: Sequence[Log], u_max: float | None) -> None:
    if not logs:
        raise ValueError("identify needs at least one log, got none")
    if len(units := {log.input_unit for log in logs}) > 1:
        raise ValueError(f"logs of one rig must share the command's unit, got {', '.join(sorted(units))}")
    if u_max is not None and not u_max >= (largest := max(float(np.abs(log.u).max()) for log in logs)):
        raise ValueError(f"u_max {u_max:g} (--u-max): the logs' command reaches {largest:g}; expected at least that")


def _template(logs: Sequence[Log], start: Plant | str | None) -> Plant:
    """The plant that supplies unit, limits and sample time; θ too if the user gave a start."""
    unit = logs[0].input_unit
    if start is not None:
        plant = Plant.resolve(start)
        if plant.unit != unit:
            raise ValueError(f"the start plant's command is in {plant.unit}, the logs' in {unit}; they must agree")
        return plant.replace(covariance=None, checks={}, provenance={})
    return Plant(np.array([1e-2, 1e-3, 1e-3, 1e-3, 1e-2, 1e-3, 1e-4, 1e-2, 1e-4]), unit=unit, u_max=_limit(logs))


def _limit(logs: Sequence[Log]) -> float:
    """u_max from the logs: where the command stops at one value, that; else somewhat above the largest seen."""
    size = np.concatenate([np.abs(log.u) for log in logs])
    largest = float(size.max())
    if largest <= 0:
        return 1.0
    if np.sum(size >= largest * (1 - 1e-9)) >= 3 and np.quantile(size, 0.5) < 0.9 * largest:
        return largest
    return float(f"{1.5 * largest:.1g}") if float(f"{1.5 * largest:.1g}") >= largest else 2.0 * largest


def _restless(plant: Plant) -> Noise:
    """Noise for a start plant: accelerations of 3 rad/s² for 10 ms that the model does not know of."""
    return Noise((0.1 * plant.theta[0] ** 2, 0.1 * plant.theta[3] ** 2))


def _with_known(plant: Plant, known: Mapping[str, float], effects: Sequence[str | Effect] = ()) -> Plant:
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


def _coordinates(
    plant: Plant,
    fixed: Iterable[str],
    priors: Mapping[str, tuple[float, float]],
    negative_friction: bool,
    records: Sequence[Record],
) -> list[Coordinate]:
    found = plant_coordinates(plant, fixed, priors, negative_friction=negative_friction)
    limited = [
        replace(c, low=_R_RANGE[0], high=_R_RANGE[1], weak_prior=_R_PRIOR) if c.name in SHARPNESS_NAMES else c
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
    expansion = optimum.expansion
    if expansion.scores is None:
        expansion = problem.expand(optimum.z, exact=True, scores=True)
    spread = fit_covariance(problem, expansion)
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
        fixed={n: _value_of(plant, n) for n in fixed},
        warnings=tuple(_warnings(logs, plant, at_bound, noise)),
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


def with_plant(
    estimate: Estimate, logs: Sequence[Log], start: Plant | str | None = None, u_max: float | None = None
) -> Estimate:
    """The estimate with its plant completed: covariance, stds of effects, sensors, u_max, provenance, checks."""
    plant = estimate.plant
    std = dict(zip(estimate.names, estimate.std.tolist(), strict=True))
    effects = tuple(
        Effect(e.name, e.parameters, {p: std[f"{e.name}.{p}"] for p in e.parameters if f"{e.name}.{p}" in std})
        for e in plant.effects
    )
    sensors = plant.sensors
    counts = np.asarray(logs[0].encoder_counts or (0.0, 0.0))
    if estimate.noise is None and counts.any():
        sensors = Sensors((float(counts[0]), float(counts[1]))).to_dict()
    elif estimate.noise is not None:
        quantum = np.divide(2 * np.pi, counts, out=np.zeros(2), where=counts > 0)
        extra = np.sqrt(np.maximum(np.square(estimate.noise.reading_std[0]) - quantum**2 / 12.0, 0.0))
        sensors = Sensors((float(counts[0]), float(counts[1])), (float(extra[0]), float(extra[1]))).to_dict()
    consistency = physical_consistency(plant.theta)
    plant = plant.replace(
        effects=effects,
        u_max=plant.u_max if u_max is None else float(u_max),
        covariance=Covariance(estimate.names, estimate.covariance),
        sensors=sensors,
        sample_time=logs[0].sample_time,
        provenance=_provenance(estimate, logs, start, u_max),
        checks=consistency.to_dict() | {"identifiability": estimate.identifiability.to_dict()},
    )
    largest = max(float(np.abs(log.u).max()) for log in logs)
    return replace(estimate, plant=plant, u_max_guessed=start is None and u_max is None, largest_command=largest)


def _value_of(plant: Plant, name: str) -> float:
    if name in THETA_NAMES:
        return float(plant.theta[THETA_NAMES.index(name)])
    if name in ("r", "r1"):
        return plant.sharpness[0]
    if name == "r2":
        return plant.sharpness[1]
    effect, _, parameter = name.partition(".")
    found = plant.effect(effect)
    return math.nan if found is None else float(found.parameters[parameter])


def _provenance(
    estimate: Estimate, logs: Sequence[Log], start: Plant | str | None, u_max: float | None
) -> dict[str, Any]:
    limit = "guessed from the logs' largest command" if start is None else "of the start plant"
    versions = {"python": platform.python_version()}
    for package in ("furuta-gym", "numpy", "scipy", "numba"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "unknown"
    return {
        "logs": [
            {"source": log.source, "sha256": log.sha256, "samples": len(log), "duration_s": round(log.duration, 6)}
            | ({"read_as": log.read_as} if log.read_as else {})
            | ({"skipped_s": log.skipped} if log.skipped else {})
            | ({"stretches_s": [list(span) for span in spans]} if spans else {})
            for log, spans in zip(logs, estimate.stretches or ((),) * len(logs), strict=True)
        ],
        **({} if logs[0].mapping.empty else {"mapping": logs[0].mapping.to_dict()}),
        "method": estimate.method,
        "start": "from the logs" if start is None else start if isinstance(start, str) else "a plant given",
        "fixed": dict(estimate.fixed),
        "torque_noise": None if estimate.noise is None else list(estimate.noise.torque),
        "log_likelihood": estimate.log_likelihood if math.isfinite(estimate.log_likelihood) else None,
        "u_max": limit if u_max is None else "given",
        "versions": versions,
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def _warnings(logs: Sequence[Log], plant: Plant, at_bound: Sequence[str], noise: Noise) -> Iterable[str]:
    signs = {log.source: motion_signs(log.t, log.q1, log.q2, log.u) for log in logs}
    doubted = any(found.wrong for found in signs.values())
    for name in at_bound:
        if name in THETA_NAMES[5:]:
            cause = "as a wrong sign does, see below" if doubted else "so an effect is probably missing"
            yield (
                f"{spoken([name])} ends at zero, its bound: this log asks for negative friction, which no rig has; "
                f"{cause} (`furuta diagnose` looks for it)"
            )
        elif name in SHARPNESS_NAMES:
            yield f"{name} ends at its bound {_value_of(plant, name):.3g} s/rad: friction near rest is not told; fix r"
        else:
            yield f"{spoken([name])} ends at its bound; give a prior, or question the log"
    for source, found in signs.items():
        if wrong := found.wrong:
            yield f"{source}: as read, {wrong}; check --pendulum-zero and --flip, about which reading it says more"
    if failures := physical_consistency(plant.theta).failures:
        remedy = "With weak parameters this happens by chance; physical=True (--physical) keeps it out"
        yield "; ".join(failures) + f". {remedy}"
    # what the torque noise adds up to over a tenth of a second, against the command's size
    missing = math.sqrt(noise.torque[0] / 0.1)
    command = float(np.sqrt(np.mean(np.concatenate([log.u for log in logs]) ** 2)))
    if missing > 0.1 * command:
        yield (
            f"the model misses torques of about {missing:.2g} {plant.unit} ({100 * missing / command:.0f} % of the "
            "command): something acts that model (5) does not hold; run `furuta diagnose`"
        )
    if max(noise.reading_factor) > 4.0:
        yield "the readings are at least twice as noisy as their counts and smoothness say; check the encoder counts"
