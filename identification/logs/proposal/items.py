"""What is proposed for a look at a table, item by item."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..encoders import encoder_step, usual_counts
from ..said import COLUMNS, of_file, parse_unit
from ..signs import Signs
from .columns import SPOKEN
from .look import Look
from .units import Unit, command_unit
from .values import Confidence, Item

_AS_YOU_SAY = "as you say"


def items_of(look: Look, others: Sequence[Look]) -> list[Item]:
    signs = _together([look, *others])
    return [*_column_items(look), *_unit_items(look), *_motion_items(look, signs), *_facts(look)]


def _column_items(look: Look) -> list[Item]:
    rows = []
    for ours in COLUMNS:
        choice = look.choices[ours]
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


def _unit_items(look: Look) -> list[Item]:
    def item(name: str, says: str, unit: Unit, option: str) -> Item:
        if (said := getattr(look.given, name)) is not None:
            return Item(name, says, said, said, Confidence.sure, _AS_YOU_SAY, (), option)
        value = None if name == "time_unit" and (look.dates or unit.unit == "s") else unit.unit
        return Item(name, says, value, unit.unit or "?", unit.confidence, unit.reason, unit.alternatives, option)

    rows = [item("time_unit", "time in", look.time, "--time-unit")]
    for axis in ("q1", "q2"):
        rows.append(item(f"unit_{axis}", f"{SPOKEN[axis]} in", look.units[axis], f"--unit {axis}=…"))
    if "counts" in (look.unit("q1"), look.unit("q2")) and look.known_counts is None:
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
    column, u = look.column("u"), look.values("u")
    if column is None or u is None:
        return rows
    unit, scale = command_unit(look.table, column, u, look.policy)
    row = item("input_unit", "command in", unit, "--input-unit")
    if row.value is None and "input_unit" in look.table.metadata:
        with of_file(look.table.name):
            stated = parse_unit(look.table.metadata["input_unit"])
        row = Item("input_unit", row.says, stated, stated, row.confidence, "the file says so", (), row.option)
    rows.append(row)
    scale = look.given.input_scale or scale
    if scale is not None and (scale != 1.0 or look.given.input_scale):
        reason = _AS_YOU_SAY if look.given.input_scale else unit.reason
        rows.append(
            Item("input_scale", "command times", scale, f"{scale:g}", Confidence.sure, reason, (), "--input-scale")
        )
    return rows


def _motion_items(look: Look, signs: Signs) -> list[Item]:
    zero, flips = signs.mended("upright", ())
    stated = look.stated_zero
    rows = []
    if look.given.pendulum_zero is not None:
        rows.append(_zero_item(look, look.given.pendulum_zero, Confidence.sure, _AS_YOU_SAY))
    elif signs.gravity:
        falls = "away from 0" if signs.gravity > 0 else "towards 0"
        rows.append(_zero_item(look, zero, Confidence.sure, f"the pendulum falls {falls}"))
    elif stated is not None:
        rows.append(_zero_item(look, stated, Confidence.sure, "the file says so"))
    else:
        rows.append(_unseen(look, _zero_item(look, _usual_zero(look), Confidence.open, "")))
    known_zero = look.given.pendulum_zero or (zero if signs.gravity else stated)
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
        said = look.given.flip
        turned = axis in (said if said is not None else flips)
        if said is not None:
            confidence, reason = Confidence.sure, _AS_YOU_SAY
        elif axis == "q1" or clear:
            confidence = Confidence.sure
        else:
            confidence, reason = Confidence.likely, ""
        if turned and confidence is Confidence.sure and said is None:
            reason = reason.replace("which way is positive is yours to choose", "its turning pushes the pendulum")
            reason = f"turned: then {reason}"
        name = {"q1": "sign of the arm", "q2": "sign of the pendulum", "u": "sign of the command"}[axis]
        shown = "turned" if turned else "as it is"
        value, alternatives = "-" if turned else "+", ("none", "q1", "q2", "u")
        row = Item(f"sign_{axis}", name, value, shown, confidence, reason, alternatives, f"--flip {axis}")
        rows.append(row if confidence is Confidence.sure else _unseen(look, row))
    return rows


def _unseen(look: Look, item: Item) -> Item:
    """A zero or a sign that the motion does not say, with the reason."""
    no_counts = look.factors is None and "counts" in (look.unit("q1"), look.unit("q2"))
    no_clock = look.time.unit is None and look.column("t") is not None and look.said("time_unit") is None
    if no_counts or no_clock:
        return replace(item, reason="the motion may tell it once the units are known", waits=True)
    return replace(item, reason="the motion does not tell it")


def _zero_item(look: Look, zero: str, confidence: Confidence, reason: str) -> Item:
    return Item(
        "pendulum_zero",
        "pendulum's zero",
        zero,
        zero,
        confidence,
        reason,
        ("upright", "hanging"),
        "--pendulum-zero",
    )


def _usual_zero(look: Look) -> str:
    q2 = look.values("q2")
    turned = 0.0 if q2 is None or not len(q2) or look.factors is None else abs(q2[0] * look.factors[1]) % (2 * np.pi)
    return "hanging" if abs(turned - np.pi) < 0.5 else "upright"


def _facts(look: Look) -> list[Item]:
    rows = []
    if look.factors is not None and look.known_counts is None:
        angles = [(look.values(q), f) for q, f in zip(("q1", "q2"), look.factors, strict=True)]
        steps = [None if v is None else encoder_step(v * f) for v, f in angles]
        counts = [usual_counts(2 * np.pi / s) if s else None for s in steps]
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
    elif look.given.encoder_counts:
        shown = ", ".join(f"{c:g}" for c in dict.fromkeys(look.given.encoder_counts))
        rows.append(
            Item(
                "encoder_counts",
                "counts per revolution",
                look.given.encoder_counts,
                shown,
                Confidence.sure,
                _AS_YOU_SAY,
                (),
                "--encoder-counts",
            )
        )
    if look.motion.T:
        ms = 1e3 * look.motion.T
        rows.append(
            Item(
                "sample_time",
                "sample time",
                None,
                f"{ms:.4g} ms",
                Confidence.sure,
                f"the median spacing of {len(look.t)} stamps over {look.t[-1]:.4g} s",
            )
        )
    return rows


def _together(looks: Sequence[Look]) -> Signs:
    """The signs that the logs show, each from the first log that tells it."""
    first = lambda name: next((s for look in looks if (s := getattr(look.signs, name))), 0)  # noqa: E731
    return Signs(first("gravity"), first("coupling"), first("command"))
