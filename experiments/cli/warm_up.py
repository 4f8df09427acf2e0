"""`furuta warm-up`: compiles everything once, so that no later command has to."""

from __future__ import annotations

import time

import typer


def warm_up_command() -> None:
    """Compile the numerical code for this machine, once; later commands load it. Takes about two minutes."""
    from experiments.demo.warm_up import warm_up
    from furuta_gym.cache_folder import cache_root

    started = time.monotonic()
    compiled = warm_up(lambda step: typer.echo(f"{step} …", err=True))
    place = cache_root()
    kept = f"kept in {place}" if place else "not kept, as no folder is private (see the warning)"
    what = f"Compiled, and {kept}" if compiled else f"Nothing was left to compile ({place})"
    typer.echo(f"{what}; {time.monotonic() - started:.0f} s.")
