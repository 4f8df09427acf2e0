"""Run an experiment on a rig and keep what the computer saw, apart from what was true."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from furuta_gym.files import write_whole

from .control import Balance, lqr_gain
from .laboratory import Laboratory
from .named import rig as named_rig
from .programme import EXPERIMENTS, Plan
from .programme import experiment as find_experiment
from .rigs import Rig

BENCH_FALLEN = 0.8  # rad from upright; a rig that shall balance is lost beyond
WOUND = 20.0  # rad of the arm, about three turns: the cable is torn off


class PendulumLost(RuntimeError):
    """The pendulum fell, or the arm turned its cable off; `record` holds what was seen until then."""

    def __init__(self, message: str, record: BenchRecord):
        super().__init__(message)
        self.record = record


class Policy(Protocol):
    """A controller that sees only encoders: readings (q1, q2) [rad] → command."""

    def reset(self) -> None: ...

    def __call__(self, y: Sequence[float]) -> float: ...


@dataclass(frozen=True)
class BenchRecord:
    """A run: time stamps t [s], encoder readings q1, q2 [rad, q2 = 0 upright], command u, excitation d in it: (n,).

    state (n, 4): true q1, q2, q̇1, q̇2. lost_at [s]: when the pendulum was lost, None if it was not.
    `rig.truth()` and `state` are for whoever may know; `write` tells nothing of them.
    """

    t: np.ndarray
    q1: np.ndarray
    q2: np.ndarray
    u: np.ndarray
    d: np.ndarray
    state: np.ndarray
    rig: Rig
    experiment: str
    seed: int
    sample_time: float
    engine: str
    lost_at: float | None = None

    @property
    def truth(self) -> dict[str, Any]:
        """What the log does not tell: parameters, hidden effects, and how the run was made."""
        run = {"experiment": self.experiment, "seed": self.seed, "engine": self.engine, "lost_at": self.lost_at}
        return {**self.rig.truth(), **run}

    def write(self, path: str | Path) -> Path:
        """Write the log as CSV, without any truth. A run that lost the pendulum is refused (ValueError)."""
        if self.lost_at is not None:
            raise ValueError(
                f"this run lost the pendulum at t = {self.lost_at:.2f} s and is not written. Take another seed, "
                "a gentler experiment, or smaller effects."
            )
        return write_log(Path(path), self)

    def write_truth(self, path: str | Path) -> Path:
        """Write the truth as JSON."""
        return write_whole(path, json.dumps(self.truth, ensure_ascii=False, indent=2) + "\n")


def write_log(path: Path, record: BenchRecord) -> Path:
    """The project's log format: comment lines `# key: value`, then t,q1,q2,u."""
    rig = record.rig
    about = {
        "input_unit": rig.kind.unit,
        "pendulum_zero": "upright",
        "encoder_counts": " ".join(str(c) for c in rig.counts),
        "device": rig.name,
    }
    lines = [f"# {key}: {value}" for key, value in about.items()]
    rows = zip(record.t.tolist(), record.q1.tolist(), record.q2.tolist(), record.u.tolist(), strict=True)
    lines += ["t,q1,q2,u", *(f"{t:.9f},{a:.10g},{b:.10g},{u:.10g}" for t, a, b, u in rows)]
    return write_whole(path, "\n".join(lines) + "\n")


def record(
    rig: Rig | str,
    experiment: str = "paper",
    seed: int = 0,
    duration: float | None = None,
    sample_time: float | None = None,
    policy: Policy | None = None,
    noise_free: bool = False,
    allow_lost: bool = False,
) -> BenchRecord:
    """Run an experiment.

    rig: a `Rig` or the name of one ("rig-07"). duration, sample_time [s]: None takes the experiment's and the
    rig's. policy: balances in place of the rig's own controller (which the experiment's excitation is added to).
    noise_free: exact encoders, clock and torques. Equal arguments give equal numbers.

    Raises PendulumLost when the pendulum falls in a balancing experiment, or the arm winds up; with allow_lost the
    run so far is returned with `lost_at` set. ValueError for names and numbers that the bench does not have.
    """
    rig = named_rig(rig) if isinstance(rig, str) else rig
    plan_of = find_experiment(experiment)
    duration = plan_of.duration if duration is None else duration
    if not 0.1 <= duration <= 3600:
        raise ValueError(f"duration {duration} s given, expected 0.1 to 3600 s.")
    if sample_time is not None and not 1e-4 <= sample_time <= 0.05:
        raise ValueError(f"sample_time {sample_time} s given, expected 0.0001 to 0.05 s.")
    if seed < 0:
        raise ValueError(f"seed {seed} given, expected a whole number ≥ 0.")
    rng = np.random.default_rng([seed, list(EXPERIMENTS).index(experiment), 0xE49])
    plan = plan_of.plan(rig.kind, rng, duration)
    lab = Laboratory(rig, seed, noise_free, sample_time)
    loop = _Loop(rig, plan, plan_of.balances, policy)
    n = round(duration / lab.period) + 1
    out = np.empty((n, 9))
    y = lab.reset(plan.start)
    loop.reset()
    lost_at = None
    for k in range(n):
        state = lab.state
        # no computer answers readings that are no numbers
        u, d = loop.command(y, lab.t) if np.isfinite(y).all() else (0.0, 0.0)
        u = min(max(u, -lab.u_max), lab.u_max)
        out[k] = (lab.t, *y, u, d, *state)
        if _lost(state, plan_of.balances):
            lost_at, out = lab.t, out[: k + 1]
            break
        if k + 1 < n:
            y = lab.step(u)
    t, q1, q2, command, excitation = out[:, :5].T
    result = BenchRecord(
        t=t,
        q1=q1,
        q2=q2,
        u=command,
        d=excitation,
        state=out[:, 5:],
        rig=rig,
        experiment=experiment,
        seed=seed,
        sample_time=lab.period,
        engine=lab.engine,
        lost_at=lost_at,
    )
    if lost_at is not None and not allow_lost:
        raise PendulumLost(
            f"{rig.name}, experiment {experiment!r}, seed {seed}: the pendulum was lost at t = {lost_at:.2f} s. "
            "Take another seed or a gentler experiment (dither, paper), or smaller effects.",
            result,
        )
    return result


def _lost(state: np.ndarray, balances: bool) -> bool:
    if not np.isfinite(state).all() or abs(state[0]) > WOUND:
        return True
    return balances and abs(state[1]) > BENCH_FALLEN


class _Loop:
    """The computer: feedback (the rig's own or a policy) plus excitation, or the excitation alone."""

    def __init__(self, rig: Rig, plan: Plan, balances: bool, policy: Policy | None):
        self._plan, self._balances, self._policy = plan, balances, policy
        gain = rig.kind.feedback if rig.controller == "paper" and rig.kind.feedback else lqr_gain(rig.kind)
        self._own = Balance(gain)
        self._last = 0.0

    def reset(self) -> None:
        self._own.reset()
        self._last = -math.inf
        if self._policy is not None:
            self._policy.reset()

    def command(self, y: tuple[float, float], t: float) -> tuple[float, float]:
        """(command, excitation in it)."""
        d = self._plan.excitation(t)
        if self._policy is not None:
            return float(self._policy(y)) + d, d
        if not self._balances:
            return d, d
        u = self._own.command(y, t - self._last, self._plan.reference(t)) + d
        self._last = t
        return u, d
