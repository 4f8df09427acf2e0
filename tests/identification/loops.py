"""Closed-loop logs of known rigs with known torque noise, for tests of what a model misses."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from furuta_gym.plant import PAPER_GAIN, TABLE_3, Effect, Plant
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import simulate
from identification.design.signals import paper_signal
from identification.logs.log import Log

from .rigs import PaperPolicy

TORQUE_NOISE = (3e-7, 1.3e-9)  # {u}² s: a twentieth of the Coulomb friction over 10 ms


def scaled_effect(name: str, size: float = 1.0) -> Effect:
    """The default effect on Table 3 with its size parameters multiplied."""
    effect = TABLE_3.default_effect(name)
    sizes = {p.name for p in effect.type.parameters if p.role == "size"}
    return Effect(name, {k: v * size if k in sizes else v for k, v in effect.parameters.items()})


@lru_cache
def loop_log(
    effect: str | None = None,
    size: float = 1.0,
    T: float = 0.002,
    counts: int = 4096,
    seed: int = 0,
    duration: float = 10.0,
    noise: bool = True,
) -> tuple[Log, Plant]:
    """(log, the plant behind it): Table 3 with an effect in the paper's loop and excitation."""
    plant = TABLE_3 if effect is None else TABLE_3.with_effects(scaled_effect(effect, size))
    run = simulate(
        plant,
        PaperPolicy(T),
        duration,
        T,
        Sensors(counts),
        excitation=paper_signal(tuple(np.random.default_rng(seed).uniform(size=3))),
        torque_noise=TORQUE_NOISE if noise else (0.0, 0.0),
        seed=seed,
        longest_step=5e-4,
    )
    log = Log(
        run.t,
        run.measured[:, 0],
        run.measured[:, 1],
        run.command,
        encoder_counts=(counts, counts),
        controller_gain=tuple(PAPER_GAIN),
        source=f"loop {effect or 'as modelled'}",
    )
    return log, plant
