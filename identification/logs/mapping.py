"""From a file's own columns, units, zeros and signs to the paper's convention, with the border checks."""

from __future__ import annotations

import difflib
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from . import checks as log_checks
from .checks import LogError
from .gaps import evened
from .jumps import warn_about_jumps
from .rig_mapping import RigMapping
from .said import (
    COLUMNS,
    RADIANS,
    SECONDS,
    of_file,
    parse_angle_units,
    parse_counts,
    parse_gain,
    parse_unit,
    parse_zero,
    seconds_of,
)
from .signs import motion_signs
from .table import Table, listed
from .vocabulary import ROLES, core, fits, unit_in
from .wrapping import unwrap

KNOWN_KEYS = ("input_unit", "pendulum_zero", "encoder_counts", "device", "controller_gain", "angle_unit")
"""Metadata that a file may declare about itself; any other key is kept as it is."""

_LOOKED_AT = 500  # columns of a file, when guessing which one is meant
_LONGEST_NAME = 80  # letters of such a column
_TURN = 2 * np.pi
_DATE = 1e7  # s; stamps beyond this count from some date, and lose digits unless they are counted from the first


@dataclass(frozen=True)
class Mapped:
    """What `map_table` found: the four signals, the known facts, and the metadata that is none of these."""

    signals: dict[str, np.ndarray]
    facts: dict[str, Any]
    metadata: dict[str, str]


def map_table(
    table: Table,
    said: RigMapping,
    *,
    device: str | None = None,
    controller_gain: str | Sequence[float] | None = None,
    constant_command: str = "error",
) -> Mapped:
    """Map and check. said: how the table is to be read; the others are arguments of `identification.logs.read_log`."""
    name = table.name
    if constant_command not in ("error", "warn", "ignore"):
        raise LogError(f"{name}: constant_command {constant_command!r}: expected error, warn or ignore")
    factor = seconds_of(said.time_unit or "s")
    gain_of_u = 1.0 if said.input_scale is None else said.input_scale
    names = _find_columns(table, said.columns)
    metadata = _named(table.metadata)
    stored = metadata.get
    units = _angle_units(name, said.angle_units, stored("angle_unit"))
    zero = _prefer(name, "pendulum_zero", said.pendulum_zero, stored("pendulum_zero"), parse_zero) or "upright"
    flips = said.flip or ()
    sign = dict.fromkeys(("q1", "q2", "u"), 1.0) | dict.fromkeys(flips, -1.0)

    raw = {ours: table.numbers(theirs) for ours, theirs in names.items()}
    lengths = {names[ours]: len(values) for ours, values in raw.items()}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{theirs} {n}" for theirs, n in lengths.items())
        raise LogError(f"{name}: columns of different length ({shown}). Expected one value per sample in each.")
    for ours, values in raw.items():
        log_checks.check_numbers(name, names[ours], values, table.where, clock=ours == "t")
    if table.columns[names["t"]].dtype.kind in "Mm":  # `Table.numbers` gives seconds
        factor = 1.0
    first = first_stamp(raw["t"], factor)
    t = (raw["t"] - first) * factor
    log_checks.check_clock(name, t, table.where)
    if (even := evened(t)) is not t:
        off, period = 1e3 * float(np.abs(t - even).max()), 1e3 * float(np.median(np.diff(even)))
        log_checks.warn(
            f"{name}: {names['t']} is rounded, by up to {off:.2g} ms. Without that it is an even clock of {period:.6g} "
            "ms, which is taken. Write the stamps with more digits. If your logger drops samples regularly instead, "
            "mend that: this clock is wrong then."
        )
        t = even
    log_checks.check_length(name, len(t))
    log_checks.check_command(name, raw["u"], constant_command)

    counts = _prefer(name, "encoder_counts", said.encoder_counts, stored("encoder_counts"), parse_counts)
    known: dict[str, float | None] = dict(zip(("q1", "q2"), counts or (None, None), strict=True))
    scale = {q: _radians(name, units[q], known[q]) for q in ("q1", "q2")}
    odd_unit = [
        units[q] != "counts" and log_checks.check_angle_unit(name, names[q], t, raw[q], units[q], known[q])
        for q in known
    ]
    q1, q2 = (raw[q] * scale[q] for q in ("q1", "q2"))
    if not any(odd_unit):
        wrapped = q1
        q1, q2 = unwrap(name, names["q1"], t, q1, known["q1"]), unwrap(name, names["q2"], t, q2, known["q2"])
        if q1 is not wrapped:  # where a wrapped angle begins says nothing of its whole turns
            q1 = q1 - _TURN * np.round(q1[0] / _TURN)
    q1 = sign["q1"] * q1
    q2 = sign["q2"] * (q2 - (np.pi if zero == "hanging" else 0.0))
    if abs(q2[0]) > 0.75 * _TURN:
        q2 = q2 - _TURN * np.round(q2[0] / _TURN)
    u = sign["u"] * gain_of_u * raw["u"]

    facts: dict[str, Any] = {}
    chosen = _prefer(name, "input_unit", said.input_unit, stored("input_unit"), parse_unit)
    facts["input_unit"] = chosen or "V"
    facts["device"] = _prefer(name, "device", device, stored("device"))
    facts["encoder_counts"] = counts
    gain = _prefer(name, "controller_gain", controller_gain, stored("controller_gain"), parse_gain)
    if gain is not None:
        factors = (sign[q] * sign["u"] * gain_of_u / scale[q] for q in ("q1", "q1", "q2", "q2"))
        gain = tuple(k * factor for k, factor in zip(gain, factors, strict=True))
    facts["controller_gain"] = gain
    facts["read_as"] = _read_as(names, units, zero, sign, known, gain_of_u, _seconds(names["t"], factor, first))

    log_checks.warn_about_clock(name, t)
    for silence in dict.fromkeys(table.silent[column] for column in names.values() if column in table.silent):
        log_checks.warn(silence)
    log_checks.warn_about_command(name, names["u"], u)
    log_checks.check_motion(name, q1, q2)
    log_checks.warn_about_held(name, {names["q1"]: q1, names["q2"]: q2})
    if not any(odd_unit):
        warn_about_jumps(name, t, {names[q]: (y, known[q]) for q, y in (("q1", q1), ("q2", q2))})
        if counts is not None:
            log_checks.check_counts(name, names["q1"], q1, counts[0])
            log_checks.check_counts(name, names["q2"], q2, counts[1])
        advice = motion_signs(t, q1, q2, u).advice(zero, flips)
        if advice:
            log_checks.warn(f"{name}: zero or signs look wrong: {advice}")
    rest = {k: v for k, v in metadata.items() if k not in KNOWN_KEYS and k not in COLUMNS}
    return Mapped({"t": t, "q1": q1, "q2": q2, "u": u}, facts, rest)


