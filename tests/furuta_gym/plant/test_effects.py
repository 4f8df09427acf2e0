"""One family of tests over the whole library: an effect that is declared enters every one of them by itself."""

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from furuta_gym.plant import EFFECTS, LARGE_RIG, QUBE, TABLE_3, Effect, Plant
from furuta_gym.plant.effects.dispatch import map_command, modify_theta
from furuta_gym.plant.effects.library import FILTERS, NUMBERS, numbered
from furuta_gym.plant.layout import N_BASE, THETA_ROWS
from furuta_gym.plant.parameters import theta_vector
from tests.furuta_gym.plant.helpers import (
    derivative,
    neutral,
    oracle,
    readings,
    reference_run,
    run,
    square_waves,
)
from tests.furuta_gym.plant.strategies import angles, states
from tests.oracles import reference

COUNT = 2 * np.pi / 4096
T_U = np.arange(75) * 0.008
STOP = 0.6
# A payload that arrives inside the tests' short motions; the other defaults are seen at once.
SOON = {"payload_step": {"t0": 0.2011}}
# Where the default is at a bound.
INSIDE = {
    "input_saturation": {"knee": 0.4},
    "arm_hysteresis": {"κ2": 0.5, "d2": 0.03, "ρ": 0.4},
    "input_gain_drift": {"s": 0.3},
    "arm_presliding": {"i": 0.6},
    "pendulum_quadratic_drag": {"λ": 0.6},
    "pendulum_stribeck": {"ΔF": 0.04, "δ": 1.3},  # at its default size the exponent moves hardly anything
}

# The contract's table: names and parameters that files, commands and acceptance checks rely on.
CONTRACT = {
    "input_delay": ("d",),
    "actuator_lag": ("T",),
    "input_dead_zone": ("w",),
    "input_saturation": ("m", "knee"),  # knee: ours; 0, its default, is the contract's sharp one
    "input_offset": ("b",),
    "input_gain_asymmetry": ("a",),
    "arm_stribeck": ("ΔF", "vs", "δ"),
    "arm_coulomb_asymmetry": ("a",),
    "arm_quadratic_drag": ("c",),
    "arm_spring": ("k", "q1n"),
    "arm_cable": ("k", "q1n", "k3", "q1s"),
    "arm_taut_cable": ("k1", "k2", "q1n", "qt"),
    "arm_hysteresis": ("κ", "d", "κ2", "d2", "ρ"),  # ρ: ours; 0, its default, is the contract's stop
    "arm_ripple": ("A", "n", "φ"),
    "arm_position_friction": ("a", "b"),
    "arm_presliding": ("σ0", "i"),  # i: ours; 1, its default, is the contract's bristle
    "arm_friction_drift": ("a",),
    "arm_backlash": ("b", "ρ"),  # ρ: ours; 0.1, its default, is the contract's rotor
    "pendulum_quadratic_drag": ("c", "λ"),  # λ: ours; 0, its default, is the contract's law
    "pendulum_stribeck": ("ΔF", "vs", "δ"),
    "friction_sharpness": ("r1", "r2"),
    "pendulum_coulomb_asymmetry": ("a",),
    "input_cubic_gain": ("a",),
    "arm_viscous_drift": ("a",),
    "periodic_torque": ("A", "f", "φ"),
    "payload_step": ("m", "t0"),
    "base_tilt": ("αx", "αy", "G1"),
    "pendulum_encoder_offset": ("b",),
    "pendulum_encoder_eccentricity": ("a", "b"),
    "arm_encoder_eccentricity": ("a", "b"),
}

every_effect = pytest.mark.parametrize("name", EFFECTS)


SENSORS = [name for name in EFFECTS if EFFECTS[name].place == "sensor"]
every_moving_effect = pytest.mark.parametrize("name", [name for name in EFFECTS if name not in SENSORS])


def with_default(plant: Plant, name: str, scale: float = 1.0) -> Plant:
    """The plant with the effect at its default size (times scale), soon enough to be seen."""
    values = dict(plant.default_effect(name).parameters) | SOON.get(name, {})
    for p in EFFECTS[name].parameters:
        if p.role == "size" and not p.integer:
            values[p.name] *= scale
    return plant.with_effects(Effect(name, values))


