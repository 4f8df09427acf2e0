"""A wider law of an effect, fitted before another effect is looked for."""

from __future__ import annotations

import pytest

from experiments.bench import HiddenEffect, Rig
from furuta_gym.plant import EFFECTS, TABLE_3, Effect
from identification import Log, diagnose
from identification.diagnosis.naming.fits import Fit, fit
from identification.diagnosis.naming.search import Search
from identification.diagnosis.naming.wider import widened
from identification.estimation.identify import identify
from identification.estimation.start import Noise
from identification.kalman.record import stretches
from tests.factories import bench_log


def recorded(form: str) -> Log:
    """A rig of the bench with hysteresis in one of its forms."""
    rig = Rig("table3", [HiddenEffect("arm_hysteresis", 8.0, form)], individual=3, scatter=0.08, sample_time=4e-3)
    return bench_log(rig, "wide", seed=5, duration=10.0)


def fitted_to(form: str) -> tuple[Fit, Search]:
    """(fit with one hysteresis, search) of its log."""
    log = recorded(form)
    found = identify(log, effects=["arm_hysteresis"])
    assert found.noise is not None
    plant = found.plant.replace(covariance=None, friction_sharpness=100.0)
    records = [stretch.record for stretch in stretches([log])]
    search = Search(plant.replace(effects=()))
    return fit(plant, Noise(found.noise.torque), records, anchor=search.anchor, effort="full"), search


def test_friction_that_yields_gradually_gets_a_second_element() -> None:
    plain, search = fitted_to("bench")
    wider = widened(plain, search)
    assert wider.value < plain.value - 20.0
    values = wider.plant.effects[0].parameters
    assert values["κ2"] > 0.0
    assert values["d2"] != pytest.approx(values["d"], rel=0.1)
    assert widened(wider, search) is wider, "what is wide already has no wider law"


def test_a_search_widens_the_law_before_it_looks_for_more() -> None:
    found = diagnose(recorded("bench"), only=("arm_hysteresis", "arm_presliding"), most=2)
    assert [s.name for s in found.named] == ["arm_hysteresis"]
    assert found.plant is not None
    hysteresis = found.plant.effect("arm_hysteresis")
    assert hysteresis is not None
    assert hysteresis.parameters["κ2"] > 0.0


def test_one_element_stays_one() -> None:
    plain, search = fitted_to("table")
    assert widened(plain, search) is plain


def test_wider_laws_have_the_effects_parameters_in_play() -> None:
    declared = [effect for effect in EFFECTS.values() if effect.wider]
    assert declared
    for effect in declared:
        plain = TABLE_3.default_effect(effect.name)
        optional = {p.optional for p in effect.parameters if p.optional}
        assert effect.wider is not None
        for values in effect.wider(plain.parameters):
            wider = Effect(effect.name, values)
            assert all(wider.parameters[name] != plain.parameters[name] for name in optional)
            assert effect.wider(wider.parameters) == ()
