"""A wider law of an effect, fitted before another effect is looked for."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.bench import HiddenEffect, Rig
from furuta_gym.plant import EFFECTS, TABLE_3, Effect, Plant
from identification import Log, diagnose
from identification.diagnosis.naming.fits import Fit, FitRequest, fit
from identification.diagnosis.naming.search import Search
from identification.diagnosis.naming.wider import widened
from identification.diagnosis.policy import DecisionPolicy
from identification.estimation.identify import identify
from identification.estimation.start import Noise
from identification.kalman.record import stretches
from tests.factories import bench_log, changing_gain_log, paper_log
from tests.identification.diagnosis.fits import NOISE, ToyFit


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
    return fit(FitRequest(plant, Noise(found.noise.torque), records, anchor=search.anchor, effort="full")), search


def test_friction_that_yields_gradually_gets_a_wider_law() -> None:
    """The bench's law is none of the library's: it yields by the square of the deflection."""
    plain, search = fitted_to("bench")
    wider = widened(plain, search)
    assert wider.value < plain.value - 20.0
    assert 0.3 < wider.plant.effects[0].parameters["ρ"] < 1.0
    assert widened(wider, search) is wider, "no wider law pays for itself beside this one"


def test_a_search_widens_the_law_before_it_looks_for_more() -> None:
    found = diagnose(recorded("bench"), only=("arm_hysteresis", "arm_presliding"), most=2)
    assert [s.name for s in found.named] == ["arm_hysteresis"]
    assert found.plant is not None
    hysteresis = found.plant.effect("arm_hysteresis")
    assert hysteresis is not None
    assert hysteresis.parameters["ρ"] > 0.3


def test_a_motor_that_warms_up_and_settles_gets_a_wider_law() -> None:
    log = changing_gain_log(lambda t: 1.0 - 0.05 * (1.0 - math.exp(-0.4 * t)) / 0.4)
    found = diagnose(log, only=("input_gain_drift", "arm_viscous_drift"))
    assert [s.name for s in found.named] == ["input_gain_drift"]
    assert not found.leftover
    assert found.after is not None
    names, std = list(found.after.names), found.after.std
    for name, true in (("a", -0.05), ("s", 0.4)):
        i = names.index(f"input_gain_drift.{name}")
        assert abs(found.after.values[i] - true) < 4.0 * std[i] < 0.5 * abs(true)


def test_stribeck_friction_of_another_exponent_gets_a_wider_law() -> None:
    rig = TABLE_3.with_effects(Effect("arm_stribeck", {"ΔF": 0.1, "vs": 0.3, "δ": 1.0}))
    found = diagnose(paper_log(0.004, plant=rig)[0], only=("arm_stribeck", "arm_quadratic_drag"))
    assert [s.name for s in found.named] == ["arm_stribeck"]
    assert not found.leftover
    assert found.after is not None
    names, std = list(found.after.names), found.after.std
    for name, true in (("ΔF", 0.1), ("vs", 0.3), ("δ", 1.0)):
        i = names.index(f"arm_stribeck.{name}")
        assert abs(found.after.values[i] - true) < 4.0 * std[i] < 0.5 * true


def test_one_element_stays_one() -> None:
    plain, search = fitted_to("table")
    assert widened(plain, search) is plain


@pytest.mark.parametrize(("d2", "kept"), [(0.9, True), (1.5, False)])
def test_a_wider_law_is_no_spring(d2: float, kept: bool) -> None:
    """A second stop that the arm never makes slip would hide a spring, which has a name of its own."""
    t = np.arange(200) * 5e-3
    log = Log(t, 0.5 * np.sin(7.0 * t), np.sin(t), np.sin(t))  # the arm turns by 1 rad
    records = tuple(stretch.record for stretch in stretches([log]))
    plant = TABLE_3.with_effects(Effect("arm_hysteresis", {"κ": 1.0, "d": 0.1}))
    plain: Any = ToyFit(plant, NOISE, 0.0, records=records)

    def fitter(request: FitRequest) -> Any:
        tried = request.plant
        values = {**tried.effects[0].parameters, "d2": d2}
        two = tried.with_effects(Effect("arm_hysteresis", values))
        return replace(plain, plant=two, value=-100.0 if values["κ2"] and not values["ρ"] else 0.0)

    search: Any = SimpleNamespace(
        fitter=fitter,
        fitted=lambda tried, start, *_: fitter(FitRequest(tried, start.noise, records)),
        anchor=plant,
        progress=lambda text: None,
        policy=DecisionPolicy(),
    )
    values = widened(plain, search).plant.effects[0].parameters
    assert (values["κ2"] > 0.0) == kept


@pytest.mark.parametrize("gain", [100.0, 4.0])
def test_only_what_may_pay_is_fitted_to_the_end(gain: float) -> None:
    """Of the laws that a coarse fit finds no better than a coarse fit of the plain one, none is: longer steps make
    either of them likelier here."""
    plant = TABLE_3.with_effects(Effect("arm_hysteresis", {"κ": 1.0, "d": 0.1}))
    plain: Any = ToyFit(plant, NOISE, 0.0)
    to_the_end = []

    def fitter(request: FitRequest) -> Any:
        tried = request.plant
        return replace(plain, plant=tried, value=-20.0 - (gain if tried.effects[0].parameters["ρ"] else 0.0))

    def fitted(tried: Plant, start: Any, *_: Any) -> Any:
        to_the_end.append(tried.effects[0].parameters)
        return fitter(FitRequest(tried, start.noise, ()))

    search: Any = SimpleNamespace(
        fitter=fitter, fitted=fitted, anchor=plant, progress=lambda text: None, policy=DecisionPolicy()
    )
    found = widened(plain, search)
    assert bool(to_the_end) == (gain > 10.0)
    assert all(parameters["ρ"] for parameters in to_the_end)
    assert bool(found.plant.effects[0].parameters["ρ"]) == (gain > 10.0)


def test_wider_laws_have_the_effects_parameters_in_play() -> None:
    """Each start brings some of them in and keeps the others, until all are there."""
    declared = [effect for effect in EFFECTS.values() if effect.wider]
    assert declared
    for effect in declared:
        absent = effect.neutral()
        optional = {p.optional for p in effect.parameters if p.optional}
        open_ = [TABLE_3.default_effect(effect.name).parameters]
        for _ in range(len(optional) + 1):
            assert effect.wider is not None
            starts = [(plain, Effect(effect.name, v).parameters) for plain in open_ for v in effect.wider(plain)]
            for plain, wider in starts:
                more = {name for name in optional if wider[name] != absent[name]}
                assert more > {name for name in optional if plain[name] != absent[name]}
            open_ = [wider for _, wider in starts]
        assert open_ == []
