"""The report's tables, as rows of strings."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from furuta_gym.plant.parameters import THETA_MEANING
from identification.diagnosis.gap_change import AXES, GapChange, rms_interval
from identification.diagnosis.locate.location import Where
from identification.estimation.estimate import Estimate, rounded, unit_of
from identification.logs.log import Log

# What a right model left on simulated logs lies well below these; each is a hint, and the likelihood decides
_R2, _FISHER, _P = 0.15, 0.2, 1e-3


@dataclass(frozen=True)
class Table:
    """Head and rows of text; the first column names the row."""

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    caption: str


def parameters(before: Estimate, after: Estimate, leftover: bool) -> Table:
    """Every parameter with its standard deviation, before and after, and what it stands for."""
    names = list(dict.fromkeys((*before.names, *before.fixed, *after.names, *after.fixed)))
    changed = after is not before
    rows = []
    for name in names:
        effect, _, parameter = name.partition(".")
        meaning = THETA_MEANING[name][0] if name in THETA_MEANING else (f"{parameter} of {effect}" if parameter else "")
        meaning = meaning or "sharpness of Coulomb friction"
        cells = [_value(before, name)] + ([_value(after, name), _shift(before, after, name)] if changed else [])
        rows.append((name.replace("theta", "θ"), meaning, *cells, unit_of(name, after.plant)))
    columns = ("before", "after", "change") if changed else ("value",)
    return Table(
        ("parameter", "meaning", *columns, "unit"),
        rows,
        "Values ± one standard deviation. The deviations assume that the model is right; before an effect is added "
        "they are too small" + (", and as something is left over here, afterwards as well." if leftover else "."),
    )


def _value(estimate: Estimate, name: str) -> str:
    if name in estimate.fixed:
        return f"{estimate.fixed[name]:.5g} (fixed)"
    if name not in estimate.names:
        return "—"
    remark = " (at its bound)" if name in estimate.at_bound else ""
    if name in (*estimate.identifiability.unidentified, *estimate.identifiability.weak):
        remark += " (weak)"
    i = estimate.names.index(name)
    return rounded(float(estimate.values[i]), float(estimate.std[i])).replace(" ", "\u00a0") + remark


def _shift(before: Estimate, after: Estimate, name: str) -> str:
    if name not in before.names or name not in after.names or not before.value(name):
        return "new" if name not in (*before.names, *before.fixed) else ""
    percent = 100 * (after.value(name) - before.value(name)) / abs(before.value(name))
    digits = f"{percent:+.0f}" if abs(percent) >= 10 else f"{percent:+.2g}" if abs(percent) >= 0.01 else "0"
    return digits + "\u00a0%"


def gaps(change: GapChange) -> Table:
    """Rms errors at the horizon, in mrad and counts, with intervals, over the floor."""
    rows = []
    for axis, name in enumerate(AXES):
        count = change.before.counts[axis]
        for side, gap in change.sides:
            low, high = 1e3 * rms_interval(gap)[axis]
            rows.append(
                (
                    f"{name}, {side}",
                    f"{1e3 * gap.rms[axis]:.3g} ({low:.3g} … {high:.3g})",
                    _counts(gap.rms[axis], count),
                    f"{gap.rms[axis] / change.floor[axis]:.3g}",
                )
            )
        rows.append(
            (f"{name}, noise floor", f"{1e3 * change.floor[axis]:.3g}", _counts(change.floor[axis], count), "1")
        )
    return Table(
        ("error", "rms [mrad] (95 %)", "encoder counts", "times the floor"),
        rows,
        f"Prediction {change.before.horizon:g} s ahead, {len(change.before.errors)} windows.",
    )


def _counts(angle: float, count: float) -> str:
    return f"{angle / count:.2g}" if count > 0 else "unknown"


def leftovers(where: Where, after: Where | None, left: float) -> Table:
    """Tests of what is left, each with what would speak against the model."""
    both = [where] if after is None else [where, after]
    tests = (
        (
            "evidence for any missing torque",
            f"nats, of the best of many families; above {left:g}: something is left",
            [_number(w.evidence, left) for w in both],
        ),
        (
            "missing torque predictable from the motion",
            f"cross-validated R², arm and pendulum; above {_R2:g}: structure",
            [_of_torque(w, w.predictable, _R2) for w in both],
        ),
        (
            "one frequency in it",
            f"Fisher's g, arm and pendulum; above {_FISHER:g}: a line",
            [_of_torque(w, w.line, _FISHER) for w in both],
        ),
        (
            "parameters constant in time",
            f"Nyblom–Hansen, p of all; below {_P:g}: they move",
            [_p(w.constancy.joint_p) for w in both],
        ),
        (
            "innovations white",
            "largest correlation with their past, q1 and q2",
            [_correlation(w, "correlation") for w in both],
        ),
        (
            "innovations free of past commands",
            "largest correlation with the command's changes, q1 and q2",
            [_correlation(w, "command_correlation") for w in both],
        ),
    )
    head = ("before", "after") if after is not None else ("result",)
    return Table(
        ("test", "how to read it", *head),
        [(name, how, *cells) for name, how, cells in tests],
        "Tests of the remainder; ● marks what does not look like noise, — a torque no larger than its uncertainty. "
        "Rounding alone makes innovations correlate a little beyond the 95 % band: compare before and after.",
    )


def _number(x: float, limit: float) -> str:
    return f"{x:.1f}" + _mark(x > limit)


def _of_torque(where: Where, values: np.ndarray, limit: float) -> str:
    """Values of both rows; a dash where the smoothed torque is nowhere larger than its uncertainty."""
    torque = max(where.torques, key=lambda torque: len(torque.t))
    stands_out = np.mean(torque.mean**2, axis=0) > np.mean(torque.std**2, axis=0)
    return ", ".join(
        f"{v:.2f}{_mark(v > limit)}" if shown else "—" for v, shown in zip(values, stands_out, strict=True)
    )


def _p(p: float) -> str:
    return ("< 0.0001" if p < 1e-4 else f"{p:.2g}") + _mark(p < _P)


def _mark(structure: bool) -> str:
    return " ●" if structure else ""


def _correlation(where: Where, name: str) -> str:
    largest = [np.abs(getattr(test, name)).max(axis=0) for test in where.innovations]
    size, limit = np.max(largest, axis=0), max(test.band for test in where.innovations)
    return ", ".join(f"{x:.3f}" for x in size) + f" (band\u00a0±\u00a0{limit:.3f})"


def suspicions(where: Where) -> Table:
    """What the missing torque goes with, the likeliest first."""
    rows = [
        (s.channel, s.variable, f"{s.net:+.0f}", f"{100 * s.share:.0f} %")
        for s in where.suspicions[:5]
        if math.isfinite(s.net)
    ]
    return Table(
        ("row or path", "against", "nats, net", "of all that any function explains"),
        rows,
        "What a free function of each variable would explain of the model's errors, the noise held at the log's own. "
        "The evidence above estimates the noise anew with and without it.",
    )


def logs(fitted: tuple[Log, ...], held_out: tuple[Log, ...]) -> Table:
    """The logs behind the report."""
    rows = []
    for use, group in (("searched", fitted), ("held out", held_out)):
        for log in group:
            counts = "unknown" if log.encoder_counts is None else " and ".join(f"{c:g}" for c in log.encoder_counts)
            rows.append(
                (log.source, use, f"{log.duration:.4g} s", f"{1e3 * log.sample_time:.4g} ms", counts, log.sha256[:12])
                if log.sha256
                else (log.source, use, f"{log.duration:.4g} s", f"{1e3 * log.sample_time:.4g} ms", counts, "—")
            )
    return Table(("log", "use", "lasts", "sampled every", "counts per turn", "SHA-256"), rows, "The logs.")
