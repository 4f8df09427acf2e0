"""`furuta demo`: the main job on bundled logs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from . import options as opt
from .output import check_folder, print_json
from .steps import steps


def demo_command(
    out: Annotated[Path, typer.Option("--out", help="Folder for the plant file, the plots and the figures.")] = Path(
        "out/demo"
    ),
    seed: opt.Seed = 0,
    as_json: opt.AsJson = False,
) -> None:
    """The whole story in some minutes: log → plant → held-out check → what is missing → controllers compared."""
    from experiments.demo.story import FILES, run_demo
    from experiments.report import require_extra

    from .whole import whole_folder

    require_extra()
    check_folder(out)
    began = time.monotonic()

    @contextmanager
    def at_work(text: str) -> Iterator[Callable[[str], None]]:
        with steps("demo", began=began) as tell:  # for each alone: the story is printed between, and may be piped
            tell(text)
            yield lambda more: tell(f"{text}: {more}")

    def say(line: str = "") -> None:
        typer.echo(line, err=as_json)

    with whole_folder(out, FILES) as folder:
        figures = run_demo(folder, seed=seed, say=say, shown=out, work=at_work)
    if as_json:
        print_json(figures)