def a_motion(plant: Plant, h_max=1e-4, amplitude=1.0):
    """From near hanging, under square waves that reverse the arm many times."""
    return run(plant, [0.3, 2.6, 0.5, -1.0], T_U, amplitude * square_waves(T_U), STOP, h_max)


def test_library_is_the_contract_and_every_effect_has_an_oracle():
    assert {name: EFFECTS[name].parameter_names for name in CONTRACT} == CONTRACT
    assert set(EFFECTS) <= reference.KNOWN


@pytest.mark.parametrize("page", ["README.md", "docs/index.md", "docs/decisions/002-effects-as-declarations.md"])
def test_pages_count_the_library(page):
    counts = re.findall(r"(\d+) effects", (Path(__file__).parents[3] / page).read_text(encoding="utf-8"))
    assert set(counts) == {str(len(EFFECTS))}


@every_effect
def test_declaration_is_complete(name):
    effect = EFFECTS[name]
    assert effect.equation
    assert effect.symptom
    assert set(effect.mistaken_for) <= set(EFFECTS) - {name}
    for p in effect.parameters:
        assert p.meaning
        assert p.unit.format(u="V")
        if p.optional:
            asked_for = next(q for q in effect.parameters if q.name == p.optional)
            assert asked_for.default == EFFECTS[name].neutral()[p.optional] == {"δ": 2.0, "i": 1.0}.get(p.optional, 0.0)
        if p.role == "size":
            assert p.lower <= p.neutral <= p.upper
        assert p.lower <= p.default
        assert p.default <= p.upper or p.relative_to
        if "{u}" in p.unit:  # commands are volts on one rig and hundredths of a newton metre on another
            assert p.lower <= 1e-6
            assert p.upper == math.inf
    assert any(p.role == "size" for p in effect.parameters)


@every_effect
@pytest.mark.parametrize("plant", [TABLE_3, LARGE_RIG], ids=["table3", "large"])
def test_neutral_effect_is_the_base_plant_bit_for_bit(name, plant):
    shapes = {p.name: p.default * 1.5 for p in EFFECTS[name].parameters if p.role == "shape" and not p.integer}
    off = plant.with_effects(neutral(name, **shapes))
    np.testing.assert_array_equal(a_motion(off, 1e-3)[:, :4], a_motion(plant, 1e-3))
    assert readings(off, 0.4, -1.3) == (0.4, -1.3)


def test_all_effects_at_neutral_together_are_the_base_plant_bit_for_bit():
    off = TABLE_3.with_effects(*(neutral(name) for name in EFFECTS))
    np.testing.assert_array_equal(a_motion(off, 1e-3)[:, :4], a_motion(TABLE_3, 1e-3))


# Largest error of (angles, velocities) on steps of 0.02 ms. The oracle's solver finds a stop or the payload's arrival
# inside a step, which fixed steps do not: there the error is of first order in the step.
TOLERANCE = {"arm_backlash": (1e-5, 1e-3), "payload_step": (5e-7, 5e-6)}
USUAL = (2e-8, 2e-7)


@every_moving_effect
@pytest.mark.parametrize("plant", [TABLE_3, LARGE_RIG], ids=["table3", "large"])
def test_motion_is_the_oracles(name, plant):
    """Default size and a third of it; the effect moves far more than the tolerance, so agreement means something."""
    angle, speed = TOLERANCE.get(name, USUAL)
    x0, u = [0.3, 2.6, 0.5, -1.0], 1.2 * square_waves(T_U)
    base = run(plant, x0, T_U, u, STOP, 2e-5)
    for scale in (1.0, 1.0 / 3.0):
        changed = with_default(plant, name, scale)
        ours = run(changed, x0, T_U, u, STOP, 2e-5)
        theirs = reference_run(changed, x0, T_U, u, STOP)
        np.testing.assert_allclose(ours[:, :2], theirs[:, :2], atol=angle)
        np.testing.assert_allclose(ours[:, 2:4], theirs[:, 2:4], atol=speed)
        assert np.abs(ours[:, :2] - base[:, :2]).max() > 50 * angle


