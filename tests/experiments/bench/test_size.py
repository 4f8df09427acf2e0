"""How plain a hidden effect is: the fit behind it stays among rigs, whatever the effect does to the log."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.bench import HiddenEffect, Rig, effect_size
from experiments.bench.size import _Windows


def test_the_refit_stays_among_rigs(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cable far beyond any rig's drove friction to ten thousand times its value, where a replay takes minutes."""
    reached = [0.0]
    plain = _Windows._residual

    def watched(self: _Windows, x0: np.ndarray, log_theta: np.ndarray) -> np.ndarray:
        reached.append(float(np.abs(log_theta).max()))
        return plain(self, x0, log_theta)

    monkeypatch.setattr(_Windows, "_residual", watched)
    rig = Rig(
        "desk", individual=3029149, scatter=0.1, effects=[HiddenEffect("arm_taut_cable", 1.927, "bench", 3410736)]
    )
    assert effect_size(rig, "wide", 3880095, 20.0).ratio > 10.0
    assert 1.0 < max(reached) <= 4.0 + 1e-3  # and a step of the differences
