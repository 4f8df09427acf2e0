"""`furuta warm-up`: compiles everything once, so that no later command has to."""

from __future__ import annotations

import time

import typer

from . import options as opt
from .output import print_json


def warm_up_command(as_json: opt.AsJson = False) -> None:
    """Compile the numerical code for this machine, once; later commands load it. Takes three to five minutes."""
    from experiments.demo.warm_up import warm_up
    from furuta_gym.cache_folder import cache_root

    started = time.monotonic()
    compiled = warm_up(lambda step: typer.echo(f"{step} …", err=True))
    place = cache_root()
    seconds = time.monotonic() - started
    if as_json:
        folder = None if place is None else str(place)
        print_json({"compiled": compiled, "kept_in": folder, "seconds": round(seconds, 3)})
        return
    kept = f"kept in {place}" if place else "not kept, as no folder is private (see the warning)"
    what = f"Compiled, and {kept}" if compiled else f"Nothing was left to compile ({place})"
    typer.echo(f"{what}; {seconds:.0f} s.")
