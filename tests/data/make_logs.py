"""Record the German logs on the virtual bench: `python -m tests.data.make_logs`.

One rig with a cable, as a laboratory in Germany would log it: decimal commas between semicolons, degrees, milliseconds,
q2 = 0 hanging and counted the other way round, comments above, Windows line ends, in Latin-1. The logs are committed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from experiments.bench import HiddenEffect, Rig, record

FOLDER = Path(__file__).parent
RIG = Rig("servo", (HiddenEffect("arm_spring", 2.0, "bench"),), individual=11, scatter=0.08, sample_time=4e-3)
RUNS = {"versuch1.csv": ("hanging-chirp", 21), "versuch2.csv": ("wide", 22)}
DURATION = 8.0  # s


def main() -> None:
    for name, (experiment, seed) in RUNS.items():
        run = record(RIG, experiment, seed, DURATION)
        arm, pendulum = np.degrees(run.q1), np.degrees(np.pi - run.q2)
        head = [
            "# Prüfstand 3: Furuta-Pendel",
            "# Versuch vom 14.03.2025, Anregung vom Rechner",
            f"# Geber: {RIG.counts[0]} Striche je Umdrehung",
            "Zeit [ms];Arm [°];Pendel [°];Spannung [V]",
        ]
        rows = zip(1e3 * run.t, arm, pendulum, run.u, strict=True)
        lines = [f"{t:.3f};{a:.4f};{p:.4f};{u:.4f}".replace(".", ",") for t, a, p, u in rows]
        (FOLDER / name).write_bytes("\r\n".join([*head, *lines, ""]).encode("latin-1"))


if __name__ == "__main__":
    main()
