"""How a rig's files are read, as a value: `RigMapping`. It goes into rig.toml and into plant files."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from .checks import LogArgumentError, LogError
from .said import (
    COLUMNS,
    parse_angle_units,
    parse_columns,
    parse_counts,
    parse_cuts,
    parse_flip,
    parse_scale,
    parse_skip,
    parse_time_unit,
    parse_unit,
    parse_zero,
)

ANGLES = ("q1", "q2")


@dataclass(frozen=True)
class RigMapping:
    """What is said of how to read the files of a rig; None is not said, and `read_log` then takes its default.

    t, q1, q2, u: names of the columns. time_unit: s, ms, us, ns, d (days) or the seconds of one count.
    unit_q1, unit_q2: rad, deg, turns or counts.
    pendulum_zero: upright or hanging. flip: of q1, q2 and u. encoder_counts: per revolution, of q1 and q2.
    input_unit: V or N·m, after the file's numbers are multiplied by input_scale. skip [s]: left out at the start.
    cut [s]: stretches (from, to) of the log's clock that are left out.
    Raises LogError for a value that is none of these.
    """

    t: str | None = None
    q1: str | None = None
    q2: str | None = None
    u: str | None = None
    time_unit: str | None = None
    unit_q1: str | None = None
    unit_q2: str | None = None
    pendulum_zero: str | None = None
    flip: tuple[str, ...] | None = None
    encoder_counts: tuple[float, float] | None = None
    input_unit: str | None = None
    input_scale: float | None = None
    skip: float | None = None
    cut: tuple[tuple[float, float], ...] | None = None

    def __post_init__(self) -> None:
        for name in COLUMNS:
            column = getattr(self, name)
            if column is not None and not (isinstance(column, str) and column.strip()):
                raise LogArgumentError("columns", f"{name}={column!r}", "expected the name of a column")
        checks = {
            "time_unit": parse_time_unit,
            "pendulum_zero": parse_zero,
            "flip": parse_flip,
            "encoder_counts": parse_counts,
            "input_unit": parse_unit,
            "input_scale": parse_scale,
            "skip": parse_skip,
            "cut": parse_cuts,
        }
        for name, parse in checks.items():
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, parse(value))
        for axis in ANGLES:
            if (unit := getattr(self, f"unit_{axis}")) is not None:
                object.__setattr__(self, f"unit_{axis}", parse_angle_units({axis: unit})[axis])

    @classmethod
    def of(
        cls,
        columns: str | Mapping[str, str] | None = None,
        unit: str | Mapping[str, str] | None = None,
        **said: Any,
    ) -> RigMapping:
        """From arguments as `read_log` takes them: names by our names, and one unit or one for each angle."""
        units = {} if unit is None else parse_angle_units(unit)
        named: dict[str, Any] = parse_columns(columns) | {f"unit_{axis}": value for axis, value in units.items()}
        return cls(**named, **said)

    @property
    def empty(self) -> bool:
        """Whether nothing is said."""
        return self == RigMapping()

    def over(self, other: RigMapping) -> RigMapping:
        """What either says; where both do, what this one says."""
        return replace(other, **{k: v for k, v in vars(self).items() if v is not None})

    def without(self, *names: str) -> RigMapping:
        """The same with these fields not said."""
        return replace(self, **dict.fromkeys(names))

    @property
    def columns(self) -> dict[str, str]:
        """Names in the file by our names, of those that are said."""
        return {name: value for name in COLUMNS if (value := getattr(self, name)) is not None}

    @property
    def angle_units(self) -> dict[str, str]:
        """Units of the angles by their names, of those that are said."""
        return {axis: unit for axis in ANGLES if (unit := getattr(self, f"unit_{axis}")) is not None}

    def arguments(self) -> dict[str, Any]:
        """The same as arguments of `read_log`."""
        return {
            "columns": self.columns or None,
            "unit": self.angle_units or None,
            "pendulum_zero": self.pendulum_zero,
            "flip": self.flip or (),
            "encoder_counts": self.encoder_counts,
            "input_unit": self.input_unit,
            "input_scale": 1.0 if self.input_scale is None else self.input_scale,
            "time_unit": self.time_unit or "s",
            "skip": self.skip or 0.0,
            "cut": self.cut or (),
        }

    def options(self) -> str:
        """The same as options of the command line; "" where nothing is said."""
        units = self.angle_units
        same = len(set(units.values())) == 1 and len(units) == 2
        counts = self.encoder_counts or ()
        said = {
            "--columns": ",".join(f"{ours}={theirs}" for ours, theirs in self.columns.items()),
            "--time-unit": self.time_unit,
            "--unit": units["q1"] if same else ",".join(f"{axis}={unit}" for axis, unit in units.items()),
            "--pendulum-zero": self.pendulum_zero,
            "--flip": "none" if self.flip == () else ",".join(self.flip or ()),  # none: not a rig.toml's either
            "--encoder-counts": ",".join(map(_exact, counts[:1] if len(set(counts)) == 1 else counts)),
            "--input-unit": self.input_unit,
            "--input-scale": None if self.input_scale is None else _exact(self.input_scale),
            "--skip": None if self.skip is None else _exact(self.skip),
        }
        options = [f"{option} {shlex.quote(value)}" for option, value in said.items() if value]
        return " ".join(options + [f"--cut {_exact(start)}:{_exact(stop)}" for start, stop in self.cut or ()])

    def to_dict(self) -> dict[str, Any]:
        """What is said, as JSON and TOML hold it."""
        said = {k: v for k, v in vars(self).items() if v is not None}
        return {k: _short(v) for k, v in said.items()}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> RigMapping:
        """Read what `to_dict` wrote. Raises LogError for what is not known."""
        names = [f.name for f in fields(cls)]
        if not isinstance(data, Mapping):
            raise LogError(f"a mapping of a log: got {data!r}. Expected names and values")
        if strange := sorted(set(data) - set(names)):
            raise LogError(f"a mapping of a log: {', '.join(strange)} is not known. Expected of {', '.join(names)}")
        values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in data.items()}
        return cls(**values)


def _exact(number: float) -> str:
    """As few digits as give the same number again."""
    return str(int(number)) if float(number).is_integer() and abs(number) < 1e15 else repr(float(number))


def _short(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_short(part) for part in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value
