"""Logs in, Estimate out: the one entry to every identification method."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from furuta_gym.plant import Effect, Plant

from ..kalman.coordinates import Zeros
from ..kalman.noise_model import Noise
from ..kalman.record import sharing_counts
from ..logs.checks import warn
from ..logs.log import Log, as_logs, check_each_once
from .completed import with_plant
from .estimate import Estimate
from .identifiability import NotIdentifiable, gate
from .informative import informative
from .methods import DEFAULT, method_named
from .model_error import with_model_error
from .pool import one_blas_thread
from .steady_gain import with_gain_changes
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
    "polished": True,
}
"""The options that belong to a method, as they are where the user gives none."""


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
    polished: bool = True,
    every_sample: bool = False,
    model_error: bool = True,
) -> Estimate:
    """Estimate θ (and r, and effect parameters) from one log or several of one rig, jointly.

    start: a plant to start from (a Plant, a known set or a file); by default the logs alone give the start.
    fixed: {name: value} of what is known, None for the start plant's value. priors: {name: (mean, std)}.
    effects: names of effects to estimate along with θ, or Effects with start values. physical: keep θ to what a
    rigid arm and pendulum can have. sharpness: r [s/rad], estimated by default. negative_friction: let friction go
    below zero (a sign that something is missing). noise: of an earlier fit, whose plant must be given as
    `start`: the fit goes on from there and no other start is tried. zeros: of the logs' encoders, to start from (see
    `estimation.zeros`).
    u_max [{u}]: largest command that the rig can give; by default the start
    plant's, else, or where the logs exceed that, a guess from the largest command. pool: where filters run side by
    side (default: `shared_pool`).
    polished: whether the descent ends with exact derivatives, which take most of its time. Without, the filters' gains
    are held in them, and it ends within some nats of the optimum, near enough to predict.
    every_sample: else "prediction-error" takes of logs with more than
    `informative.BUDGET` samples together the stretches that say most about θ.
    model_error: whether error bars allow for what the model lacks (see `model_error.model_error`), which takes a
    second or two, and the gain is looked at along each log (`steady_gain`); of methods with a likelihood only.
    method: one of `methods.METHODS`. All options above but u_max, every_sample and model_error belong to
    "prediction-error".

    Logs may differ in sensors, sample time and experiment; uneven stamps are used as they are, gaps cut a log.
    Raises ValueError for bad arguments, among them an option that the method does not use, and NotIdentifiable (a
    ValueError) where the logs cannot tell a parameter.
    """
    logs = sharing_counts(as_logs(logs))
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
        "polished": polished,
    }
    used = [name for name in chosen.options() if name in options]
    if ignored := [n for n, v in options.items() if n not in used and _is_given(v, _ABSENT[n])]:
        raise ValueError(f"method {method!r} does not use {', '.join(ignored)}; leave it out, or use {DEFAULT!r}")
    if verdict := gate(logs, known={*options["fixed"], *options["priors"], *(["r"] if sharpness is not None else [])}):
        raise NotIdentifiable(verdict)
    template = _template(logs, start)
    guessed = u_max is None and (start is None or _exceeded(template, logs))
    if guessed and start is not None:
        template = _with_limit(template, logs)
    best = informative(logs) if method == DEFAULT and not every_sample else None
    estimator = chosen.load()
    given = {name: options[name] for name in used}
    fitted = logs if best is None else best.logs
    estimate = estimator.estimate(fitted, template, None if start is None else template, **given)
    if model_error:
        estimate = with_gain_changes(with_model_error(estimate), fitted)
    if best is not None:
        estimate = replace(estimate, stretches=best.spans)
    warn_about_zeros(estimate.plant, logs, estimate.zeros)
    return with_plant(estimate, logs, start, u_max, guessed)


def _is_given(value: Any, absent: Any) -> bool:
    return value is not None if absent is None else value != absent


def _check(logs: Sequence[Log], u_max: float | None) -> None:
    if not logs:
        raise ValueError("identify needs at least one log, got none")
    check_each_once(logs, "error bars come out too small")
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
        return plant.without_fit()
    return Plant(np.array([1e-2, 1e-3, 1e-3, 1e-3, 1e-2, 1e-3, 1e-4, 1e-2, 1e-4]), unit=unit, u_max=_limit(logs))


def _exceeded(plant: Plant, logs: Sequence[Log]) -> bool:
    return plant.u_max * (1 + 1e-9) < max(float(np.abs(log.u).max()) for log in logs)


def _with_limit(plant: Plant, logs: Sequence[Log]) -> Plant:
    """The start plant with a u_max that its rig's logs allow, and a warning."""
    limit, largest = _limit(logs), max(float(np.abs(log.u).max()) for log in logs)
    warn(
        f"the start plant's u_max is {plant.u_max:g} {plant.unit}, and the logs' command reaches {largest:g}: taking "
        f"{limit:g}. Give the rig's own with --u-max (u_max in Python)."
    )
    return plant.replace(u_max=limit)


_FEW_VALUES = 20  # of a command that is made of square waves or steps


def _limit(logs: Sequence[Log]) -> float:
    """u_max from the logs: where the command stops at one value, that; else somewhat above the largest seen. A command
    of few values, as of square waves, always stops at its largest and says nothing of the amplifier."""
    size = np.concatenate([np.abs(log.u) for log in logs])
    largest = float(size.max())
    if largest <= 0:
        return 1.0
    stops = np.sum(size >= largest * (1 - 1e-9)) >= 3 and np.quantile(size, 0.5) < 0.9 * largest
    if stops and np.unique(np.round(size / largest, 6)).size > _FEW_VALUES:
        return largest
    return float(f"{1.5 * largest:.1g}") if float(f"{1.5 * largest:.1g}") >= largest else 2.0 * largest
