"""What a user says of how to read a file, as values of one form: columns, units, zeros, signs, scales, stretches."""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np

from .checks import LogArgumentError, LogError

COLUMNS = ("t", "q1", "q2", "u")

_short = reprlib.Repr()  # of what a file says of itself, which may be a page
_short.maxstring = _short.maxother = 100

_UNITS = {"v": "V", "volt": "V", "volts": "V", "nm": "N·m", "newtonmetre": "N·m", "newtonmeter": "N·m"}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "d": 86400.0}
"""What one unit of a time column is in s."""
RADIANS = {"rad": 1.0, "deg": math.pi / 180.0, "turns": 2.0 * math.pi}
"""What one unit of an angle is in rad, of those that do not depend on the encoder."""
ANGLE_UNITS = (*RADIANS, "counts")
_NEXT_NAME = re.compile(r",(?=\s*\w+\s*=)")  # a comma that no name follows belongs to the column before it
_CUT = "expected FROM:TO in seconds of the log's own clock, FROM before TO, such as 12:14"


@contextmanager
def of_file(name: str) -> Iterator[None]:
    """Let an error in what is said of a file, or in what the file says of itself, begin with the file's name.

    Raises LogError."""
    try:
        yield
    except LogArgumentError as error:
        raise LogError(f"{name}: {error}") from None


def parse_columns(columns: str | Mapping[str, str] | None) -> dict[str, str]:
    """Names in the file by our names, from "t=Time,q1=theta" or a mapping. Raises LogError.

    A name in the file may hold commas, as "t=Time, s,q1=Arm, deg" has it."""
    if columns is None:
        return {}
    if isinstance(columns, str):
        pairs = [pair.strip(", ").split("=", 1) for pair in _NEXT_NAME.split(columns) if pair.strip(", ")]
        if any(len(pair) != 2 or not pair[1].strip() for pair in pairs):
            raise LogArgumentError("columns", repr(columns), "expected pairs such as t=Time,q1=theta,q2=alpha,u=volts")
        names = [pair[0].strip() for pair in pairs]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise LogArgumentError("columns", repr(columns), f"{twice} is given twice. Expected each once.")
        columns = {ours.strip(): theirs.strip() for ours, theirs in pairs}
    unknown = [ours for ours in columns if ours not in COLUMNS]
    if unknown:
        expected = f"expected one of {', '.join(COLUMNS)} (ours=theirs)"
        raise LogArgumentError("columns", f"{unknown[0]!r} on the left", expected)
    return dict(columns)


def parse_flip(flip: str | Iterable[str]) -> tuple[str, ...]:
    """Axes whose sign is turned, from "q1,q2" or a sequence. Raises LogError."""
    if not (isinstance(flip, str) or (isinstance(flip, Iterable) and all(isinstance(name, str) for name in flip))):
        raise LogArgumentError("flip", _short.repr(flip), "expected a list of q1, q2, u")
    names = tuple(n for n in re.split(r"[,\s]+", flip) if n) if isinstance(flip, str) else tuple(flip)
    names = tuple(part for name in names for part in name.split(","))
    for name in names:
        if name not in ("q1", "q2", "u"):
            raise LogArgumentError("flip", repr(name), "expected q1, q2 or u")
    if len(set(names)) < len(names):
        raise LogArgumentError("flip", ",".join(names), "an axis is given twice, which would change nothing")
    return names


def parse_unit(value: str) -> str:
    """The command's unit, "V" or "N·m", from any common spelling. Raises LogError."""
    plain = re.sub(r"[\s·*.⋅-]", "", str(value)).lower()
    if plain not in _UNITS:
        hint = " (scale the command first if it is anything else)"
        raise LogArgumentError("input_unit", _short.repr(value), "expected V or N·m", hint)
    return _UNITS[plain]


def parse_counts(value: float | str | Sequence[float]) -> tuple[float, float]:
    """Counts per revolution of both encoders, from one number or two. Raises LogError."""
    counts = _floats("encoder_counts", value)
    if len(counts) not in (1, 2) or not all(np.isfinite(c) and c >= 2 for c in counts):
        expected = "expected one or two numbers above 2, as 2048 or 2048,4096"
        raise LogArgumentError("encoder_counts", _short.repr(value), expected)
    return counts[0], counts[-1]


