"""Log: what a rig recorded, in the paper's convention, whatever the file looked like.

`read_log` turns a file into a `Log` and checks it at this border, once; everything behind it relies on that.
A `Log` is in seconds, radians (q2 = 0 upright) and the command's own unit. The angles y[k] are sampled at t[k],
and the command u[k] is held from t[k] to t[k+1].
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .checks import LogError, LogWarning
from .encoders import encoder_step, noise_std, shortest_for_noise
from .formats import write_table
from .gaps import gaps
from .mapping import KNOWN_KEYS
from .rig_mapping import RigMapping
from .said import COLUMNS, of_file, parse_counts, parse_gain, parse_unit

__all__ = ["Log", "LogError", "LogWarning", "write_log"]

_Index = NDArray[Any] | slice  # here: the class has a method `slice`
_OFF_GRID = 0.01  # stamps within this fraction of a sample of an even grid count as regular


class Run(Protocol):
    """What a simulator made: t (n,) [s], readings (n, 2) of q1, q2 [rad], the command (n,) held from t on."""

    @property
    def t(self) -> np.ndarray: ...

    @property
    def measured(self) -> np.ndarray: ...

    @property
    def command(self) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class Log:
    """One recording. Arrays are read-only float64 of equal length n ≥ 2, finite, t strictly increasing.

    t [s], q1, q2 [rad], u [input_unit]. encoder_counts: counts per revolution of (q1, q2), None if unknown.
    controller_gain: K of u = −K (q1, q̇1, q2, q̇2) + d, None if unknown. source, sha256: the file it came from.
    read_as: what the mapping did to the file's columns, as formulas. skipped: seconds left out at its start.
    cut: stretches (from, to) [s] of its clock whose samples are left out. begins [s]: its first sample after that of
    the recording, whose part it is; from there the effects that follow the clock count.
    mapping: what was said of how to read it, so that the rig's other files can be read likewise.
    metadata: further `# key: value` pairs of that file. Raises LogError if any of this does not hold.
    """

    t: np.ndarray
    q1: np.ndarray
    q2: np.ndarray
    u: np.ndarray
    input_unit: str = "V"
    encoder_counts: tuple[float, float] | None = None
    device: str | None = None
    controller_gain: tuple[float, float, float, float] | None = None
    source: str = "log"
    sha256: str | None = None
    read_as: str = ""
    skipped: float = 0.0
    cut: tuple[tuple[float, float], ...] = ()
    begins: float = 0.0
    mapping: RigMapping = field(default_factory=RigMapping)
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in COLUMNS:
            values = np.array(getattr(self, name), dtype=np.float64)
            if values.ndim != 1 or len(values) != np.size(self.t) or len(values) < 2:
                raise LogError(
                    f"{self.source}: {name} has shape {values.shape}, t has {np.size(self.t)} samples. Expected "
                    "four vectors of equal length, at least 2."
                )
            if not np.isfinite(values).all():
                raise LogError(f"{self.source}: {name} holds NaN or infinity. Expected finite numbers.")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if not (np.diff(self.t) > 0).all():
            raise LogError(f"{self.source}: t does not increase strictly. Sort the samples, drop repeated ones.")
        if not 0.0 <= self.begins < np.inf:
            raise LogError(f"{self.source}: begins = {self.begins!r}. Expected seconds after the first sample.")
        with of_file(self.source):
            object.__setattr__(self, "input_unit", parse_unit(self.input_unit))
            if self.encoder_counts is not None:
                object.__setattr__(self, "encoder_counts", parse_counts(self.encoder_counts))
            if self.controller_gain is not None:
                object.__setattr__(self, "controller_gain", parse_gain(self.controller_gain))
        if self.device is not None:
            object.__setattr__(self, "device", self.device.strip() or None)
            if len((self.device or "").splitlines()) > 1:
                raise LogError(f"{self.source}: device {self.device!r}: expected one line of text")
        for key, value in self.metadata.items():
            storable = isinstance(value, str) and len(value.splitlines()) <= 1 and key.isidentifier()
            if key in KNOWN_KEYS or key in COLUMNS or not storable:
                raise LogError(
                    f"{self.source}: metadata {key!r} cannot be stored. Expected a name of letters, digits and _ "
                    f"that is none of {', '.join((*COLUMNS, *KNOWN_KEYS))}, and a value of one line."
                )
        object.__setattr__(self, "metadata", MappingProxyType(dict(self.metadata)))

    @classmethod
    def from_run(
        cls,
        run: Run,
        unit: str = "V",
        counts: float | Sequence[float] | None = None,
        source: str = "simulated",
        **facts: Any,
    ) -> Log:
        """The readings and commands of a run, such as one of `furuta_gym.simulate`.

        unit: of the command. counts: per revolution, one number or (q1, q2), None for sensors without steps.
        facts: further fields of Log, such as controller_gain. Raises LogError as Log does."""
        pair = None if counts is None else parse_counts(counts)
        q1, q2 = run.measured.T
        return cls(run.t, q1, q2, run.command, unit, encoder_counts=pair, source=source, **facts)

    def __reduce__(self) -> tuple[Any, ...]:  # by construction, so that a copy in a worker is read-only too
        values = [getattr(self, f.name) for f in fields(self)]
        return Log, (*values[:-1], dict(self.metadata))

    def __len__(self) -> int:
        return len(self.t)

    @property
    def angles(self) -> np.ndarray:
        """(q1, q2) [rad] as one array, shape (n, 2)."""
        return np.column_stack([self.q1, self.q2])

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def origin(self) -> float:
        """The stamp [s] of the recording's first sample, from which the effects that follow the clock count."""
        return float(self.t[0]) - self.begins

    @property
    def span(self) -> tuple[float, float]:
        """Its first and last sample [s after `origin`]."""
        return self.begins, self.begins + self.duration

    @property
    def sample_time(self) -> float:
        """Median spacing of the stamps [s]."""
        return float(np.median(np.diff(self.t)))

    @property
    def regular(self) -> bool:
        """True if every stamp lies on an even grid (within 1 % of a sample), so that T is one number."""
        grid = np.linspace(self.t[0], self.t[-1], len(self))
        return bool(np.max(np.abs(self.t - grid)) <= _OFF_GRID * self.sample_time)

    @property
    def encoder_steps(self) -> tuple[float | None, float | None]:
        """Smallest step of q1 and q2 that the samples show [rad], None where they do not move in steps."""
        return encoder_step(self.q1), encoder_step(self.q2)

    @property
    def noise_std(self) -> tuple[float, float]:
        """Measurement noise of q1 and q2 [rad], quantisation included, estimated without a model.

        Raises ValueError for a log that is too short."""
        T = self.sample_time
        parts = [piece for piece in self.pieces() if len(piece) >= shortest_for_noise(T)] or [self]
        each = np.array([(noise_std(part.q1, T), noise_std(part.q2, T)) for part in parts])
        if len(parts) == 1:
            return float(each[0, 0]), float(each[0, 1])
        q1, q2 = np.sqrt(np.average(each**2, axis=0, weights=[len(part) for part in parts]))
        return float(q1), float(q2)

    def slice(self, start: float = -np.inf, stop: float = np.inf) -> Log:
        """The samples with start ≤ t < stop [s, as in the stamps]. Raises LogError if fewer than 2 are left."""
        inside = (self.t >= start) & (self.t < stop)
        if inside.sum() < 2:
            raise LogError(
                f"{self.source}: {inside.sum()} samples between {start:g} and {stop:g} s. Expected at least 2; "
                f"the log runs from {self.t[0]:g} to {self.t[-1]:g} s."
            )
        return self.taken(inside)

    def moved(self, zero1: float, zero2: float) -> Log:
        """The same with zeros [rad] of the arm's and the pendulum's encoder taken off."""
        return replace(self, q1=self.q1 - zero1, q2=self.q2 - zero2)

    def split(self, fraction: float) -> tuple[Log, Log]:
        """The first part (that fraction of the time) and the rest, for example to hold out the tail."""
        if not 0 < fraction < 1:
            raise LogError(f"fraction = {fraction}: expected a number between 0 and 1")
        at = float(self.t[0]) + fraction * self.duration
        return self.slice(stop=at), self.slice(at)

    def pieces(self) -> tuple[Log, ...]:
        """The log cut at gaps of its clock (dropped samples); lone samples between two gaps are left out."""
        cuts = np.flatnonzero(gaps(self.t)) + 1
        groups = np.split(np.arange(len(self)), cuts)
        return tuple(self.taken(group) for group in groups if len(group) >= 2)

    def resampled(self, sample_time: float | None = None) -> Log:
        """On an even grid (default: the mean spacing): angles interpolated linearly, the command held.

        For methods that need one T. Methods that can use the stamps should use them instead.
        """
        if sample_time is None:
            t = np.linspace(self.t[0], self.t[-1], len(self))
        elif 0 < sample_time <= self.duration:
            t = self.t[0] + sample_time * np.arange(np.floor(self.duration / sample_time + 1e-9) + 1)
        else:
            raise LogError(f"sample_time = {sample_time}: expected seconds, at most the {self.duration:g} recorded")
        held = np.searchsorted(self.t, t + 1e-9 * self.sample_time, side="right") - 1
        q1, q2 = np.interp(t, self.t, self.q1), np.interp(t, self.t, self.q2)
        return replace(self, t=t, q1=q1, q2=q2, u=self.u[held])

    def overlaps(self, other: Log) -> bool:
        """Whether both are the same, or parts of one file that share samples."""
        same_file = self.sha256 is not None and self.sha256 == other.sha256
        return self is other or (same_file and self.t[0] <= other.t[-1] and other.t[0] <= self.t[-1])

    def check_unit(self, unit: str) -> None:
        """Raise ValueError unless the command is in a plant's unit."""
        if unit != self.input_unit:
            raise ValueError(
                f"the plant's command is in {unit}, that of {self.source} in {self.input_unit}; they must agree "
                "(--input-unit, input_unit in Python)"
            )

    def taken(self, index: _Index) -> Log:
        """The samples of an index that increases, by the same clock."""
        t = self.t[index]
        begins = self.begins + float(t[0] - self.t[0]) if len(t) else 0.0
        return replace(self, t=t, q1=self.q1[index], q2=self.q2[index], u=self.u[index], begins=begins)

    def __str__(self) -> str:
        clock = "even clock" if self.regular else "uneven clock, stamps are used"
        lines = [
            f"Log {self.source}" + (f" ({self.device})" if self.device else ""),
            f"  {len(self)} samples, {self.duration:.4g} s at {1e3 * self.sample_time:.4g} ms, {clock}",
        ]
        for name, q, step in (("q1", self.q1, self.encoder_steps[0]), ("q2", self.q2, self.encoder_steps[1])):
            seen = f", steps of 2π/{2 * np.pi / step:.0f}" if step else ""
            lines.append(f"  {name}  {q.min():+.3f} to {q.max():+.3f} rad{seen}")
        lines.append(f"  u   {self.u.min():+.3g} to {self.u.max():+.3g} {self.input_unit}")
        return "\n".join(lines)

    __repr__ = __str__


