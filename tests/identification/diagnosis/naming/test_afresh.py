"""Fits of every effect from the logs' own starts, and the torque of one effect beside another's."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification.diagnosis.added_torque import added_torque, motion_of
from identification.diagnosis.naming.afresh import afresh, cost
from identification.diagnosis.naming.fits import Fit, FitRequest, fit
from identification.diagnosis.naming.forward import START_NOISE
from identification.diagnosis.naming.search import Search
from identification.diagnosis.naming.suspects import price
from identification.estimation.start import Start, candidates
from identification.kalman.record import stretches
from tests.factories import loop_log, noisy_log

ONLY = ("arm_spring", "arm_stribeck", "input_offset", "input_gain_asymmetry", "pendulum_stribeck")


@pytest.fixture(scope="module")
def strong():
    """A log of a motor that has a quarter of its strength one way, and model (5) at a θ that this dragged away."""
    plant = TABLE_3.with_effects(Effect("input_gain_asymmetry", {"a": -0.6}))
    log = noisy_log(1, plant)
    records = [s.record for s in stretches([log])]
    anchor = TABLE_3.replace(theta=TABLE_3.theta * [2.3, 0.1, 0.15, 0.15, 0.15, 10.0, 0.05, 0.1, 0.2])
    return log, fit(FitRequest(anchor, START_NOISE, records, anchor=anchor, iterations=4, effort="coarse")), anchor


def test_a_strong_effect_is_found_where_model_5_is_far_away(strong):
    log, nominal, anchor = strong
    fits = afresh(nominal, candidates([log], TABLE_3), Search(anchor, ONLY), None, ())
    assert len(fits) == 3
    assert min(fits, key=lambda name: cost(fits[name])) == "input_gain_asymmetry"
    found = fits["input_gain_asymmetry"]
    (effect,) = found.plant.effects
    assert effect.name == "input_gain_asymmetry"
    assert effect.parameters["a"] == pytest.approx(-0.6, abs=0.02)
    assert found.records == nominal.records
    assert cost(found) == pytest.approx(found.value + price(effect.name, found.samples))
    assert cost(found) < cost(nominal) - 100.0


def test_what_cannot_catch_up_with_a_known_fit_costs_less(strong):
    """Beside the right effect's fit, the others are given up early; without it the best of them are followed."""
    log, nominal, anchor = strong
    starts, right = candidates([log], TABLE_3), "input_gain_asymmetry"
    known = afresh(nominal, starts, Search(anchor, [right]), None, ())[right]
    rounds: list[str] = []

    def counting(request: FitRequest) -> Fit:
        rounds.append(request.effort)
        return fit(request)

    wrong = Search(anchor, [name for name in ONLY if name != right], fitter=counting)
    without = afresh(nominal, starts, wrong, None, ())
    spent = len(rounds)
    beside = afresh(nominal, starts, wrong, known, ())
    assert len(rounds) - spent - 1 < spent  # one round is of the known fit
    assert all(cost(found) > cost(known) + 100.0 for found in (*without.values(), *beside.values()))


def test_what_derivatives_promise_too_little_is_left_after_its_first_round(strong, monkeypatch):
    log, nominal, anchor = strong
    rounds: list[str] = []

    def counting(request: FitRequest) -> Fit:
        rounds.append(request.effort)
        return fit(request)

    def spent(nats: float) -> int:
        rounds.clear()
        monkeypatch.setattr(Fit, "promised", property(lambda self: nats))
        fits = afresh(nominal, candidates([log], TABLE_3), Search(anchor, ONLY, fitter=counting), None, ())
        assert min(fits, key=lambda name: cost(fits[name])) == "input_gain_asymmetry"
        return len(rounds)

    assert spent(1e9) - spent(2.0) >= len(ONLY) - 1


def test_without_starts_nothing_is_found(strong):
    _, nominal, anchor = strong
    assert afresh(nominal, [], Search(anchor, ONLY), None, ()) == {}
    assert afresh(nominal, [Start(TABLE_3, START_NOISE)], Search(anchor, ["no_effect"]), None, ()) == {}


def test_the_torque_of_an_effect_is_its_law():
    """Drag and friction near standstill of the pendulum, by their equations; ΔF at rest is the whole of it."""
    drag, stribeck = (
        Effect("pendulum_quadratic_drag", {"c": 0.01}),
        Effect("pendulum_stribeck", {"ΔF": 0.02, "vs": 0.5}),
    )
    plant = TABLE_3.with_effects(drag, stribeck)
    log, _ = loop_log(duration=4.0)
    signals = motion_of(plant, [log])
    v = signals.v[:, 1]
    by_hand = -0.01 * v * np.abs(v), -0.02 * np.exp(-((v / 0.5) ** 2)) * np.tanh(plant.sharpness[1] * v)
    for effect, torque in zip((drag, stribeck), by_hand, strict=True):
        added = added_torque(plant, [effect.name], signals)
        np.testing.assert_allclose(added[:, 1], torque, atol=1e-9)
        np.testing.assert_allclose(added[:, 0], 0.0, atol=1e-9)
