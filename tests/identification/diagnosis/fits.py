"""Fits, suspects and rankings made by hand: what the search decides on, without the search."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from furuta_gym.plant import TABLE_3
from identification.diagnosis.naming.search import Suspect
from identification.kalman.noise_model import Noise


def a_fit(*effects: str, value: float = 0.0) -> Any:
    plant = TABLE_3.with_effects(*(TABLE_3.default_effect(name) for name in effects))
    return SimpleNamespace(plant=plant, noise=Noise((1.0, 1.0)), value=value, samples=1000, records=())


def ranked(*suspects: tuple[str, float], fit: Any) -> tuple[Suspect, ...]:
    return tuple(Suspect(name, net + 5.0, net, fit) for name, net in suspects)
