"""A second, plain laboratory: model (5) by Lagrange's equations, Runge–Kutta at a tenth of a millisecond, and encoders.

It shares no code with the rest of the bench or with the plant, has no torque noise and no jitter, and rounds its
readings. What a diagnosis finds in its logs, rounding has put there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are

Array = NDArray[np.float64]

STEP = 1e-4  # s, of the integration
SHARPNESS = 100.0  # s/rad, of the friction


@dataclass(frozen=True)
class PlainRig:
    """A rig of model (5): theta (9,) in units of its command, the command's limit, and counts a turn of both
    encoders. cable: torque k (q1 − q1n) on the arm as (k, q1n), (0, 0) for none."""

    theta: tuple[float, ...]
    u_max: float
    counts: int
    cable: tuple[float, float] = (0.0, 0.0)


def a_rig(seed: int) -> PlainRig:
    """A rig drawn from masses, lengths and frictions that stand on desks, small ones as well as large ones."""
    rng = np.random.default_rng(seed)
    length, arm = math.exp(rng.uniform(math.log(0.06), math.log(0.2))), math.exp(rng.uniform(-2.5, -1.4))
    mass = rng.uniform(0.02, 0.12)
    about_end = mass * length**2 * rng.uniform(1.2, 1.5)  # of a rod with its centre at `length`
    hub = mass * arm**2 * rng.uniform(0.4, 2.0)
    weight = mass * 9.81 * length
    u_max = math.exp(rng.uniform(math.log(2.0), math.log(12.0)))
    scale = u_max / (12.0 * weight)  # units of the command for a torque of 1 N·m
    inertia = hub + mass * arm**2
    theta = scale * np.array(
        [
            inertia,
            mass * length**2,
            mass * arm * length,
            about_end,
            weight,
            inertia * rng.uniform(0.5, 3.0),
            about_end * rng.uniform(0.05, 0.3),
            0.0,
            weight * rng.uniform(0.001, 0.01),
        ]
    )
    theta[7] = u_max * rng.uniform(0.01, 0.04)
    return PlainRig(tuple(theta), u_max, int(rng.choice([2048, 4096, 8192])))


def a_log(rig: PlainRig, experiment: str, seed: int, duration: float = 20.0, T: float = 4e-3) -> dict[str, Array]:
    """A recording as columns t, q1, q2, u. experiment: "hanging" (a random multisine), "sweep" (hanging, a sine whose
    frequency rises from 0.5 to 8 Hz, so large that the joints turn fast), "pulses" (hanging, with pauses of 1.5 to 3 s
    in which a sticky arm rests) or "upright" (as hanging, around a state feedback). Raises ValueError for another
    experiment, and if the pendulum is lost."""
    if experiment not in ("hanging", "sweep", "pulses", "upright"):
        raise ValueError(f"experiment {experiment!r} given, expected hanging, sweep, pulses or upright")
    rng = np.random.default_rng([seed, len(experiment)])
    t = np.arange(0.0, duration, T)
    f = rng.uniform(0.3, 4.0, 12)
    wish = sum(np.sin(2 * np.pi * (fi * t + phase)) for fi, phase in zip(f, rng.uniform(0, 1, 12), strict=True))
    up = experiment == "upright"
    wish *= (0.10 if up else 0.12) * rig.u_max / np.std(wish)
    if experiment == "sweep":
        turns = (0.5 + 3.75 * t / duration) * t + rng.uniform()
        wish = 0.3 * rig.u_max * np.sin(2 * np.pi * turns)
    elif experiment == "pulses":
        wish = _pulses(rng, t, rig.u_max)
    x = np.array([rng.uniform(-0.5, 0.5), 0.01 if up else math.pi, 0.0, 0.0])
    K = _feedback(rig) if up else np.zeros(4)
    count = 2 * math.pi / rig.counts
    cable = np.array(rig.cable)
    q, u = _run(np.array(rig.theta), cable, x, t, wish, K, rig.u_max, count, up)
    if not np.isfinite(q).all() or (up and np.abs(q[:, 1]).max() > 1.2):
        raise ValueError("the pendulum is lost")
    return {"t": t, "q1": q[:, 0], "q2": q[:, 1], "u": u}


def _pulses(rng: np.random.Generator, t: Array, u_max: float) -> Array:
    wish, begin = np.zeros_like(t), 0.3
    while begin < t[-1]:
        end = begin + rng.uniform(0.2, 0.5)
        wish[(t >= begin) & (t < end)] = rng.uniform(0.12, 0.35) * u_max * rng.choice([-1, 1])
        begin = end + rng.uniform(1.5, 3.0)
    return wish


def _feedback(rig: PlainRig) -> Array:
    """LQR gain of the upright rig, without its dry friction."""
    a = rig.theta
    M = np.array([[a[0], a[2]], [a[2], a[3]]])
    A, B = np.zeros((4, 4)), np.zeros((4, 1))
    A[:2, 2:] = np.eye(2)
    A[2:, :2] = np.linalg.solve(M, np.diag([0.0, a[4]]))
    A[2:, 2:] = np.linalg.solve(M, -np.diag([a[5], a[6]]))
    B[2:, 0] = np.linalg.solve(M, [1.0, 0.0])
    cost = np.array([[1.0 / rig.u_max**2 * 4.0]])
    X = solve_continuous_are(A, B, np.diag([1.0, 5.0, 0.05, 0.05]), cost)
    return np.linalg.solve(cost, B.T @ X)[0]


@numba.njit(cache=True)
def _rates(x, u, a, cable):
    s, c = math.sin(x[1]), math.cos(x[1])
    m11, m12, m22 = a[0] + a[1] * s * s, a[2] * c, a[3]
    f1 = u - a[5] * x[2] - a[7] * math.tanh(SHARPNESS * x[2]) - cable[0] * (x[0] - cable[1])
    f1 += a[2] * s * x[3] ** 2 - 2.0 * a[1] * s * c * x[2] * x[3]
    f2 = a[4] * s + a[1] * s * c * x[2] ** 2 - a[6] * x[3] - a[8] * math.tanh(SHARPNESS * x[3])
    det = m11 * m22 - m12 * m12
    return np.array([x[2], x[3], (m22 * f1 - m12 * f2) / det, (m11 * f2 - m12 * f1) / det])


@numba.njit(cache=True)
def _run(a, cable, x, t, wish, K, u_max, count, up):
    q, us = np.empty((t.shape[0], 2)), np.empty(t.shape[0])
    v, last = np.zeros(2), np.empty(2)
    steps = round((t[1] - t[0]) / STEP)
    T = t[1] - t[0]
    for k in range(t.shape[0]):
        for i in range(2):
            q[k, i] = count * np.round(x[i] / count)
            if k > 0:
                v[i] += 0.3 * ((q[k, i] - last[i]) / T - v[i])
            last[i] = q[k, i]
        u = wish[k]
        if up:
            u -= K[0] * q[k, 0] + K[1] * q[k, 1] + K[2] * v[0] + K[3] * v[1]
        u = min(max(u, -u_max), u_max)
        us[k] = u
        for _ in range(steps):
            k1 = _rates(x, u, a, cable)
            k2 = _rates(x + 0.5 * STEP * k1, u, a, cable)
            k3 = _rates(x + 0.5 * STEP * k2, u, a, cable)
            k4 = _rates(x + STEP * k3, u, a, cable)
            x = x + STEP / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return q, us
