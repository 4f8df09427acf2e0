"""`propose`: tables in, a proposal of how to read them out."""

from __future__ import annotations

import shlex
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .. import checks
from ..encoders import encoder_step
from ..mapping import COLUMNS, SECONDS, parse_counts, parse_zero
from ..rig_mapping import RigMapping
from ..signs import Signs
from ..table import Table
from .columns import SPOKEN, Choice, angle_candidates, named, numeric
from .motion import RADIANS, Motion, Pair
from .policy import USUAL_COUNTS, ProposalPolicy
from .units import ANGLE_UNITS, Unit, angle_units, any_unit, command_unit, time_unit
from .values import Confidence, Item, Problem, Proposal

_AS_YOU_SAY = "as you say"


def propose(
    tables: Table | Sequence[Table], given: RigMapping | None = None, policy: ProposalPolicy | None = None
) -> Proposal:
    """Propose how to read the tables of one rig's logs, and say everything that is wrong with them.

    tables: as `formats.read_table` gives them. given: what is known already; it is kept and looked at too.
    policy: holds the thresholds. Raises LogError for no tables.
    """
    tables = [tables] if isinstance(tables, Table) else list(tables)
    if not tables:
        raise checks.LogError("no log was given. Expected at least one file.")
    policy, given = policy or ProposalPolicy(), given or RigMapping()
    looks = [_Look(table, given, policy) for table in tables]
    first = next((look for look in looks if look.driven), looks[0])
    items = first.items([look for look in looks if look is not first])
    several = len(tables) > 1
    problems = [p for look in looks for p in look.problems(several)]
    problems += _same_columns(first, looks) + _same_rig(looks, policy)
    unique = {(p.text, p.mend): p for p in problems}
    return Proposal(tuple(t.name for t in tables), tuple(items), tuple(unique.values()), given)


