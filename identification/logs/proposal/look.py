"""`Look`: what one table shows, each answer from those before it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .. import checks
from ..gaps import evened
from ..rig_mapping import RigMapping
from ..said import ANGLE_UNITS, COLUMNS, RADIANS, SECONDS, parse_counts, parse_zero, seconds_of
from ..signs import Signs
from ..table import Table
from .columns import Choice, angle_candidates, named, numeric
from .motion import Motion, Pair
from .policy import ProposalPolicy
from .same_gain import Driven
from .units import Unit, angle_units, any_unit, time_unit
from .values import Confidence, Problem


class Look:
    """One table, looked at in the order in which one answer needs the other: columns, clock, units, zero, signs.

    given: what the user says. assumed: what nobody says is as `read_log` takes it, and is held against the data."""

    def __init__(self, table: Table, given: RigMapping, policy: ProposalPolicy, assumed: bool = False):
        self.table, self.given, self.policy, self.assumed = table, given, policy, assumed
        self.numbers = numeric(table)
        dated = [name for name, values in table.columns.items() if values.dtype.kind in "Mm"]
        own = {ours: ours for ours in COLUMNS if assumed and ours in self.numbers}
        self.choices = named(self.numbers, own | given.columns, dated)
        self.found: list[Problem] = []
        self.time = self._time()
        self.factor = seconds_of(self.time.believed(self.said("time_unit")) or "s")
        if self.dates:
            self.factor = 1.0
        time = self.choices["t"].column
        stamps = self.numbers[time] if time else np.arange(0.0)
        self.t = evened((stamps - stamps[0]) * self.factor) if len(stamps) else stamps
        self.known_counts = self._known_counts()
        self.motion = Motion(self.t, {c: v for c, v in self.numbers.items() if c != time}, policy, self.known_counts)
        self._columns_by_motion()
        self.units = self._units()
        self.factors = self._factors()
        self.signs = self._signs()

    def column(self, ours: str) -> str | None:
        return self.choices[ours].column

    def values(self, ours: str) -> np.ndarray | None:
        column = self.column(ours)
        return None if column is None else self.numbers[column]

    @property
    def driven(self) -> bool:
        u = self.values("u")
        return u is not None and bool(np.isfinite(u).any()) and bool(np.nanmax(u) > np.nanmin(u))

    @property
    def driven_arm(self) -> Driven | None:
        """How the command drives the arm; None where it cannot be seen."""
        arm, pendulum, command = map(self.column, ("q1", "q2", "u"))
        if self.factors is None or arm is None or pendulum is None or command is None:
            return None
        return self.motion.driven(arm, pendulum, command, self.factors)

    @property
    def dates(self) -> bool:
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
                for ours in changed.keys() - said.keys():
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

    def said(self, name: str) -> str | None:
        """What is said of a unit or the zero: by the user, or else what is taken where nobody says anything."""
        if (value := getattr(self.given, name)) is not None or not self.assumed:
            return value
        angle = str(self.table.metadata.get("angle_unit", "rad")).strip()
        return {"time_unit": "s", "unit_q1": angle, "unit_q2": angle, "pendulum_zero": self.stated_zero or "upright"}[
            name
        ]

    def unit(self, axis: str) -> str | None:
        """The unit of an angle, as far as the data can be believed."""
        return self.units[axis].believed(self.said(f"unit_{axis}"))

    @property
    def stated_zero(self) -> str | None:
        """The zero that the file states."""
        try:
            return parse_zero(self.table.metadata["pendulum_zero"])
        except (KeyError, checks.LogError):
            return None

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
