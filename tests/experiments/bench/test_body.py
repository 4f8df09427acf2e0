"""The bodies: energy, MuJoCo, and SciPy as oracles."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from experiments.bench import SETS, HiddenEffect, Laboratory, Rig
from experiments.bench.control import linear_model, lqr_gain
from experiments.bench.kernels.body import energy, mass_and_bias
from experiments.bench.kernels.fields import N_STATES

NO_LINK = tuple(np.zeros(2) for _ in range(5))
CONSISTENT = [name for name, s in SETS.items() if s.bodies is not None]


def _still(name, **more):
    """A rig of this set without any friction."""
    from dataclasses import replace

    return Rig(replace(SETS[name], viscous=(0.0, 0.0), coulomb=(0.0, 0.0)), **more)


def _momentum_oracle(t, z, s, tau):
    """Hamilton's equations, written once more: z = (q1, q2, p1, p2), friction as in model (5)."""
    q2, p = z[1], z[2:]
    th1, th2, th3, th4, th5, th6, th7, th8, th9 = s.theta
    m = np.array([[th1 + th2 * np.sin(q2) ** 2, th3 * np.cos(q2)], [th3 * np.cos(q2), th4]])
    v = np.linalg.solve(m, p)
    dm = np.array([[th2 * np.sin(2 * q2), -th3 * np.sin(q2)], [-th3 * np.sin(q2), 0.0]])
    force = np.array([tau, 0.5 * v @ dm @ v + th5 * np.sin(q2)])
    r = s.sharpness
    force -= np.array([th6, th7]) * v + np.array([th8, th9]) * np.tanh(r * v)
    return np.concatenate([v, force])


@pytest.mark.parametrize("name", SETS)
def test_energy_is_kept_without_friction(name):
    rig = _still(name, engine="lagrange")
    lab = Laboratory(rig, noise_free=True)
    lab.reset(q=(0.3, 1.0), v=(2.0, -1.0))
    p = rig.draft().fields[0]
    x = np.zeros(N_STATES)
    energies = []
    for _ in range(1000):
        lab.step(0.0)
        x[:4] = lab.state
        energies.append(energy(0.0, x, p))
    scale = rig.kind.inertia[4]
    assert np.ptp(energies) < 1e-6 * scale


@pytest.mark.parametrize("name", SETS)
def test_motion_agrees_with_hamiltons_equations_by_scipy(name):
    rig, s = Rig(name, engine="lagrange"), SETS[name]
    lab = Laboratory(rig, noise_free=True, sample_time=0.002)
    lab.reset(q=(0.0, 2.5))
    tau = 0.6 * s.drive
    for _ in range(500):
        lab.step(tau)
    q2 = 2.5
    m = np.array([[s.theta[0] + s.theta[1] * np.sin(q2) ** 2, s.theta[2] * np.cos(q2)], [0.0, s.theta[3]]])
    m[1, 0] = m[0, 1]
    run = solve_ivp(
        _momentum_oracle, (0, 1), [0, q2, *(m @ [0, 0])], args=(s, tau), method="DOP853", rtol=1e-11, atol=1e-12
    )
    assert lab.state[:2] == pytest.approx(run.y[:2, -1], abs=1e-6)


@pytest.mark.parametrize("name", CONSISTENT)
def test_mujoco_has_the_same_mass_matrix_and_forces(name):
    pytest.importorskip("mujoco")
    rng = np.random.default_rng(1)
    up = (0.05, -0.08, 0.99)
    rig = Rig(name, engine="mujoco")
    draft, body = rig.mechanics()
    assert body is not None
    from experiments.bench import mujoco_body

    tilted = mujoco_body.make(rig.kind.bodies, 0.0, up)
    draft.put(nx=up[0], ny=up[1], nz=up[2], **tilted.addresses)
    plain = draft.fields.copy()
    plain["mujoco"] = 0
    for _ in range(20):
        x = np.zeros(N_STATES)
        x[:4] = rng.normal(size=4) * [2, 2, 5, 5]
        ours = mass_and_bias(0.0, x, plain[0], NO_LINK)
        theirs = mass_and_bias(0.0, x, draft.fields[0], tilted.link)
        assert theirs == pytest.approx(ours, rel=1e-9, abs=1e-9 * rig.kind.inertia[0])


@pytest.mark.parametrize("name", CONSISTENT)
@pytest.mark.parametrize("effect", [None, "arm_backlash", "base_tilt"])
def test_mujoco_and_lagrange_move_alike(name, effect):
    pytest.importorskip("mujoco")
    effects = () if effect is None else (HiddenEffect(effect, form="bench"),)
    ends = []
    for engine in ("mujoco", "lagrange"):
        lab = Laboratory(Rig(name, effects, engine=engine), noise_free=True)
        assert lab.engine == engine
        lab.reset(q=(0.2, 3.0), v=(1.0, 0.0))
        for k in range(round(2.0 / lab.period)):
            lab.step(SETS[name].drive * np.sin(9.0 * k * lab.period))
        ends.append(lab.state)
    assert ends[0] == pytest.approx(ends[1], abs=2e-6)


def test_mujoco_is_refused_where_no_rigid_body_has_the_parameters():
    with pytest.raises(ValueError, match="rigid bodies"):
        Rig("table3", engine="mujoco")


def test_a_motor_heavier_than_its_arm_is_moved_by_lagrange():
    play = HiddenEffect("arm_backlash", 1.0, "table", variation=3765499)
    options = {"individual": 3409866, "scatter": 0.1}
    _, body = Rig("servo", [play], **options).mechanics()
    assert body is None
    with pytest.raises(ValueError, match="heavier than its motor's share"):
        Rig("servo", [play], engine="mujoco", **options)


@pytest.mark.parametrize("name", SETS)
def test_linear_model_is_the_slope_of_the_mechanics(name):
    rig = _still(name, engine="lagrange")
    a, b = linear_model(rig.kind)
    lab = Laboratory(rig, noise_free=True, sample_time=1e-4)
    eps = 1e-5
    for x0 in np.eye(4) * eps:
        lab.reset(q=(x0[0], x0[2]), v=(x0[1], x0[3]))
        lab.step(0.0)
        q1, q2, v1, v2 = lab.state
        rate = (np.array([q1, v1, q2, v2]) - x0) / 1e-4
        assert rate == pytest.approx(a @ x0, abs=2e-3 * eps * np.abs(a).max())
    closed = a - np.outer(b, lqr_gain(rig.kind))
    assert np.linalg.eigvals(closed).real.max() < -0.5


@pytest.mark.parametrize("individual", range(1, 60, 7))
@pytest.mark.parametrize("name", SETS)
def test_every_individual_has_a_positive_mass_matrix(name, individual):
    s = SETS[name].individual(individual, 0.1)
    th1, _, th3, th4, th5 = s.inertia
    assert th1 * 0.7 * th4 > th3**2
    assert th5 > 0
    assert s.inertia != SETS[name].inertia
    if s.bodies is not None:
        from experiments.bench.mujoco_body import model_xml

        assert "furuta" in model_xml(s.bodies, 0.15 * th1)