class _Look:
    """One table, looked at in the order in which one answer needs the other: columns, clock, units, zero, signs."""

    def __init__(self, table: Table, given: RigMapping, policy: ProposalPolicy):
        self.table, self.given, self.policy = table, given, policy
        self.numbers = numeric(table)
        self.choices = named(self.numbers, given.columns)
        self.found: list[Problem] = []
        self.time = self._time()
        self.factor = SECONDS[given.time_unit or self.time.unit or "s"]
        if self._dates():
            self.factor = 1.0
        time = self.choices["t"].column
        stamps = self.numbers[time] if time else np.arange(0.0)
        self.t = (stamps - stamps[0]) * self.factor if len(stamps) else stamps
        self.motion = Motion(self.t, {c: v for c, v in self.numbers.items() if c != time}, policy)
        self._columns_by_motion()
        self.units = self._units()
        self.known_counts = self._known_counts()
        self.factors = self._factors()
        self.signs = self._signs()

    # --- what is in it ---------------------------------------------------------------------------------------

    def column(self, ours: str) -> str | None:
        return self.choices[ours].column

    def values(self, ours: str) -> np.ndarray | None:
        column = self.column(ours)
        return None if column is None else self.numbers[column]

    @property
    def driven(self) -> bool:
        u = self.values("u")
        return u is not None and bool(np.isfinite(u).any()) and bool(np.nanmax(u) > np.nanmin(u))

    def _dates(self) -> bool:
        time = self.column("t")
        return time is not None and self.table.columns[time].dtype.kind in "Mm"

    def _time(self) -> Unit:
        column = self.column("t")
        if column is None or len(self.numbers[column]) < 3:
            return Unit(None, Confidence.open, "there is no time column", tuple(SECONDS))
        return time_unit(self.table, column, self.numbers[column], self.policy)

    def _columns_by_motion(self) -> None:
        """Let the motion say what names leave open, and contradict them where it clearly does."""
        names = {ours: self.column(ours) for ours in ("q1", "q2", "u")}
        said = self.given.columns
        by_name = all(self.choices[ours].confidence is Confidence.sure for ours in ("q1", "q2"))
        if self.motion.short:
            return
        pool = [c for c in names.values() if c] if by_name else angle_candidates(self.numbers, self.choices)
        pool = [c for c in pool if c not in {said.get("t")}]
        best = self.motion.best(pool)
        if best is None:
            return
        if by_name:
            own = self._readings(names["q1"], names["q2"])
            mine = min((r for r in own if self.motion.speaks(r)), key=lambda r: r.unexplained, default=None)
            worse = mine is None or best.unexplained < self.policy.swapped * mine.unexplained
            if worse and (best.arm, best.pendulum) != (names["q1"], names["q2"]):
                rest = [c for c in names.values() if c not in (best.arm, best.pendulum)]
                meant = {"q1": best.arm, "q2": best.pendulum} | ({"u": rest[0]} if rest and rest[0] else {})
                changed = {ours: c for ours, c in meant.items() if names[ours] != c}
                self.found.append(
                    Problem(
                        f"the columns look swapped: {best.pendulum} moves as a pendulum that {best.arm} drives, "
                        f"{names['q2']} does not.",
                        "If so: " + RigMapping(**changed).options(),  # type: ignore[arg-type]
                    )
                )
                for ours in changed:
                    alternatives = tuple(dict.fromkeys([meant[ours], *pool]))
                    self.choices[ours] = Choice(names[ours], Confidence.open, "its motion says otherwise", alternatives)
            return
        reason = f"{best.pendulum} moves as a pendulum that {best.arm} drives"
        for ours, column in (("q1", best.arm), ("q2", best.pendulum)):
            if ours not in said and self.choices[ours].confidence is not Confidence.sure:
                self.choices[ours] = Choice(column, Confidence.likely, reason, tuple(pool))
        if self.choices["u"].confidence is not Confidence.sure and "u" not in said:
            self._command_by_motion(pool)

    def _readings(self, arm: str | None, pendulum: str | None) -> list[Pair]:
        there = arm in self.motion.raw and pendulum in self.motion.raw
        return list(self.motion.readings(arm, pendulum)) if there and arm and pendulum else []

    def _command_by_motion(self, pool: Sequence[str]) -> None:
        arm, pendulum = self.column("q1"), self.column("q2")
        rest = [c for c in pool if c not in (arm, pendulum)]
        if arm is None or pendulum is None or not rest:
            return
        r2 = {c: self.motion.command_r2(arm, pendulum, c, (1.0, 1.0)) for c in rest}
        best = max(rest, key=lambda c: r2[c])
        reason = "the only other column that moves" if len(rest) == 1 else "the arm's motion follows it best"
        self.choices["u"] = Choice(best, Confidence.likely, reason, tuple(rest))

    def _units(self) -> dict[str, Unit]:
        columns = [self.column("q1"), self.column("q2")]
        unknown = Unit(None, Confidence.open, "its column is not known", ANGLE_UNITS)
        if None in columns or self.column("t") is None or len(self.t) < 3:
            return {"q1": unknown, "q2": unknown}
        values = [self.numbers[c] for c in columns]  # type: ignore[index]
        if not all(np.isfinite(v).all() for v in values):
            told = [any_unit(self.table, c) for c in columns]  # type: ignore[arg-type]
            return {
                q: Unit(unit, Confidence.sure if unit in ANGLE_UNITS else Confidence.likely, "by its name", ANGLE_UNITS)
                for q, unit in zip(("q1", "q2"), told, strict=True)
            }
        q1, q2 = angle_units(self.table, columns, values, self.t, self.motion, self.policy)  # type: ignore[arg-type]
        return {"q1": q1, "q2": q2}

    def unit(self, axis: str) -> str | None:
        return getattr(self.given, f"unit_{axis}") or self.units[axis].unit

    def _known_counts(self) -> tuple[float, float] | None:
        if self.given.encoder_counts:
            return self.given.encoder_counts
        try:
            return parse_counts(self.table.metadata["encoder_counts"])
        except (KeyError, checks.LogError):
            return None

    def _factors(self) -> tuple[float, float] | None:
        """rad per unit of both angles, None while it is not known."""
        counts = self.known_counts
        found = []
        for i, axis in enumerate(("q1", "q2")):
            unit = self.unit(axis)
            if unit in RADIANS:
                found.append(RADIANS[unit])
            elif unit == "counts" and counts:
                found.append(2 * np.pi / counts[i])
            else:
                return None
        return found[0], found[1]

    def _signs(self) -> Signs:
        arm, pendulum = self.column("q1"), self.column("q2")
        if self.factors is None or arm is None or pendulum is None:
            return Signs(0, 0, 0)
        return self.motion.signs(arm, pendulum, self.column("u"), self.factors)

    # --- what follows ----------------------------------------------------------------------------------------

    def items(self, others: Sequence[_Look]) -> list[Item]:
        signs = _together([self, *others])
        return [*self._column_items(), *self._unit_items(), *self._motion_items(signs), *self._facts()]

    def _column_items(self) -> list[Item]:
        rows = []
        for ours in COLUMNS:
            choice = self.choices[ours]
            option = f"--columns {ours}=…"
            shown = choice.column or "?"
            rows.append(
                Item(
                    ours,
                    f"{SPOKEN[ours]} column",
                    choice.column,
                    shown,
                    choice.confidence,
                    choice.reason,
                    choice.alternatives,
                    option,
                )
            )
        return rows

    def _unit_items(self) -> list[Item]:
        def item(name: str, says: str, unit: Unit, option: str) -> Item:
            if (said := getattr(self.given, name)) is not None:
                return Item(name, says, said, said, Confidence.sure, _AS_YOU_SAY, (), option)
            value = None if name == "time_unit" and (self._dates() or unit.unit == "s") else unit.unit
            return Item(name, says, value, unit.unit or "?", unit.confidence, unit.reason, unit.alternatives, option)

        rows = [item("time_unit", "time in", self.time, "--time-unit")]
        for axis in ("q1", "q2"):
            rows.append(item(f"unit_{axis}", f"{SPOKEN[axis]} in", self.units[axis], f"--unit {axis}=…"))
        if "counts" in (self.unit("q1"), self.unit("q2")) and self.known_counts is None:
            rows.append(
                Item(
                    "encoder_counts",
                    "counts per revolution",
                    None,
                    "?",
                    Confidence.open,
                    "angles in counts need it, and no motion tells it",
                    ("2048", "4096"),
                    "--encoder-counts",
                )
            )
        column, u = self.column("u"), self.values("u")
        if column is None or u is None:
            return rows
        unit, scale = command_unit(self.table, column, u, self.policy)
        row = item("input_unit", "command in", unit, "--input-unit")
        if row.value is None and "input_unit" in self.table.metadata:
            row = Item("input_unit", row.says, None, self.table.metadata["input_unit"], row.confidence, row.reason)
        rows.append(row)
        scale = self.given.input_scale or scale
        if scale is not None and scale != 1.0:
            reason = _AS_YOU_SAY if self.given.input_scale else unit.reason
            rows.append(
                Item("input_scale", "command times", scale, f"{scale:g}", Confidence.sure, reason, (), "--input-scale")
            )
        return rows

    def _motion_items(self, signs: Signs) -> list[Item]:
        zero, flips = signs.mended("upright", ())
        stated = self._stated_zero()
        rows = []
        if self.given.pendulum_zero is not None:
            rows.append(self._zero_item(self.given.pendulum_zero, Confidence.sure, _AS_YOU_SAY))
        elif signs.gravity:
            falls = "away from 0" if signs.gravity > 0 else "towards 0"
            rows.append(self._zero_item(zero, Confidence.sure, f"the pendulum falls {falls}", stated))
        elif stated is not None:
            rows.append(self._zero_item(stated, Confidence.sure, "the file says so", stated))
        else:
            rows.append(self._zero_item(self._usual_zero(), Confidence.open, "the motion does not tell it"))
        known_zero = self.given.pendulum_zero or (zero if signs.gravity else stated)
        if known_zero is not None and known_zero != zero:
            # as it is said, against the motion or without its word: signs are those seen with that zero
            flips = Signs(signs.gravity and 1, -signs.coupling, signs.command).mended(known_zero, ())[1]
        reasons = {
            "q1": ("which way is positive is yours to choose", signs.coupling),
            "q2": (
                "the arm's turning pushes the pendulum to its proper side" if signs.coupling else "",
                signs.coupling,
            ),
            "u": ("a positive command turns the arm to the positive side" if signs.command else "", signs.command),
        }
        for axis, (reason, clear) in reasons.items():
            said = self.given.flip
            turned = axis in (said if said is not None else flips)
            if said is not None:
                confidence, reason = Confidence.sure, _AS_YOU_SAY
            elif axis == "q1" or clear:
                confidence = Confidence.sure
            else:
                confidence, reason = Confidence.likely, "the motion does not tell it"
            if turned and confidence is Confidence.sure and said is None:
                reason = reason.replace("which way is positive is yours to choose", "its turning pushes the pendulum")
                reason = f"turned: then {reason}"
            name = {"q1": "sign of the arm", "q2": "sign of the pendulum", "u": "sign of the command"}[axis]
            shown = "turned" if turned else "as it is"
            rows.append(
                Item(
                    f"sign_{axis}",
                    name,
                    "-" if turned else "+",
                    shown,
                    confidence,
                    reason,
                    ("none", "q1", "q2", "u"),
                    f"--flip {axis}",
                )
            )
        return rows

    def _zero_item(self, zero: str, confidence: Confidence, reason: str, stated: str | None = None) -> Item:
        value = None if stated == zero or (zero == "upright" and stated is None) else zero
        value = zero if self.given.pendulum_zero else value
        return Item(
            "pendulum_zero",
            "pendulum's zero",
            value,
            zero,
            confidence,
            reason,
            ("upright", "hanging"),
            "--pendulum-zero",
        )

    def _stated_zero(self) -> str | None:
        try:
            return parse_zero(self.table.metadata["pendulum_zero"])
        except (KeyError, checks.LogError):
            return None

    def _usual_zero(self) -> str:
        q2 = self.values("q2")
        turned = (
            0.0 if q2 is None or not len(q2) or self.factors is None else abs(q2[0] * self.factors[1]) % (2 * np.pi)
        )
        return "hanging" if abs(turned - np.pi) < 0.5 else "upright"

    def _facts(self) -> list[Item]:
        rows = []
        if self.factors is not None and self.known_counts is None:
            angles = [(self.values(q), f) for q, f in zip(("q1", "q2"), self.factors, strict=True)]
            steps = [None if v is None else encoder_step(v * f) for v, f in angles]
            counts = [_usual(2 * np.pi / s, self.policy) if s else None for s in steps]
            if all(counts):
                pair = (float(counts[0]), float(counts[1]))  # type: ignore[arg-type]
                shown = f"{pair[0]:g}" if pair[0] == pair[1] else f"{pair[0]:g}, {pair[1]:g}"
                rows.append(
                    Item(
                        "encoder_counts",
                        "counts per revolution",
                        pair,
                        shown,
                        Confidence.sure,
                        "the angles move in such steps",
                        (),
                        "--encoder-counts",
                    )
                )
        elif self.given.encoder_counts:
            shown = ", ".join(f"{c:g}" for c in dict.fromkeys(self.given.encoder_counts))
            rows.append(
                Item(
                    "encoder_counts",
                    "counts per revolution",
                    self.given.encoder_counts,
                    shown,
                    Confidence.sure,
                    _AS_YOU_SAY,
                    (),
                    "--encoder-counts",
                )
            )
        if self.motion.T:
            ms = 1e3 * self.motion.T
            rows.append(
                Item(
                    "sample_time",
                    "sample time",
                    None,
                    f"{ms:.4g} ms",
                    Confidence.sure,
                    f"the median spacing of {len(self.t)} stamps over {self.t[-1]:.4g} s",
                )
            )
        return rows

    # --- what is wrong ---------------------------------------------------------------------------------------

    def problems(self, several: bool) -> list[Problem]:
        """Everything that is wrong with this table, in the order of the items."""
        name = self.table.name
        missing = [ours for ours in COLUMNS if self.column(ours) is None]
        found = []
        if missing:
            spoken = ", ".join(f"{SPOKEN[m]} ({m})" for m in missing)
            there = ", ".join(list(self.table.columns)[:20]) or "none"
            example = ",".join(f"{ours}=NAME" for ours in missing)
            found.append(
                Problem(f"no column is known to be {spoken}; the file has {there}.", f"Name it: --columns {example}")
            )
        used = {ours: c for ours in COLUMNS if (c := self.column(ours)) is not None}
        for column in used.values():
            found += _said(
                name, lambda c=column: checks.check_numbers(name, c, self.table.numbers(c), self.table.where)
            )
        finite = {ours: self.numbers[c] for ours, c in used.items() if np.isfinite(self.numbers[c]).all()}
        if "t" in finite:
            found += _said(name, lambda: checks.check_clock(name, self.t, self.table.where))
            found += _said(name, lambda: checks.check_length(name, len(self.t)))
        if self.time.against and self.given.time_unit is None:
            found.append(Problem(self.time.against, f"If so: --time-unit {self.time.alternatives[0]}"))
        elif self.given.time_unit is not None and "t" in finite and len(self.t) > 2 and not self._dates():
            found += self._given_time()
        for axis in ("q1", "q2"):
            found += self._unit_problems(axis)
        if "u" in finite:
            found += _said(name, lambda: checks.check_command(name, finite["u"], "ignore" if several else "error"))
            unit = command_unit(self.table, used["u"], finite["u"], self.policy)[0]
            if unit.against and not (self.given.input_unit and self.given.input_scale):
                scale = "N·m --input-scale K, with the motor's constant K in N·m/A"
                if "A" not in unit.reason:
                    scale = "V --input-scale K, with the volts of one unit"
                found.append(Problem(unit.against, f"Give its unit and the factor: --input-unit {scale}"))
        if {"q1", "q2"} <= set(finite) and self.factors is not None:
            q1, q2 = (finite[q] * f for q, f in zip(("q1", "q2"), self.factors, strict=True))
            found += _said(name, lambda: checks.check_motion(name, q1, q2))
        return [*found, *self.found, *self._zero_problems()]

    def _given_time(self) -> list[Problem]:
        step, p = float(np.median(np.diff(self.t))), self.policy
        if p.shortest_step <= step <= p.longest_step:
            return []
        better = [u for u in self.time.alternatives if u != self.given.time_unit] or [self.time.unit or "s"]
        text = f"--time-unit {self.given.time_unit} gives {step:.3g} s between samples, which no log of a pendulum has."
        return [Problem(text, f"Perhaps --time-unit {better[0]}")]

    def _unit_problems(self, axis: str) -> list[Problem]:
        unit, said = self.units[axis], getattr(self.given, f"unit_{axis}")
        stated = unit.unit if unit.against else None
        if stated is not None and (said is None or said == stated):
            better = unit.against.partition("looks like ")[2].partition(":")[0]
            mend = f"If so: --unit {axis}={better}" + (" --encoder-counts N" if better == "counts" else "")
            return [Problem(unit.against, mend)]
        if (
            said is not None
            and not unit.against
            and unit.confidence is Confidence.sure
            and unit.unit not in (None, said)
        ):
            text = f"{self.column(axis)} is read in {said}, but looks like {unit.unit}: {unit.reason}."
            return [Problem(text, f"If so: --unit {axis}={unit.unit}")]
        return []

    def _zero_problems(self) -> list[Problem]:
        stated = self.given.pendulum_zero or self._stated_zero()
        arm, pendulum = self.column("q1"), self.column("q2")
        if self.factors is None or arm is None or pendulum is None:
            return []
        if self.signs.gravity == 0:
            degrees = self.motion.zero(arm, pendulum, self.factors)
            off = None if degrees is None else min(abs(degrees), 180 - abs(degrees))
            if degrees is not None and off is not None and off > self.policy.zero:
                text = f"{pendulum} is upright at about {degrees:.0f}°, so its zero is neither upright nor hanging."
                return [
                    Problem(
                        text, f"Subtract {degrees:.0f}° (or that plus 180°) from the column and read the file again."
                    )
                ]
            return []
        zero, flips = self.signs.mended("upright", ())
        said_flips = self.given.flip
        wrong = []
        if stated is not None and stated != zero:
            source = "you say" if self.given.pendulum_zero else "the file says"
            wrong.append(f"{source} that {pendulum} is 0 {stated}, but the pendulum falls as if it were 0 {zero}")
        if said_flips is not None and (set(said_flips) ^ set(flips)) and not _mirrored(said_flips, flips, self.signs):
            shown = ",".join(said_flips) or "nothing"
            wrong.append(f"with the sign of {shown} turned, the arm and the pendulum do not move as one rig's do")
        if not wrong:
            return []
        mend = f"--pendulum-zero {zero}" + (f" --flip {','.join(flips)}" if flips else " and no --flip")
        return [Problem("; ".join(wrong) + ".", f"Unless you know better, read it with {mend}")]


