"""The figures of `compare` for a run that was measured: what a controller did on the rig itself."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from furuta_gym.plant.plant_file import ARM_TRAVEL

from .trials import HOLD, Score

_ROUNDING = 1e-9  # of a duration
_LONGEST_GAP = 0.1  # s; over longer ones no figure can be taken


@dataclass(frozen=True)
class RunFigures:
    """Figures of one run, as `Outcome` has them for trials, from readings in place of states.

    success: whether the pendulum stayed within a right angle of upright and the arm within its travel (swing-up: the
    pendulum upright during the last 5 s). failed_at [s]: from the beginning, or None. why: it failed, "arm" (beyond its
    travel), "speed" (of the arm), "tilt", or "not upright" (at the end of a swing-up). rms_q1, rms_q2 [rad]: up to a
    failure or over the whole run (swing-up: over its last 5 s). mean_q1 [rad]: over the same, what the arm is off by
    for good, which rms_q1 contains. energy: ∫u² dt [{u}² s]. roughness: mean |Δu|/T [{u}/s]. settling [s]: from the
    beginning until |q2| stays below 0.05 rad (swing-up: 0.2 rad), None where it does not. largest_q1 [rad].
    """

    success: bool
    failed_at: float | None
    why: str | None
    rms_q1: float
    rms_q2: float
    mean_q1: float
    energy: float
    roughness: float
    settling: float | None
    largest_q1: float

    def __str__(self) -> str:
        ends = "to the end" if self.failed_at is None else f"for {self.failed_at:.2f} s ({self.why})"
        settled = "not settled" if self.settling is None else f"settled after {self.settling:.2f} s"
        return (
            f"held {ends}; rms q1 {self.rms_q1:.3f} rad (mean {self.mean_q1:+.3f}), rms q2 {self.rms_q2:.4f} rad, "
            f"energy {self.energy:.3g}, roughness {self.roughness:.3g}, {settled}"
        )


def run_figures(
    t: ArrayLike,
    q1: ArrayLike,
    q2: ArrayLike,
    u: ArrayLike,
    *,
    swing_up: bool = False,
    arm_travel: float = ARM_TRAVEL,
    arm_speed: float = np.inf,
    count: float = 0.0,
) -> RunFigures:
    """Figures of a run with stamps t (N,) [s], readings q1, q2 (N,) [rad], q2 = 0 upright, and commands u (N,).

    The columns of a `Log` fit: `run_figures(log.t, log.q1, log.q2, log.u)`. arm_travel [rad]: to either side. Beyond it
    the run has failed, and where the arm is faster than arm_speed [rad/s] from one sample to the next, by more than a
    count [rad] of its encoder. Encoder noise is part of what is read. Raises ValueError for columns of different
    lengths, what is not finite, a clock with gaps of more than 0.1 s, and runs that are too short. Over shorter gaps
    angles are taken on a line and the command as held.
    """
    t, y, u = np.asarray(t, dtype=float), np.array([q1, q2], dtype=float), np.asarray(u, dtype=float)
    T = _sample_time(t, y, u)
    y, u = _evenly(t, y, u, T)
    if swing_up and len(u) * T <= (1.0 + _ROUNDING) * HOLD:
        raise ValueError(
            f"the run lasts {len(u) * T:.3g} s; expected more than the {HOLD:g} s that it must stay upright"
        )
    n = len(u) - 1
    speed = np.maximum(np.abs(np.diff(y[0], prepend=y[0, 0])) - count, 0.0) / T
    score = Score(T, n, np.zeros(1), np.full(1, arm_travel), np.full(1, arm_speed), HOLD if swing_up else None)
    lost = 0
    for k in range(n + 1):
        lost = k
        if not score.watch(k, np.array([[y[0, k]], [y[1, k]], [speed[k]], [0.0]])):
            break
    found = score.outcome(u[: n + 1, None])
    settling = float(found.settling[0])
    failed = None if found.success[0] else float(found.failed_at[0])
    last = n + 1 if failed is None else max(1, round(failed / T))
    used = slice(0 if failed is not None else score.hold_from, last)
    upright = np.remainder(y[1, used] + np.pi, 2 * np.pi) - np.pi if swing_up else y[1, used]
    return RunFigures(
        success=failed is None,
        failed_at=failed,
        why=None if failed is None else _why(y[:, lost], speed[lost], arm_travel, arm_speed, swing_up),
        rms_q1=float(np.sqrt(np.mean(y[0, used] ** 2))),
        rms_q2=float(np.sqrt(np.mean(upright**2))),
        mean_q1=float(np.mean(y[0, used])),
        energy=float(np.sum(u[:last] ** 2) * T),
        roughness=float(np.mean(np.abs(np.diff(u[:last]))) / T) if last > 1 else 0.0,
        settling=settling if failed is None and np.isfinite(settling) else None,
        largest_q1=float(np.max(np.abs(y[0, :last]))),
    )


def _why(y: NDArray[np.float64], speed: float, arm_travel: float, arm_speed: float, swing_up: bool) -> str:
    """Why a run failed at these readings (2,)."""
    if abs(y[0]) > arm_travel:
        return "arm"
    if speed > arm_speed:
        return "speed"
    return "not upright" if swing_up else "tilt"


def _sample_time(t: NDArray[np.float64], y: NDArray[np.float64], u: NDArray[np.float64]) -> float:
    """The run's sample time [s]; ValueError where there is none for all of it."""
    if t.ndim != 1 or y.shape != (2, t.size) or u.shape != t.shape:
        raise ValueError(f"expected four columns of one length, got t {t.shape}, q1 and q2 {y.shape[1:]}, u {u.shape}")
    if t.size < 3:
        raise ValueError(f"a run of {t.size} samples has no figures; expected 3 or more")
    if not (np.isfinite(t).all() and np.isfinite(y).all() and np.isfinite(u).all()):
        raise ValueError("the run has values that are not finite; cut them out, or read it by identification.read_log")
    steps = np.diff(t)
    T = float(np.median(steps))
    if not steps.min() > 0:
        raise ValueError("the clock does not rise from sample to sample")
    if steps.max() > max(_LONGEST_GAP, 1.5 * T):
        raise ValueError(
            f"the clock has a step of {steps.max():.3g} s among steps of {T:.3g} s; give a part without gaps of more "
            f"than {_LONGEST_GAP:g} s"
        )
    return T


def _evenly(
    t: NDArray[np.float64], y: NDArray[np.float64], u: NDArray[np.float64], T: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Readings (2, M) and commands (M,) every T seconds: between lost samples angles on a line, the command held."""
    even = t[0] + T * np.arange(round((t[-1] - t[0]) / T) + 1)
    held = np.clip(np.searchsorted(t, even + 0.5 * T) - 1, 0, t.size - 1)
    return np.array([np.interp(even, t, angle) for angle in y]), u[held]
