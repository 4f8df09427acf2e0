"""Options that several commands share, and what their texts mean."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated

import typer

from .output import check_folder

if TYPE_CHECKING:
    from furuta_gym.plant import Plant

Logs = Annotated[list[Path], typer.Argument(help="Logs of one rig: .csv, .parquet, .mat, .mcap, ….", metavar="LOG…")]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust", help="Also read policies that stable-baselines3 saved. Such a file runs code when it is read."
    ),
]
Report = Annotated[
    Path | None,
    typer.Option("--report", help="Write a page to this file, .html: is the model adequate?", metavar="PAGE"),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for machines instead of text.")]
Seed = Annotated[int, typer.Option(help="Everything random follows from it.", min=0)]


def output_file(path: Path, endings: Iterable[str], inputs: Iterable[Path] = ()) -> Path:
    """Check a file to be written before any work is done. Raises ValueError."""
    endings = tuple(endings)
    if path.suffix.lower() not in endings:
        raise ValueError(f"output {path}: expected a name that ends in {' or '.join(endings)}")
    if path.is_dir():
        raise ValueError(f"output {path} is a folder; expected the name of a file")
    check_folder(path.parent)
    if any(os.path.realpath(path) == os.path.realpath(i) for i in inputs):  # goes through loops of links
        raise ValueError(f"output {path} is also an input and would be lost; choose another name")
    return path


def report_file(path: Path | None, inputs: Iterable[Path] = ()) -> Path | None:
    """Check --report before any work is done. Raises ValueError."""
    if path is None:
        return None
    from experiments.report.page import require_extra

    require_extra(str(path))
    return output_file(path, [".html"], inputs)


def log_file(path: Path, inputs: Iterable[Path] = ()) -> Path:
    """Check a log or a command file to be written before any work is done. Raises ValueError."""
    from identification.logs.formats import WRITERS

    return output_file(path, WRITERS, inputs)


@contextmanager
def as_typed(*arguments: str, hints: Mapping[str, str] = MappingProxyType({})) -> Iterator[None]:
    """Let an error about one of these arguments name the option that gave it. hints: instead of those for Python.

    Raises ArgumentError."""
    from furuta_gym.arguments import ArgumentError

    try:
        yield
    except ArgumentError as error:
        name = error.argument
        if name not in arguments:
            raise
        raise error.renamed(f"--{name.replace('_', '-')}", hints.get(name)) from None


def numbers(option: str, text: str, count: tuple[int, ...] = (1, 2)) -> tuple[float, ...]:
    """Comma-separated finite numbers. Raises ValueError."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) not in count or not all(map(math.isfinite, values)):
        wanted = "a number" if count == (1,) else f"{' or '.join(map(str, count))} numbers, separated by a comma"
        raise ValueError(f"{option} {text!r}: expected {wanted}")
    return values


def within(option: str, value: float | None, low: float, high: float, what: str) -> None:
    """Before the work: a number that an option cannot have. low itself is left out. Raises ValueError."""
    if value is not None and not low < value <= high:
        raise ValueError(f"{option} {value:g}: expected {what}")


def names(text: str) -> list[str]:
    """Names separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def library_effects(option: str, texts: Iterable[str]) -> None:
    """Before the work: names that the library does not have, or values where names are expected. Raises ValueError."""
    from furuta_gym.plant.effects import EFFECTS, where_to_look

    given = list(texts)
    if valued := [text for text in given if text not in EFFECTS and re.search(r"[:=]", text)]:
        ways = "names alone, such as arm_spring,input_delay"
        hold = "; hold a parameter with --fix arm_spring.k=0.3" if option == "--effects" else ""
        raise ValueError(f"{option} {','.join(valued)}: expected {ways}{hold}")
    if strange := [name for name in given if name not in EFFECTS]:
        raise ValueError(f"{option} {','.join(strange)}: no such effect{where_to_look(strange)}")
    if len(set(given)) < len(given):
        raise ValueError(f"{option} {','.join(given)}: an effect stands there twice; name each once")


def _parts(option: str, texts: Iterable[str] | None) -> list[str]:
    """What commas separate, each of another NAME. Raises ValueError."""
    parts = [part for text in texts or () for part in text.split(",")]
    once(option, [part.partition("=")[0].strip() for part in parts])
    return parts


def once(option: str, given: Sequence[str]) -> None:
    """Raises ValueError for a name that is given twice."""
    if twice := [name for name in dict.fromkeys(given) if name and given.count(name) > 1]:
        raise ValueError(f"{option}: {', '.join(twice)} stands there twice; give each once")


def fixed_values(texts: Iterable[str] | None) -> dict[str, float | None]:
    """`theta4=0.012` (or `theta4` alone: the start plant's value) as {name: value or None}. Raises ValueError."""
    found: dict[str, float | None] = {}
    for text in _parts("--fix", texts):
        name, equals, value = (s.strip() for s in text.partition("="))
        if not name or (equals and not value):
            raise ValueError(f"--fix {text!r}: expected NAME=VALUE such as theta4=0.012")
        found[name] = numbers(f"--fix {name}", value, (1,))[0] if equals else None
    return found


def prior_values(texts: Iterable[str] | None) -> dict[str, tuple[float, float]]:
    """`theta2=0.012±0.001` (± may be typed +-) as {name: (mean, std)}. Raises ValueError."""
    found: dict[str, tuple[float, float]] = {}
    for text in _parts("--prior", texts):
        parts = re.split(r"±|\+/-|\+-", text.partition("=")[2])
        name = text.partition("=")[0].strip()
        if not name or len(parts) != 2:
            raise ValueError(f"--prior {text!r}: expected NAME=MEAN±STD such as theta2=0.012±0.001 (or +-)")
        mean, std = (numbers(f"--prior {name}", part, (1,))[0] for part in parts)
        if std <= 0:
            raise ValueError(f"--prior {text!r}: the standard deviation must be positive")
        found[name] = (mean, std)
    return found


def with_effects(plant: Plant, texts: Iterable[str] | None) -> Plant:
    """The plant with `NAME:p=v,…` added; parameters left out have a size worth noticing. Raises ValueError."""
    from furuta_gym.plant import Effect

    once("--effect", [text.partition(":")[0].strip() for text in texts or ()])
    for text in texts or ():
        plant = plant.with_effects(Effect.parse(text, plant.default_effect))
    return plant
