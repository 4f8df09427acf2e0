"""`furuta bench`: the bench's own commands, and `seal` and `reveal` of the lab session."""

from __future__ import annotations

import secrets
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.bench.cli import app

from . import options as opt
from .output import check_folder, counted, print_json

if TYPE_CHECKING:
    from experiments.lab.marking import Comparison

KeyFile = Annotated[
    Path | None, typer.Option("--key-file", help="Text file with the teacher's key; default: ask for it.")
]


@app.command("seal")
def seal_command(
    output: Annotated[Path, typer.Option("-o", "--output", help="New folder, with a folder for each group.")],
    groups: Annotated[int, typer.Option(help="Rigs to draw, one for each group.")] = 4,
    key_file: KeyFile = None,
    kinds: Annotated[str, typer.Option(help="What rigs may hide, of: library, two, none, outside.")] = "library,none",
    effects: Annotated[str, typer.Option(help="Hide only these effects, separated by commas; default: all.")] = "",
    rigs: Annotated[
        str, typer.Option(help="Only rigs of these sets of the bench: table3, servo, workshop, desk.")
    ] = "",
    seed: Annotated[
        int | None, typer.Option(help="Draw the same rigs again, for a rehearsal; default: a secret one.", min=0)
    ] = None,
    as_json: opt.AsJson = False,
) -> None:
    """Draw rigs for a lab session: logs for each group, and what its rig hides in a file that only a key opens.

    Whoever knows --seed can draw the same rigs. Leave it out for a real session.
    """
    from experiments.lab.rigs import SEALED, draw, hand_out

    from .whole import whole_folder

    check_folder(output)
    if output.is_dir() and any(output.iterdir()):
        raise ValueError(f"output {output} is not empty; expected a new folder, so that no older rig stays in it")
    passphrase = _passphrase(key_file, new=True)
    secret = secrets.randbits(128) if seed is None else seed
    with counted("drawing rigs") as tell:
        truths = draw(groups, secret, opt.names(kinds), opt.names(effects), opt.names(rigs))
        with whole_folder(output) as folder:
            for number, truth in enumerate(truths, 1):
                tell(number - 1, groups, "recording")
                hand_out(truth, folder / f"group-{number:02d}", passphrase)
    written = [f"group-{number:02d}" for number in range(1, groups + 1)]
    if as_json:
        print_json({"folder": str(output), "groups": written})
        return
    typer.echo(f"Written in {output}: {', '.join(written)}. Each has its logs, data_sheet.md and {SEALED}.")
    key = "" if key_file is None else f" --key-file {shlex.quote(str(key_file))}"
    sealed = shlex.quote(str(output / written[0] / SEALED))
    typer.echo(f"Keep the key. Afterwards: furuta bench reveal {sealed}{key} --diagnosis diagnosis.json")


@app.command("reveal")
def reveal_command(
    sealed: Annotated[list[Path], typer.Argument(help="Files that `furuta bench seal` wrote.", metavar="SEALED…")],
    key_file: KeyFile = None,
    diagnosis: Annotated[
        Path | None, typer.Option(help="A group's diagnosis.json, to be compared with what its rig hides.")
    ] = None,
    diagnoses: Annotated[
        Path | None,
        typer.Option(
            help="Folder of what was handed in, as GROUP/diagnosis.json, where GROUP is the name of a sealed file's "
            "folder: a table of all marks."
        ),
    ] = None,
    as_json: opt.AsJson = False,
) -> None:
    """Show what sealed rigs hide, and mark a diagnosis by it. Needs the key that they were sealed with."""
    from experiments.lab.marking import foreign_logs, marked, read_diagnosis
    from experiments.lab.vault import opened

    if diagnoses is not None:
        if diagnosis is not None:
            raise ValueError("--diagnosis and --diagnoses given, expected one of them")
        _all_marks(sealed, diagnoses, _passphrase(key_file), as_json)
        return
    if diagnosis is not None and len(sealed) > 1:
        raise ValueError(f"one diagnosis and {len(sealed)} sealed files given, expected one of each")
    answer = read_diagnosis(diagnosis) if diagnosis is not None else None
    passphrase = _passphrase(key_file)
    truths = {file: opened(file, passphrase) for file in sealed}
    marks = None if answer is None else marked(truths[sealed[0]], answer)
    if answer is not None and (others := foreign_logs(sealed[0], answer)):
        typer.echo(
            f"Warning: {diagnosis} is of files that were not handed out with this rig: {', '.join(others)}.", err=True
        )
    if as_json:
        facts: list[dict[str, Any]] = [{"sealed": str(file)} | truth for file, truth in truths.items()]
        if marks is not None:
            outcome, said, rows = marks
            facts[0] |= {"outcome": asdict(outcome), "says": said, "parameters": [asdict(row) for row in rows]}
        print_json(facts)
        return
    for file, truth in truths.items():
        _show_truth(file, truth)
    if marks is not None:
        outcome, said, rows = marks
        assert answer is not None
        typer.echo(f"\n{diagnosis}: verdict {answer['verdict']}, names {', '.join(outcome.named) or 'nothing'}.")
        typer.echo(said)
        if rows:
            _show_comparison(rows)


