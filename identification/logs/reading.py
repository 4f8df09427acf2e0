"""Logs read from files: mapped to the paper's convention, checked, and what is to be left out left out."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .checks import LogError, check_length, warn
from .formats import file_hash, read_table
from .log import Log
from .mapping import map_table
from .rig_mapping import RigMapping
from .said import of_file, parse_counts, parse_cuts, parse_flip, parse_skip
from .table import Table


def read_log(
    path: str | os.PathLike[str],
    columns: str | Mapping[str, str] | None = None,
    *,
    unit: str | Mapping[str, str] | None = None,
    pendulum_zero: str | None = None,
    flip: str | Iterable[str] = (),
    encoder_counts: float | str | Sequence[float] | None = None,
    input_unit: str | None = None,
    input_scale: float = 1.0,
    device: str | None = None,
    controller_gain: str | Sequence[float] | None = None,
    time_unit: str = "s",
    constant_command: str = "error",
    skip: float = 0.0,
    cut: str | Iterable[str | Sequence[float]] = (),
    table: Table | None = None,
) -> Log:
    """Read a file of any format in `formats.READERS`, map it to the paper's convention, and check it.

    columns: names in the file by our names, `{"t": "Time", "q1": "theta"}` or `"t=Time,q1=theta"`.
    unit: of the angles, "rad" (default), "deg", "turns" or "counts", or one per column, `{"q2": "deg"}`.
    pendulum_zero: "upright" (default) or "hanging", the position where the file's q2 is 0.
    flip: of "q1", "q2", "u", the ones whose sign is turned. The order is: unit, then zero, then sign, so that
    hanging with q2 flipped gives q2 = −(q2_file − π); then whole turns are taken off q2 if it starts more
    than three quarters of a turn from upright.
    encoder_counts: counts per revolution (all four edges), one number or two, for (q1, q2).
    controller_gain: K of the file's own units and signs; it is mapped as the angles and the command are.
    input_scale: what the file's command is multiplied by to be in input_unit, as 0.001 for millivolts.
    time_unit: "s", "ms", "us", "ns" or "d" (days), or of a counter the seconds of one count, "0.002"; dates need none.
    constant_command: "error", "warn" or "ignore" (no word about free decays, u = 0).
    skip [s]: left out at the start, for example while a controller is handed over; plant files say so.
    cut [s]: stretches of the log's clock that are left out, each "12:14" or (12, 14); plant files say so. The log is
    cut in two there, as at any gap of its clock.
    table: the file's content, where it has been read already.

    What is given here beats the file's own `# key: value` lines; where the two differ, a LogWarning says so.
    Raises LogError (a ValueError), naming the file, for an argument that cannot be and for anything that would make an
    estimate from this file meaningless.
    """
    with of_file(Path(path).name if table is None else table.name):
        skip = parse_skip(skip)
        cuts = parse_cuts(cut)
        said = RigMapping.of(
            columns,
            unit,
            time_unit=None if time_unit == "s" else time_unit,
            pendulum_zero=pendulum_zero,
            flip=parse_flip(flip) or None,
            encoder_counts=None if encoder_counts is None else parse_counts(encoder_counts),
            input_unit=input_unit,
            input_scale=None if input_scale == 1.0 else input_scale,
            skip=skip or None,
            cut=cuts or None,
        )
    table = read_table(path) if table is None else table
    mapped = map_table(table, said, device=device, controller_gain=controller_gain, constant_command=constant_command)
    for note in table.notes if said.empty else ():  # where names are given, they were found
        warn(note)
    digest = table.sha256 or file_hash(path)
    about: dict[str, Any] = {**mapped.signals, **mapped.facts}
    log = Log(**about, source=table.name, sha256=digest, mapping=said, metadata=mapped.metadata)
    whole, begin = log, float(log.t[0])
    if cuts:
        log = _without(log, cuts)
    if not skip:
        return log
    rest = log.slice(begin + skip)
    since = float(whole.t[np.searchsorted(whole.t, begin + skip)])  # what is skipped is no part of the recording
    rest = replace(rest, skipped=float(skip), begins=float(rest.t[0]) - since)
    check_length(f"{log.source} after the {skip:g} s that are left out (--skip)", len(rest))
    return rest


def _without(log: Log, cuts: Sequence[tuple[float, float]]) -> Log:
    """The log without the samples of these stretches [s]."""
    left_out = np.zeros(len(log), dtype=bool)
    for start, stop in cuts:
        inside = (log.t >= start) & (log.t <= stop)
        if not inside.any():
            raise LogError(
                f"{log.source}: no sample lies in the stretch to be cut out (--cut {start:g}:{stop:g}). Expected "
                f"seconds of the log's own clock, which runs from {log.t[0]:g} to {log.t[-1]:g} s."
            )
        left_out |= inside
    said = " ".join(f"--cut {start:g}:{stop:g}" for start, stop in cuts)
    check_length(f"{log.source} without the stretches that are cut out ({said})", int((~left_out).sum()))
    return replace(log.taken(~left_out), cut=tuple(cuts))


def read_logs(
    paths: Iterable[str | os.PathLike[str]],
    *,
    mappings: Sequence[RigMapping] | None = None,
    tables: Sequence[Table] | None = None,
    **mapping: Any,
) -> tuple[Log, ...]:
    """Several logs of one rig, all with the same mapping (see `read_log`); sample times may differ.

    mappings, tables: of each log, in place of one mapping for all and of reading the files once more.

    A log whose command is constant (a free decay) is accepted beside one that is driven, never alone. Raises LogError
    as `read_log` does, for no logs, and for logs whose commands differ in unit.
    """
    paths = list(paths)
    if not paths:
        raise LogError("no log was given. Expected at least one file.")
    severity = mapping.pop("constant_command", "warn" if len(paths) > 1 else "error")
    each = [m.arguments() for m in mappings] if mappings is not None else [mapping] * len(paths)
    read = tables if tables is not None else [None] * len(paths)
    logs = tuple(
        read_log(path, constant_command=severity, table=table, **said)
        for path, table, said in zip(paths, read, each, strict=True)
    )
    if severity == "warn" and len(logs) > 1 and all(np.ptp(log.u) == 0 for log in logs):
        raise LogError(f"the command is constant in all {len(logs)} logs. Expected at least one that is driven.")
    units = {log.input_unit for log in logs}
    if len(units) > 1:
        raise LogError(f"logs of one rig with commands in {' and '.join(sorted(units))}. Expected one unit.")
    return logs
