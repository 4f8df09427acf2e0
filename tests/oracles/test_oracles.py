"""The oracles against each other: energies, geometry, plain equations and MuJoCo must tell one story."""

import ast
import dataclasses
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from tests.oracles import lagrangian as lag
from tests.oracles.mujoco_model import RigidSet
from tests.oracles.reference import Reference, energy, extra_torques, rates

TABLE_3 = (0.19717, 0.03909, 0.01746, 0.01187, 0.40808, 0.0108, 0.00267, 0.11456, 0.00732)
RIGID = RigidSet(J1=0.004, m2=0.1, L1=0.2, l2=0.15, J2=0.001, damping=(0.002, 0.0005))
FRICTIONLESS = (*TABLE_3[:5], 0.0, 0.0, 0.0, 0.0)


def test_oracles_import_nothing_of_the_package():
    """A reference that called the code under test would agree with anything."""
    for file in Path(__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                assert name.split(".")[0] not in {"furuta_gym", "identification", "controllers", "experiments"}


def test_geometry_gives_table_2_only_for_a_pendulum_that_is_round_about_its_joint():
    """θ2 = m2 l2² + J_tangent − J_rod: Table 2 for J_tangent = J_rod, and θ2 = θ4 for a thin rod."""
    th1, th2, th3, th4, th5 = lag.theta_of_geometry()
    round_body = {lag.J_tangent: 0, lag.J_rod: 0}
    assert sp.simplify(th1.subs(round_body) - (lag.m2 * lag.L1**2 + lag.J1)) == 0
    assert sp.simplify(th2.subs(round_body) - lag.m2 * lag.l2**2) == 0
    assert sp.simplify(th3 - lag.L1 * lag.l2 * lag.m2) == 0
    assert sp.simplify(th4 - (lag.m2 * lag.l2**2 + lag.J_joint)) == 0
    assert sp.simplify(th5 - lag.l2 * lag.m2 * lag.gravity) == 0
    thin_rod = {lag.J_rod: 0, lag.J_tangent: lag.J_joint}
    assert sp.simplify((th2 - th4).subs(thin_rod)) == 0


def test_theta4_is_never_below_theta2_for_a_rigid_body():
    """θ4 − θ2 = J_joint + J_rod − J_tangent, which the triangle inequality of inertias keeps at or above zero."""
    _, th2, _, th4, _ = lag.theta_of_geometry()
    assert sp.simplify(th4 - th2 - (lag.J_joint + lag.J_rod - lag.J_tangent)) == 0


def test_geometry_moves_as_model_5_in_theta():
    geometry, model = lag.from_geometry(), lag.from_theta()
    named = dict(zip(lag.theta[:5], lag.theta_of_geometry(), strict=True))
    for ours, theirs in ((model.M, geometry.M), (model.h, geometry.h), (model.g, geometry.g)):
        assert (ours.subs(named) - theirs).applyfunc(sp.simplify) == sp.zeros(*ours.shape)


def test_christoffel_gives_the_corrected_c11_not_the_printed_one():
    mass = lag.from_theta().M
    C = lag.christoffel(mass)
    assert (C - lag.coriolis()).applyfunc(sp.simplify) == sp.zeros(2, 2)
    skew = lag.mass_rate(mass) - 2 * C
    assert (skew + skew.T).applyfunc(sp.simplify) == sp.zeros(2, 2)
    printed = lag.mass_rate(mass) - 2 * lag.coriolis(printed=True)
    assert (printed + printed.T).applyfunc(sp.simplify) != sp.zeros(2, 2)


def test_plain_equations_are_the_lagrangian_ones():
    numeric, rng = lag.numeric(), np.random.default_rng(1)
    for _ in range(20):
        q1, q2, v1, v2, tau = rng.uniform(-3, 3, 5)
        state = (q1, q2, v1, v2, FRICTIONLESS)
        a = np.array(rates(0.0, (q1, q2, v1, v2), tau, FRICTIONLESS, 100.0, {})[2:])
        left = numeric["M"](*state) @ a + (numeric["h"](*state) + numeric["g"](*state)).ravel()
        np.testing.assert_allclose(left, [tau, 0.0], atol=1e-12)


@pytest.mark.parametrize("rod", [False, True], ids=["round", "rod"])
def test_plain_equations_move_as_mujoco(rod):
    rigid = dataclasses.replace(RIGID, rod=rod)
    times, x0 = np.linspace(0, 4, 21), [0.3, 1.0, 2.0, -3.0]
    ours = Reference(tuple(rigid.theta), 100.0).run(x0, times, [0.0], [0.0])
    np.testing.assert_allclose(rigid.run(x0, times), ours, atol=1e-8)


def test_rigid_set_comes_back_from_its_theta():
    back = dataclasses.asdict(RigidSet.from_theta(RIGID.theta))
    for name, value in dataclasses.asdict(RIGID).items():
        np.testing.assert_allclose(back[name], value, rtol=1e-12, err_msg=name)


def test_base_tilt_of_the_table_is_gravity_tilted_in_the_geometry():
    """The table's torques follow from −∂V/∂q of the weights under g·(αx, αy, −1)."""
    ax, ay, G1 = sp.symbols("alpha_x alpha_y G1")
    radial = sp.Matrix([sp.cos(lag.q1), sp.sin(lag.q1)])
    tangent = sp.Matrix([-sp.sin(lag.q1), sp.cos(lag.q1)])
    tilt, th5 = sp.Matrix([ax, ay]), lag.theta[4]
    V = -G1 * radial.dot(tilt) - th5 * sp.sin(lag.q2) * tangent.dot(tilt)
    torque = sp.lambdify((lag.q1, lag.q2, ax, ay, G1, th5), [-sp.diff(V, lag.q1), -sp.diff(V, lag.q2)])
    p = {"αx": 0.03, "αy": -0.02, "G1": 0.7}
    for q1, q2 in np.random.default_rng(2).uniform(-3, 3, (20, 2)):
        expected = torque(q1, q2, *p.values(), TABLE_3[4])
        given = extra_torques(0.0, q1, q2, 0.0, 0.0, TABLE_3, 100.0, {"base_tilt": p}, TABLE_3)
        np.testing.assert_allclose(given, expected, atol=1e-14)


CONSERVATIVE = {
    "nothing": {},
    "arm_spring": {"arm_spring": {"k": 0.6, "q1n": -0.4}},
    "arm_cable": {"arm_cable": {"k": 0.2, "q1n": -0.4, "k3": 0.1, "q1s": 0.5}},
    "arm_taut_cable": {"arm_taut_cable": {"k1": 0.1, "k2": 0.7, "q1n": -0.4, "qt": 0.5}},
    "arm_ripple": {"arm_ripple": {"A": 0.1, "n": 6, "φ": 0.3}},
    "base_tilt": {"base_tilt": {"αx": 0.05, "αy": -0.03, "G1": 0.8}},
}


@pytest.mark.parametrize("effects", CONSERVATIVE.values(), ids=CONSERVATIVE)
def test_reference_keeps_the_energy_of_conservative_effects(effects):
    theta = (*RIGID.theta[:5], 0.0, 0.0, 0.0, 0.0)
    states = Reference(theta, 100.0, effects).run([0.2, 0.5, 1.0, -2.0], np.linspace(0, 3, 31), [0.0], [0.0])
    levels = [energy(0.0, x, theta, effects) for x in states]
    np.testing.assert_allclose(levels, levels[0], atol=1e-9)
    assert np.ptp(states[:, 0]) > 0.5


DISSIPATIVE = {
    "arm_presliding": {"arm_presliding": {"σ0": 30.0}},
    "abrupt bristle": {"arm_presliding": {"σ0": 30.0, "i": 0.4}},
    "arm_backlash": {"arm_backlash": {"b": 0.02}},
    "arm_hysteresis": {"arm_hysteresis": {"κ": 1.0, "d": 0.05, "κ2": 0.3, "d2": 0.2}},
    "gradual": {"arm_hysteresis": {"κ": 1.0, "d": 0.05, "κ2": 0.3, "d2": 0.2, "ρ": 0.7}},
}


@pytest.mark.parametrize("effects", DISSIPATIVE.values(), ids=DISSIPATIVE)
def test_bristle_play_and_stops_only_lose_energy(effects):
    states = Reference(TABLE_3, 100.0, effects).run([0.2, 0.5, 1.0, -2.0], np.linspace(0, 3, 301), [0.0], [0.0])
    levels = np.array([energy(0.0, x, TABLE_3, effects) for x in states])
    assert np.diff(levels).max() < 1e-9
    assert levels[0] - levels[-1] > 0.01


def test_lag_closed_form_solves_its_equation():
    """A lag of T reaches 1 − e⁻¹ of a step after T; seen on a frictionless arm whose pendulum hangs still."""
    heavy = (1.0, 1e-9, 1e-9, 1e-3, 1e-9, 0.0, 0.0, 0.0, 0.0)  # the arm alone: q̈1 = τ
    T, times = 0.1, np.linspace(0, 0.5, 51)
    states = Reference(heavy, 100.0, {"actuator_lag": {"T": T}}).run([0, np.pi, 0, 0], times, [0.0], [1.0], lag0=0.0)
    np.testing.assert_allclose(states[:, 2], times - T * (1 - np.exp(-times / T)), atol=1e-8)


def test_delay_shifts_the_command_by_a_fraction_of_a_sample():
    heavy = (1.0, 1e-9, 1e-9, 1e-3, 1e-9, 0.0, 0.0, 0.0, 0.0)
    t_u, u = np.arange(10) * 0.01, np.r_[0.0, np.ones(9)]
    states = Reference(heavy, 100.0, {"input_delay": {"d": 0.0137}}).run([0, np.pi, 0, 0], [0.0, 0.05, 0.09], t_u, u)
    np.testing.assert_allclose(states[1:, 2], [0.05 - 0.0237, 0.09 - 0.0237], atol=1e-8)
