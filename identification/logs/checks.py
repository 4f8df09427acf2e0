"""What a log must satisfy before anything is estimated from it: errors stop, warnings say what to do next.

The functions take plain arrays, so that they can be called from a reader or from a value that validates itself.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

from furuta_gym.arguments import ArgumentError

from .encoders import counted_in_turns, encoder_step, is_decimal, moves_by
from .gaps import gaps
from .turns import continuous

MIN_SAMPLES = 50
"""Shortest log that a file may hold; a tenth of a second at 500 Hz tells nothing about a pendulum."""

SHORTEST_STRETCH = 0.5, 40
"""Seconds and samples, both, of a stretch without a gap that certainly gives start values of a fit."""

_TOO_SHORT = 0.3, 20  # seconds and samples of a stretch, below which it gives none

_MAX_STEP_RAD = 0.02  # encoders below 314 counts per revolution are not built into such rigs
_MIN_STEP_DEG = 0.0126  # nor above 28 600 as a rule; as radians, this is an encoder of 500
_SLOWEST = 0.5  # s between samples; slower is no log of a swinging pendulum
_STILL = 1e-12  # s
_HUGE = 1e12  # of any number in a log, whatever its unit
_HUGEST_CLOCK = 1e19  # nanoseconds of three centuries
_FEWEST_CHANGES = 100  # of an angle, from which it may be told whether its readings are held
_ALL_BUT = 0.98  # of the distances between changes
_FASTEST = 1e-6  # s between samples; faster is no rig's computer
_DAY = 86400.0  # s
_LARGEST_COMMAND = 1e6
MAX_SPEED = 60.0
"""Of an angle [rad/s]; a pendulum of 5 cm that falls from upright reaches about 30."""


class LogError(ValueError):
    """A log that cannot be used. The message says what was found, what is expected, and how to mend it."""


class LogArgumentError(ArgumentError, LogError):
    """An argument of how a log is read that cannot be; its parts are those of `ArgumentError`."""


class LogWarning(UserWarning):
    """A log that can be used, with something in it that the user should look at first."""


def warn(message: str) -> None:
    """Warn, pointing at the caller of the reader rather than here."""
    warnings.warn(message, LogWarning, stacklevel=5)


def check_numbers(name: str, column: str, values: np.ndarray, where: Callable[[int], str], clock: bool = False) -> None:
    """Raise `LogError` at the first number of a column that is NaN, infinite or beyond any measurement.

    clock: the column is that of time, which may count from 1970 in any unit."""
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        kind = "NaN (or an empty cell)" if np.isnan(values[bad[0]]) else "infinity"
        more = f", and {bad.size - 1} more like it" if bad.size > 1 else ""
        raise LogError(
            f"{name}: {kind} in column {column} at {where(int(bad[0]))}{more}. Expected finite numbers. Delete those "
            "rows rather than invent values: the log is cut where stamps are missing, and prediction starts anew."
        )
    most = _HUGEST_CLOCK if clock else _HUGE
    large = np.flatnonzero(np.abs(values) > most)
    if large.size:
        raise LogError(
            f"{name}: column {column} holds {values[large[0]]:.3g} at {where(int(large[0]))} ({large.size} such rows). "
            f"Expected numbers up to {most:.0g}: check how the column was written, and delete rows that are damaged."
        )


def check_clock(name: str, t: np.ndarray, where: Callable[[int], str]) -> None:
    """Raise `LogError` unless time increases, by more than rounding."""
    steps = np.diff(t)
    bad = np.flatnonzero(steps <= _STILL)
    if not bad.size:
        return
    k = int(bad[0]) + 1
    if steps[k - 1] >= 0:
        raise LogError(
            f"{name}: time stands still at {where(k)} (t = {t[k]:.9g} s twice; {bad.size} such rows). Expected "
            "strictly increasing time. Write the stamps with more digits, or delete the repeated rows."
        )
    raise LogError(
        f"{name}: time runs backwards at {where(k)} (from {t[k - 1]:g} s to {t[k]:g} s; {bad.size} such rows). "
        "Expected strictly increasing time. If two recordings were joined, split the file there and pass both; "
        "if the clock wrapped, unwrap it first."
    )


def check_length(name: str, n: int) -> None:
    """Raise `LogError` below `MIN_SAMPLES`."""
    if n < MIN_SAMPLES:
        raise LogError(
            f"{name}: {n} sample{'' if n == 1 else 's'}. Expected at least {MIN_SAMPLES}, and for a useful "
            "estimate some seconds of motion. Record longer, or check that the file was written to its end."
        )


def check_stretches(name: str, t: np.ndarray) -> None:
    """Raise `LogError` where samples are missing so often that no stretch without a gap can be fitted."""
    cuts = np.flatnonzero(gaps(t)) + 1
    (least, fewest), (seconds, samples) = _TOO_SHORT, SHORTEST_STRETCH
    pieces = np.split(t, cuts)
    if cuts.size and not any(len(p) >= fewest and p[-1] - p[0] >= least for p in pieces):
        longest = max(float(p[-1] - p[0]) for p in pieces)
        places = "one place" if cuts.size == 1 else f"{cuts.size} places"
        raise LogError(
            f"{name}: samples are missing in {places}, and the longest stretch without a gap lasts "
            f"{longest:.3g} s. Expected one of at least {least:g} s and {fewest} samples; {seconds:g} s and {samples} "
            "samples are safe. Record again with a logger that keeps up, or with a longer sample time."
        )


def check_command(name: str, u: np.ndarray, severity: str) -> None:
    """A command that never changes: `LogError`, or a warning if `severity` is "warn"; "ignore" passes free decays."""
    if np.ptp(u) > 0 or (severity == "ignore" and u[0] == 0):
        return
    message = (
        f"{name}: the command u is {u[0]:g} in every sample. Expected a command that moves the arm: without it "
        "the parameters have no scale. Check the column mapping (--columns u=...), or excite the rig, for "
        "example with the paper's d(t). A free decay (u = 0) can only be used together with a driven log."
    )
    if severity in ("warn", "ignore"):
        warn(message)
    else:
        raise LogError(message)


def warn_about_command(name: str, column: str, u: np.ndarray) -> None:
    """Warn about a command that no rig has."""
    if (largest := float(np.abs(u).max())) > _LARGEST_COMMAND:
        warn(
            f"{name}: the command {column} reaches {largest:.3g}. Expected volts or N·m, which no rig has so many of; "
            "check the column, or scale it."
        )


def check_motion(name: str, q1: np.ndarray, q2: np.ndarray) -> None:
    """Warn about an angle that never changes."""
    for column, q, part in (("q1", q1, "arm"), ("q2", q2, "pendulum")):
        if np.ptp(q) == 0:
            warn(
                f"{name}: {column} is {q[0]:g} rad in every sample. Was the {part} held, or its encoder not "
                "connected? What concerns it cannot be identified from this log."
            )


def warn_about_held(name: str, angles: dict[str, np.ndarray]) -> None:
    """Warn about angles that change in every n-th row only: they are read more slowly than the rows are written."""
    held = {column: n for column, q in angles.items() if (n := _held_for(q)) > 1}
    if held:
        nth = {n: f"{n}{ {2: 'nd', 3: 'rd'}.get(n, 'th') }" for n in held.values()}
        said = [f"{column} changes in every {nth[n]} row only" for column, n in held.items()]
        warn(
            f"{name}: {', and '.join(said)}, so the readings are older than their rows say. If the logger is faster "
            "than the loop, keep one row of each reading."
        )


def _held_for(q: np.ndarray) -> int:
    """Rows for which each reading stands, 1 if they change as a motion does."""
    steps = np.diff(q)
    changes = np.flatnonzero(steps)
    distances = np.diff(changes)
    if len(distances) < _FEWEST_CHANGES:
        return 1
    n = int(np.median(distances))
    sizes = np.abs(steps[changes])
    one_speed = float(np.max(sizes)) < 2.5 * float(np.min(sizes))  # a coarse encoder that turns evenly
    return n if n > 1 and not one_speed and np.mean(distances % n == 0) > _ALL_BUT else 1


def warn_about_clock(name: str, t: np.ndarray) -> None:
    """Warn about dropped samples, and about stamps that look like milliseconds. `LogError` where nothing else they
    can be."""
    steps = np.diff(t)
    typical = float(np.median(steps))
    if typical > _SLOWEST:
        raise LogError(
            f"{name}: the samples are {typical:g} s apart. Expected less than {_SLOWEST:g} s, as a pendulum swings. "
            "If the time column is in milliseconds, say so: --time-unit ms (or us), time_unit='ms' in Python. If it "
            "counts the samples, give the seconds from one to the next: --time-unit 0.002."
        )
    if typical < _FASTEST:
        day = f" In days, as spreadsheets keep time, it would be {1e3 * typical * _DAY:.3g} ms: --time-unit d."
        warn(
            f"{name}: the samples are {typical:.3g} s apart, faster than any rig's computer. Expected seconds; check "
            f"the time column and its unit.{day if 1e-4 < typical * _DAY < _SLOWEST else ''}"
        )
    cuts = np.flatnonzero(gaps(t))
    if cuts.size:
        missing = int(np.sum(np.round(steps[cuts] / typical) - 1))
        longest = int(cuts[np.argmax(steps[cuts])])
        plural = "s" if cuts.size > 1 else ""
        warn(
            f"{name}: {cuts.size} gap{plural} in the clock, about {max(missing, 1)} samples dropped; the longest lasts "
            f"{steps[longest]:.3g} s, after t = {t[longest]:g} s. The log is cut there, and prediction starts anew "
            "after each gap. If samples are dropped often, record with a longer sample time."
        )
    if typical > 0.2:
        warn(
            f"{name}: the samples are {typical:g} s apart, which is very long for this plant. If the time column "
            "is in milliseconds, say so: --time-unit ms (or us), time_unit='ms' in Python."
        )


def check_angle_unit(
    name: str, column: str, t: np.ndarray, raw: np.ndarray, unit: str, counts: float | None = None
) -> bool:
    """Warn about angles that do not look like the declared unit; `raw` is in that unit. True if it warned.

    An encoder's smallest step tells: 0.04 to 0.7 in degrees, 0.0006 to 0.013 in radians for 500 to 10 000
    counts; or the declared counts per revolution, if it is theirs. Angles that do not move in steps are judged by
    their speed.
    """
    step, whole = encoder_step(raw), np.array_equal(raw, np.round(raw))
    declared = {"rad": 2.0 * np.pi, "deg": 360.0, "turns": 1.0}[unit] / counts if counts else 0.0
    if declared and ((step is not None and abs(step / declared - 1) < 0.1) or (not whole and moves_by(raw, declared))):
        return False
    if step == 1.0 and whole:
        warn(
            f"{name}: {column} holds whole numbers, which looks like encoder counts, but {unit} was declared. If so: "
            "--unit counts with --encoder-counts."
        )
        return True
    if unit == "rad":
        speed = float(np.quantile(np.abs(np.diff(continuous(raw))) / np.diff(t), 0.99))
        if (step is not None and step > _MAX_STEP_RAD) or ((step is None or is_decimal(step)) and speed > MAX_SPEED):
            seen = f"moves in steps of {step:.3g}" if step is not None else f"reaches a speed of {speed:.3g} /s"
            warn(f"{name}: {column} {seen}, which looks like degrees, but radians were declared. If so: --unit deg.")
            return True
        if usual := counted_in_turns(step):
            warn(
                f"{name}: {column} moves in steps of 1/{usual}, which looks like turns, but radians were declared "
                f"({2 * np.pi / step:.0f} counts per revolution). If so: --unit turns."  # type: ignore[operator]
            )
    elif unit == "turns":
        if step is not None and 2.0 * np.pi * step > _MAX_STEP_RAD:
            warn(
                f"{name}: {column} moves in steps of {step:.3g}, an encoder of {1.0 / step:.0f} counts per revolution "
                "if it were turns, as declared. If it is in degrees or radians: --unit deg, or --unit rad."
            )
            return True
    elif step is not None and step < _MIN_STEP_DEG and not is_decimal(step):
        warn(
            f"{name}: {column} moves in steps of {step:.3g}, which looks like radians ({2 * np.pi / step:.0f} "
            f"counts per revolution), but degrees were declared ({360 / step:.0f} counts). If so: --unit rad."
        )
        return True
    return False


def check_counts(name: str, column: str, q: np.ndarray, counts: float) -> None:
    """Warn if the angle moves in steps that are not a whole multiple of the declared encoder's."""
    step, declared = encoder_step(q), 2 * np.pi / counts
    if step is None:
        return
    ratio = step / declared
    if abs(ratio - max(round(ratio), 1)) > 0.1 or ratio > 1.5:
        warn(
            f"{name}: {column} moves in steps of {step:.4g} rad, as an encoder of {2 * np.pi / step:.0f} counts "
            f"per revolution would, but {counts:g} were declared. Count all four edges of a quadrature encoder, "
            "or leave encoder_counts out: the noise is then estimated from the data."
        )
