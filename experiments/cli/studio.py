"""`furuta studio`: look, try and diagnose in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def studio_command(
    logs: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Logs to open: .csv, .parquet, .mat, .mcap, …; or a saved session, .furuta.", metavar="LOG…"
        ),
    ] = None,
    port: Annotated[
        int | None, typer.Option(help="Port on this machine; default: a free one.", min=1, max=65535)
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(
            "--mapping",
            "--rig",
            help="The rig's rig.toml; none: no rig.toml. Default: beside the first log, else here. "
            "The page can change what it says.",
        ),
    ] = None,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Open no browser; the address is printed.")] = False,
) -> None:
    """Open a local page to look at logs, fit them, move effects by sliders and search for what is missing.

    It answers to this machine only. Its address, with a random token, is the one line on stdout. Ctrl-C ends it.
    There is no --json: a program reads that line, and the command ends with no other result.
    """
    from experiments.studio import require_extra

    require_extra()
    for log in logs or ():
        if log.is_dir():
            raise ValueError(f"{log} is a folder; the studio opens files. Write its log to one, such as a .csv")
        if not log.is_file():
            raise FileNotFoundError(f"no log at {log}; expected a file that exists")
    from identification.logs.rig_file import load_mapping
    from identification.logs.rig_mapping import RigMapping

    stated = None if mapping is None else RigMapping() if str(mapping) == "none" else load_mapping(mapping)
    from experiments.studio.server import serve

    serve(logs or (), port, not no_browser, typer.echo, stated)
