"""Logs in, verified Diagnosis out: is an effect missing from the model, which, how large, and how sure are we."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from furuta_gym.arguments import ArgumentError
from furuta_gym.plant import Plant
from furuta_gym.plant.effects import EFFECTS, where_to_look

from ..estimation.pool import one_blas_thread
from ..kalman.record import sharing_counts
from ..logs.log import Log, as_logs, check_each_once
from . import sentences
from .held_out import HeldOut
from .learning import with_learned
from .naming.journal import FitJournal
from .one_plant import different_plants, first_alone
from .outcome import Diagnosis
from .policy import MOST_EFFECTS, DecisionPolicy
from .searched import searched
from .searched_part import searched_part
from .second_witness import with_second_witness
from .verify import verified
from .watched import Tried, Watched


@one_blas_thread
def diagnose(
    logs: Log | Sequence[Log],
    held_out: Log | Sequence[Log] | None = None,
    start: Plant | str | None = None,
    most: int = MOST_EFFECTS,
    only: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
    policy: DecisionPolicy | None = None,
    journal: Path | str | None = None,
    watch: Callable[[Tried], None] | None = None,
    minutes: float = math.inf,
) -> Diagnosis:
    """Search the library for what model (5) misses in these logs of one rig, and verify it on data that no fit saw.

    held_out: logs of the same rig that are predicted and never fitted; without any, the last part of each log serves.
    start: a plant to start from, without its effects (default: the logs alone). most: effects at most. only: names
    of effects, to restrict the library. progress(text) is called at each step. policy: the thresholds (default:
    `DecisionPolicy()`). journal: a file that keeps what was fitted, from which a search that was stopped goes on and
    ends the same. watch(tried) is called after each fit, from several threads; what it raises ends the search.
    minutes: after these, no further effect is looked for; what was found is judged as always, which takes its own time.
    Raises ValueError for bad arguments, and for held-out logs that are also searched, given twice or of
    another unit.
    """
    began = time.monotonic()
    searched_logs = len(as_logs(logs))
    every = sharing_counts((*as_logs(logs), *as_logs(held_out or ())))
    logs, held_out = every[:searched_logs], every[searched_logs:]
    say, policy = progress or _silent, policy or DecisionPolicy()
    _check(logs, held_out, most, only, minutes)
    if start is not None:  # effects are for the search to find, and to be judged
        start = Plant.resolve(start).replace(effects=())
    part = searched_part(logs, policy)
    held = HeldOut(part.logs, searched_part(held_out, policy).logs, policy)
    kept = FitJournal(None if journal is None else Path(journal))
    fitter = kept if watch is None else Watched(kept, watch)
    if len(kept):
        say(f"{journal} keeps {len(kept)} fits of a search that was stopped; those of these logs are not made again")

    def names(held: HeldOut) -> Diagnosis:
        found = searched(held, start, most, only, say, fitter, began + 60.0 * minutes)
        say("predicting the held-out data")
        return verified(found, held)

    found = names(held)
    complete = not found.ended_early  # else an effect that is not found yet may pass for another plant
    if complete and (len(part.logs) > 1 or held.whole):
        say("asking whether all logs are of one plant")
    if complete and (different := different_plants(found, held)) is not None:
        say(f"the logs are of different plants: searching {different.sources[0]} alone")
        held = HeldOut(first_alone(part.logs, different), (), policy)  # its last part judges
        found = names(held).beside_other_plants(different)
    if found.still_off > 1.0 or found.torque_floor_exceeded:
        say("fitting the parameters a second way: multiple shooting")
        found = with_second_witness(found, held)
    if found.leftover:
        say("learning what no name explains")
        found = with_learned(found, held)
    if found.ended_early:
        found = replace(found, summary=f"{found.summary} {sentences.ENDED_EARLY}")
    return replace(found, stretches=part.spans[: len(held.logs)], runtime_s=time.monotonic() - began)


def _silent(text: str) -> None:
    """Progress that nobody wants."""


def _check(logs: Sequence[Log], held_out: Sequence[Log], most: int, only: Sequence[str] | None, minutes: float) -> None:
    if strange := [name for name in only or () if name not in EFFECTS]:
        raise ArgumentError("only", ",".join(strange), "no such effect", where_to_look(strange))
    if most < 1:
        raise ValueError(f"most must be at least 1, got {most}")
    if not minutes > 0.0:
        raise ArgumentError("minutes", f"{minutes:g}", "no time to search", "; expected more than 0")
    if not logs:
        raise ValueError("diagnose needs at least one log, got none")
    if searched_too := [log for log in held_out if any(log.overlaps(own) for own in logs)]:
        names = ", ".join(log.source for log in searched_too)
        raise ValueError(f"{names} is searched and held out at once; hold out a log that is not fitted")
    check_each_once(held_out, "as held-out data its noise floor would be that of a repeated run without noise: zero")
    if units := {log.input_unit for log in held_out} - {logs[0].input_unit}:
        raise ValueError(
            f"the held-out logs' command is in {', '.join(sorted(units))}, the others' in {logs[0].input_unit}; "
            "they must agree (--input-unit)"
        )