@every_effect
def test_usual_steps_of_a_millisecond_are_enough(name):
    """The step rule's 1 ms stays below a tenth of an encoder count over half a second, effect on."""
    changed = with_default(TABLE_3, name)
    coarse, fine = a_motion(changed, 1e-3, amplitude=0.7), a_motion(changed, 2e-5, amplitude=0.7)
    assert np.abs(coarse[:, :2] - fine[:, :2]).max() < 0.1 * COUNT


@every_moving_effect
def test_each_parameter_moves_the_motion_as_in_the_oracle(name):
    """∂(angles)/∂(parameter) by central differences, here and there. (t0 and n move the motion by jumps.)"""
    (effect,) = with_default(LARGE_RIG, name).effects
    effect = Effect(name, dict(effect.parameters) | INSIDE.get(name, {}))
    x0, t_u, u = [0.3, 2.6, 0.5, -1.0], T_U[:50], 1.2 * square_waves(T_U[:50])
    for p in EFFECTS[name].parameters:
        if p.integer or p.name == "t0":
            continue
        size = max(abs(effect.parameters[p.name]), 1e-2)
        step = 0.1 * size  # the same difference on both sides: it need not be small
        ours, theirs = 0.0, 0.0
        for sign in (1, -1):
            values = dict(effect.parameters) | {p.name: effect.parameters[p.name] + sign * step}
            moved = LARGE_RIG.with_effects(Effect(name, values))
            ours = ours + sign * run(moved, x0, t_u, u, 0.4, 2e-5)[:, :2] / (2 * step)
            theirs = theirs + sign * reference_run(moved, x0, t_u, u, 0.4)[:, :2] / (2 * step)
        scale = np.abs(theirs).max()
        assert scale * size > 1e-6, f"{p.name} moves nothing"
        tolerance = 1e-2 if name == "arm_backlash" else 1e-3
        np.testing.assert_allclose(ours, theirs, atol=tolerance * scale, err_msg=p.name)


def parameters_of(name: str) -> st.SearchStrategy:
    """Values over the declared bounds (open bounds: a few times the default size on the large rig)."""
    default = LARGE_RIG.default_effect(name).parameters
    fields = {}
    for p in EFFECTS[name].parameters:
        reach = 3.0 * max(abs(default[p.name]), 1e-3) if default[p.name] or p.role == "size" else 3.0
        low, high = max(p.lower, -reach), min(p.upper, reach)
        fields[p.name] = st.integers(int(low), int(high)).map(float) if p.integer else st.floats(low, high)
    return st.fixed_dictionaries(fields)


@pytest.mark.parametrize(("name", "hook"), [("input_delay", "delay"), ("actuator_lag", "filter")])
def test_a_second_effect_that_would_take_the_place_of_a_delay_or_filter_is_refused(name, hook):
    library = dict(EFFECTS)
    assert numbered(library) == {n: NUMBERS[n] for n in EFFECTS}
    library["mine"] = EFFECTS[name]
    with pytest.raises(ValueError, match=f"one effect with a {hook} kernel, got {name}, mine"):
        numbered(library)


def test_the_filter_of_the_command_is_the_lag():
    assert {NUMBERS["actuator_lag"]} == FILTERS


def test_each_spelling_without_greek_letters_is_of_one_parameter():
    names = {p.name: p.typed for effect in EFFECTS.values() for p in effect.parameters}
    assert all(typed.isascii() for typed in names.values())
    assert len(set(names.values())) == len(names)
    spelt = {name: typed for name, typed in names.items() if name != typed}
    assert spelt == {
        **{"ΔF": "dF", "δ": "delta", "φ": "phi", "σ0": "sigma0", "κ": "kappa", "κ2": "kappa2", "ρ": "rho"},
        **{"λ": "lambda", "αx": "alphax", "αy": "alphay"},
    }


@pytest.mark.parametrize(("name", "reads"), [("pendulum_encoder_offset", ""), ("input_offset", "arm")])
def test_the_joint_that_a_sensor_effect_reads_is_declared(name, reads):
    with pytest.raises(ValueError, match=f"effect {name}: reads must be one of .*, got {reads!r}"):
        dataclasses.replace(EFFECTS[name], reads=reads)


