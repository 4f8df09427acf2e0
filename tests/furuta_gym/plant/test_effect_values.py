"""An effect with values: its checks, its text form and its file form."""

import math
import pickle

import numpy as np
import pytest

from furuta_gym.plant import EFFECTS, LARGE_RIG, TABLE_3, Effect, Plant

every_effect = pytest.mark.parametrize("name", EFFECTS)


@every_effect
def test_round_trips(name):
    effect = LARGE_RIG.default_effect(name)
    text = name + ":" + ",".join(f"{k}={v!r}" for k, v in effect.parameters.items())
    for back in (Effect.parse(text), Effect.from_dict(effect.to_dict("V")), pickle.loads(pickle.dumps(effect))):
        assert back == effect
        assert dict(back.parameters) == dict(effect.parameters)


@every_effect
def test_without_values_it_is_neutral(name):
    assert dict(Effect(name).parameters) == EFFECTS[name].neutral()
    assert dict(Effect.parse(name).parameters) == EFFECTS[name].neutral()


@every_effect
@pytest.mark.parametrize("value", [math.nan, "much", None, [1.0]], ids=str)
def test_what_is_no_number_is_an_error_that_names_effect_and_parameter(name, value):
    for p in EFFECTS[name].parameters:
        with pytest.raises(ValueError, match=rf"{name}.*{p.name}"):
            Effect(name, {p.name: value})


@every_effect
def test_bounds_are_held_and_told(name):
    for p in EFFECTS[name].parameters:
        for bound, outside in ((p.lower, -1.0), (p.upper, 1.0)):
            if math.isfinite(bound):
                assert Effect(name, {p.name: math.trunc(bound) if p.integer else bound})
                with pytest.raises(ValueError, match=rf"{name}.*{p.name}.*{bound:g}"):
                    Effect(name, {p.name: bound + outside * (1.0 + abs(bound))})


def test_no_gravity_gives_a_tilted_base_a_negative_moment():
    """A search once named a tilt of G1 = −6.3 V."""
    with pytest.raises(ValueError, match=r"base_tilt.*G1.*-6\.3"):
        Effect("base_tilt", {"αx": 0.01, "αy": 0.0, "G1": -6.3})
    g1 = LARGE_RIG.default_effect("base_tilt").parameters["G1"]
    assert 0.5 * LARGE_RIG.theta[4] <= g1 <= 5.0 * LARGE_RIG.theta[4]


@every_effect
def test_infinity_is_an_error_unless_it_is_the_neutral_value(name):
    """No torque, time or stiffness of a rig is infinite; a file cannot hold it either."""
    for p in EFFECTS[name].parameters:
        for value in (math.inf, -math.inf):
            if value == p.neutral and p.role == "size":
                assert Effect(name, {p.name: value})
            else:
                with pytest.raises(ValueError, match=rf"{name}.*{p.name}"):
                    Effect(name, {p.name: value})


@every_effect
def test_an_unknown_parameter_is_an_error_that_lists_the_known(name):
    with pytest.raises(ValueError, match=EFFECTS[name].parameters[0].name):
        Effect(name, {"nonsense": 1.0})
    with pytest.raises(ValueError, match="nonsense"):
        Effect(name, std={"nonsense": 1.0})


def test_an_unknown_effect_is_an_error_that_guesses_and_says_where_the_library_is():
    with pytest.raises(ValueError, match=r"did you mean arm_spring.*`furuta effects`"):
        Effect("arm_sprig")


@pytest.mark.parametrize("name", [None, 3, ["arm_spring"], {}], ids=str)
def test_a_name_that_is_no_text_is_an_error(name):
    with pytest.raises(ValueError, match="effect"):
        Effect(name)


@pytest.mark.parametrize("text", ["arm_spring:k", "arm_spring:k=", "arm_spring:=3", "arm_spring:k=a", ":k=1", ""])
def test_bad_text_is_an_error(text):
    with pytest.raises(ValueError, match="effect"):
        Effect.parse(text)


def test_a_parameter_given_twice_is_an_error():
    with pytest.raises(ValueError, match="k"):
        Effect.parse("arm_spring:k=0.1,k=0.2")
    with pytest.raises(ValueError, match="ΔF"):
        Effect("arm_stribeck", {"dF": 0.1, "ΔF": 0.2})


def test_plain_letters_stand_for_the_greek_ones():
    assert Effect.parse("arm_stribeck:dF=0.1,vs=0.2") == Effect("arm_stribeck", {"ΔF": 0.1, "vs": 0.2})
    assert Effect.parse("base_tilt:alphax=0.1,alphay=0.2") == Effect("base_tilt", {"αx": 0.1, "αy": 0.2})
    assert Effect.parse("arm_presliding:sigma0=9") == Effect("arm_presliding", {"σ0": 9.0})
    assert Effect.parse("arm_hysteresis:kappa=2,kappa2=1") == Effect("arm_hysteresis", {"κ": 2.0, "κ2": 1.0})
    assert Effect.parse("arm_ripple:phi=0.1") == Effect("arm_ripple", {"φ": 0.1})


@pytest.mark.parametrize("text", ["arm_stribeck:vs=0", "periodic_torque:f=0", "arm_ripple:n=0"])
def test_a_shape_of_zero_is_out_of_bounds(text):
    """Nothing is divided by it, and no neutral value excuses it."""
    with pytest.raises(ValueError, match="must lie in"):
        Effect.parse(text)


def test_what_the_text_leaves_out_may_come_from_elsewhere():
    default = TABLE_3.default_effect("arm_stribeck").parameters
    found = Effect.parse("arm_stribeck:dF=0.1", TABLE_3.default_effect)
    assert found == Effect("arm_stribeck", {**default, "ΔF": 0.1})
    assert default["vs"] == found.parameters["vs"]