def own_clock(stamps: np.ndarray, factor: float) -> np.ndarray:
    """Stamps in s, whose unit is `factor` s. Those that count from some date are counted from the first one."""
    return (stamps - first_stamp(stamps, factor)) * factor


def first_stamp(stamps: np.ndarray, factor: float) -> float:
    """The stamp that a log's clock counts from: the first one where stamps count from some date, else 0."""
    return stamps[0] if len(stamps) and abs(stamps[0]) * factor > _DATE else 0.0


def _seconds(column: str, factor: float, first: float) -> str:
    """The column of time as a formula in s."""
    counted = f"{column} - {column}[0]" if first else column
    if factor == 1.0:
        return counted
    return f"({counted})*{factor:g}" if first else f"{counted}*{factor:g}"


def _radians(name: str, unit: str, counts: float | None) -> float:
    """What one unit of an angle is in rad. Raises LogError where counts have no number per revolution."""
    if unit == "counts" and not counts:
        raise LogError(
            f"{name}: angles in counts need the counts per revolution: --encoder-counts 4096 (or two numbers)"
        )
    return (RADIANS | {"counts": _TURN / (counts or 1.0)})[unit]


def _read_as(
    names: Mapping[str, str],
    units: Mapping[str, str],
    zero: str,
    sign: Mapping[str, float],
    counts: Mapping[str, float | None],
    gain_of_u: float = 1.0,
    time: str = "t",
) -> str:
    """What the mapping does to the file's columns, as formulas; "" where it does nothing. time: the formula of t, which
    is left out where it is the file's."""
    said = {} if time == "t" else {"t": time}
    for ours in ("q1", "q2", "u"):
        unit = units.get(ours, "")
        text = names[ours] + {"deg": "*pi/180", "turns": "*2*pi", "counts": f"*2*pi/{counts.get(ours) or 1:g}"}.get(
            unit, ""
        )
        if ours == "u" and gain_of_u != 1.0:
            text = f"{gain_of_u:g}*{text}"
        if ours == "q2" and zero == "hanging":
            text = f"{text} - pi" if sign[ours] > 0 else f"({text} - pi)"
        said[ours] = text if sign[ours] > 0 else f"-{text}"
    return "" if all(ours == text for ours, text in said.items()) else ", ".join(f"{a} = {b}" for a, b in said.items())


