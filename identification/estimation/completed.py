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
from furuta_gym.plant.parameters import physical_consistency
from furuta_gym.sensors import Sensors

from ..logs.log import Log
from .estimate import Estimate


def with_plant(
    estimate: Estimate, logs: Sequence[Log], start: Plant | str | None = None, u_max: float | None = None
) -> Estimate:
    """The estimate with its plant completed: covariance, stds of effects, sensors, u_max, provenance, checks."""
    plant = estimate.plant
    std = {name: s for name, s in zip(estimate.names, estimate.std.tolist(), strict=True) if math.isfinite(s)}
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
        sample_time=float(f"{logs[0].sample_time:.9g}"),  # stamps differ in their last bits
        provenance=_provenance(estimate, logs, start, u_max),
        checks=consistency.to_dict()
        | {"identifiability": estimate.identifiability.to_dict()}
        | ({"error_bars": estimate.error_bars} if estimate.error_bars else {}),
    )
    largest = max(float(np.abs(log.u).max()) for log in logs)
    return replace(estimate, plant=plant, u_max_guessed=start is None and u_max is None, largest_command=largest)


def _provenance(
    estimate: Estimate, logs: Sequence[Log], start: Plant | str | None, u_max: float | None
) -> dict[str, Any]:
    limit = "guessed from the logs' largest command" if start is None else "of the start plant"
    mapping = logs[0].mapping.without("cut")  # a bad stretch is of one log and not of the rig
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
            for log, spans in zip(logs, estimate.stretches or ((),) * len(logs), strict=True)
        ],
        **({} if mapping.empty else {"mapping": mapping.to_dict()}),
        "method": estimate.method,
        "start": "from the logs" if start is None else start if isinstance(start, str) else "a plant given",
        "fixed": dict(estimate.fixed),
        "torque_noise": None if estimate.noise is None else list(estimate.noise.torque),
        "log_likelihood": estimate.log_likelihood if math.isfinite(estimate.log_likelihood) else None,
        "u_max": limit if u_max is None else "given",
        "versions": versions,
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }
