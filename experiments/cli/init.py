"""`furuta init`: a stranger's log in, a rig.toml out that says how it is read."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from . import options as opt
from .output import print_json
from .reading import Reading, reads_as_given, reads_logs
from .told import in_one, said_of

if TYPE_CHECKING:
    from identification.logs.proposal import Item, Proposal
    from identification.logs.rig_mapping import RigMapping

_MARKS = {"sure": "[green]sure[/]", "likely": "[yellow]likely[/]", "open": "[red]open[/]"}


@reads_logs
def init_command(
    logs: opt.Logs,
    reading: Reading,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="File to write (.toml). Default: rig.toml beside the log.")
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="Take what is likely without asking, and replace the file.")
    ] = False,
    as_json: opt.AsJson = False,
) -> None:
    """Look at logs of a rig, propose how to read them, and write it to rig.toml, which every command then uses.

    Options say what is known already. On a terminal it asks about what is not sure; elsewhere it says what to give.
    """
    from experiments.replaced import kept_mapping
    from furuta_gym.files import told_apart
    from identification.logs.checks import LogError
    from identification.logs.formats import read_table
    from identification.logs.proposal import Confidence, propose
    from identification.logs.rig_file import NAME, load_mapping, save_mapping
    from identification.logs.rig_mapping import RigMapping

    target = opt.output_file(out or logs[0].parent / NAME, [".toml"], logs)
    tables = [read_table(path) for path in logs]
    alone = reading.file is not None  # what the rig.toml there says does not count
    file = None if str(reading.file) == "none" else reading.file
    known = reading.said if file is None else reading.said.over(load_mapping(file))
    proposal = propose(tables, known)
    kept = kept_mapping(target, proposal) if yes and target.exists() and not alone else RigMapping()
    if not kept.empty:
        typer.echo(f"Kept from {target}: {kept.options()}", err=True)
        proposal = propose(tables, known.over(kept))
    talks = not as_json and not yes and _talks()
    if not as_json:
        show(proposal)
    if proposal.fatal and not reading.as_given:
        of_one = dict(zip(told_apart(logs), tables, strict=True))
        said = said_of(proposal.fatal, of_one, lambda table: propose([table], proposal.mapping).fatal)
        readable = reads_as_given(logs, tables, [proposal.mapping] * len(logs))
        raise LogError(in_one(said, logs, looked=True, readable=readable) + _NOTHING)
    if talks:
        proposal = _asked(tables, proposal)
    left = proposal.below(Confidence.likely if yes else Confidence.sure)
    if left:
        raise LogError(_needed(proposal, left, _typed(logs, reading, out)) + _NOTHING)
    mapping = proposal.mapping
    _try(logs, tables, mapping)
    differs = target.exists() and not yes and (there := load_mapping(target)) != mapping and there.options()
    if differs and not (talks and typer.confirm(f"{target} says otherwise ({differs}). Replace it?", err=True)):
        raise LogError(f"{target} is there and says otherwise: {differs}. Replace it with --yes.")
    reasons = {item.name: item.reason for item in proposal.items} | {"flip": _signs(proposal)}
    about = f"How the logs of this rig are read. Written by `furuta init` from {', '.join(proposal.sources)}."
    reasons |= dict.fromkeys(kept.to_dict(), "kept from the file that was here")
    save_mapping(target, mapping, reasons, about)
    if as_json:
        print_json(proposal.to_dict() | {"written": str(target)})
        return
    typer.echo(f"Written: {target}")
    fitted, *checked = (shlex.quote(os.fspath(log)) for log in logs)
    other = "" if target.name == NAME and target.parent == logs[0].parent else f" --mapping {shlex.quote(str(target))}"
    typer.echo(f"Next: furuta identify {fitted}{other} -o rig.json")
    if checked:
        typer.echo(f"Then, on what was not fitted: furuta validate rig.json {' '.join(checked)}{other}")


def _talks() -> bool:
    """Whether there is somebody to ask."""
    return sys.stdin.isatty() and sys.stderr.isatty()


_NOTHING = "\nNothing was written."


def show(proposal: Proposal, console: Console | None = None) -> None:
    """The proposal as a table, and what is noteworthy below it."""
    console = console or Console()
    console = console if console.is_terminal else Console(width=120)
    table = RichTable(
        "what", "proposed", "", "why", title=", ".join(map(escape, proposal.sources)), title_justify="left"
    )
    for item in proposal.items:
        table.add_row(item.says, escape(item.shown), _MARKS[item.confidence.value], escape(item.reason))
    console.print(table)
    for problem in proposal.problems:
        if not problem.fatal:
            console.print(f"Note: {problem}", markup=False)


def _asked(tables: Sequence[Any], proposal: Proposal) -> Proposal:
    """The proposal after the items that are not sure have been asked about, one at a time."""
    from identification.logs.checks import LogError
    from identification.logs.proposal import Confidence, propose

    while unsure := proposal.below(Confidence.sure):
        item = unsure[0]
        choices = f" ({', '.join(item.alternatives)})" if item.alternatives else ""
        turned = ",".join(proposal.mapping.flip or ()) or "none"
        default = turned if item.name.startswith("sign_") else None if item.value is None else item.shown
        typer.echo(f"{item.says}: {item.reason}.", err=True)
        question = "signs to turn (of q1, q2, u)" if item.name.startswith("sign_") else f"{item.says}{choices}"
        answer = typer.prompt(question, default=default, err=True)
        try:
            proposal = propose(tables, _with(proposal.given, item, str(answer).strip()))
            if proposal.fatal:
                raise LogError(str(proposal.fatal[0]))
        except LogError as error:
            typer.echo(f"{error}", err=True)
            proposal = propose(tables, proposal.given if not proposal.fatal else proposal.given.without(_field(item)))
    return proposal


def _field(item: Item) -> str:
    return "flip" if item.name.startswith("sign_") else item.name


def _with(given: RigMapping, item: Item, answer: str) -> RigMapping:
    """What is given, and an answer to the question about an item. Raises LogError for one that cannot be."""
    from dataclasses import replace

    value: Any = answer
    if _field(item) == "flip":
        value = "" if answer == "none" else answer
    return replace(given, **{_field(item): value})


def _typed(logs: Sequence[Path], reading: Reading, out: Path | None) -> str:
    """The command as it was given."""
    said = reading.said.options()
    words = ["furuta init", shlex.join(map(str, logs)), *([said] if said else [])]
    words += ["--as-given"] if reading.as_given else []
    return " ".join(words + ([] if out is None else [f"-o {shlex.quote(str(out))}"]))


def _needed(proposal: Proposal, left: Sequence[Item], command: str) -> str:
    """What to give for the items that are not sure. command: the one that was given."""
    from identification.logs.proposal import Confidence

    rest, give = ("is", "it as an option") if len(left) == 1 else ("are", "them as options")
    count = f"{len(left)} of {len(proposal.items)} things {rest}"
    waiting = [item.says for item in left if item.waits]
    if waiting:
        give = "what stands here first"
    lines = [f"{', '.join(proposal.sources)}: {count} not sure. Give {give}:"]
    for item in left:
        if item.says in waiting:
            continue
        value = "" if "…" in item.option or item.option.startswith("--flip") else f" {_example(item)}"
        if item.name == "pendulum_zero":  # nobody knows, so neither is proposed
            value = f" {item.alternatives[0]}, or {item.option} {item.alternatives[1]}"
        option = item.option.replace("…", _example(item)) + value
        lines.append(f"  {shlex_free(option)}   ({item.says}: {item.reason}{_by_hand(item)})")
    if waiting:
        lines.append(f"The motion may tell the rest then: {', '.join(waiting)}.")
    if all(item.confidence is Confidence.likely for item in left):
        lines.append(f"Or take what is proposed: {command} --yes")
    return "\n".join(lines)


def _example(item: Item) -> str:
    shown = item.shown if item.shown not in ("?", "") else "NAME"
    if item.value is None and item.name in ("encoder_counts", "time_unit"):
        return "COUNTS" if item.name == "encoder_counts" else "SECONDS"
    return shlex.quote(shown) if " " in shown else shown


def _by_hand(item: Item) -> str:
    """How to find out a sign that the log does not show."""
    return {
        "sign_u": "; none if a small positive command makes q1 rise",
        "sign_q2": "; none if, with the pendulum hanging, q2 rises at first when you jerk the arm towards positive q1",
    }.get(item.name, "")


def shlex_free(option: str) -> str:
    """An option for a sign that is not sure, which is given by turning it or by none."""
    return f"{option}, or --flip none" if option.startswith("--flip") else option


def _signs(proposal: Proposal) -> str:
    return "; ".join(f"{i.name[5:]} {i.shown}" for i in proposal.items if i.name.startswith("sign_"))


def _try(logs: Sequence[Path], tables: Sequence[Any], mapping: RigMapping) -> None:
    """Read the logs once with what is to be written. Raises LogError."""
    from identification.logs.reading import read_logs

    read_logs(logs, mappings=[mapping] * len(logs), tables=tables)
