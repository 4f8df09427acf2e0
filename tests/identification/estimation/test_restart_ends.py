"""Short fits of a restart come to an end, whatever the optimiser does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from identification.estimation import restarts
from identification.estimation.optimise import Expansion, Optimum


class Alone:
    """A problem that has no threads, with V = 0 everywhere."""

    pool = None

    def value(self, z: np.ndarray) -> float:
        return 0.0

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


@pytest.mark.parametrize("lower", [False, True])
def test_what_is_lower_on_a_part_only_takes_no_exact_derivatives(monkeypatch: pytest.MonkeyPatch, lower: bool) -> None:
    """Thinned records have minima of their own. Short fits with frozen gains say whether all records agree."""
    whole, part, exactly = Alone(), Alone(), []

    def ended(value: float) -> Optimum:
        return Optimum(np.zeros(1), value, Expansion(value, np.zeros(1), np.eye(1)), 1, True, "converged")

    def descends(problem: Any, *_: Any, exact: bool = True, **__: Any) -> Optimum:
        if exact:
            exactly.append(problem)
        return ended(-90.0 if problem is part else 50.0 if lower else 150.0)

    found = replace(ended(100.0), converged=False)
    monkeypatch.setattr(restarts, "glimpse_of", lambda problem: part)
    monkeypatch.setattr(restarts, "minimise", descends)
    monkeypatch.setattr(restarts, "_rounds", lambda *_, **__: ended(-90.0))
    again = restarts.restarted(whole, found, 20, 0.05, exact=True)  # type: ignore[arg-type]
    assert again.value == (50.0 if lower else 100.0)
    assert exactly == ([whole] if lower else [])