def parse_zero(value: str) -> str:
    """Where the file's q2 is 0: "upright" or "hanging". Raises LogError."""
    if str(value).strip().lower() not in ("upright", "hanging"):
        expected = "expected upright or hanging (the position where q2 is 0)"
        raise LogArgumentError("pendulum_zero", _short.repr(value), expected)
    return value.strip().lower()


def parse_angle_units(value: str | Mapping[str, str]) -> dict[str, str]:
    """Units of q1 and q2, of `ANGLE_UNITS`, from one word or one for each, "q1=deg,q2=rad"; of the angles that are
    named only. Raises LogError."""
    units: dict[str, str]
    if isinstance(value, Mapping):
        units = dict(value)
    elif "=" in value:
        units = {k.strip(): v.strip() for k, _, v in (part.partition("=") for part in value.split(","))}
    else:
        units = dict.fromkeys(("q1", "q2"), str(value).strip())
    for column, unit in units.items():
        if column not in ("q1", "q2") or unit not in ANGLE_UNITS:
            expected = f"expected {', '.join(RADIANS)} or counts, for q1 and q2"
            raise LogArgumentError("unit", f"{column}={_short.repr(unit)}", expected)
    return units


def parse_time_unit(value: str) -> str:
    """Unit of the time column: one of `SECONDS`, or the seconds of one count, as "0.002". Raises LogError."""
    if value in SECONDS:
        return value
    try:
        seconds = float(value)
    except (TypeError, ValueError):
        seconds = np.nan
    if not 0.0 < seconds < np.inf:
        expected = f"expected one of {', '.join(SECONDS)}, or the seconds of one count, as 0.002"
        raise LogArgumentError("time_unit", _short.repr(value), expected)
    return repr(seconds)


def seconds_of(time_unit: str) -> float:
    """Seconds of one unit of the time column. Raises LogError."""
    unit = parse_time_unit(time_unit)
    return SECONDS[unit] if unit in SECONDS else float(unit)


def parse_scale(value: float) -> float:
    """What the command's numbers are multiplied by. Raises LogError."""
    (scale,) = _floats("input_scale", value)[:1] or (0.0,)
    if not (np.isfinite(scale) and scale > 0):
        raise LogArgumentError("input_scale", repr(value), "expected a positive number", " (use flip for the sign)")
    return scale


def parse_cuts(value: str | Iterable[str | Sequence[float]]) -> tuple[tuple[float, float], ...]:
    """Stretches of a log's clock [s], each "FROM:TO" or a pair. Raises LogError."""
    cuts = []
    for one in (value,) if isinstance(value, str) else value:
        try:
            start, stop = (float(part) for part in (one.split(":") if isinstance(one, str) else one))
        except (TypeError, ValueError, OverflowError):
            raise LogArgumentError("cut", _short.repr(one), _CUT) from None
        if not (math.isfinite(start) and math.isfinite(stop)):
            raise LogArgumentError("cut", _short.repr(one), _CUT)
        if start >= stop:
            raise LogArgumentError("cut", f"{start:g}:{stop:g}", f"{start:g} s is not before {stop:g} s; {_CUT}")
        cuts.append((start, stop))
    return tuple(cuts)


def parse_skip(value: float) -> float:
    """Seconds left out at the start. Raises LogError."""
    try:
        seconds = float(value)
    except (TypeError, ValueError, OverflowError):
        seconds = -1.0
    if not 0.0 <= seconds < np.inf:
        raise LogArgumentError("skip", repr(value), "expected seconds, not negative")
    return seconds


def parse_gain(value: str | Sequence[float]) -> tuple[float, float, float, float]:
    """K of u = −K (q1, q̇1, q2, q̇2), four numbers. Raises LogError."""
    gain = _floats("controller_gain", value)
    if len(gain) != 4 or not np.isfinite(gain).all():
        raise LogArgumentError("controller_gain", _short.repr(value), "expected four numbers, for q1, q1', q2, q2'")
    return gain[0], gain[1], gain[2], gain[3]


def _floats(key: str, value: float | str | Sequence[float]) -> tuple[float, ...]:
    try:
        if isinstance(value, str):
            return tuple(float(part) for part in re.split(r"[,;\s]+", value.strip(" []()")) if part)
        return tuple(float(part) for part in np.atleast_1d(np.asarray(value, dtype=float)))
    except (TypeError, ValueError):
        raise LogArgumentError(key, _short.repr(value), "expected numbers, separated by a comma") from None
