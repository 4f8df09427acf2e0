"""Every effect of the catalogue: nothing at zero strength, plain at one, one name for two forms."""

import functools
import math

import numpy as np
import pytest

from experiments.bench import (
    SETS,
    EffectSize,
    HiddenEffect,
    PendulumLost,
    Rig,
    catalogue,
    effect_size,
    record,
    strength_for,
)
from experiments.bench.declaration import Variation
from experiments.bench.effects import find
from experiments.bench.kernels.forces import _looked_up

CASES = [(name, form) for name, e in catalogue().items() for form in e.forms()]
# a few seconds in which each kind of effect has had time to act
WHERE = {"arm_position_friction": "wide", "arm_encoder_eccentricity": "wide", "pendulum_encoder_eccentricity": "wide"}


def _run(*effects, experiment="paper", duration=4.0):
    return record(Rig("servo", effects, engine="lagrange"), experiment, seed=2, duration=duration)


_plain = functools.cache(_run)


@pytest.mark.parametrize("name", catalogue())
def test_zero_strength_is_no_effect(name):
    none = _run(HiddenEffect(name, 0.0), duration=2.0)
    assert np.array_equal(none.state, _plain(duration=2.0).state)
    assert none.truth["effects"] == []


# these have a shape, a mass or a mode of their own that does not fade with the strength
_DO_NOT_FADE = (
    "stick_slip", "arm_backlash", "friction_sharpness", "slipping_coupling", "lost_counts", "arm_presliding",
)  # fmt: skip


def _hanging(*effects):
    run = record(Rig("servo", effects, engine="lagrange"), "hanging-chirp", 1, 1.5, noise_free=True)
    return np.stack([run.q1, run.q2])


_quiet = functools.cache(_hanging)


@pytest.mark.parametrize(("name", "form"), [case for case in CASES if case[0] not in _DO_NOT_FADE])
def test_a_hundredth_of_an_effect_does_little_of_what_it_does(name, form):
    early = {"t0": 0.5} if name == "payload_step" else {}
    values = HiddenEffect(name, parameters=early).values(SETS["servo"])
    shapes = {
        key: value
        for key, value in values.items()
        if key in ("q1n", "q1s", "qt", "vs", "n", "φ", "f", "t0", "t1", "t2", "t3")
        or (key == "d" and name == "arm_hysteresis")  # of a delay it is the size
    }
    still = _quiet()
    weak, plain = (np.abs(_hanging(HiddenEffect(name, k, form, parameters=shapes)) - still).max() for k in (0.01, 1.0))
    assert weak <= 0.1 * plain + 1e-6


@pytest.mark.parametrize(("name", "form"), CASES)
def test_strength_one_changes_the_log_by_more_than_a_count(name, form):
    where = WHERE.get(name, "paper")
    early = {key: 1.0 + i for i, key in enumerate(("t0", "t1", "t2", "t3")) if key in find(name).units}
    try:
        changed = _run(HiddenEffect(name, 1.0, form, parameters=early), experiment=where)
    except PendulumLost as loss:
        pytest.fail(f"{name} at strength 1 loses the pendulum: {loss}")
    plain = _plain(experiment=where)
    count = 2 * math.pi / SETS["servo"].encoder_counts[0]
    difference = max(np.abs(changed.q1 - plain.q1).max(), np.abs(changed.q2 - plain.q2).max())
    assert difference > 2 * count


@pytest.mark.parametrize("name", [name for name, e in catalogue().items() if e.kind == "library"])
def test_the_two_forms_of_an_effect_differ(name):
    early = {"t0": 1.0} if name == "payload_step" else {}
    rigs = [Rig("servo", [HiddenEffect(name, 1.0, form, parameters=early)]) for form in ("table", "bench")]
    a, b = (record(rig, "wide", seed=2, duration=3.0, noise_free=True) for rig in rigs)
    assert np.abs(a.q2 - b.q2).max() > 1e-6


class _Drawn(Variation):
    """Draws one given sign, and always the same place of a range."""

    def __init__(self, sign, place):
        self._sign, self._place = sign, place

    def sign(self):
        return self._sign

    def near(self, typical, low, high):
        return low + self._place * (high - low)

    def one_of(self, *values):
        return values[round(self._place * len(values))]


@pytest.mark.parametrize("name", catalogue())
def test_variations_differ_in_signs_places_or_times_and_repeat(name):
    """What may have either sign has both in forty variations, and what may lie elsewhere does."""
    drawn, again = ([HiddenEffect(name, variation=k).values(SETS["desk"]) for k in range(40)] for _ in range(2))
    assert drawn == again
    assert all(set(values) == set(find(name).units) for values in drawn)
    plus, minus, moved = (find(name).sizes(SETS["desk"], 1.0, _Drawn(*of)) for of in ((1, 0.2), (-1, 0.2), (1, 0.5)))
    for key in find(name).units:
        seen = {values[key] for values in drawn}
        if plus[key] == -minus[key] != 0.0:
            assert min(seen) < 0.0 < max(seen), key
        assert (len(seen) > 1) == (not plus[key] == minus[key] == moved[key]), key


