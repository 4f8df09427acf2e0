"""Everything that is wrong with a table, or with several together, each with what mends it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from .. import checks
from ..jumps import warn_about_jumps
from ..mapping import own_clock
from ..said import COLUMNS, SECONDS
from ..signs import Signs
from ..vocabulary import fits
from ..wrapping import unwrap
from .columns import SPOKEN
from .look import Look
from .policy import ProposalPolicy
from .same_gain import gains
from .units import Unit, command_unit
from .values import Confidence, NoColumn, Problem

_WHOLE = 1e-6  # by which the numbers of a counter may differ from whole ones


def problems_of(look: Look, constant_command: str) -> list[Problem]:
    """Everything that is wrong with this table, in the order of the items."""
    name = look.table.name
    missing = [ours for ours in COLUMNS if look.column(ours) is None]
    found: list[Problem] = []
    for ours in list(missing):
        if column := _named_but_text(look, ours):
            found += _said(name, lambda c=column: look.table.numbers(c))
            missing.remove(ours)
    if missing:
        spoken = ", ".join(f"{SPOKEN[m]} ({m})" for m in missing)
        there = ", ".join(list(look.table.columns)[:20]) or "none"
        example = ",".join(f"{ours}=NAME" for ours in missing)
        free = [c for c in look.table.columns if c not in map(look.column, COLUMNS)]
        lost = "" if free else ". No other column is left in the file; what was not logged needs a new recording"
        text = f"no column is known to be {spoken}; the file has {there}."
        found.append(NoColumn(text, f"Name it: --columns {example}{lost}"))
        for column in free:
            if _spoilt(look, column):
                found += _said(name, lambda c=column: look.table.numbers(c))
    used = {ours: c for ours in COLUMNS if (c := look.column(ours)) is not None}
    for column in used.values():
        check = partial(checks.check_numbers, name, column, where=look.table.where, clock=column == used.get("t"))
        found += _said(name, lambda c=column, check=check: check(look.table.numbers(c)))
    finite = {ours: look.numbers[c] for ours, c in used.items() if np.isfinite(look.numbers[c]).all()}
    if "t" in finite:
        clock = _said(name, lambda: checks.check_clock(name, look.t, look.table.where))
        found += [*clock, *_said(name, lambda: checks.check_length(name, len(look.t))), *_no_counter(look, used["t"])]
        if not clock:
            found += _said(name, lambda: checks.check_stretches(name, look.t))
    if "t" in finite and not look.dates and look.said("time_unit") in (None, *SECONDS):  # else it is a counter's
        found += _unit_problem(look, "t", look.time, "time_unit", "--time-unit ")
    for axis in ("q1", "q2"):
        found += _unit_problem(look, axis, look.units[axis], f"unit_{axis}", f"--unit {axis}=")
    if "u" in finite:
        found += _said(name, lambda: checks.check_command(name, finite["u"], constant_command))
        unit = command_unit(look.table, used["u"], finite["u"], look.policy)[0]
        said = look.given
        enough = look.assumed or said.input_unit if unit.by_name else said.input_unit and said.input_scale
        if unit.against and not enough:
            scale = "N·m --input-scale K, with the motor's constant K in N·m/A, or 1 if unknown"
            if not unit.current:
                scale = "V --input-scale K, with the volts of one unit"
            found.append(Problem(unit.against, f"Give its unit and the factor: --input-unit {scale}"))
    if {"q1", "q2"} <= set(finite) and look.factors is not None:
        q1, q2 = (finite[q] * f for q, f in zip(("q1", "q2"), look.factors, strict=True))
        found += _said(name, lambda: checks.check_motion(name, q1, q2))
        found += _said(name, lambda: checks.warn_about_held(name, {used["q1"]: q1, used["q2"]: q2}))
        found += _jumps(look, used, (q1, q2))
    silent = dict.fromkeys(look.table.silent[column] for column in used.values() if column in look.table.silent)
    notes = [Problem(note.removeprefix(f"{name}: "), "", False) for note in (*look.table.notes, *silent)]
    return [*found, *look.found, *_zero_problems(look), *notes]


def _no_counter(look: Look, column: str) -> list[Problem]:
    """A time column that is said to count, and holds no whole numbers."""
    said = look.said("time_unit")
    if look.dates or said in (None, *SECONDS):
        return []
    steps = np.diff(look.numbers[column])
    if np.abs(steps - np.round(steps)).max(initial=0.0) < _WHOLE:
        return []
    text = f"--time-unit {said} says that {column} counts, {said} s each, and its numbers are not whole."
    return [Problem(text, f"Give the unit of its numbers instead: --time-unit {', '.join(SECONDS)}")]


def _named_but_text(look: Look, ours: str) -> str | None:
    """The column that is one of ours by what is said or by its name, and was left out as it mostly holds text."""
    left = [c for c in look.table.columns if c not in look.numbers]
    if ours in look.given.columns:
        return next((c for c in left if c == look.given.columns[ours]), None)
    best = max((fits(c, ours) for c in left), default=0)
    named = [c for c in left if fits(c, ours) == best]
    return named[0] if best >= 2 and len(named) == 1 else None


def _spoilt(look: Look, column: str) -> bool:
    """Whether a column of numbers is unknown as some cells of it hold text."""
    return column in look.numbers and bool(np.isnan(look.numbers[column]).all())


def _unit_problem(look: Look, ours: str, unit: Unit, name: str, option: str) -> list[Problem]:
    """A unit that the file states, or that was said or assumed, against the data."""
    said = look.said(name)
    if unit.looks and said != unit.looks and (said in (None, unit.unit) or look.assumed):
        text, better = unit.against, unit.looks
    elif said is not None and unit.confidence is Confidence.sure and unit.unit not in (None, said) and not unit.looks:
        text, better = f"{look.column(ours)} is read in {said}, but is in {unit.unit}: {unit.reason}.", unit.unit
    else:
        return []
    return [Problem(text, f"Read it with {option}{better}" + (" --encoder-counts N" if better == "counts" else ""))]


def _zero_problems(look: Look) -> list[Problem]:
    arm, pendulum = look.column("q1"), look.column("q2")
    if look.factors is None or arm is None or pendulum is None:
        return []
    if look.signs.gravity == 0:
        degrees = look.motion.zero(arm, pendulum, look.factors)
        off = None if degrees is None else min(abs(degrees), 180 - abs(degrees))
        if degrees is not None and off is not None and off > look.policy.zero:
            text = f"{pendulum} is upright at about {degrees:.0f}°, so its zero is neither upright nor hanging."
            return [
                Problem(text, f"Subtract {degrees:.0f}° (or that plus 180°) from the column and read the file again.")
            ]
        return []
    zero, flips = look.signs.mended("upright", ())
    stated = look.said("pendulum_zero") or look.stated_zero
    said_flips = look.given.flip if look.given.flip is not None or not look.assumed else ()
    wrong = []
    if stated is not None and stated != zero:
        source = "it is read" if look.given.pendulum_zero else "the file says" if look.stated_zero else "it is read"
        wrong.append(f"{source} that {pendulum} = 0 is {stated}, but the pendulum falls as if it were {zero}")
    if said_flips is not None and not _same_signs(said_flips, flips, look.signs):
        shown = f"the sign of {','.join(said_flips)} turned" if said_flips else "no sign turned"
        wrong.append(f"with {shown}, arm, pendulum and command do not move as those of one rig")
    if not wrong:
        return []
    mend = f"--pendulum-zero {zero}" + (f" --flip {','.join(flips)}" if flips else " and no --flip")
    return [Problem("; ".join(wrong) + ".", f"Unless you know better, read it with {mend}")]


def _jumps(look: Look, used: Mapping[str, str], angles: Sequence[np.ndarray]) -> list[Problem]:
    """What stands out of angles [rad], where the clock is one and no jump is refused in reading."""
    name, stamps = look.table.name, look.values("t")
    if stamps is None or len(stamps) < checks.MIN_SAMPLES or not np.all(np.diff(stamps) > 0):
        return []
    t = own_clock(stamps, look.factor)
    counts = look.known_counts or (None, None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", checks.LogWarning)  # wrapped angles are in order
        try:
            whole = [unwrap(name, used[q], t, y, n) for q, y, n in zip(("q1", "q2"), angles, counts, strict=True)]
        except checks.LogError:
            return []
    found = {used[q]: (y, n) for q, y, n in zip(("q1", "q2"), whole, counts, strict=True)}
    return _said(name, lambda: warn_about_jumps(name, t, found))


def _same_signs(said: Sequence[str], wanted: Sequence[str], signs: Signs) -> bool:
    """Whether two sets of flips read the motion alike: they differ by nothing, or by what it cannot tell, which is
    always the turning of all three."""
    differ = set(said) ^ set(wanted)
    unknown = ({"u"} if not signs.command else set()) | ({"q2"} if not signs.coupling else set())
    return differ <= unknown or {"q1", "q2", "u"} - differ <= unknown


def _said(name: str, check: Callable[[], Any]) -> list[Problem]:
    """What a check of `checks` raises or warns of, as problems."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            check()
        except checks.LogError as error:
            return [_problem(name, str(error), True)]
    return [_problem(name, str(w.message), False) for w in caught if issubclass(w.category, checks.LogWarning)]