@every_effect
@given(data=st.data())
def test_rates_are_the_oracles_at_any_state(name, data):
    """dx/dt over random states, times, torques and parameters, memory included."""
    values = data.draw(parameters_of(name))
    if name == "arm_backlash":
        assume(values["b"] > 1e-6)  # at b = 0 the play is switched off
    plant = LARGE_RIG.with_effects(Effect(name, values))
    x, tau, t = data.draw(states), data.draw(st.floats(-5, 5)), data.draw(st.floats(0, 20))
    memory = [data.draw(st.floats(-0.05, 0.05)) for _ in EFFECTS[name].memory]
    held = [x[0] - z for z in memory] if name == "arm_hysteresis" else memory  # where the stops hang, not how far
    ours = derivative(plant, [*x, *held], tau, t)
    r = oracle(plant)
    theirs = np.array(reference.rates(t, [*x, *memory], tau, r.theta, r.r, r.effects))
    if "rate" not in EFFECTS[name].kernels or "update" in EFFECTS[name].kernels:  # memory that is not integrated alone
        ours, theirs = ours[:4], theirs[:4]
    np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * (1 + np.abs(theirs).max()))


@pytest.mark.parametrize("name", SENSORS)
@given(data=st.data())
def test_readings_are_the_oracles(name, data):
    values = data.draw(parameters_of(name))
    q1, q2 = data.draw(angles), data.draw(angles)
    theirs = reference.measured(q1, q2, {name: values})
    np.testing.assert_allclose(readings(LARGE_RIG.with_effects(Effect(name, values)), q1, q2), theirs, atol=1e-14)


@pytest.mark.parametrize("name", SENSORS)
def test_sensor_effects_leave_the_motion_alone_and_show_in_the_reading(name):
    plant = with_default(TABLE_3, name)
    np.testing.assert_array_equal(a_motion(plant, 1e-3), a_motion(TABLE_3, 1e-3))
    assert np.abs(np.subtract(readings(plant, 0.6, 0.7), (0.6, 0.7))).max() > COUNT


# What physics says may only take energy out, and the parameters for which it does, on the large rig.
TH = LARGE_RIG.theta
LOSSES = {
    "arm_quadratic_drag": st.fixed_dictionaries({"c": st.floats(0, 1)}),
    "pendulum_quadratic_drag": st.fixed_dictionaries({"c": st.floats(0, 1), "λ": st.floats(0, 3)}),
    "arm_stribeck": st.fixed_dictionaries({"ΔF": st.floats(0, 1), "vs": st.floats(0.01, 3), "δ": st.floats(0.5, 4)}),
    "pendulum_stribeck": st.fixed_dictionaries(
        {"ΔF": st.floats(0, 1), "vs": st.floats(0.01, 3), "δ": st.floats(0.5, 4)}
    ),
    "arm_coulomb_asymmetry": st.fixed_dictionaries({"a": st.floats(-TH[7], TH[7])}),
    "pendulum_coulomb_asymmetry": st.fixed_dictionaries({"a": st.floats(-TH[8], TH[8])}),
    "arm_position_friction": st.fixed_dictionaries(
        {"a": st.floats(-0.7 * TH[7], 0.7 * TH[7]), "b": st.floats(-0.7 * TH[7], 0.7 * TH[7])}
    ),
    "arm_friction_drift": st.fixed_dictionaries({"a": st.floats(0, 0.2)}),
    "arm_viscous_drift": st.fixed_dictionaries({"a": st.floats(0, 1)}),
    "friction_sharpness": st.fixed_dictionaries({"r1": st.floats(0, 1000), "r2": st.floats(0, 1000)}),
}


@pytest.mark.parametrize("name", LOSSES)
@given(data=st.data())
def test_losses_never_add_energy(name, data):
    """The power of friction and effect together, v · (M q̈ + C q̇ + g) without input, is never positive."""
    effect = Effect(name, data.draw(LOSSES[name]))
    x, t = data.draw(states), data.draw(st.floats(0, 10))
    plant, lossless = LARGE_RIG.with_effects(effect), LARGE_RIG.replace(theta=[*TH[:5], 0, 0, 0, 0])
    difference = derivative(plant, x, 0.0, t)[2:4] - derivative(lossless, x, 0.0, t)[2:4]
    s, c = math.sin(x[1]), math.cos(x[1])
    M = np.array([[TH[0] + TH[1] * s**2, TH[2] * c], [TH[2] * c, TH[3]]])
    power = np.array(x[2:]) @ M @ difference
    assert power <= 1e-9 * (1 + abs(power))