@pytest.mark.parametrize("kind", SETS)
def test_friction_that_falls_stays_friction(kind):
    for strength in (1.0, 4.0):
        a = HiddenEffect("arm_friction_drift", strength).values(SETS[kind])["a"]
        assert -1.0 / 20.0 < a < 0.0  # 1 + a t is positive all along a run of 20 s


def test_names_are_those_of_the_contract():
    """The contract's; the bench may have more, which `test_agrees_with_the_plant` holds to the plant's library."""
    library = {name for name, e in catalogue().items() if e.kind == "library"}
    assert library >= {
        "input_delay", "actuator_lag", "input_dead_zone", "input_saturation", "input_offset",
        "input_gain_asymmetry", "arm_stribeck", "arm_coulomb_asymmetry", "arm_quadratic_drag", "arm_spring",
        "arm_ripple", "arm_position_friction", "arm_presliding", "arm_friction_drift", "arm_backlash",
        "pendulum_quadratic_drag", "pendulum_stribeck", "friction_sharpness", "pendulum_coulomb_asymmetry",
        "input_cubic_gain", "arm_viscous_drift", "periodic_torque", "payload_step", "base_tilt",
        "pendulum_encoder_offset", "pendulum_encoder_eccentricity", "arm_encoder_eccentricity",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: HiddenEffect("arm_sprong"), "arm_spring"),
        (lambda: HiddenEffect("arm_spring", -1.0), "strength"),
        (lambda: HiddenEffect("arm_spring", form="other"), "table, bench"),
        (lambda: HiddenEffect("flexible_arm", form="table"), "no form"),
        (lambda: HiddenEffect("arm_spring", parameters={"kk": 1.0}), "k, q1n"),
        (lambda: HiddenEffect("arm_spring", parameters={"k": math.nan}), "NaN"),
        (lambda: Rig("tableau"), "table3"),
        (lambda: Rig("servo", [HiddenEffect("arm_spring")] * 2), "twice"),
        (lambda: Rig("servo", [HiddenEffect("flexible_arm"), HiddenEffect("arm_backlash")]), "only one"),
        (lambda: Rig("servo", [HiddenEffect("arm_presliding")], friction="hard"), "bristle"),
        (lambda: Rig("servo", controller="paper"), "lqr"),
        (lambda: Rig("servo", sample_time=1.0), "sample_time"),
    ],
)
def test_what_the_bench_does_not_have_is_refused_with_what_it_has(make, says):
    with pytest.raises(ValueError, match=says):
        make()


def test_size_tells_what_parameters_absorb():
    def of(*effects):
        return effect_size(Rig("table3", effects), "paper", seed=1, duration=3.0)

    assert of().ratio == pytest.approx(1.0, abs=1e-6)
    spring, emf = of(HiddenEffect("arm_spring")), of(HiddenEffect("back_emf"))
    assert spring.ratio > 2.0
    assert emf.ratio_before > 1.05
    assert emf.ratio < 1.001
    assert emf.absorbed > 0.99


def test_a_strength_is_found_for_a_wanted_gap(monkeypatch):
    tried = []

    def measured(rig, experiment, seed):
        tried.append(rig.effects[-1].strength)
        if tried[-1] > 0.9:
            raise PendulumLost("fell", None)
        return EffectSize(0.0, 0.0, math.sqrt(1.0 + (6.0 * tried[-1]) ** 2.2), 9.0, 0.5, 0.4)

    monkeypatch.setattr("experiments.bench.size.effect_size", measured)
    found = strength_for(Rig("servo"), "arm_spring", 1.5)
    assert found in tried
    assert math.sqrt(1.0 + (6.0 * found) ** 2.2) == pytest.approx(1.5, abs=0.15)
    for name, ratio in (("arm_spring", 1.0), ("back_emf", 2.0), ("arm_sprong", 2.0)):
        with pytest.raises(ValueError, match=r"expected|can hide"):
            strength_for(Rig("servo"), name, ratio)


def test_no_strength_is_given_at_which_the_pendulum_is_lost():
    late = Rig("servo", [HiddenEffect("input_delay", parameters={"d": 0.08})])
    with pytest.raises(PendulumLost, match=r"arm_spring on servo, .*lost at the strengths 1, 0\.5, 0\.25"):
        strength_for(late, "arm_spring", 1.5)


@pytest.mark.parametrize("name", ["arm_cable", "arm_taut_cable"])
def test_a_cables_other_law_has_no_corner_and_pulls_back_everywhere(name):
    """Between the points of its table, at them, and beyond."""
    rig = Rig("servo", [HiddenEffect(name, 3.0, "bench")])
    p = rig.mechanics()[0].fields[0]
    q = np.linspace(-4.0, 4.0, 8001)
    torque = np.array([_looked_up(x, p) for x in q])
    slope = np.diff(torque) / np.diff(q)
    assert slope.min() > 0.0
    assert np.abs(np.diff(slope)).max() < 0.02 * slope.max(), "a corner"
    at = p["table_from"] + p["table_step"] * np.arange(len(p["table"]))
    np.testing.assert_allclose([_looked_up(x, p) for x in at], p["table"], atol=1e-12)
