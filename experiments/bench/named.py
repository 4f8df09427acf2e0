"""The named rigs: rig-01 … rig-NN. A name tells nothing of what its rig hides; the assignment is fixed."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .effects import catalogue
from .rigs import HiddenEffect, Rig

_PAIRS = (
    ("arm_stribeck", "actuator_lag"),
    ("input_offset", "pendulum_quadratic_drag"),
    ("input_dead_zone", "pendulum_encoder_offset"),
    ("arm_spring", "arm_stribeck"),
    ("base_tilt", "input_dead_zone"),
    ("arm_ripple", "input_delay"),
)
_KINDS = ("table3", "servo", "workshop", "desk")
_SHUFFLE = 20_180_417  # fixes which name hides what; another number would be another bench


def _plain(kind: str, number: int, effects: tuple[HiddenEffect, ...], **more) -> Rig:
    return Rig(kind, effects, individual=number, scatter=0.08, **more)


@lru_cache
def _rigs() -> dict[str, Rig]:
    specs: list[tuple[tuple[HiddenEffect, ...], dict]] = []
    for number, e in enumerate(catalogue().values()):
        form = e.forms()[number % len(e.forms())]
        specs.append(((HiddenEffect(e.name, form=form, variation=number + 1),), {}))
    for number, pair in enumerate(_PAIRS):
        specs.append((tuple(HiddenEffect(name, variation=number + 1) for name in pair), {}))
    specs += [((), {}), ((), {}), ((), {"encoder_noise": 3e-4}), ((), {"friction": "hard"})]
    rng = np.random.default_rng(_SHUFFLE)
    order = rng.permutation(len(specs))
    rigs = {}
    for place, which in enumerate(order):
        effects, more = specs[which]
        name = f"rig-{place + 1:02d}"
        jitter = float(rng.choice([0.0, 0.0, 0.03]))
        kind = _KINDS[int(rng.integers(len(_KINDS)))]
        rigs[name] = _plain(kind, int(rng.integers(1, 10_000)), effects, clock_jitter=jitter, name=name, **more)
    return rigs


def list_rigs() -> tuple[str, ...]:
    """Names of the rigs, in order."""
    return tuple(_rigs())


def rig(name: str) -> Rig:
    """A rig by name; ValueError says which there are."""
    rigs = _rigs()
    if name not in rigs:
        names = list(rigs)
        raise ValueError(f"unknown rig {name!r}. Expected {names[0]} … {names[-1]}; see `furuta bench list`.")
    return rigs[name]
