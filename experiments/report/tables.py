"""The report's tables, as rows of strings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import EFFECTS
from furuta_gym.plant.effects.words import number
from furuta_gym.plant.parameters import THETA_MEANING
from identification.diagnosis.gap_change import AXES, GapChange, Part, rms_interval
from identification.diagnosis.locate.location import Where
from identification.diagnosis.outcome import SecondWitness
from identification.diagnosis.policy import DecisionPolicy
from identification.estimation.estimate import Estimate, unit_of
from identification.estimation.known import value_of
from identification.logs.log import Log
from identification.validation.gap import HORIZON, Gap, printed_fits

from .by_part import OneLog
from .contents import Table

# What a right model left on simulated logs lies well below these; each is a hint, and the likelihood decides
_R2, _FISHER, _P = 0.15, 0.2, 1e-3


def parameters(before: Estimate, after: Estimate, leftover: bool) -> Table:
    """Every parameter with its standard deviation, before and after, and what it stands for."""
    names = list(dict.fromkeys((*before.names, *before.fixed, *after.names, *after.fixed)))
    changed = after is not before
    rows = []
    for name in names:
        cells = [_value(before, name)] + ([_value(after, name), _shift(before, after, name)] if changed else [])
        rows.append((name.replace("theta", "θ"), _meaning(name), *cells, unit_of(name, after.plant)))
    columns = ("before", "after", "change") if changed else ("value",)
    return Table(
        ("parameter", "meaning", *columns, "unit"),
        rows,
        "Values ± one standard deviation. It allows for what the model lacks, as far as the log shows it."
        + (" Where much is lacking, as in the column before, it may be too small." if changed else "")
        + (" Unexplained structure remains, so the last column may be too small as well." if leftover else ""),
    )


def _value(estimate: Estimate, name: str) -> str:
    if name in estimate.fixed:
        return f"{estimate.fixed[name]:.5g} (fixed)"
    if name not in estimate.names:
        return "—"
    remark = " (at its bound)" if name in estimate.at_bound else ""
    if name in estimate.identifiability.unidentified:
        remark += " (not identified)"
    elif name in estimate.identifiability.weak:
        remark += " (weak)"
    return estimate.shown(name).replace(" ", "\u00a0") + remark


def _shift(before: Estimate, after: Estimate, name: str) -> str:
    if name not in before.names or name not in after.names or not before.value(name):
        return "new" if name not in (*before.names, *before.fixed) else ""
    if name in before.identifiability.unidentified:
        return ""
    percent = 100 * (after.value(name) - before.value(name)) / abs(before.value(name))
    digits = f"{percent:+.0f}" if abs(percent) >= 10 else f"{percent:+.2g}" if abs(percent) >= 0.01 else "0"
    return digits.replace("-", "−") + "\u00a0%"


def second_fit(first: Estimate, second: SecondWitness) -> Table:
    """Every parameter that the search fitted, beside its value by multiple shooting."""
    rows = []
    for name in first.names:
        found = f"{value_of(second.plant, name):.4g}" + (" ●" if name in second.disagreeing else "")
        rows.append(
            (name.replace("theta", "θ"), _meaning(name), _value(first, name), found, unit_of(name, first.plant))
        )
    note = "By multiple shooting; ● marks where both fits disagree beyond their errors."
    return Table(("parameter", "meaning", "first fit", "second fit", "unit"), rows, note)


def _meaning(name: str) -> str:
    effect, _, parameter = name.partition(".")
    if parameter:
        return next(p.meaning for p in EFFECTS[effect].parameters if p.name == parameter)
    return THETA_MEANING[name][0] if name in THETA_MEANING else "sharpness of Coulomb friction"


def gaps(change: GapChange) -> Table:
    """Rms errors at the horizon, in mrad and counts, with intervals, over the floor they share."""
    rows = []
    for axis, name in enumerate(AXES):
        rows += [_error_row(f"{name}, {side}", gap, axis, change.floor[axis]) for side, gap in change.sides]
        rows.append(_floor_row(name, change.before, axis, change.floor))
    return Table(_ERRORS, rows, _windows(change.before))


def parts(found: Sequence[Part], what: str) -> Table:
    """The error over the floor of each log, or of each kind of experiment."""
    rows = []
    for part in found:
        before, after = (f"{ratio:.3g}" for ratio in part.over_floor)
        rows.append((part.name, before, after, f"{part.closed}" + (" grows" if part.grows else "")))
    head = (what, "times the noise floor, before", "after", "closed share")
    return Table(head, rows, f"The same by {what}.")


def by_log(found: Sequence[OneLog]) -> Table:
    """The error of one plant on each log."""
    rows = [
        (one.name, one.kind, *(("too short", "", "") if one.rms is None else _three(one.rms, one.ratio or 0.0)))
        for one in found
    ]
    return Table(("log", "kind of experiment", *_PART), rows, "Over the noise floor of all logs of its kind.")


def by_kind(found: Mapping[str, Gap]) -> Table:
    """The error of one plant on each kind of experiment."""
    rows = [(kind, *_three(gap.rms, gap.ratio_to_floor)) for kind, gap in found.items()]
    return Table(("kind of experiment", *_PART), rows, "Each over a noise floor of its own.")


_PART = ("rms q1 [mrad]", "rms q2 [mrad]", "times the noise floor")


def _three(rms: NDArray[np.float64], ratio: float) -> tuple[str, str, str]:
    return f"{1e3 * rms[0]:.3g}", f"{1e3 * rms[1]:.3g}", f"{ratio:.3g}"


def gap(found: Gap) -> Table:
    """The same of one plant, with its fit."""
    rows = []
    for axis, name in enumerate(AXES):
        rows.append(_error_row(name, found, axis, found.floor[axis]))
        rows.append(_floor_row(name, found, axis, found.floor))
    return Table(_ERRORS, rows, _windows(found))


_ERRORS = ("error", "rms [mrad] (95 %)", "encoder counts", "times the noise floor", "fit")


def _error_row(name: str, found: Gap, axis: int, floor: float) -> tuple[str, ...]:
    rms = found.rms[axis]
    text, interval = f"{1e3 * rms:.3g}", rms_interval(found)
    if interval is not None:
        low, high = 1e3 * interval[axis]
        text += f" ({low:.3g} … {high:.3g})"
    return (
        name,
        text,
        _counts(rms, found.counts[axis]),
        f"{rms / floor:.3g}",
        f"{found.fits[axis]} %".replace("-", "−"),
    )


def _floor_row(name: str, found: Gap, axis: int, floor: NDArray[np.float64]) -> tuple[str, ...]:
    fit = printed_fits(found.fit_at(floor))[axis].replace("-", "−")
    return (
        f"{name}, noise floor",
        f"{1e3 * floor[axis]:.3g}",
        _counts(floor[axis], found.counts[axis]),
        "1",
        f"{fit} %",
    )


def _windows(found: Gap) -> str:
    return f"Prediction {found.horizon:g} s ahead, {len(found.errors)} windows."


def innovation_tests(found: Gap) -> Table:
    """Tests that one-step errors are noise, of every stretch."""
    rows = []
    for i, test in enumerate(found.tests):
        for axis, name in enumerate(AXES):
            own, command = np.abs(test.correlation[:, axis]).max(), np.abs(test.command_correlation[:, axis]).max()
            which = f"{name}, stretch {i + 1}" if len(found.tests) > 1 else name
            band = f"± {test.band:.3f}"
            rows.append((which, f"{own:.3f}", _p(test.p_white[axis]), f"{command:.3f}", _p(test.p_command[axis]), band))
    head = ("innovations of", "with their past", "p", "with past commands", "p", "band")
    return Table(
        head,
        rows,
        "Largest correlations of errors of predicting the next reading. ● marks what noise would hardly give; rounding "
        "alone can take a correlation a little beyond the band.",
    )


def _counts(angle: float, count: float) -> str:
    return number(angle / count, 2) if count > 0 else "unknown"


def leftovers(where: Where, after: Where | None, policy: DecisionPolicy) -> Table:
    """Tests of what is left, each with what would speak against the model."""
    both, left = [where] if after is None else [where, after], policy.left
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
            f"Nyblom–Hansen, p of all, and what that changes of predictions {HORIZON:g} s ahead; below "
            f"{policy.constant:g} and from {policy.negligible:g} counts on: they move",
            [_drift(w) for w in both],
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
        "●: this does not look like noise. —: the torque is no larger than its uncertainty, so it is not tested. "
        "Rounding alone lifts correlations a little above the 95 % band: compare before and after.",
    )


def _number(x: float, limit: float) -> str:
    return f"{x:.1f}".replace("-", "−") + _mark(x > limit)


def _of_torque(where: Where, values: np.ndarray, limit: float) -> str:
    """Values of both rows; a dash where the smoothed torque is nowhere larger than its uncertainty."""
    torque = max(where.torques, key=lambda torque: len(torque.t))
    stands_out = np.mean(torque.mean**2, axis=0) > np.mean(torque.std**2, axis=0)
    return ", ".join(
        f"{v:.2f}{_mark(v > limit)}" if shown else "—" for v, shown in zip(values, stands_out, strict=True)
    )


def _p(p: float) -> str:
    return _probability(p) + _mark(p < _P)


def _drift(where: Where) -> str:
    p = _probability(where.constancy.joint_p)
    return f"{p}, {where.drift_counts.max():.2g} counts{_mark(where.changing)}"


def _probability(p: float) -> str:
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}"


def _mark(structure: bool) -> str:
    return " ●" if structure else ""


def _correlation(where: Where, name: str) -> str:
    largest = [np.abs(getattr(test, name)).max(axis=0) for test in where.innovations]
    size, limit = np.max(largest, axis=0), max(test.band for test in where.innovations)
    return ", ".join(f"{x:.3f}" for x in size) + f" (band\u00a0±\u00a0{limit:.3f})"


def suspicions(where: Where) -> Table:
    """What the missing torque goes with, the likeliest first."""
    rows = [(s.channel, s.variable, f"{100 * s.share:.0f} %") for s in where.suspicions[:5] if math.isfinite(s.net)]
    return Table(
        ("row or path", "against", "of all that any function explains"),
        rows,
        "What a free function of each variable would explain of the model's errors.",
    )


def logs(fitted: Sequence[Log], held_out: Sequence[Log] = (), use: str = "searched") -> Table:
    """The logs behind a page."""
    rows = []
    for what, group in ((use, fitted), ("held out", held_out)):
        for log in group:
            counts = "unknown" if log.encoder_counts is None else " and ".join(f"{c:g}" for c in log.encoder_counts)
            sampled = f"{1e3 * log.sample_time:.4g} ms"
            digest = log.sha256[:12] if log.sha256 else "—"
            rows.append((log.source, what, f"{log.duration:.4g} s", sampled, counts, digest))
    return Table(("log", "use", "lasts", "sampled every", "counts per turn", "SHA-256"), rows, "Digests are cut short.")
