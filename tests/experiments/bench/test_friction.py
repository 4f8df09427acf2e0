"""Hard friction: events, exact sticking, and its limit."""

import math

import numpy as np
import pytest

from experiments.bench import SETS, HiddenEffect, Laboratory, Rig


def test_an_arm_below_break_away_does_not_move_at_all():
    lab = Laboratory(Rig("workshop", friction="hard", engine="lagrange"), noise_free=True)
    lab.reset(q=(0.4, math.pi))
    level = SETS["workshop"].coulomb[0]
    for _ in range(200):
        lab.step(0.999 * level)
    assert lab.stuck == (True, True)
    assert lab.state.tolist() == [0.4, math.pi, 0.0, 0.0]
    for _ in range(50):
        lab.step(1.01 * level)
    assert not lab.stuck[0]
    assert lab.state[0] > 0.4


def test_a_swinging_pendulum_comes_to_rest_off_its_lowest_point_and_stays_there():
    lab = Laboratory(Rig("servo", friction="hard"), noise_free=True)
    lab.reset(q=(0.0, math.pi + 0.3))
    seen = []
    for _ in range(round(40 / lab.period)):
        lab.step(0.0)
        seen.append((*lab.state, *lab.stuck))
    last = np.array(seen[-500:])
    assert lab.stuck == (True, True)
    assert np.ptp(last[:, :4], axis=0).tolist() == [0.0] * 4
    s = SETS["servo"]
    assert 0 < abs(lab.state[1] - math.pi) <= math.asin(s.coulomb[1] / s.inertia[4]) + 1e-9


@pytest.mark.parametrize("name", SETS)
def test_hard_friction_is_the_limit_of_a_sharp_smooth_one(name):
    from dataclasses import replace

    sharp = replace(SETS[name], sharpness=3e4)
    runs = []
    for rig in (Rig(sharp, engine="lagrange"), Rig(name, friction="hard", engine="lagrange")):
        lab = Laboratory(rig, noise_free=True)
        lab.reset(q=(0.0, math.pi - 0.5))
        run = []
        for k in range(round(2.0 / lab.period)):
            lab.step(1.3 * SETS[name].drive * math.sin(7.0 * k * lab.period))
            run.append(lab.state)
        runs.append(np.array(run))
    assert np.abs(runs[0][:, 2]).max() > 0.3
    assert runs[0][:, :2] == pytest.approx(runs[1][:, :2], abs=2e-4)


def test_hard_friction_never_adds_energy():
    from experiments.bench.kernels.body import energy
    from experiments.bench.kernels.fields import N_STATES

    rig = Rig("workshop", (HiddenEffect("stick_slip"),), engine="lagrange")
    lab = Laboratory(rig, noise_free=True)
    lab.reset(q=(0.0, 2.0), v=(3.0, 0.0))
    p, x, energies = rig.draft().fields[0], np.zeros(N_STATES), []
    for _ in range(3000):
        x[:4] = lab.state
        energies.append(energy(0.0, x, p))
        lab.step(0.0)
    assert np.diff(energies).max() < 1e-9
    assert energies[-1] < energies[0] - 0.1


def test_static_level_above_the_sliding_one_makes_the_arm_jump():
    rig = Rig("workshop", (HiddenEffect("stick_slip", parameters={"static": 1.5}),), engine="lagrange")
    lab = Laboratory(rig, noise_free=True)
    lab.reset(q=(0.0, math.pi))
    level = SETS["workshop"].coulomb[0]
    k = 0
    while lab.stuck[0]:
        lab.step(k * 1e-4)
        k += 1
    assert (k - 1) * 1e-4 == pytest.approx(1.5 * level, abs=2e-4)
    lab.step(k * 1e-4)
    assert lab.state[2] > 0.3 * 0.5 * level * lab.period / SETS["workshop"].inertia[0]