def _find_columns(table: Table, wanted: Mapping[str, str]) -> dict[str, str]:
    """The file's name for each of ours. Raises LogError with what is there and a mapping that may be meant."""
    found: dict[str, str] = {}
    missing: list[str] = []
    for ours in COLUMNS:
        theirs = wanted.get(ours, ours)
        inside = [c for c in table.columns if c.endswith(f".{theirs}")]  # a field of a struct in a MAT file
        if theirs in table.columns:
            found[ours] = theirs
        elif len(inside) == 1:
            found[ours] = inside[0]
        else:
            missing.append(ours)
    if missing:
        taken = set(found.values())
        free = [c for c in islice(table.columns, _LOOKED_AT) if c not in taken and len(c) <= _LONGEST_NAME]
        guesses = [f"{ours}={guess}" for ours in missing if (guess := _guess(ours, free))]
        absent = listed([wanted.get(ours, ours) for ours in missing])
        hint = ",".join(guesses) if guesses else ",".join(f"{ours}=..." for ours in missing)
        hint = shlex.quote(hint) if guesses else hint
        meant = {ours: theirs for ours, _, theirs in (guess.partition("=") for guess in guesses)}
        angles = [unit_in(theirs) for ours, theirs in meant.items() if ours in ("q1", "q2")]
        time = unit_in(meant.get("t", ""))
        hint += next((f" --unit {unit}" for unit in RADIANS if unit != "rad" and unit in angles), "")
        hint += f" --time-unit {time}" if time in SECONDS and time != "s" else ""
        raise LogError(
            f"{table.name}: no column {absent}. Found: {listed(list(table.columns)) or 'none'}. Expected t, q1 (arm), "
            f"q2 (pendulum), u; map names that differ, {'perhaps ' if guesses else ''}--columns {hint}"
        )
    used = list(found.values())
    if len(set(used)) < len(used):
        raise LogError(f"{table.name}: one column is mapped to two of t, q1, q2, u. Expected four different ones.")
    return found


def _guess(ours: str, free: Sequence[str]) -> str | None:
    """The column that is most likely meant, with a unit at the end of its name or without; None if none is near."""
    if (best := max(free, key=lambda c: fits(c, ours), default=None)) is not None and fits(best, ours):
        return best
    plain = {core(c): c for c in reversed(free)}
    near = [m for w in ROLES[ours] if len(w) > 2 for m in difflib.get_close_matches(w, plain, n=1, cutoff=0.75)]
    return plain[near[0]] if near else None


def _angle_units(name: str, said: Mapping[str, str], stored: str | None) -> dict[str, str]:
    """Units of q1 and q2: of each what the user says, else what the file says, else rad."""
    with of_file(name):
        held = {} if stored is None else parse_angle_units(stored)
    chosen = {q: _prefer(name, f"the angle unit of {q}", said.get(q), held.get(q)) for q in ("q1", "q2")}
    return {q: unit or "rad" for q, unit in chosen.items()}


def _prefer(name: str, key: str, explicit: Any, stored: str | None, parse: Any = None) -> Any:
    """What the user says, else what the file says; a warning where they differ."""
    with of_file(name):
        said = parse(explicit) if parse and explicit is not None else explicit
        held = parse(stored) if parse and stored is not None else stored
    if said is not None and held is not None and said != held:
        log_checks.warn(f"{name}: {key} is {held} in the file and {said} as given. Using what was given.")
    return held if said is None else said


def _named(metadata: Mapping[str, str]) -> dict[str, str]:
    """Metadata by names of letters, digits and underscores, each on one line.

    A comment that only looks like `key: value`, such as one that starts with a date, is no metadata."""
    found: dict[str, str] = {}
    for key in sorted(metadata, key=str.isidentifier):  # exact names have the last word
        value = metadata[key]
        name = re.sub(r"\W+", "_", key).strip("_")
        if name.isidentifier():
            found[name] = " ".join(value.splitlines())
    return found
