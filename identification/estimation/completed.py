"""The plant of an estimate, completed: covariance, sensors, limits, checks, and where its numbers come from."""

from __future__ import annotations

import datetime
import math
import platform
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from furuta_gym.plant import Effect, Plant
from furuta_gym.plant.covariance import Covariance
from furuta_gym.plant.rigid_body import physical_consistency
from furuta_gym.sensors import Sensors

from ..kalman.record import counts_of
from ..logs.log import Log
from .estimate import Estimate
from .methods import DEFAULT

_REMEDY = "An effect may be missing; physical=True (--physical) keeps it out"


def with_plant(
    estimate: Estimate, logs: Sequence[Log], start: Plant | str | None, u_max: float | None, guessed: bool
) -> Estimate:
    """The estimate with its plant completed: covariance, stds of effects, sensors, u_max, provenance, checks.

    guessed: whether the plant's u_max comes from the logs' largest command."""
    plant = estimate.plant
    std = {name: s for name, s in zip(estimate.names, estimate.std.tolist(), strict=True) if math.isfinite(s)}
    effects = tuple(
        Effect(e.name, e.parameters, {p: std[f"{e.name}.{p}"] for p in e.parameters if f"{e.name}.{p}" in std})
        for e in plant.effects
    )
    covariance = Covariance(estimate.names, estimate.covariance)
    body = physical_consistency(plant.theta, covariance)
    plant = plant.replace(
        effects=effects,
        u_max=plant.u_max if u_max is None else float(u_max),
        covariance=covariance,
        sensors=_sensors(estimate, logs),
        sample_time=float(f"{logs[0].sample_time:.9g}"),  # stamps differ in their last bits
        provenance=_provenance(estimate, logs, start, u_max, guessed),
        checks=body.to_dict()
        | {"identifiability": estimate.identifiability.to_dict()}
        | ({"error_bars": estimate.error_bars} if estimate.error_bars else {})
        | ({"at_bound": list(estimate.at_bound)} if estimate.at_bound else {})
        | ({} if estimate.converged else {"converged": False}),
    )
    largest = max(float(np.abs(log.u).max()) for log in logs)
    warnings = estimate.warnings
    if body.failures and estimate.method == DEFAULT:
        warnings = (*warnings, f"{'; '.join(body.failures)}. {_REMEDY}")
    return replace(estimate, plant=plant, warnings=warnings, u_max_guessed=guessed, largest_command=largest)


def _sensors(estimate: Estimate, logs: Sequence[Log]) -> dict[str, Any] | None:
    """The encoders of the first log that was fitted; None where nothing is known of them. Those of a start plant may be
    another rig's."""
    noise, problem = estimate.noise, estimate.problem
    counts = counts_of(logs[problem.records[0].log if problem is not None else 0])
    if noise is None:
        return Sensors(counts).to_dict() if any(counts) else None
    quantum = np.array([2 * math.pi / count if count else 0.0 for count in counts])
    extra = np.sqrt(np.maximum(np.square(noise.reading_std[0]) - quantum**2 / 12.0, 0.0))
    return Sensors(counts, (float(extra[0]), float(extra[1]))).to_dict()


def _provenance(
    estimate: Estimate, logs: Sequence[Log], start: Plant | str | None, u_max: float | None, guessed: bool
) -> dict[str, Any]:
    limit = "guessed from the logs' largest command" if guessed else "of the start plant"
    mappings = [log.mapping.without("cut") for log in logs]  # a bad stretch is of one log and not of the rig
    alike = len(set(mappings)) == 1
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
            | ({"cut_s": [list(span) for span in log.cut]} if log.cut else {})
            | ({"stretches_s": [list(span) for span in spans]} if spans else {})
            | ({} if alike or mapping.empty else {"mapping": mapping.to_dict()})
            for log, mapping, spans in zip(logs, mappings, estimate.stretches or ((),) * len(logs), strict=True)
        ],
        **({"mapping": mappings[0].to_dict()} if alike and not mappings[0].empty else {}),
        "method": estimate.method,
        "start": "from the logs" if start is None else start if isinstance(start, str) else "a plant given",
        "fixed": dict(estimate.fixed),
        "torque_noise": None if estimate.noise is None else list(estimate.noise.torque),
        "log_likelihood": estimate.log_likelihood if math.isfinite(estimate.log_likelihood) else None,
        "u_max": limit if u_max is None else "given",
        "versions": versions,
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }
