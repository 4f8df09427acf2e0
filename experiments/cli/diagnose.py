"""`furuta diagnose`: which effect the model misses, if any, and a report that shows it."""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from identification.diagnosis.policy import MOST_EFFECTS

from . import options as opt
from .command import INTERRUPTED, Command
from .output import check_folder, print_json, write_json
from .reading import Reading, reads_logs, tell_undriven
from .reading import read as read_logs
from .steps import steps

if TYPE_CHECKING:
    from experiments.report import Examination


class DiagnoseCommand(Command):
    """Takes several logs after one --held-out where the logs to be fitted stand before it."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        return super().parse_args(ctx, _repeated(args, "--held-out", lambda before: self._has_logs(ctx, before)))

    def _has_logs(self, ctx: Any, args: list[str]) -> bool:
        return bool(self.make_parser(ctx).parse_args(list(args))[0].get("logs"))


def _repeated(args: Sequence[str], option: str, may: Callable[[list[str]], bool]) -> list[str]:
    """`option a b c`, or `option=a b c`, as `option a option b option c`, up to the next option, where `may` says so of
    what is before."""
    given: list[str] = []
    rest = list(args)
    while rest:
        word = rest.pop(0)
        if word.startswith(f"{option}="):
            word, rest = option, [word.removeprefix(f"{option}="), *rest]
        given.append(word)
        if word == option and rest and may(given[:-1]):
            given.append(rest.pop(0))
            while rest and not rest[0].startswith("-"):
                given += [option, rest.pop(0)]
    return given


@dataclass
class _Journal:
    """Of a search: its file, and whether the search is to go on from it later."""

    path: Path
    needed: bool = False


@contextmanager
def _kept_until_written(journal: Path) -> Iterator[_Journal]:
    """Once its results are on the disk a search that came to its end needs no journal; another one goes on from it.

    What Ctrl-C leaves is said here, as it depends on whether a fit was kept."""
    kept = _Journal(journal)
    try:
        yield kept
    except KeyboardInterrupt:
        if not journal.exists():
            raise
        typer.echo(
            f"Interrupted. Nothing was written but the fits so far, in {journal.name} beside the output: the same "
            "command goes on from there.",
            err=True,
        )
        raise typer.Exit(INTERRUPTED) from None
    if not kept.needed:
        journal.unlink(missing_ok=True)


def _show_policy(wanted: bool) -> None:
    if wanted:
        from identification.diagnosis.policy import DecisionPolicy

        typer.echo(DecisionPolicy().table())
        raise typer.Exit


@reads_logs
def diagnose_command(
    logs: opt.Logs,
    reading: Reading,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help="Folder for diagnosis.json, plant.json, report.html, next_experiment.csv."),
    ],
    held_out: Annotated[
        list[Path] | None,
        typer.Option(
            help="Held-out logs, which are never fitted and test the result; more may follow. Default: the last 30 % "
            "of each log, predicted by plants fitted to the rest.",
            metavar="LOG…",
        ),
    ] = None,
    plant: Annotated[str | None, typer.Option(help="Plant to start from; default: from the logs.")] = None,
    policy: Annotated[
        bool,
        typer.Option(
            "--policy",
            help="Print every threshold with its reason, and stop. Needs no log.",
            is_eager=True,
            callback=_show_policy,
        ),
    ] = False,
    max_effects: Annotated[int, typer.Option(min=1, help="Effects to look for at most.")] = MOST_EFFECTS,
    minutes: Annotated[
        float | None,
        typer.Option(
            help="Look for no further effect after so many minutes; what was found by then is judged and written. "
            "The same command with more minutes goes on. Default: no limit."
        ),
    ] = None,
    as_json: opt.AsJson = False,
) -> None:
    """Search the library of effects for what model (5) misses in logs of one rig, add it to the plant, and report.

    A search that was stopped goes on with the same command.
    """
    from experiments.report import COMMAND_FILE, examine, extra_lacking, render, write_command
    from furuta_gym.plant import Plant

    from .whole import whole_folder

    check_folder(output)
    opt.within("--minutes", minutes, 0.0, math.inf, "minutes, more than 0")
    if lacking := extra_lacking():
        typer.echo(f"No page will be written: {lacking}", err=True)
    known = None if plant is None else Plant.resolve(plant)
    read = read_logs(logs, reading, known, beside=held_out or ())
    held = read_logs(held_out, reading, known, "ignore", logs) if held_out else ()
    tell_undriven(held)
    from identification.diagnosis.diagnose import diagnose
    from identification.diagnosis.policy import DecisionPolicy

    own = ("diagnosis.json", "plant.json", "report.html", COMMAND_FILE)
    there = Path(os.path.realpath(output))
    journal = there.with_name(f"{there.name}.search.jsonl")
    stopped, limit = journal.exists(), math.inf if minutes is None else minutes
    with (
        _kept_until_written(journal) as kept,
        whole_folder(output, own) as folder,
        steps("diagnose", min(sum(map(len, read)), DecisionPolicy().samples)) as tell,
    ):
        try:
            found = diagnose(*(read, held, plant, max_effects), progress=tell, journal=journal, minutes=limit)
        except ValueError:  # a search that cannot end needs no journal; one that was stopped may have been mistyped
            if not stopped:
                journal.unlink(missing_ok=True)
            raise
        kept.needed = found.ended_early
        paths = [*logs, *(held_out or ())]
        typed = f"{shlex.join(map(str, paths))}{reading.again(paths, (*read, *held))}"
        examination = examine(found, read, held, progress=tell, typed=typed)
        result = examination.to_dict()
        write_json(folder / "diagnosis.json", result)
        if found.plant is not None:
            found.plant.save(folder / "plant.json")
        if not lacking:
            from experiments.report.diagnosis_page import diagnosis_page

            (folder / "report.html").write_text(render(diagnosis_page(examination)), encoding="utf-8")
        if examination.design is not None:
            write_command(examination.design, folder)
    if as_json:
        print_json(result)
        return
    typer.echo(str(found))
    for line in _evidence(examination):
        typer.echo(f"  {line}")
    written = ["diagnosis.json", *(["plant.json"] if found.plant else [])]
    written += [] if lacking else ["report.html"]
    written += [COMMAND_FILE] if examination.design else []
    typer.echo("Written: " + ", ".join(str(output / name) for name in written))
    if found.plant is not None and found.together is None and found.verdict != "unknown":
        typer.echo(f"Next: furuta compare --plant {shlex.quote(str(output / 'plant.json'))} -o comparison")


def _evidence(x: Examination) -> list[str]:
    """Where the model fails, what the gap does, and what to do next, a line each."""

    if x.diagnosis.plant is None:
        nothing = f"where and gap are not known, and there is no plant.json: {x.remarks['gap']}"
        return [nothing, f"next: {x.next_experiment}"]
    lines = [f"where: {x.where.sentence}" if x.where else f"where: {x.remarks.get('where', 'not known')}"]
    if x.gap:
        data = "held-out logs" if x.gap.tail is None else f"the last {100 * x.gap.tail:.0f} % of the logs, not fitted"
        ratios = " before, ".join(f"{x.gap.over_floor(gap):.2f}" for _, gap in x.gap.sides)
        ending = " after" if x.gap.changed else ""
        lines.append(f"gap: {ratios}{ending} times the noise floor on {data}")
        if resting := x.gap.after.at_rest:
            lines.append(f"in doubt: {resting}")
        if x.gap.changed:
            adequate = x.gap.before.at_the_floor(x.diagnosis.policy.adequate)
            closed = "not defined, the error was at the floor before" if adequate else x.gap.closed
            lines.append(f"closed share: {closed}; log-likelihood there: {x.gap.likelier:+.0f} nats")
    elif "gap" in x.remarks:
        lines.append(f"gap: {x.remarks['gap']}")
    return [*lines, f"next: {x.next_experiment}"]
