"""The application: every command by name, and the one place where an error becomes a sentence and exit code 2."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from .changes import changes_command
from .command import INTERRUPTED, Command
from .compare import compare_command
from .demo import demo_command
from .diagnose import DiagnoseCommand, diagnose_command
from .effects import effects_command
from .errors import explained
from .excite import excite_command
from .export import export_command
from .identify import identify_command
from .init import init_command
from .letters import print_any_letter
from .logbook import keep_logbook, print_version
from .residuals import residuals_command
from .score import score_command
from .simulate import simulate_command
from .studio import studio_command
from .train import train_command
from .trials import trials_command
from .validate import validate_command
from .warm_up import warm_up_command

KEPT: dict[str | None, str] = {
    None: "Nothing was written; results of an earlier run are as they were.",
    "warm-up": "What was compiled is kept: the same command compiles the rest.",
    "studio": "The studio has ended. Files that it wrote are kept.",
    "trials": "What was answered is kept: the same command goes on from there.",
}
"""What Ctrl-C leaves of each command, unless the command says it itself."""


class ExplainingGroup(TyperGroup):
    """Runs a command with `explained` around it."""

    def invoke(self, ctx: Any) -> Any:
        with explained(traceback=bool(ctx.params.get("traceback"))):
            try:
                return super().invoke(ctx)
            except (KeyboardInterrupt, typer.Abort):  # at a question, typer makes the second of Ctrl-C and Ctrl-D
                command = ctx.invoked_subcommand
                typer.echo(f"Interrupted. {KEPT.get(command, KEPT[None])}", err=True)
                raise typer.Exit(INTERRUPTED) from None


app = typer.Typer(
    name="furuta",
    cls=ExplainingGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="From measured logs of a Furuta pendulum to a plant with error bars, and to controllers that balance it.",
    epilog="Start with `furuta demo`, or with `furuta init LOG` of your own. Every command has --help.",
)


@app.callback()
def options(
    traceback: Annotated[bool, typer.Option("--traceback", help="Show where in the code an error arose.")] = False,
    verbose: Annotated[
        int, typer.Option("-v", "--verbose", count=True, help="Say what is done; -vv says more.", show_default=False)
    ] = 0,
    log_file: Annotated[
        Path | None, typer.Option(help="Keep a record of what is done in this file.", metavar="FILE")
    ] = None,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=print_version)
    ] = False,
) -> None:
    """Options of every command; `ExplainingGroup` reads --traceback."""
    keep_logbook(verbose, log_file)


app.command("demo", cls=Command)(demo_command)
app.command("init", cls=Command)(init_command)
app.command("identify", cls=Command)(identify_command)
app.command("validate", cls=Command)(validate_command)
app.command("diagnose", cls=DiagnoseCommand)(diagnose_command)
app.command("changes", cls=Command)(changes_command)
app.command("residuals", cls=Command)(residuals_command)
app.command("effects", cls=Command)(effects_command)
app.command("excite", cls=Command)(excite_command)
app.command("simulate", cls=Command)(simulate_command)
app.command("compare", cls=Command)(compare_command)
app.command("score", cls=Command)(score_command)
app.command("trials", cls=Command)(trials_command)
app.command("train", cls=Command)(train_command)
app.command("export", cls=Command)(export_command)
app.command("studio", cls=Command)(studio_command)
app.command("warm-up", cls=Command)(warm_up_command)


@app.command(
    "bench",
    cls=Command,
    add_help_option=False,
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
)
def bench_command(ctx: typer.Context) -> None:
    """The virtual bench: rigs that may hide something. For a lab session: `bench seal`, `bench reveal`."""
    from .bench import app as bench  # compiles nothing, but is too slow to import for every --help

    code = typer.main.get_command(bench).main(ctx.args, prog_name="furuta bench", standalone_mode=False)
    if code == INTERRUPTED:  # typer's word for Ctrl-C, of which it says nothing
        raise KeyboardInterrupt
    raise typer.Exit(code if isinstance(code, int) else 0)


def main() -> None:
    """Entry point of the console script `furuta`."""
    print_any_letter()
    app()
