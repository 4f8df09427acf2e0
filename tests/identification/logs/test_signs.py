"""The motion tells zero and signs: never wrongly, whatever the rig, the encoder and the effect that is hidden."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import EFFECTS, LARGE_RIG, QUBE, TABLE_3, Effect
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate
from identification.design.signals import excitation
from identification.logs.signs import Signs, motion_signs
from tests.factories import paper_log


def signs_of(run) -> Signs:
    return motion_signs(run.t, run.measured[:, 0], run.measured[:, 1], run.command)


@pytest.mark.parametrize("name", EFFECTS)
def test_a_hidden_effect_does_not_turn_a_sign(name):
    log, _ = paper_log(0.004, 10.0, 4096, TABLE_3.with_effects(TABLE_3.default_effect(name)))
    found = motion_signs(log.t, log.q1, log.q2, log.u)
    assert (found.gravity, found.coupling) == (1, 1)
    late = name in ("input_delay", "actuator_lag")  # then the command's sign may not be clear
    assert found.command == 1 or (late and found.command == 0)


@pytest.mark.parametrize("stiffness", [1.0, 2.0, 5.0])
def test_a_strong_cable_does_not_take_the_sign_of_the_arms_inertia(stiffness):
    """Hanging and driven slowly, the command holds the cable, and next to nothing of it moves the arm."""
    plant = QUBE.with_effects(Effect("arm_spring", {"k": stiffness, "q1n": 0.0}))
    t = np.arange(0.0, 8.0, 0.004)
    run = simulate(plant, open_loop(2.0 * np.sin(2 * np.pi * 0.5 * t)), 8.0, 0.004, Sensors(2048), x0=(0, np.pi, 0, 0))
    assert signs_of(run).command >= 0


@pytest.mark.parametrize("plant", [QUBE, LARGE_RIG], ids=["qube", "large"])
@pytest.mark.parametrize("counts", [500, 4096])
@pytest.mark.parametrize("name", ["chirp", "prbs", "square"])
def test_hanging_in_open_loop(plant, counts, name):
    d = excitation(name, 0.3 * plant.u_max, 8.0, 1)
    run = simulate(plant, open_loop(), 8.0, 0.004, Sensors(encoder_counts=counts), d, (0, np.pi, 0, 0))
    assert signs_of(run) == Signs(1, 1, 1)


def test_a_free_decay_shows_gravity_and_says_nothing_of_the_command():
    run = simulate(QUBE, open_loop(), 8.0, 0.004, x0=(0, 1.0, 0, 0))
    signs = signs_of(run)
    assert (signs.gravity, signs.command) == (1, 0)
    shifted = motion_signs(run.t, run.measured[:, 0], run.measured[:, 1] + np.pi, run.command)
    assert shifted.gravity == -1


@pytest.mark.parametrize(
    ("t", "q1", "q2"),
    [
        (np.arange(2000) * 0.002, np.zeros(2000), np.zeros(2000)),
        (np.arange(2000) * 0.2, np.sin(np.arange(2000)), np.cos(np.arange(2000))),
        (np.arange(60) * 0.002, np.sin(np.arange(60)), np.cos(np.arange(60))),
        (np.arange(2000) * 0.002, *np.random.default_rng(0).normal(0, 1e-3, (2, 2000))),
    ],
    ids=["still", "slow clock", "short", "noise"],
)
def test_silence_where_nothing_can_be_told(t, q1, q2):
    assert motion_signs(t, q1, q2, np.sin(t)) == Signs(0, 0, 0)


def test_coarse_encoders_on_small_motions_are_never_read_wrongly():
    for seed in range(6):
        log, _ = paper_log(0.002, 10.0, 500, seed=seed)
        signs = motion_signs(log.t, log.q1, log.q2, log.u)
        assert min(signs.gravity, signs.coupling, signs.command) >= 0


@pytest.mark.parametrize(
    ("signs", "zero", "flip", "expected"),
    [
        (Signs(1, 1, 1), "upright", (), None),
        (Signs(0, 0, 0), "hanging", ("q1",), None),
        (Signs(-1, 1, 1), "upright", (), "--pendulum-zero hanging --flip q2."),
        (Signs(-1, -1, 1), "upright", (), "--pendulum-zero hanging and no --flip."),
        (Signs(-1, 1, 1), "hanging", ("q2",), "--pendulum-zero upright and no --flip."),
        (Signs(1, -1, 1), "hanging", (), "--pendulum-zero hanging --flip q2."),
        (Signs(1, -1, -1), "upright", (), "--pendulum-zero upright --flip q1."),
        (Signs(1, 1, -1), "upright", ("q2",), "--pendulum-zero upright --flip q2,u."),
    ],
)
def test_advice_completes_the_options_that_were_given(signs, zero, flip, expected):
    advice = signs.advice(zero, flip)
    assert advice is None if expected is None else advice.endswith(expected)
