"""Many trials at once: one controller on many rigs side by side, all sampled as `furuta_gym.simulation` samples one."""

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.arguments import ArgumentError
from furuta_gym.envs.options import SAMPLE_TIME
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import Plant
from furuta_gym.plant.advance import advance
from furuta_gym.plant.parameters import pendulum_frequency
from furuta_gym.plant.plant_file import ARM_TRAVEL
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import LONGEST_STEP, check_clock, integration_step

from ..base import Controller
from .seeds import BUILT_SEED, judging

HORIZONTAL = np.pi / 2  # rad from upright; from below it only a swing-up brings the pendulum back
CALM = 0.05  # rad; a pendulum has settled after a push when it stays within
QUIET = 0.5  # s at the end of a trial; one that leaves `CALM` in them has not settled, it may go on for ever
PUSH_LENGTH = 0.02  # s
UPRIGHT = 0.2  # rad; swung up while within
HOLD = 5.0  # s at the end of a swing-up trial, all of which must be upright

Lanes = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class Starts:
    """How L trials begin and what hits them.

    x0 (4, L): q1, q2, q̇1, q̇2. push (L,) [rad/s]: the change of q̇2 that a tap on the pendulum makes upright, spread
    over 20 ms from push_time (L,) [s] on.
    """

    x0: NDArray[np.float64]
    push: NDArray[np.float64]
    push_time: NDArray[np.float64]

    @property
    def lanes(self) -> int:
        return self.x0.shape[1]


def start_angle(travel: float) -> float:
    """Largest |q1| [rad] at which a trial begins, where the arm may turn by `travel` [rad] to either side."""
    return min(0.5, 0.25 * travel)


def balance_starts(
    plant: Plant,
    n: int,
    duration: float,
    rng: np.random.Generator,
    push: float | NDArray[np.float64] | None = None,
    travel: float = ARM_TRAVEL,
) -> Starts:
    """n starts near upright, and a push to a random side at 40 to 60 % of the duration.

    |q1| ≤ 0.5 rad (at most a quarter of `travel` [rad]), |q2| ≤ 0.1 rad, |q̇1| and |q̇2| ≤ 0.1 ω; push [rad/s], by
    default 0.2 ω. ω is the pendulum's frequency, which makes speeds comparable between rigs.
    """
    w = pendulum_frequency(plant.theta)
    x0 = rng.uniform(-1, 1, (4, n)) * np.array([[start_angle(travel)], [0.1], [0.1 * w], [0.1 * w]])
    size = 0.2 * w if push is None else push
    return Starts(x0, size * rng.choice([-1.0, 1.0], n), duration * rng.uniform(0.4, 0.6, n))


def swing_up_starts(n: int, rng: np.random.Generator, travel: float = ARM_TRAVEL) -> Starts:
    """n starts that hang: |q1| ≤ 0.5 (at most a quarter of `travel` [rad]), |q2 − π| ≤ 0.1 rad, |q̇1|, |q̇2| ≤ 0.1 rad/s,
    no push."""
    x0 = rng.uniform(-1, 1, (4, n)) * np.array([[start_angle(travel)], [0.1], [0.1], [0.1]])
    x0[1] += np.pi
    return Starts(x0, np.zeros(n), np.zeros(n))


@dataclass(frozen=True)
class Outcome:
    """What happened in L trials, arrays (L,). Where a trial failed, only `success`, `failed_at` and `left_travel`
    mean something.

    rms_q1, rms_q2 [rad] over the whole trial (swing-up: over the holding time at its end); energy ∫u² dt [{u}² s];
    roughness: mean |Δu|/T [{u}/s]; settling [s]: from the push until |q2| stays below 0.05 rad, NaN where it does
    not for the last 0.5 s (swing-up: from the start, or the push, until it stays below 0.2 rad from upright);
    largest_q1 [rad]. left_travel: whether it failed
    because the arm left its travel.
    """

    success: NDArray[np.bool_]
    failed_at: NDArray[np.float64]
    rms_q1: NDArray[np.float64]
    rms_q2: NDArray[np.float64]
    energy: NDArray[np.float64]
    roughness: NDArray[np.float64]
    settling: NDArray[np.float64]
    largest_q1: NDArray[np.float64]
    left_travel: NDArray[np.bool_]


