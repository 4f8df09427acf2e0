"""Entry point of the console script `furuta`: looks whether the packages are this project's own, then starts them."""

from __future__ import annotations

import sys
from importlib.machinery import PathFinder
from pathlib import Path

PACKAGES = ("furuta_gym", "identification", "controllers", "experiments")


def in_the_way(home: Path) -> str:
    """What another package of the same name that Python finds first does, and what helps; empty if there is none.

    home: folder that this project's packages lie in."""
    for name in PACKAGES:
        own = home / name
        spec = PathFinder.find_spec(name)
        found = list(spec.submodule_search_locations or [spec.origin or ""]) if spec else []
        if not (own / "__init__.py").exists():
            return f"{own} is missing or is not furuta-gym's; install furuta-gym again, in an environment of its own"
        if found and Path(found[0]).resolve() != own.resolve():
            return (
                f"{found[0]} is in the way of furuta-gym's own package {name!r} in {own}: rename it, or take its "
                "folder off PYTHONPATH and out of the folder that Python starts in"
            )
    return ""


def main() -> None:
    """Run `furuta`; a sentence and exit code 2 where another package is in the way, 130 at Ctrl-C while it loads."""
    try:
        _start()
    except KeyboardInterrupt:
        print("Interrupted. Nothing was written; results of an earlier run are as they were.", file=sys.stderr)
        raise SystemExit(130) from None


def _start() -> None:
    trouble = in_the_way(Path(__file__).parent)
    if trouble:
        print(f"Error: {trouble}", file=sys.stderr)
        raise SystemExit(2)
    from experiments.cli import main as furuta

    furuta()


if __name__ == "__main__":
    main()
