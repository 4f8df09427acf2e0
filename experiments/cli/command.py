"""What every command does before its own work: end in order when it is told to, and say when it has to compile."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperCommand

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""


class Command(TyperCommand):
    """A command of `furuta`. `--help` is answered before `invoke`, so it loads none of this."""

    def invoke(self, ctx: Any) -> Any:
        from furuta_gym.cache_folder import when_compiling
        from furuta_gym.processes import ending_in_order

        with ending_in_order(), when_compiling(_say):
            return super().invoke(ctx)


def _say() -> None:
    typer.echo("Compiling for this machine: up to three minutes (`furuta warm-up` compiles everything once).", err=True)