def as_lanes(policy: Any, lanes: int) -> Lanes:
    """`policy`, started anew, for (2, L) readings: a `Controller` as it is, any other policy as L copies."""
    if isinstance(policy, Controller):
        one = copy.deepcopy(policy)
        one.reset()
        return one
    copies = [copy.deepcopy(policy) for _ in range(lanes)]
    for one in copies:
        if hasattr(one, "reset"):
            one.reset()
    return lambda y: np.array([one(y[:, k]) for k, one in enumerate(copies)])


def pack(plants: Sequence[Plant]) -> tuple[NDArray[np.float64], NDArray[np.int64], int]:
    """(P, codes, rows of X) of plants that carry the same effects, for the compiled lanes; P (n, L).

    Raises ValueError if their effects differ.
    """
    packed = [plant.packed() for plant in plants]
    codes = packed[0].codes
    if any(p.codes.shape != codes.shape or (p.codes != codes).any() for p in packed):
        raise ValueError("plants that run side by side must carry the same effects, in the same order")
    return np.ascontiguousarray(np.stack([p.p for p in packed], axis=1)), codes, packed[0].rows


def plants_off_by(share: float, plant: Plant, n: int, rng: np.random.Generator) -> list[Plant]:
    """n plants whose θ is each off by a random factor, log-normal with standard deviation `share`."""
    drawn: list[Plant] = []
    while len(drawn) < n:
        theta = plant.theta * np.exp(share * rng.standard_normal(9))
        th1, th2, th3, th4 = theta[:4]
        if th1 * th4 > 1.05 * th3 * th3 and th1 + th2 > 0:  # a mass matrix well away from singular
            drawn.append(plant.replace(theta=theta))
    return drawn


def built_plants(share: float, plant: Plant, n: int, seed: int) -> list[Plant]:
    """n rigs that could be built: masses, lengths, inertias, frictions and gain each off by up to `share`."""
    # of the env's own clock: what is drawn does not depend on it, and a plant may be sampled faster than an env can be
    batch = FurutaVectorEnv(n, plant, "swing_up", sample_time=SAMPLE_TIME, randomize={"theta": f"physical:{share:g}"})
    batch.reset(seed=judging(BUILT_SEED, seed))
    return batch.plants()


def run_trials(
    plant: Plant | Sequence[Plant],
    policy: Any,
    starts: Starts,
    duration: float,
    sample_time: float,
    sensors: Sensors | None = None,
    *,
    swing_up: bool = False,
    arm_travel: float | None = None,
    hold: float = HOLD,
    seed: int = 0,
) -> Outcome:
    """Play `policy` in every trial of `starts`, on one plant or on one plant for each trial.

    A balance trial succeeds if |q2| never passes π/2; a swing-up trial if the last `hold` seconds are all within
    0.2 rad of upright. In both the arm must stay within `arm_travel` [rad], by default its plant's limit or 2π. It must
    turn no faster than its plant's limit `arm_speed`. sensors: default is what the plants say, else 4096 counts. Noise
    depends on `seed` and the number of trials only, so every policy meets the same. Raises ValueError where plants
    differ in their effects or, without `sensors`, in these.
    """
    L, T = starts.lanes, sample_time
    plants = [plant] * L if isinstance(plant, Plant) else list(plant)
    if len(plants) != L:
        raise ValueError(f"{L} trials need one plant or {L}, got {len(plants)}")
    check_clock(policy, T)
    n = round(duration / T)
    if n < 1 or (swing_up and duration <= hold):
        least = f"more than the {hold:g} s that it must stay up" if swing_up else f"at least one sample of {T:g} s"
        raise ArgumentError("duration", f"{duration:g} s", f"expected {least}")
    if sensors is None:
        sensors, *others = {Sensors.of_file(p.sensors) for p in plants}
        if others:
            raise ArgumentError("sensors", "None", "the plants differ in them; expected those of all trials")
    rng = np.random.default_rng(seed)
    control = as_lanes(policy, L)
    P, codes, rows = pack(plants)
    h_max = min(integration_step(p, LONGEST_STEP, T) for p in plants)
    supply = np.array([p.supply for p in plants])
    slew = np.array([p.limit("slew", np.inf) for p in plants]) * T
    impulse = starts.push * (P[0] * P[3] - P[2] ** 2) / P[0]  # 1/(M⁻¹)₂₂ upright
    first_push, push_samples = np.round(starts.push_time / T), max(1, round(PUSH_LENGTH / T))
    X = np.zeros((rows, L))
    X[:4] = starts.x0
    U, W, t = np.zeros((n + 1, L)), np.zeros((2, L)), np.arange(n + 1) * T
    held = np.concatenate([[-np.inf], t[:n]])  # nothing is commanded before the trial
    travel = np.array([p.limit("arm_travel", ARM_TRAVEL) if arm_travel is None else arm_travel for p in plants])
    speed = np.array([p.limit("arm_speed", np.inf) for p in plants])
    score = Score(T, n, starts.push_time, travel, speed, hold if swing_up else None)
    for k in range(n):
        if not score.watch(k, X):
            break
        u = np.clip(control(sensors.read(X, P, codes, rng)), -supply, supply)
        u = np.clip(u, U[k] - slew, U[k] + slew)
        U[k + 1] = np.where(score.alive, u, 0.0)
        W[1] = impulse / (push_samples * T) * ((k >= first_push) & (k < first_push + push_samples))
        advance(X, t[k], t[k + 1], held, U, k + 1, W, P, codes, h_max)
    else:
        score.watch(n, X)
    return score.outcome(U[1:])


