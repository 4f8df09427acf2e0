"""What the motion of a table says: which columns can be arm and pendulum, in which units, where the zero is."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..encoders import USUAL_COUNTS
from ..said import RADIANS
from ..signs import (
    Row,
    Signs,
    Smoothed,
    arm_row,
    evenly,
    longest_piece,
    motion_signs,
    pendulum_row,
    smoothed,
    smoothed_command,
)
from ..turns import continuous
from .policy import ProposalPolicy
from .same_gain import Driven


@dataclass(frozen=True)
class Pair:
    """Two columns read as arm and pendulum, in these units, and the pendulum's row that follows."""

    arm: str
    pendulum: str
    units: tuple[str, str]
    row: Row

    @property
    def unexplained(self) -> float:
        return 1.0 - self.row.r2


class Motion:
    """Columns of a table over its liveliest stretch without a gap, t in s. `short` if there is none.

    counts: of the encoders of arm and pendulum, a turn, if known. Columns of whole numbers are read in counts alone."""

    def __init__(
        self,
        t: np.ndarray,
        columns: Mapping[str, np.ndarray],
        policy: ProposalPolicy,
        counts: tuple[float, float] | None = None,
    ):
        self.policy = policy
        self.counts = counts
        steps = np.diff(t)
        usable = len(t) > 10 and np.isfinite(t).all() and bool((steps > 0).all())
        piece, self.window = longest_piece(t) if usable else (np.arange(0), 0)
        self.short = not self.window
        finite = {name: c for name, c in columns.items() if np.isfinite(c).all()}
        self.piece = _liveliest(piece, finite, policy.samples)
        self.T = float(np.median(steps)) if usable else 0.0
        self.t = t[self.piece]
        self.raw = {name: c[self.piece] for name, c in finite.items()}
        self._smooth: dict[str, Smoothed] = {}

    def angle(self, name: str) -> np.ndarray:
        """A column as it stands, but for the jumps of a wrapped angle."""
        return continuous(self.raw[name], (*(self.counts or ()), *USUAL_COUNTS))

    def smooth(self, name: str) -> Smoothed:
        """A column as it stands, smoothed."""
        if name not in self._smooth:
            self._smooth[name] = smoothed(evenly(self.t, self.angle(name), self.T), self.T, self.window)
        return self._smooth[name]

    def pair(self, arm: str, pendulum: str, units: tuple[str, str], factors: Sequence[float]) -> Pair:
        """The pendulum's row with these columns; factors: rad per unit of each."""
        row = pendulum_row(self.smooth(arm).scaled(factors[0]), self.smooth(pendulum).scaled(factors[1]))
        return Pair(arm, pendulum, units, row)

    def readings(self, arm: str, pendulum: str) -> Iterator[Pair]:
        """The pair in every combination of units that its columns can have."""
        for (one, first), (other, second) in itertools.product(self._factors(arm, 0), self._factors(pendulum, 1)):
            yield self.pair(arm, pendulum, (one, other), (first, second))

    def _factors(self, name: str, axis: int) -> list[tuple[str, float]]:
        """Units of a column that is taken for the arm (axis 0) or the pendulum (1), with rad per unit."""
        if not np.array_equal(self.raw[name], np.round(self.raw[name])):
            return list(RADIANS.items())
        return [("counts", 2.0 * np.pi / self.counts[axis])] if self.counts else []

    def speaks(self, pair: Pair) -> bool:
        """Whether a row explains the pendulum, with numbers that a pendulum has."""
        p, (gravity, coupling) = self.policy, pair.row.coefficients
        return (
            pair.row.r2 >= p.r2
            and p.gravity[0] <= abs(gravity) <= p.gravity[1]
            and p.coupling[0] <= abs(coupling) <= p.coupling[1]
        )

    def best(self, names: Sequence[str]) -> Pair | None:
        """The pair among these columns that explains its pendulum best, if one does."""
        names = [n for n in names if n in self.raw and np.ptp(self.raw[n]) > 0]
        if self.short:
            return None
        found = [r for a, b in itertools.permutations(names, 2) for r in self.readings(a, b) if self.speaks(r)]
        return min(found, key=lambda pair: pair.unexplained, default=None)

    def command_r2(self, arm: str, pendulum: str, command: str, factors: Sequence[float]) -> float:
        """How much of a command the arm's motion explains."""
        if self.short or command not in self.raw or np.ptp(self.raw[command]) == 0:
            return 0.0
        u = smoothed_command(evenly(self.t, self.raw[command], self.T), self.window)
        row = arm_row(self.smooth(arm).scaled(factors[0]), self.smooth(pendulum).scaled(factors[1]), u)
        return row.r2

    def driven(self, arm: str, pendulum: str, command: str, factors: Sequence[float]) -> Driven | None:
        """How the command drives the arm; factors: rad per unit of both angles. None where this cannot be seen."""
        if self.short or not {arm, pendulum, command} <= set(self.raw) or np.ptp(self.raw[command]) == 0:
            return None
        u = smoothed_command(evenly(self.t, self.raw[command], self.T), self.window)
        return Driven.of(self.smooth(arm).scaled(factors[0]), self.smooth(pendulum).scaled(factors[1]), u)

    def signs(self, arm: str, pendulum: str, command: str | None, factors: Sequence[float]) -> Signs:
        """Zero and signs, read in rad as upright and not flipped."""
        if self.short or arm not in self.raw or pendulum not in self.raw:
            return Signs(0, 0, 0)
        u = self.raw[command] if command in self.raw else np.zeros(len(self.t))
        return motion_signs(self.t, factors[0] * self.angle(arm), factors[1] * self.angle(pendulum), u)

    def zero(self, arm: str, pendulum: str, factors: Sequence[float]) -> float | None:
        """Where upright lies on the pendulum's column [degrees], in steps of 10; None where the motion does not say."""
        if self.short or arm not in self.raw or pendulum not in self.raw:
            return None
        a, p = self.smooth(arm).scaled(factors[0]), self.smooth(pendulum).scaled(factors[1])
        if np.ptp(p.q) < 0.5:  # near one point every zero fits
            return None
        rows = [(pendulum_row(a, p.scaled(1.0, np.radians(d))), d) for d in range(-170, 181, 10)]
        rows = [(row, d) for row, d in rows if row.coefficients[0] > 0]
        row, degrees = max(rows, key=lambda found: found[0].r2, default=(None, 0))
        return float(degrees) if row is not None and row.r2 >= self.policy.r2 else None


def _liveliest(piece: np.ndarray, columns: Mapping[str, np.ndarray], samples: int) -> np.ndarray:
    """At most `samples` of a stretch, in one block, where its columns change most."""
    if len(piece) <= samples:
        return piece
    change = np.zeros(len(piece) - 1)
    for values in columns.values():
        steps = np.abs(np.diff(values[piece].astype(np.float64)))
        if steps.sum() > 0:
            change += steps / steps.sum()
    ends = np.concatenate([[0.0], np.cumsum(change)])
    start = int(np.argmax(ends[samples - 1 :] - ends[: len(ends) - samples + 1]))
    return piece[start : start + samples]