def _all_marks(sealed: Sequence[Path], handed_in: Path, passphrase: str, as_json: bool) -> None:
    """A row for each group. A diagnosis that is missing or broken is told in its row, and stops no other."""
    from experiments.lab.marking import foreign_logs, marked, read_diagnosis
    from experiments.lab.vault import opened

    if not handed_in.is_dir():
        raise ValueError(f"--diagnoses {handed_in}: expected a folder with a folder for each group in it")
    rows: list[dict[str, Any]] = []
    for file in sealed:
        group = file.resolve().parent.name
        truth = opened(file, passphrase)
        row: dict[str, Any] = {"group": group, "hidden": [effect["name"] for effect in truth["truth"]["effects"]]}
        place = handed_in / group / "diagnosis.json"
        try:
            answer = read_diagnosis(place)
        except FileNotFoundError:
            row |= {"verdict": None, "named": [], "says": f"No {place}."}
        except (ValueError, OSError) as error:
            row |= {"verdict": None, "named": [], "says": str(error)}
        else:
            outcome, said, _ = marked(truth, answer)
            if others := foreign_logs(file, answer):
                said = f"It is of files that were not handed out with this rig: {', '.join(others)}. {said}"
            row |= {"verdict": answer["verdict"], "named": list(outcome.named), "says": said, "outcome": outcome.result}
        rows.append(row)
    if as_json:
        print_json(rows)
        return
    table = Table("group", "hidden", "verdict", "named", "mark")
    for row in rows:
        hidden, named = (", ".join(row[key]) or "nothing" for key in ("hidden", "named"))
        table.add_row(
            *map(escape, (row["group"], hidden, row["verdict"] or "", named if row["verdict"] else "", row["says"]))
        )
    Console(width=None if Console().is_terminal else 140).print(table)


def _passphrase(file: Path | None, new: bool = False) -> str:
    """From the key file, or typed by the teacher (twice for a new one)."""
    from experiments.lab.vault import checked, passphrase_in, require_extra

    require_extra()
    if file is not None:
        return passphrase_in(file)
    if not sys.stdin.isatty():
        raise ValueError("no key given, and nobody to ask: give a text file that holds it, --key-file FILE")
    return checked(typer.prompt("Key", hide_input=True, confirmation_prompt=new), "the key")


def _show_truth(file: Path, sealed: Mapping[str, Any]) -> None:
    truth, trial = sealed["truth"], sealed["trial"]
    typer.echo(f"{file}: {truth['parameter_set']}, experiment {trial['experiment']}, {truth['base_friction']} friction")
    theta = ", ".join(f"θ{i} {value:.4g}" for i, value in enumerate(truth["theta"].values(), 1))
    typer.echo(f"  true parameters [{truth['unit']}]: {theta}; r {truth['friction_sharpness']:g} s/rad")
    if not truth["effects"]:
        typer.echo("  hides nothing")
    for effect, ratio in zip(truth["effects"], sealed["ratios"], strict=False):
        values = ", ".join(f"{key} = {p['value']:.4g} {p['unit']}".rstrip() for key, p in effect["parameters"].items())
        size = f"; error-to-noise ratio without it {ratio:.1f}" if ratio else ""
        typer.echo(f"  hides {effect['name']}: {effect['says']} ({values}{size})")


def _show_comparison(rows: Sequence[Comparison]) -> None:
    table = Table("parameter", "hidden", "found", "95 % interval holds it")
    for row in rows:
        found = f"{row.found:.4g}" + (f" ± {row.std:.2g}" if row.std else "")
        inside = "another law" if row.inside is None else "yes" if row.inside else "no"
        table.add_row(row.parameter, f"{row.hidden:.4g} {row.unit}".rstrip(), found, inside)
    Console(width=None if Console().is_terminal else 100).print(table)
