"""Runs and logs of known rigs. Each is made once in a process for its arguments: logs and runs are read-only.

`closed_loop` is the one place that plays the paper's experiment; `paper_log`, `loop_log` and `noisy_log` are its usual
settings. `hanging_log` and `open_loop_log` are recorded without a controller, `bench_log` on the virtual bench, and
`made_log` is no motion at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from experiments.bench import Rig, record
from furuta_gym.plant import PAPER_GAIN, TABLE_3, Effect, Plant
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import Simulation, open_loop, simulate
from identification.design.signals import Chirp, paper_signal
from identification.logs.log import Log

TORQUE_NOISE = (3e-7, 1.3e-9)  # {u}² s: a twentieth of the Coulomb friction over 10 ms


class PaperPolicy:
    """u = −K (q, q̇) with velocities by a filtered difference (pole 100 rad/s), as a rig would have them."""

    def __init__(self, T: float):
        self.T, self.a = T, float(np.exp(-100 * T))
        self.reset()

    def reset(self) -> None:
        self.last, self.v = None, np.zeros(2)

    def __call__(self, y: np.ndarray) -> float:
        if self.last is not None:
            self.v = self.a * self.v + (1 - self.a) * (y - self.last) / self.T
        self.last = y.copy()
        return float(-np.dot(PAPER_GAIN, [y[0], self.v[0], y[1], self.v[1]]))


@cache
def closed_loop(
    plant: Plant = TABLE_3,
    T: float = 0.002,
    duration: float = 10.0,
    counts: int | None = 4096,
    seed: int = 0,
    *,
    phases: bool = True,
    reading_noise: float = 0.0,
    torque_noise: tuple[float, float] = (0.0, 0.0),
    longest_step: float = 2.5e-4,
) -> Simulation:
    """The paper's controller and excitation on a plant. phases: drawn from the seed, else the signal's own."""
    drawn = tuple(np.random.default_rng(seed).uniform(size=3))
    return simulate(
        plant,
        PaperPolicy(T),
        duration,
        T,
        Sensors(counts, reading_noise),
        excitation=paper_signal(drawn) if phases else paper_signal(),
        torque_noise=torque_noise,
        seed=seed,
        longest_step=longest_step,
    )


@cache
def paper_log(
    T: float = 0.002, duration: float = 10.0, counts: int | None = 4096, plant: Plant = TABLE_3, seed: int = 0
) -> tuple[Log, np.ndarray]:
    """(log, true states (n, 4)) of the paper's experiment without any noise; counts None for perfect sensors."""
    run = closed_loop(plant, T, duration, counts, seed)
    return Log.from_run(run, plant.unit, counts), run.state


def scaled_effect(name: str, size: float = 1.0) -> Effect:
    """The default effect on Table 3 with its size parameters multiplied."""
    effect = TABLE_3.default_effect(name)
    sizes = {p.name for p in effect.type.parameters if p.role == "size"}
    return Effect(name, {k: v * size if k in sizes else v for k, v in effect.parameters.items()})


@cache
def loop_log(
    effect: str | None = None,
    size: float = 1.0,
    T: float = 0.002,
    counts: int = 4096,
    seed: int = 0,
    duration: float = 10.0,
    noise: bool = True,
) -> tuple[Log, Plant]:
    """(log, the plant behind it): Table 3 with an effect, known torque noise, and the controller's gain in the log."""
    plant = TABLE_3 if effect is None else TABLE_3.with_effects(scaled_effect(effect, size))
    torque_noise = TORQUE_NOISE if noise else (0.0, 0.0)
    run = closed_loop(plant, T, duration, counts, seed, torque_noise=torque_noise, longest_step=5e-4)
    source = f"loop {effect or 'as modelled'}"
    return Log.from_run(run, plant.unit, counts, source, controller_gain=tuple(PAPER_GAIN)), plant


@cache
def noisy_log(seed: int, plant: Plant = TABLE_3, T: float = 0.002, duration: float = 10.0) -> Log:
    """The paper's experiment with noise of readings and torques, another realisation for each seed."""
    run = closed_loop(
        plant,
        T,
        duration,
        4096,
        seed,
        phases=False,
        reading_noise=2e-4,
        torque_noise=(1e-6, 1e-8),
        longest_step=2e-3,
    )
    return Log.from_run(run, plant.unit, 4096)


@cache
def changing_gain_log(gain: Callable[[float], float], duration: float = 8.0, T: float = 0.004) -> Log:
    """Table 3 under the paper's experiment; the motor gives `gain`(t) times the command that the log has, t seconds
    after its start."""
    loop, signal = PaperPolicy(T), paper_signal()
    clock = iter(np.arange(0.0, 2 * duration, T))

    def motor(y: np.ndarray) -> float:
        t = next(clock)
        return gain(t) * (loop(y) + float(signal(t)))

    run = simulate(TABLE_3, motor, duration, T, Sensors(4096), torque_noise=TORQUE_NOISE, longest_step=5e-4)
    log = Log.from_run(run, TABLE_3.unit, 4096, "sagging.csv")
    return replace(log, t=log.t + 3.0, u=log.u / np.array([gain(t) for t in log.t]))


def hanging_log(plant: Plant = TABLE_3, duration: float = 8.0) -> Log:
    """The plant hanging, driven by a chirp, with coarse sensors and a slow clock (4 ms)."""
    chirp = Chirp(1.5, 0.5, 3.0, duration)
    run = simulate(plant, open_loop(), duration, 0.004, Sensors(2048), excitation=chirp, x0=(0, np.pi, 0, 0))
    return Log.from_run(run, plant.unit, 2048)


def open_loop_log(
    command: ArrayLike,
    q2: float = np.pi,
    torque_noise: tuple[float, float] = (0.0, 0.0),
    seed: int = 0,
    plant: Plant = TABLE_3,
) -> Log:
    """A command played sample by sample (4 ms) from rest at q2 [rad]."""
    command = np.asarray(command, dtype=float)
    T = 0.004
    run = simulate(
        plant, open_loop(command), len(command) * T, T, x0=(0, q2, 0, 0), torque_noise=torque_noise, seed=seed
    )
    return Log.from_run(run, plant.unit, 4096)


def bench_log(rig: Rig, experiment: str = "paper", seed: int = 1, duration: float | None = None) -> Log:
    """What the virtual bench records, whose physics are not the plant's."""
    run = record(rig, experiment, seed, duration)
    return Log(run.t, run.q1, run.q2, run.u, rig.kind.unit, encoder_counts=rig.counts, source=rig.name)


def made_log(n: int = 200, T: float = 0.002, **changes) -> Log:
    """Four smooth signals; no rig moves so, which does not matter where only a Log is needed."""
    t = np.arange(n) * T
    values = {"t": t, "q1": 0.3 * np.sin(7 * t), "q2": 0.2 * np.cos(5 * t), "u": np.sin(3 * t + 0.4)}
    return Log(**(values | changes))
