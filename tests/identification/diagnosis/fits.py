"""Fits, suspects and rankings made by hand: what the search decides on, without the search."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from furuta_gym.plant import TABLE_3
from identification.diagnosis.naming.search import Suspect


def a_fit(*effects: str, value: float = 0.0) -> Any:
    plant = TABLE_3.with_effects(*(TABLE_3.default_effect(name) for name in effects))
    return SimpleNamespace(plant=plant, noise=np.ones(4), value=value, samples=1000, records=())


def ranked(*suspects: tuple[str, float], fit: Any) -> tuple[Suspect, ...]:
    return tuple(Suspect(name, net + 5.0, net, fit) for name, net in suspects)
