"""In which unit a column is: by what the file states, by steps, size and speed, and by the motion."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..encoders import counted_in_turns, encoder_step, is_decimal, moves_by
from ..said import ANGLE_UNITS, RADIANS, SECONDS
from ..table import Table
from ..turns import continuous
from ..vocabulary import fits, is_current, unit_in, unit_of, words
from .motion import Motion, Pair
from .policy import ProposalPolicy
from .values import Confidence


@dataclass(frozen=True)
class Unit:
    """A unit with its reason. against: what contradicts it or makes it unusable, in a sentence. looks: the unit that
    the data show instead. current: whether it is one, of a current. by_name: whether only the column's name says so,
    which may mean something else."""

    unit: str | None
    confidence: Confidence
    reason: str
    alternatives: tuple[str, ...] = ()
    against: str = ""
    looks: str | None = None
    current: bool = False
    by_name: bool = False

    def believed(self, said: str | None) -> str | None:
        """The unit to go on with: what the data show, else what is said."""
        sure = self.confidence is Confidence.sure
        return self.looks or (self.unit if sure and self.unit else said or self.unit)


def stated(table: Table, column: str, known: Collection[str | None]) -> tuple[str | None, str]:
    """The unit that a file states for a column, of those that are known, and where it does."""
    places = [
        (unit_of(table.units.get(column, "")), f"the file gives its unit as {table.units.get(column, '')}"),
        (unit_in(column), "its name says so"),
    ]
    return next(((unit, why) for unit, why in places if unit in known), (None, ""))


def any_unit(table: Table, column: str) -> str | None:
    """Whatever unit a file states for a column."""
    return unit_of(table.units.get(column, "")) or unit_in(column)


def time_unit(table: Table, column: str, t: np.ndarray, policy: ProposalPolicy) -> Unit:
    """Unit of the stamps, from what is stated and from the spacing."""
    if table.columns[column].dtype.kind in "Mm":
        return Unit("s", Confidence.sure, "the stamps are dates or durations")
    unit, why = stated(table, column, SECONDS)
    steps = np.diff(t)
    step = float(np.median(steps)) if len(steps) else 0.0
    possible = [
        u
        for u, f in SECONDS.items()
        if policy.shortest_step <= step * f <= policy.longest_step
        and policy.shortest_log <= float(t[-1] - t[0]) * f <= policy.longest_log
    ]
    spaced = lambda u: f"{_short(step * SECONDS[u])} between samples"  # noqa: E731
    if unit is not None:
        if unit in possible or not possible:
            return Unit(unit, Confidence.sure, f"{why}, {spaced(unit)}", tuple(possible))
        return Unit(
            unit,
            Confidence.open,
            f"{why}, but that would be {spaced(unit)}",
            tuple(possible),
            f"{column} is stated in {unit}, which would be {spaced(unit)}; in {possible[0]} it is "
            f"{spaced(possible[0])}.",
            possible[0],
        )
    if len(steps) > 1 and step <= 2.0 and np.allclose(steps, np.round(steps), rtol=0.0, atol=1e-9):
        if "ms" in possible and fits(column, "t") >= 2:
            why = f"{step:g} ms between samples, if it is a clock and does not count the samples"
            return Unit("ms", Confidence.likely, why, tuple(SECONDS))
        why = "it counts the samples; give the seconds from one to the next, as 0.002"
        return Unit(None, Confidence.open, why, tuple(SECONDS))
    if not possible:
        return Unit(None, Confidence.open, f"a spacing of {step:g} suits no unit", tuple(SECONDS))
    best = possible[0]
    if len(possible) == 1:
        usual = best != "d"  # of spreadsheets; a stamp's last digits may be lost there
        reason = f"{spaced(best)}; every other unit would give a clock that no rig has"
        return Unit(best, Confidence.sure if usual else Confidence.likely, reason, tuple(SECONDS))
    return Unit(best, Confidence.likely, f"{spaced(best)}, but {' or '.join(possible[1:])} could be", tuple(possible))


def _short(seconds: float) -> str:
    for unit, factor in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.2 * factor:
            return f"{seconds / factor:.4g} {unit}"
    return f"{seconds:.3g} s"


def excluded(
    values: np.ndarray, t: np.ndarray, policy: ProposalPolicy, counts: float | None = None, told: str | None = None
) -> dict[str, str]:
    """Units that an angle cannot be in, by the steps that it moves in or by its speed, each with the reason.

    counts: of its encoder a turn, if known. They tell more than a speed: an arm may spin. told: the unit that the file
    states; of turns that it does not, only steps of a usual encoder are believed."""
    whole = bool(np.array_equal(values, np.round(values)))
    turns = [2.0 * np.pi / factor for factor in RADIANS.values()]
    declared = [turn / counts for turn in turns] if counts and not whole else []
    step = next((d for d in declared if moves_by(values, d)), None) or encoder_step(values)
    rounded = is_decimal(step)  # says nothing of an encoder
    out: dict[str, str] = {} if whole else {"counts": "its values are no whole numbers"}
    if whole:
        out["turns"] = "its values are whole numbers"
        if step is not None:
            out["deg"] = out["turns"]
    elif told != "turns" and step is not None and not rounded and not _whole_parts(values, step, counts):
        out["turns"] = f"no usual encoder moves in steps of {step:.4g} turns"
    for unit, factor in RADIANS.items():
        size = None if step is None else step * factor
        if size is not None and (size > policy.coarsest or (size < policy.finest and not whole and not rounded)):
            out[unit] = (
                f"it moves in steps of {step:.4g}, an encoder of {2 * np.pi / size:.0f} counts if it were {unit}"
            )
    if (step is None or rounded) and len(t) > 1:
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds = np.abs(np.diff(continuous(values, (counts,) if counts else ())) / np.diff(t))
        speed = float(np.quantile(speeds[~np.isnan(speeds)], 0.99)) if not np.isnan(speeds).all() else 0.0
        if speed > policy.fastest:
            out["rad"] = f"it turns at {speed:.3g} rad/s if it were in rad"
    return out


def _whole_parts(values: np.ndarray, step: float, counts: float | None) -> bool:
    """Whether an angle in turns moves by whole counts: of its encoder where that is known, else of a usual one."""
    return bool(counts and moves_by(values, 1.0 / counts)) or counted_in_turns(step) is not None


def angle_units(
    table: Table,
    columns: Sequence[str],
    values: Sequence[np.ndarray],
    t: np.ndarray,
    motion: Motion,
    policy: ProposalPolicy,
) -> tuple[Unit, Unit]:
    """Units of arm and pendulum; t in s."""
    declared = str(table.metadata.get("angle_unit", "")).strip()
    told = [stated(table, c, ANGLE_UNITS) for c in columns]
    told = [
        (declared, "the file says so") if unit is None and declared in ANGLE_UNITS else (unit, why)
        for unit, why in told
    ]
    known = zip(values, motion.counts or (None, None), told, strict=True)
    out = [excluded(v, t, policy, n, unit) for v, n, (unit, _) in known]
    pairs = [] if motion.short or any(c not in motion.raw for c in columns) else list(motion.readings(*columns))
    speaking = sorted((p for p in pairs if motion.speaks(p)), key=lambda p: p.unexplained)
    possible = [p for p in speaking if all(u not in o for u, o in zip(p.units, out, strict=True))]
    clear = _clear(possible, policy)
    small = max(float(np.ptp(v)) for v in values) < policy.too_still
    turns = [counted_in_turns(encoder_step(v)) for v in values]
    return (
        _angle(0, columns[0], told[0], out[0], clear, speaking, small, turns[0]),
        _angle(1, columns[1], told[1], out[1], clear, speaking, small, turns[1]),
    )


def _clear(speaking: Sequence[Pair], policy: ProposalPolicy) -> list[Pair]:
    """The readings that explain the pendulum about as well as the best one."""
    if not speaking:
        return []
    return [p for p in speaking if p.unexplained * policy.clearly <= speaking[0].unexplained]


def _angle(
    axis: int,
    column: str,
    told: tuple[str | None, str],
    out: Mapping[str, str],
    clear: Sequence[Pair],
    speaking: Sequence[Pair],
    small: bool,
    turns: int | None,
) -> Unit:
    unit, why = told
    left = [u for u in ANGLE_UNITS if u not in out]
    by_motion = sorted({p.units[axis] for p in clear})
    choice = by_motion[0] if len(by_motion) == 1 else left[0] if len(left) == 1 else None
    if unit is not None:
        moved = any(p.units[axis] == unit for p in speaking)
        if choice in (None, unit) or (unit not in out and moved):
            return Unit(unit, Confidence.sure, why, ANGLE_UNITS)
        reason = out.get(unit, f"in {choice} the pendulum moves as gravity makes it, in {unit} it does not")
        return Unit(
            unit,
            Confidence.open,
            f"{why}, but the data do not",
            ANGLE_UNITS,
            f"{column} is stated in {unit}, but looks like {choice}: {reason}.",
            choice,
        )
    if len(by_motion) == 1 and len(left) > 1:
        return Unit(
            choice, Confidence.sure, f"only in {choice} does the pendulum move as gravity makes it", ANGLE_UNITS
        )
    if len(left) == 1:
        reason = next(iter(out[u] for u in RADIANS if u in out), "")
        return Unit(left[0], Confidence.sure, f"by its steps or speed: {reason}", ANGLE_UNITS)
    if not left:
        return Unit("rad", Confidence.open, "its steps suit no unit", ANGLE_UNITS)
    if turns and "turns" in left:
        reason = f"it moves in steps of 1/{turns}, an encoder of {turns} counts if it were turns"
        return Unit("turns", Confidence.likely, reason, ANGLE_UNITS)
    if small and "rad" in left:
        return Unit("rad", Confidence.sure, "in degrees, next to nothing would have moved", ANGLE_UNITS)
    if left[0] == "counts":
        return Unit("counts", Confidence.likely, "it holds whole numbers", ANGLE_UNITS)
    return Unit(left[0], Confidence.likely, "nothing in the file says otherwise", ANGLE_UNITS)


def command_unit(table: Table, column: str, u: np.ndarray, policy: ProposalPolicy) -> tuple[Unit, float | None]:
    """Unit of the command and what its numbers are multiplied by to be in it (None: nothing)."""
    if "input_unit" in table.metadata:
        return Unit(None, Confidence.sure, f"the file says {table.metadata['input_unit']}"), None
    units = ("V", "N·m")
    unit = any_unit(table, column)
    if unit in units:
        return Unit(unit, Confidence.sure, stated(table, column, units)[1], units), None
    if unit in ("mV", "mN·m"):
        return Unit(unit[1:], Confidence.sure, f"the file gives {unit}", units), 1e-3
    if unit in ("A", "mA", "%"):
        reason, against = f"the file gives {unit}", f"the command {column} is in {unit}."
        return Unit(None, Confidence.open, reason, units, against, current=unit != "%"), None
    parts = set(words(column))
    if is_current(column):
        reason, against = "its name means a current, in A", f"the command {column} is a current."
        return Unit(None, Confidence.open, reason, units, against, current=True, by_name=True), None
    if parts & {"duty", "pwm"}:
        reason, against = "its name means a duty", f"the command {column} is a duty."
        return Unit(None, Confidence.open, reason, units, against, by_name=True), None
    if parts & {"voltage", "volts", "volt", "spannung", "motorspannung", "ankerspannung", "voltaje", "tensione", "vm"}:
        return Unit("V", Confidence.sure, "its name means a voltage", units), None
    if parts & {"torque", "drehmoment", "tau"}:
        return Unit("N·m", Confidence.sure, "its name means a torque", units), None
    largest = float(np.max(np.abs(u[np.isfinite(u)]), initial=0.0))
    if largest >= policy.large_command:
        return Unit("V", Confidence.likely, f"it reaches {largest:.3g}, more than a small motor's N·m", units), None
    return Unit("V", Confidence.likely, "nothing in the file says so", units), None
