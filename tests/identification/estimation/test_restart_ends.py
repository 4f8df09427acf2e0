"""Short fits of a restart come to an end, whatever the optimiser does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from identification.estimation import restarts
from identification.estimation.optimise import Expansion, Optimum


class Alone:
    """A problem that has no threads."""

    pool = None

    def alone(self) -> Alone:
        return self


@pytest.mark.timeout(30)
def test_a_start_that_no_longer_improves_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    """A descent that stands still without having converged would otherwise be tried again for ever."""
    tried: list[float] = []

    def stands_still(problem: Any, z: np.ndarray, *_: Any, **__: Any) -> Optimum:
        tried.append(float(z[0]))
        value = 39.0 + float(z[0])
        return Optimum(z, value, Expansion(value, z, np.eye(1)), 1, False, "no further descent")

    monkeypatch.setattr(restarts, "minimise", stands_still)
    best = restarts._best_of(Alone(), [np.array([x]) for x in (0.0, 1.0, 2.0)], 39.0, 0.05)  # type: ignore[arg-type]
    assert best.value == 39.0
    assert len(tried) < 10
