"""The pendulum is set to zero by hand: a count is no effect, and an offset of many counts is one."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification.diagnosis.naming.fits import FitRequest, fit
from identification.diagnosis.naming.forward import START_NOISE
from identification.kalman.record import Record
from tests.factories import loop_log

COUNT = 2 * math.pi / 4096


def _fitted(counts: float, *effects: Effect):
    log, _ = loop_log(duration=6.0)
    log = replace(log, q2=log.q2 + counts * COUNT)
    return fit(FitRequest(TABLE_3.with_effects(*effects), START_NOISE, [Record.from_log(log)], anchor=TABLE_3))


def test_a_count_is_the_zeros() -> None:
    plain, named = _fitted(1.0), _fitted(1.0, Effect("pendulum_encoder_offset", {"b": 0.001}))
    assert plain.zeros[0][1] == pytest.approx(COUNT, abs=0.5 * COUNT)
    assert plain.value - named.value < 2.0  # an effect gains nothing over it


def test_many_counts_are_an_effect_and_told_once() -> None:
    plain, named = _fitted(20.0), _fitted(20.0, Effect("pendulum_encoder_offset", {"b": 0.01}))
    assert plain.value - named.value > 300.0  # and not only the price of a zero so far off, 89 nats
    assert plain.zeros[0][1] == pytest.approx(3.0 * COUNT, rel=1e-6)
    again = fit(FitRequest(named.plant, named.noise, named.records, anchor=TABLE_3, zeros={0: (0.0, 10.0 * COUNT)}))
    (effect,) = again.plant.effects
    assert next(iter(effect.parameters.values())) == pytest.approx(20.0 * COUNT, abs=2.0 * COUNT)
    assert again.zeros.get(0, (0.0, 0.0))[1] == 0.0
