"""Kill -9 at random moments, full disks and read-only folders, for every command that writes.

    python -m experiments.studies.hard_use --kills 100 -o out/hard_use

A command's result must be the old one or the new one, whole, every time; nothing may run on, and the same command
must work again afterwards and leave nothing of the others behind. Without the right to mount a small file system, a
full disk is a limit on the size of files (RLIMIT_FSIZE), and the read-only disk is left out.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from furuta_gym.files import write_whole

from .cases import CASES
from .disks import full_disk
from .kills import kill_at_random
from .laboratory import Laboratory, Outcome


def study(
    names: Sequence[str], kills: int, disks: bool, seed: int, say: Callable[[str], None] = print
) -> dict[str, dict[str, Any]]:
    """What came of each command: {name: {"kills": …, "disk": …}}."""
    found: dict[str, dict[str, Any]] = {}
    for number, name in enumerate(names):
        draw = random.Random(f"{seed} {number}")
        results = found[name] = {}
        runs: list[tuple[str, Callable[[Laboratory], Outcome]]] = []
        if kills:
            runs.append(("kills", lambda lab, n=name, d=draw: kill_at_random(lab, n, CASES[n], kills, d)))
        if disks:
            runs.append(("disk", lambda lab, n=name: full_disk(lab, n, CASES[n])))
        for kind, run in runs:
            with tempfile.TemporaryDirectory(prefix="hard-use-") as room:
                outcome = run(Laboratory(Path(room) / "room"))
            results[kind] = outcome.to_dict()
            counts = ", ".join(f"{n} {what}" for what, n in sorted(outcome.counts.items()))
            say(f"{name}, {kind}: {counts or 'nothing run'}; {len(outcome.faults)} faults")
            for fault in outcome.faults[:5]:
                say(f"    {fault}")
    return found


def main() -> int:
    """Exit code 1 where something happened that may not."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commands", nargs="*", choices=[[], *CASES], help="default: all")
    parser.add_argument("--kills", type=int, default=100, help="kills of each command")
    parser.add_argument("--no-disks", action="store_true", help="leave the full and read-only disks out")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/hard_use"))
    options = parser.parse_args()
    names = options.commands or list(CASES)
    found = study(names, options.kills, not options.no_disks, options.seed, lambda line: print(line, flush=True))
    write_whole(options.output / "results.json", json.dumps(found, ensure_ascii=False, indent=2) + "\n")
    return int(any(part["faults"] for parts in found.values() for part in parts.values()))


if __name__ == "__main__":
    sys.exit(main())
