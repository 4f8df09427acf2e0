"""Estimate: what an identification found, how sure it is, and what to do next."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import THETA_NAMES, Plant
from furuta_gym.plant.covariance import NORMAL_95
from furuta_gym.plant.effects.words import number
from furuta_gym.plant.parameters import THETA_MEANING
from furuta_gym.plant.rigid_body import ConsistencyCheck, physical_consistency

from ..kalman.coordinates import SHARPNESS_NAMES, Zeros
from .identifiability import LOST, WEAK, Identifiability, Level, spoken
from .informative import spans_text
from .optimise import Optimum
from .prediction_error import PredictionError
from .uncertainty import Profile, profile


@dataclass(frozen=True)
class NoiseReport:
    """What a fit says about the noise: torque intensities on the rows [{u}² s], reading noise [rad] of each log."""

    torque: tuple[float, float]
    reading_std: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class GainChange:
    """factor: what the command does after `since` [s] of the log's clock over what it did before; or, with since None,
    at the log's end over what it did at its beginning. sure: in standard deviations. beside: whether that is beside a
    drift of the gain that the plant has."""

    source: str
    factor: float
    since: float | None
    sure: float
    beside: bool = False

    def __str__(self) -> str:
        when = (
            f"at the end of {self.source} as at its beginning"
            if self.since is None
            else f"after about {self.since:.3g} s of {self.source} as before"
        )
        if self.beside:
            return (
                f"beside the drift that was fitted, the command does about {self.factor:.2g} times as much {when}: "
                "this log does not follow that drift. Fit it alone, or parts of it (--cut)"
            )
        steady = self.since is None
        remedy = "fit the change too (`identify --effects input_gain_drift`)" if steady else "fit parts of it (--cut)"
        return (
            f"the command does about {self.factor:.2g} times as much {when}, and these numbers are a mean of both: "
            f"look at the supply, the driver and the motor's temperature, or {remedy}"
        )


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters from logs. Printing it gives the table and the verdict.

    plant: ready to use and to save, with covariance, provenance and checks. names, values (n,): what was estimated,
    in the units of `unit_of`.
    classical, sandwich (n, n): covariance from the inverse Fisher information, and the one that stays right when the
    innovations are not white (see `uncertainty`); `covariance` is the one recommended and stored in the plant.
    model_error (n, n): the part of it that allows for what the model lacks (see `model_error`), or None.
    error_bars: in words, why `std` is too small, for the methods whose error bars are no measure of the error; else "".
    zeros: of the encoders in each log; the arm's in the first log is the plant's own.
    stretches: of each log, the seconds (from, to) that were fitted, where not all were.
    gain_changes: where what the command does changed within a log (see `steady_gain`); `warnings` tell it too.
    u_max_guessed: whether the plant's u_max was guessed from the largest command, which is largest_command [{u}].
    problem, optimum: the fit itself, for profiles and tests (None for methods without a likelihood).
    """

    plant: Plant
    method: str
    names: tuple[str, ...]
    values: NDArray[np.float64]
    covariance: NDArray[np.float64]
    identifiability: Identifiability
    classical: NDArray[np.float64] | None = None
    sandwich: NDArray[np.float64] | None = None
    model_error: NDArray[np.float64] | None = None
    noise: NoiseReport | None = None
    log_likelihood: float = math.nan
    samples: int = 0
    converged: bool = True
    message: str = ""
    iterations: int = 0
    at_bound: tuple[str, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    error_bars: str = ""
    stretches: tuple[tuple[tuple[float, float], ...], ...] = ()
    gain_changes: tuple[GainChange, ...] = ()
    u_max_guessed: bool = False
    largest_command: float = math.nan
    zeros: Zeros = field(default_factory=dict)
    problem: PredictionError | None = field(default=None, repr=False)
    optimum: Optimum | None = field(default=None, repr=False)

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard deviations (n,) of `values`; infinite for those of a `rough` effect.

        The likelihood of a play's width has an optimum every fraction of a per cent, a dozen nats deep: its curvature
        in one of them says nothing of the error.
        """
        return np.where(self._rough, np.inf, self._width)

    @property
    def _width(self) -> NDArray[np.float64]:
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def std_if_right(self) -> NDArray[np.float64]:
        """Standard deviations (n,) if the model is right: those of `std` without `model_error`."""
        return np.where(self._rough, np.inf, self._width_if_right)

    @property
    def _width_if_right(self) -> NDArray[np.float64]:
        added = 0.0 if self.model_error is None else np.diag(self.model_error)
        return np.sqrt(np.maximum(np.diag(self.covariance) - added, 0.0))

    @property
    def _widened(self) -> str:
        """How much wider `model_error` makes the error bars, where that is much; empty elsewhere."""
        alone = self.std_if_right
        ratio = np.divide(self.std, alone, out=np.ones(len(alone)), where=np.isfinite(alone) & (alone > 0))
        if not ratio.size or ratio.max() < _MUCH_WIDER:
            return ""
        most = int(np.argmax(ratio))
        return (
            "error bars allow for what this model lacks: in the median "
            f"{np.median(ratio):.1f} times those of a right model, at most {ratio[most]:.1f} times ({self.names[most]})"
        )

    @property
    def _rough(self) -> NDArray[np.bool_]:
        rough = {f"{e.name}.{p.name}" for e in self.plant.effects for p in e.type.parameters if e.type.rough}
        return np.array([name in rough for name in self.names])

    @property
    def correlation(self) -> NDArray[np.float64]:
        std = np.where(self._width > 0, self._width, 1.0)
        return self.covariance / np.outer(std, std)

    @property
    def valid(self) -> bool:
        """Converged, everything identified, nothing at a bound."""
        return self.converged and self.identifiability.level is not Level.LOST and not self.at_bound

    def value(self, name: str) -> float:
        """An estimated or fixed value by name. Raises KeyError with the names there are."""
        if name in self.names:
            return float(self.values[self.names.index(name)])
        if name in self.fixed:
            return float(self.fixed[name])
        raise KeyError(f"{name} is neither estimated ({', '.join(self.names)}) nor fixed ({', '.join(self.fixed)})")

    def shown(self, name: str) -> str:
        """An estimated value with its standard deviation, as tables print it.

        One that is not identified has none that means anything. Of a friction the upper end of the 95 % interval is
        left, unless it shares a scale that the logs do not show. Raises KeyError for a name that is not estimated.
        """
        if name not in self.names:
            raise KeyError(f"{name} is not estimated; estimated are {', '.join(self.names)}")
        i = self.names.index(name)
        value, std = float(self.values[i]), float(self.std[i])
        if name not in self.identifiability.unidentified:
            return rounded(value, std)
        alone = not (self.identifiability.relative_std or {}).get(name, math.inf) < LOST
        if name in THETA_NAMES[5:] and alone and math.isfinite(std):
            return f"below {value + NORMAL_95 * std:.2g}"
        return f"{value:.2g}"

    def profile(self, name: str) -> Profile:
        """Profile likelihood of one estimated parameter: an interval that need not be symmetric.

        Everything else is fitted anew at each value tried, some dozens of short fits. It is that of a right model: what
        the model lacks is not allowed for. Raises ValueError for a name
        that was not estimated, or a method without a likelihood.
        """
        if self.problem is None or self.optimum is None:
            raise ValueError(f"{self.method} has no likelihood to profile; use --method prediction-error")
        if name not in self.names:
            raise ValueError(f"{name} was not estimated; a profile can be had of {', '.join(self.names)}")
        i = [c.name for c in self.problem.coordinates].index(name)
        slope = self.problem.coordinates[i].slope(self.optimum.z[i])
        width = float(self._width_if_right[self.names.index(name)])
        return profile(self.problem, self.optimum.z, name, width / abs(slope))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the plant file."""
        return self.plant.save(path)

    def to_dict(self) -> dict[str, Any]:
        """For machines (`--json`): everything but the arrays of the fit."""
        noise = self.noise
        return {
            "method": self.method,
            "parameters": {
                n: {"value": float(v), "std": _finite(s), "std_if_right": _finite(t), "unit": unit_of(n, self.plant)}
                for n, v, s, t in zip(self.names, self.values, self.std, self.std_if_right, strict=True)
            },
            "fixed": dict(self.fixed),
            "noise": noise and {"torque_intensity": noise.torque, "reading_std": noise.reading_std},
            "log_likelihood": _finite(self.log_likelihood),
            "samples": self.samples,
            "stretches_s": [[list(span) for span in spans] for spans in self.stretches],
            "converged": self.converged,
            "message": self.message,
            "at_bound": list(self.at_bound),
            "valid": self.valid,
            "verdict": self.verdict,
            "uncertain": self.uncertain,
            "gain_changes": [asdict(change) for change in self.gain_changes],
            "identifiability": self.identifiability.to_dict(),
            "physical_consistency": self.rigid_body.to_dict(),
            "zeros": self.zeros_by_log,
            "warnings": list(self.warnings),
            "error_bars": self.error_bars or None,
        }

    @property
    def rigid_body(self) -> ConsistencyCheck:
        """Whether a rigid arm and pendulum can have this θ, within its error bars."""
        return physical_consistency(self.plant.theta, self.plant.covariance)

    @property
    def zeros_by_log(self) -> dict[str, list[float]]:
        """Zeros of the encoders [rad], arm and pendulum, by the log's number, for JSON."""
        return {f"log {i + 1}": list(zeros) for i, zeros in self.zeros.items()}

    @property
    def zeros_told(self) -> list[str]:
        """A sentence for each log that counts from zeros of its own; for the first, where it is off by a count."""
        count = math.sqrt(12.0) * self.noise.reading_std[0][1] if self.noise else 0.0
        return [
            f"log {i + 1} counts from {arm:+.4f} rad (arm) and {1e3 * pendulum:+.2f} mrad (pendulum)"
            for i, (arm, pendulum) in self.zeros.items()
            if i > 0 or abs(pendulum) > count
        ]

    def __str__(self) -> str:
        lines = [f"Estimate ({self.method}, {self.samples} samples): {self.message}"]
        width = max(len(n) for n in (*self.names, *self.fixed))
        each = zip(self.names, self.values, self.std, self.std_if_right, self._rough, strict=True)
        for n, v, s, right, rough in each:
            lost = n in self.identifiability.unidentified
            relative = f"{number(float(100 * s / abs(v)), 2)} %" if v and s <= _MANY_TIMES * abs(v) and not lost else ""
            remark = "at its bound" if n in self.at_bound else "likelihood too rough for an error" if rough else ""
            if lost:
                remark = "NOT IDENTIFIED"
            elif n in self.identifiability.weak:
                remark = "weak"
            elif n.startswith("theta") and not remark and right > WEAK * abs(v):
                remark = "small beside the other torques"
            elif n in self.uncertain:
                remark = "uncertain, as this model lacks something"
            row = f"  {n:<{width}}  {self.shown(n):<24} {unit_of(n, self.plant):<10}{relative:>9}  {remark}"
            lines.append(row.rstrip())
        lines += [f"  {n:<{width}}  {v:.6g} (fixed)" for n, v in self.fixed.items()]
        if self.noise is not None:
            q, unit = self.noise.torque, self.plant.unit
            lines.append(f"  torque noise {q[0]:.2g}, {q[1]:.2g} ({unit})² s; " + _readings(self.noise.reading_std))
        lines += [f"  {line}" for line in (*self.zeros_told, self._widened) if line]
        if self.stretches:
            lines.append(f"  fitted on {spans_text(self.stretches)}: what says most about θ; --all takes every sample")
        if self.u_max_guessed:
            lines.append(f"  {self.u_max_told}; set it with --u-max")
        lines.append(f"Verdict: {self.verdict}")
        lines += [f"  ! {w}" for w in (*self.identifiability.advice, *self.warnings)]
        return "\n".join(lines)

    @property
    def uncertain(self) -> list[str]:
        """Parameters that a log of a right model would give, and that what this model lacks may have shifted much."""
        taken = {*self.at_bound, *self.identifiability.weak, *self.identifiability.unidentified}
        each = zip(self.names, self.values, self.std, self.std_if_right, self._rough, strict=True)
        return [n for n, v, s, right, rough in each if s > WEAK * abs(v) > right and not rough and n not in taken]

    @property
    def u_max_told(self) -> str:
        """The guessed u_max, and from what it was guessed."""
        why = "where the commands stop" if self.plant.u_max == self.largest_command else "plus margin"
        limit = f"{self.plant.u_max:g} {self.plant.unit}"
        return f"u_max = {limit} (largest command {self.largest_command:.3g}, {why})"

    @property
    def verdict(self) -> str:
        """One sentence: what is good, what is not."""
        if not self.converged:
            return "did not converge; the numbers are not an optimum"
        good = _ALL if self.names else "no parameter was free"
        parts = [good if self.identifiability.level is Level.GOOD else self.identifiability.level]
        if self.identifiability.weak or self.identifiability.unidentified:
            lost, weak = self.identifiability.unidentified, self.identifiability.weak
            said = f", not {spoken(lost)}" if lost else ""
            said += f", only weakly {spoken(weak)}" if weak else ""
            parts = [f"{len(self.names) - len(lost)} of {len(self.names)} parameters identified{said}"]
        uncertain = [name for name in self.uncertain if name not in SHARPNESS_NAMES]  # as r is never weak
        if (uncertain or self.gain_changes) and parts[0] == _ALL:
            parts = ["all parameters show in the log"]
        if self.gain_changes:
            parts.append("θ is a mean, as the command did not do the same all along")
        if uncertain:
            parts.append(f"{spoken(uncertain)} uncertain, as this model lacks something")
        if self.at_bound:
            parts.append(f"{spoken(self.at_bound)} at the bound")
        parts.append("physically consistent" if self.rigid_body.consistent else "not a possible rigid body")
        return "; ".join(parts)


_ALL = "all parameters identified"
_MUCH_WIDER = 1.5  # times the error bars of a right model, from which it is said
_MANY_TIMES = 100.0  # a value, from which its error bar has no percentage
_MOST_READINGS = 6  # pieces of logs whose reading noise is shown


def rounded(value: float, std: float) -> str:
    """ "value ± std" with the deviation to two digits and the value to the same place."""
    if not (math.isfinite(std) and std > 0):
        return f"{value:.5g} ± ?"
    digits = 1 - math.floor(math.log10(std))
    if digits > 12 or digits < -6:
        return f"{value:.6g} ± {std:.2g}"
    return f"{value:.{max(digits, 0)}f} ± {std:.{max(digits, 0)}f}"


def unit_of(name: str, plant: Plant) -> str:
    """The unit of a parameter by its name, with the command's unit in it."""
    if name in THETA_MEANING:
        return THETA_MEANING[name][1].format(u=plant.unit)
    if name in ("r", "r1", "r2"):
        return "s/rad"
    effect = plant.effect(name.partition(".")[0])
    if effect is None:
        return ""
    return next(p.unit.format(u=plant.unit) for p in effect.type.parameters if p.name == name.partition(".")[2])


def _readings(stds: Sequence[tuple[float, float]]) -> str:
    shown = " | ".join(f"{1e3 * a:.3g}, {1e3 * b:.3g}" for a, b in stds[:_MOST_READINGS])
    return f"reading noise {shown} mrad" + (f" and {n} more pieces" if (n := len(stds) - _MOST_READINGS) > 0 else "")


def _finite(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None