def _problem(name: str, message: str, fatal: bool) -> Problem:
    text, dot, mend = message.removeprefix(f"{name}: ").partition(". ")
    return Problem(text + dot.strip(), mend, fatal)


_OF_ITS_OWN = (
    "Logs that are written in different ways need a rig.toml each: put them into folders of their own, run "
    "`furuta init` on each there, then give them together"
)


def same_columns(first: Look, looks: Sequence[Look]) -> list[Problem]:
    """Logs that one mapping cannot read, by the names of their columns or the units of their angles."""
    found = []
    for look in looks:
        lacking = [c for ours in COLUMNS if (c := first.column(ours)) is not None and c not in look.table.columns]
        if lacking:
            text = f"{look.table.name} has no column {', '.join(lacking)}, which {first.table.name} has."
            found.append(Problem(text, f"{_OF_ITS_OWN}."))
            continue
        units = {axis: (first.units[axis], look.units[axis]) for axis in ("q1", "q2")}
        read = {axis: tuple(unit.believed(None) for unit in pair) for axis, pair in units.items()}
        if any(one == other for one, other in read.values()):
            continue  # who writes one angle alike writes both alike; an arm that spins looks as if it were in degrees
        for axis, (one, other) in read.items():
            if None not in (one, other) and all(unit.confidence is Confidence.sure for unit in units[axis]):
                text = f"{first.column(axis)} is in {one} in {first.table.name}, in {other} in {look.table.name}."
                found.append(Problem(text, f"{_OF_ITS_OWN}."))
    return found