@pytest.mark.parametrize("name", ["arm_presliding", "arm_backlash"])
def test_losses_with_memory_never_add_energy(name):
    """Bristle and stop hold energy for a while; with theirs counted in, the sum only falls."""
    plant = with_default(LARGE_RIG, name)
    states_ = run(plant, [0.3, 2.0, 3.0, -1.0], np.arange(1500) * 0.002, np.zeros(1500), 3.0, 1e-4)
    effects = {e.name: dict(e.parameters) for e in plant.effects}
    levels = np.array([reference.energy(0.0, x, plant.theta, effects) for x in states_])
    assert np.diff(levels).max() < 1e-8
    assert levels[-1] < levels[0] - 0.1


KEEPERS = {
    "arm_spring": {"k": 0.6, "q1n": -0.4},
    "arm_cable": {"k": 0.2, "q1n": -0.4, "k3": 0.1, "q1s": 0.5},
    "arm_taut_cable": {"k1": 0.1, "k2": 0.7, "q1n": -0.4, "qt": 0.5},
    "arm_ripple": {"A": 0.1, "n": 6, "φ": 0.3},
    "base_tilt": {"αx": 0.05, "αy": -0.03, "G1": 0.8},
}


@pytest.mark.parametrize("name", KEEPERS)
def test_conservative_effects_keep_energy_with_their_potential(name):
    plant = LARGE_RIG.replace(theta=[*TH[:5], 0, 0, 0, 0]).with_effects(Effect(name, KEEPERS[name]))
    states_ = run(plant, [0.3, 2.0, 3.0, -1.0], np.arange(300) * 0.01, np.zeros(300), 3.0, 5e-4)
    levels = [reference.energy(0.0, x, plant.theta, {name: KEEPERS[name]}) for x in states_]
    # a torque with a kink, which fixed steps do not stop at, costs more
    np.testing.assert_allclose(levels, levels[0], rtol=0.0, atol=1e-7 if name == "arm_taut_cable" else 1e-8)


@given(
    u=st.floats(-5.0, 5.0),
    m=st.one_of(st.floats(0.01, 5.0), st.just(math.inf)),
    knee=st.one_of(st.floats(0.001, 1.0), st.just(0.0)),
)
def test_saturation_with_any_knee_is_the_oracles(u, m, knee):
    plant = TABLE_3.with_effects(Effect("input_saturation", {"m": m, "knee": knee}))
    p, codes, _ = plant.packed()
    tau = np.array([u])
    map_command(p[:, None], codes, tau)
    assert tau[0] == pytest.approx(reference.rounded_clip(u, m, knee), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("theta2", [0.0, 1e-12, 0.002, -0.02, QUBE.theta[1], 3.0 * QUBE.theta[3]])
@pytest.mark.parametrize("m", [0.0, -0.9, -0.2, 0.5, 10.0])
def test_a_payload_leaves_a_rig_that_moves(theta2, m):
    """Also where no rigid body has the θ2, as a log that hardly shows it gives."""
    plant = QUBE.replace(theta=[QUBE.theta[0], theta2, *QUBE.theta[2:]])
    P, codes, _ = plant.with_effects(Effect("payload_step", {"m": m, "t0": 1.0})).packed()
    P = P[:, None]
    before, after = P[:N_BASE].copy(), P[:N_BASE].copy()
    modify_theta(np.array([0.5]), P, codes, before)
    np.testing.assert_array_equal(before, P[:N_BASE])
    modify_theta(np.array([1.5]), P, codes, after)
    theta = theta_vector(after[THETA_ROWS, 0])  # M stays positive definite
    assert abs(theta[0] / plant.theta[0] - 1.0) <= abs(m) * (1 + 1e-12)
    np.testing.assert_allclose(theta[[2, 4]], plant.theta[[2, 4]] * (1.0 + m))
