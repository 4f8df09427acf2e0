"""Controllers inside their envelope: in Python, and as compiled C that plays the same rows of readings."""

import shutil
import subprocess
from pathlib import Path

import numpy as np

from controllers import make_controller
from controllers.envelope import REASONS, Envelope, Guarded
from furuta_gym.plant import QUBE

COMPILER = shutil.which("gcc") or shutil.which("cc") or shutil.which("clang")
MAIN = """\
#include <stdio.h>
#include "c.h"
int main(void)
{
    c_state s;
    int again;
    double q1, q2, r;
    c_reset(&s);
    while (scanf("%d %lf %lf %lf", &again, &q1, &q2, &r) == 4) {
        if (again) c_reset(&s);
        printf("%.17g", (double)c_step(&s, (REAL)q1, (REAL)q2, (REAL)r));
        printf(" %d\\n", s.off);
    }
    return 0;
}
"""


def compiled(header: str, folder: Path, real: str) -> Path:
    (folder / "c.h").write_text(header)
    (folder / "main.c").write_text(MAIN.replace("REAL", real))
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic", "-ffp-contract=off"]
    subprocess.run([str(COMPILER), *flags, "-o", folder / "c", folder / "main.c", "-lm"], check=True, timeout=60)
    return folder / "c"


def played(program: Path, rows: list[tuple[int, float, float, float]]) -> tuple[np.ndarray, np.ndarray]:
    text = "\n".join(f"{a} {x!r} {y!r} {r!r}" for a, x, y, r in rows)
    out = subprocess.run([program], input=text, capture_output=True, text=True, check=True, timeout=60).stdout
    numbers = np.array([line.split() for line in out.splitlines()], dtype=float)
    assert len(numbers) == len(rows)
    return numbers[:, 0], numbers[:, 1].astype(int)


def in_python(controller, envelope, rows):
    """Commands and reasons of the same rows from the controller in Python."""
    inside = Guarded(controller, envelope)
    ours, reasons = [], []
    for again, q1, q2, reference in rows:
        if again:
            inside.reset()
        controller.reference = reference
        ours.append(inside((q1, q2)))
        reasons.append(REASONS.index(inside.off))
    return np.array(ours), reasons


def guarded(**changes):
    controller = make_controller("dlqr", QUBE.replace(limits=None), 0.004)
    return Guarded(controller, Envelope.of(controller, **changes))