def test_ripple_order_is_whole():
    with pytest.raises(ValueError, match="whole"):
        Effect("arm_ripple", {"n": 2.5})


@pytest.mark.parametrize("std", [-1.0, math.nan, math.inf, "wide"], ids=str)
def test_an_impossible_standard_deviation_is_an_error(std):
    with pytest.raises(ValueError, match="arm_spring"):
        Effect("arm_spring", {"k": 0.1}, std={"k": std})


def test_values_cannot_be_changed_from_outside():
    given = {"k": 0.1}
    effect = Effect("arm_spring", given)
    given["k"] = 9.0
    assert effect.parameters["k"] == 0.1
    with pytest.raises(TypeError):
        effect.parameters["k"] = 1.0


def test_defaults_scale_with_the_plant():
    small, large = (LARGE_RIG.replace(theta=LARGE_RIG.theta * s) for s in (0.1, 1.0))
    for name, effect in EFFECTS.items():
        for p in effect.parameters:
            ratio = small.default_effect(name).parameters[p.name], large.default_effect(name).parameters[p.name]
            expected = 0.1 if p.relative_to and p.relative_to.startswith("theta") else 1.0
            np.testing.assert_allclose(ratio[0], expected * ratio[1], err_msg=f"{name}.{p.name}")


def test_defaults_are_as_large_in_any_unit():
    """A rig whose command is written in other units: sizes that grow with the command, or with its inverse square."""
    volts, millivolts = LARGE_RIG, LARGE_RIG.replace(theta=1e3 * LARGE_RIG.theta, u_max=1e3 * LARGE_RIG.u_max)
    power = {"{u}": 1, "1/{u}²": -2}
    for name, effect in EFFECTS.items():
        for p in effect.parameters:
            ratio = millivolts.default_effect(name).parameters[p.name] / (
                volts.default_effect(name).parameters[p.name] or 1
            )
            expected = 1e3 ** power.get(p.unit, 1 if "{u}" in p.unit else 0)
            if p.default:
                np.testing.assert_allclose(ratio, expected, err_msg=f"{name}.{p.name}")


def test_a_value_out_of_bounds_is_told_with_its_unit_or_with_none() -> None:
    with pytest.raises(ValueError, match=r"a must lie in \[-0\.9, 0\.9\], got 7"):
        Effect("input_gain_asymmetry", {"a": 7})
    with pytest.raises(ValueError, match=r"vs must lie in .*\] rad/s, got -1"):
        Effect("arm_stribeck", {"vs": -1})


def test_an_unknown_effect_is_told_in_whole_sentences() -> None:
    with pytest.raises(ValueError, match=r"effect 'arm_sprng'; did you mean arm_spring\? `furuta effects` lists"):
        Effect("arm_sprng")


def test_a_unit_that_is_not_the_plant_s_is_refused() -> None:
    """A stiffness in N·m/rad would be taken for V/rad: 30 times too small on a QUBE."""
    data = TABLE_3.with_effects(Effect("arm_spring", {"k": 0.2, "q1n": 0.1})).to_dict()
    assert Plant.from_dict(data).effects
    data["effects"][0]["parameters"]["k"]["unit"] = "N·m/rad"
    with pytest.raises(ValueError, match=r"arm_spring: k is given in 'N·m/rad'.*expected V/rad"):
        Plant.from_dict(data)
    data["effects"][0]["parameters"]["k"] = {"value": 0.2}
    assert Plant.from_dict(data).effects[0].parameters["k"] == 0.2


@pytest.mark.parametrize(
    ("name", "parameter", "value", "std", "expected", "text"),
    [
        ("base_tilt", "G1", 0.33, 0.26, (0.0705, 1.546), "0.33 (0.07 … 1.5)"),  # known to a factor, never negative
        ("base_tilt", "G1", 0.33, 0.01, (0.311, 0.3502), "0.33 ± 0.01"),
        ("base_tilt", "αx", 0.01, 0.02, (-0.0292, 0.0492), "0.01 ± 0.02"),  # of either sign
        ("arm_spring", "k", 0.1, 0.02, (0.0608, 0.1392), "0.1 ± 0.02"),
        ("arm_spring", "k", 0.1, 0.2, (0.0, 0.492), "0.1 (0 … 0.49)"),  # as far down as its bound
        ("arm_hysteresis", "d", 9.0, 4.0, (3.767, 10.0), "9 ± 4"),
    ],
)
def test_an_interval_is_of_what_is_estimated_and_within_bounds(name, parameter, value, std, expected, text):
    effect = Effect(name, {parameter: value}, {parameter: std})
    assert effect.interval(parameter) == pytest.approx(expected, rel=1e-3, abs=1e-4)
    assert effect.shown(parameter) == text
    assert f"{parameter} = {text}" in str(effect)


def test_what_a_law_does_not_have_is_not_shown():
    stop = Effect("arm_hysteresis", {"κ": 1.0, "d": 0.1, "d2": 10.0})
    assert str(stop) == "arm_hysteresis(κ = 1, d = 0.1)"
    two = Effect("arm_hysteresis", {"κ": 1.0, "d": 0.1, "κ2": 0.5, "d2": 0.2, "ρ": 0.7})
    assert str(two) == "arm_hysteresis(κ = 1, d = 0.1, κ2 = 0.5, d2 = 0.2, ρ = 0.7)"


@every_effect
def test_what_was_not_estimated_has_no_interval(name):
    effect = LARGE_RIG.default_effect(name)
    assert all(effect.interval(p) is None and "±" not in effect.shown(p) for p in effect.parameters)