class Score:
    """Adds up a batch of trials while it runs."""

    def __init__(
        self,
        T: float,
        n: int,
        push_time: NDArray[np.float64],
        arm_travel: NDArray[np.float64],
        arm_speed: NDArray[np.float64],
        hold: float | None,
    ) -> None:
        L = push_time.size
        self.T, self.n, self.swing_up = T, n, hold is not None
        self.arm_travel, self.arm_speed = arm_travel, arm_speed
        self.alive = np.ones(L, dtype=bool)
        self.failed_at = np.full(L, np.inf)
        self.left_travel = np.zeros(L, dtype=bool)
        self.settled = np.zeros(L)
        self.push_time = push_time
        self.hold_from = n - round(hold / T) if hold is not None else 0
        self.sum1, self.sum2, self.largest = np.zeros(L), np.zeros(L), np.zeros(L)

    def watch(self, k: int, X: NDArray[np.float64]) -> bool:
        """Take in the states at sample k; failed trials are stopped. Whether any trial goes on."""
        q1 = np.abs(X[0])
        q2 = np.abs(X[1] - 2 * np.pi * np.round(X[1] / (2 * np.pi))) if self.swing_up else np.abs(X[1])
        limit = (UPRIGHT if k >= self.hold_from else np.inf) if self.swing_up else HORIZONTAL
        kept = q1 <= self.arm_travel
        good = kept & (np.abs(X[2]) <= self.arm_speed) & (q2 <= limit)  # False for NaN too
        lost = self.alive & ~good
        if lost.any():
            self.failed_at[lost] = k * self.T
            self.left_travel[lost] = ~kept[lost]
            self.alive &= good
        X[:, ~self.alive] = 0.0  # keeps stopped trials from running off to infinity
        since = (k + 1) * self.T - self.push_time
        restless = (q2 > (UPRIGHT if self.swing_up else CALM)) & (since > 0)
        self.settled[restless] = since[restless]
        np.maximum(self.largest, q1, out=self.largest, where=self.alive)
        if k >= self.hold_from:
            self.sum1 += q1 * q1
            self.sum2 += q2 * q2
        return bool(self.alive.any())

    def outcome(self, U: NDArray[np.float64]) -> Outcome:
        count = self.n + 1 - self.hold_from
        restless = (self.settled > 0) & (self.push_time + self.settled > (self.n + 1) * self.T - QUIET)
        return Outcome(
            success=self.alive,
            failed_at=self.failed_at,
            rms_q1=np.sqrt(self.sum1 / count),
            rms_q2=np.sqrt(self.sum2 / count),
            energy=(U**2).sum(axis=0) * self.T,
            roughness=np.abs(np.diff(U, axis=0)).mean(axis=0) / self.T,
            settling=self.settled if self.swing_up else np.where(restless, np.nan, self.settled),
            largest_q1=self.largest,
            left_travel=self.left_travel,
        )
