"""What somebody who watches a search is told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from identification.diagnosis.naming.fits import FitRequest
from identification.diagnosis.watched import Tried, Watched
from tests.identification.diagnosis.fits import a_fit


def test_fits_of_all_samples_are_told_and_those_of_thinned_ones_are_not() -> None:
    told: list[Tried] = []
    fits = iter([a_fit(value=3.0), a_fit("arm_spring", value=-500.0), a_fit("arm_spring", value=1.0)])
    watched = Watched(lambda _: next(fits), told.append)
    whole: Any = (SimpleNamespace(t=range(400)), SimpleNamespace(t=range(100)))
    thin: Any = (SimpleNamespace(t=range(100)),)
    plant, noise = a_fit().plant, a_fit().noise
    watched(FitRequest(plant, noise, whole, effort="full"))
    watched(FitRequest(plant, noise, thin, effort="coarse"))
    watched(FitRequest(plant, noise, whole, effort="coarse"))
    assert [(t.effects, t.log_likelihood, t.rough) for t in told] == [((), -3.0, False), (("arm_spring",), -1.0, True)]