def _mirrored(said: Sequence[str], wanted: Sequence[str], signs: Signs) -> bool:
    """Whether two sets of flips differ by what the motion cannot tell: all three signs, or the command's."""
    differ = set(said) ^ set(wanted)
    unknown = ({"u"} if not signs.command else set()) | ({"q2"} if not signs.coupling else set())
    return differ - unknown == set() or ({"q1", "q2", "u"} - differ) <= unknown


def _usual(counts: float, policy: ProposalPolicy) -> int | None:
    near = min(USUAL_COUNTS, key=lambda usual: abs(counts / usual - 1))
    return near if abs(counts / near - 1) < policy.same_counts else None


def _together(looks: Sequence[_Look]) -> Signs:
    """The signs that the logs show, each from the first log that tells it."""
    first = lambda name: next((s for look in looks if (s := getattr(look.signs, name))), 0)  # noqa: E731
    return Signs(first("gravity"), first("coupling"), first("command"))


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


def _same_columns(first: _Look, looks: Sequence[_Look]) -> list[Problem]:
    found = []
    for look in looks:
        lacking = [c for ours in COLUMNS if (c := first.column(ours)) is not None and c not in look.table.columns]
        if lacking:
            text = f"{look.table.name} has no column {', '.join(lacking)}, which {first.table.name} has."
            found.append(Problem(text, "Give logs that are written alike, or one at a time."))
    return found


def _same_rig(looks: Sequence[_Look], policy: ProposalPolicy) -> list[Problem]:
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
            return [
                Problem(text, f"Give them one at a time, each with its own rig.toml ({shlex.quote('--rig')} FILE).")
            ]
    return []