def same_rig(looks: Sequence[Look], policy: ProposalPolicy) -> list[Problem]:
    """Logs whose pendulums differ, by what gravity and the arm do to them, or whose signs do."""
    seen = []
    for look in looks:
        arm, pendulum = look.column("q1"), look.column("q2")
        if look.factors is None or arm is None or pendulum is None or look.motion.short:
            continue
        if not {arm, pendulum} <= set(look.motion.raw):
            continue
        row = look.motion.pair(arm, pendulum, ("rad", "rad"), look.factors).row
        if row.r2 >= policy.sure_of_rig and all(row.coefficients):
            seen.append((look, row))
    for look, row in seen[1:]:
        one, other = seen[0][1].coefficients, row.coefficients
        ratios = [abs(a / b) for a, b in zip(one, other, strict=True)]
        if any(max(r, 1 / r) > policy.same_rig for r in ratios):
            text = (
                f"{seen[0][0].table.name} and {look.table.name} are not of one rig: gravity moves their pendulums by "
                f"{abs(one[0]):.0f} and {abs(other[0]):.0f} 1/s², the arm by {abs(one[1]):.2f} and {abs(other[1]):.2f}."
            )
            return [Problem(text, "Give the logs of one rig at a time.")]
        if seen[0][0].signs.gravity * look.signs.gravity < 0:
            text = f"{seen[0][0].table.name} and {look.table.name} count from different zeros of the pendulum."
            return [Problem(text, "Give them one at a time, each with its own rig.toml (--rig FILE).")]
    return []


def same_gain(looks: Sequence[Look], policy: ProposalPolicy) -> list[Problem]:
    """Logs in which the command does not do the same, as notes: each against the first that is driven."""
    seen = [(look.table.name, driven) for look in looks if (driven := look.driven_arm) is not None]
    found = []
    for name, driven in seen[1:]:
        between = gains(seen[0][1], driven)
        larger = max(between.factor, 1.0 / between.factor) > policy.same_gain
        if larger and between.with_one > policy.sure_of_gain * between.unexplained:
            text = f"the command of {name} does {between.factor:.2g} times what that of {seen[0][0]} does to the arm."
            mend = "Look at the supply, the driver and the command's scale. If they differ, identify each log alone."
            found.append(Problem(text, mend, False, True))
    return found