def as_logs(given: Log | Iterable[Log]) -> tuple[Log, ...]:
    """One log or several as a tuple. Raises TypeError for the name of a file, which must be read first."""
    logs = (given,) if isinstance(given, Log | str | os.PathLike) else tuple(given)
    if files := [one for one in logs if isinstance(one, str | os.PathLike)]:
        name = os.fspath(files[0])
        raise TypeError(f"expected a Log, got {name!r}; read the file first: read_log({name!r})")
    return logs


def check_each_once(logs: Iterable[Log], lest: str) -> None:
    """Raise ValueError where logs are the same, or parts of one file that share samples. lest: what comes of it."""
    if twice := [one.source for one, other in itertools.combinations(logs, 2) if one.overlaps(other)]:
        raise ValueError(f"{twice[0]} is given twice; expected each log once, or {lest}")


def write_log(path: str | os.PathLike[str], log: Log) -> None:
    """Write a log as .csv, .parquet, .npz or .mat, whole or not at all; `read_log` gives the same log back.

    (The same but for whole turns of q2, the hash and `begins`, as a file is a recording of its own. A finite float is
    written with all its digits.) Raises LogError for an ending that has no writer.
    """
    facts: dict[str, str] = {"input_unit": log.input_unit, "pendulum_zero": "upright"}
    if log.encoder_counts is not None:
        facts["encoder_counts"] = " ".join(map(repr, log.encoder_counts))
    if log.device is not None:
        facts["device"] = log.device
    if log.controller_gain is not None:
        facts["controller_gain"] = " ".join(map(repr, log.controller_gain))
    write_table(path, {name: getattr(log, name) for name in COLUMNS}, facts | dict(log.metadata))
