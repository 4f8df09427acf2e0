"""What no effect of the library says: a torque on the arm that was learned from logs, as a smooth surface.

A sum of products of cubic B-splines on even knots (de Boor 1978) in the arm's angle and in its speed. The angle is held
at the edge of what the logs visited, and the speed enters through v/√(v² + w²): beyond what was seen the torque stays
what it was there. It is no name, and no search proposes it: `identification.diagnosis.learning` fits it last.
"""

import math
from typing import Any

import numpy as np

from ..compiled import compiled
from .declaration import EffectType, Parameter

ANGLES, SPEEDS = 7, 5
"""Splines in the arm's angle and in its speed."""

COEFFICIENTS = tuple(f"c{i}{j}" for i in range(ANGLES) for j in range(SPEEDS))
"""Names of the coefficients, angle by angle."""


@compiled(forceinline=True)
def spline(d):
    """The cubic B-spline at d knots from its centre."""
    a, b = max(2.0 - abs(d), 0.0), max(1.0 - abs(d), 0.0)
    return (a * a * a - 4.0 * b * b * b) * (1.0 / 6.0)


@compiled(forceinline=True)
def angle_place(q1, low, width):
    """Where an angle [rad] lies among the centres of its splines: from 1 at `low` to ANGLES − 2, held beyond."""
    return 1.0 + (ANGLES - 3) * min(max((q1 - low) / width, 0.0), 1.0)


@compiled(forceinline=True)
def speed_place(v1, w):
    """Where a speed [rad/s] lies among the centres of its splines: between 1 and SPEEDS − 2."""
    return 1.0 + (SPEEDS - 3) * 0.5 * (1.0 + v1 / math.sqrt(v1 * v1 + w * w))


@compiled(nogil=True)
def surface_columns(q1, v1, low, width, w):
    """Every product of splines along a motion q1, v1 (N,): (N, ANGLES SPEEDS), in the order of COEFFICIENTS."""
    out = np.empty((len(q1), ANGLES * SPEEDS))
    for k in range(len(q1)):
        x, y = angle_place(q1[k], low, width), speed_place(v1[k], w)
        for i in range(ANGLES):
            for j in range(SPEEDS):
                out[k, i * SPEEDS + j] = spline(x - i) * spline(y - j)
    return out


def _torque() -> Any:
    """The kernel, written out: a kernel's arguments are numbers."""
    angles = [f"spline(x - {i}.0)" for i in range(ANGLES)]
    rows = [" + ".join(f"s{j} * c{i}{j}" for j in range(SPEEDS)) for i in range(ANGLES)]
    lines = [f"def torque(q1, v1, low, width, w, {', '.join(COEFFICIENTS)}):"]
    lines += ["    x, y = angle_place(q1, low, width), speed_place(v1, w)"]
    lines += [f"    s{j} = spline(y - {j}.0)" for j in range(SPEEDS)]
    lines += [f"    return {' + '.join(f'{a} * ({r})' for a, r in zip(angles, rows, strict=True))}, 0.0"]
    names: dict[str, Any] = {
        "spline": spline,
        "angle_place": angle_place,
        "speed_place": speed_place,
        "__name__": __name__,
    }
    exec(compile("\n".join(lines), __file__, "exec"), names)
    return names["torque"]


LEARNED_EFFECTS = (
    EffectType(
        name="arm_learned",
        title="a torque on the arm that was learned, and has no name",
        place="arm",
        equation="arm: Σ c_ij B_i(q1) B_j(q̇1 / √(q̇1² + w²)), B cubic B-splines",
        symptom="named effects leave an error that goes with the arm's angle and speed",
        says=lambda low, width: (
            f"A torque that has no name, learned over {width} of the arm's angle from {low}, acts on it"
        ),
        parameters=(
            Parameter("low", "rad", "least angle of the arm that was seen", -1.0, role="shape"),
            Parameter("width", "rad", "range of angles that were seen", 2.0, lower=1e-6, role="shape"),
            Parameter("w", "rad/s", "half of the speeds that were seen are below", 1.0, lower=1e-6, role="shape"),
            *(Parameter(name, "{u}", "coefficient of a product of splines", 0.0) for name in COEFFICIENTS),
        ),
        kernels={"torque": _torque()},
        learned=True,
    ),
)
