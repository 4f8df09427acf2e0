"""What ranges draw in cases of their own: two axes under one chance, tails, times of a change, friction that drifts."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from furuta_gym import cores as counted
from furuta_gym import open_loop, simulate
from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.registration import MAX_EPISODE_STEPS
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import QUBE, Effect, Plant


def drawn(asked: str, n: int = 3000, **options):
    return FurutaVectorEnv(n, "qube", randomize=asked, **options).reset(seed=4)[1]


@pytest.mark.parametrize("name", ["noise_std", "encoder_offset"])
def test_a_chance_is_tossed_once_for_both_axes(name):
    found = drawn(f"{name}=chance:0.3:uniform:0.001,0.002", **{name: (0.0, 0.0)})["rig"][name]
    assert (found > 0.0).any(axis=1).mean() == pytest.approx(0.3, abs=0.03)
    assert ((found > 0.0).all(axis=1) == (found > 0.0).any(axis=1)).all()
    on = found[found[:, 0] > 0.0]
    assert abs(np.corrcoef(on.T)[0, 1]) < 0.1  # and each has a value of its own


def test_a_normal_range_has_no_heap_at_its_bounds():
    found = drawn("noise_std=normal:0.0005,0.001")["rig"]["noise_std"]
    assert (found > 0.0).all()
    above = np.histogram(found, 4, (0.0, 0.001))[0]  # symmetric about its mean, as far as it is drawn
    assert above[0] + above[1] == pytest.approx(above[2] + above[3], rel=0.1)


@pytest.mark.parametrize(
    "options",
    [
        {"effect_probabilities": {"payload_step": 1.0}},
        {"randomize": "payload_step=chance:1"},
        {"randomize": "payload_step.m=uniform:0.1,0.2"},
    ],
)
def test_a_pendulum_that_becomes_heavier_does_so_within_the_episode(options):
    env = FurutaVectorEnv(2000, "qube", **options)
    t0 = env.reset(seed=1)[1]["plant"]["effects"]["payload_step"]["t0"]
    episode = MAX_EPISODE_STEPS * env.setup.action_period
    assert t0.min() < 0.05 * episode
    assert 0.95 * episode < t0.max() <= episode
    for limit in (1.0, 60.0):
        other = FurutaVectorEnv(2000, "qube", time_limit=limit, max_episode_steps=None, **options)
        t0 = other.reset(seed=1)[1]["plant"]["effects"]["payload_step"]["t0"]
        assert 0.9 * limit < t0.max() <= limit + other.setup.action_period


def test_a_time_that_is_given_or_measured_stays():
    asked = "payload_step.m=uniform:0.1,0.2 payload_step.t0=2"
    assert (drawn(asked)["plant"]["effects"]["payload_step"]["t0"] == 2.0).all()
    plant = QUBE.with_effects(Effect("payload_step", {"m": 0.1, "t0": 8.0}))
    info = FurutaVectorEnv(100, plant, effect_probabilities={"payload_step": 0.5}).reset(seed=1)[1]
    assert (info["plant"]["effects"]["payload_step"]["t0"] == 8.0).all()


@pytest.mark.parametrize(("effect", "a"), [("arm_viscous_drift", -0.2), ("arm_friction_drift", -0.1)])
def test_friction_that_falls_vanishes_and_drives_nothing(effect, a):
    """After 1/|a| seconds there is none of it left, and what moves does not gain speed without a command."""
    plant = QUBE.with_effects(Effect(effect, {"a": a}))
    t = 0.004 * np.arange(7500)
    shaken = np.where(t < 2.0, 3.0 * np.sign(np.sin(6.0 * t)), 0.0)
    run = simulate(plant, open_loop(), 30.0, 0.004, excitation=shaken, x0=(0.0, np.pi, 0.0, 0.0))
    speed = np.abs(run.state[:, 2])
    assert speed[t > 25.0].max() <= speed[t < 3.0].max()


def test_chance_makes_no_learned_torque():
    with pytest.raises(ValueError, match="the plant has no arm_learned"):
        FurutaEnv("qube", effect_probabilities={"arm_learned": 1.0})


def test_a_parameter_may_be_named_without_greek_letters():
    plain = drawn("arm_presliding.sigma0=100")["plant"]["effects"]["arm_presliding"]["σ0"]
    assert (plain == 100.0).all()


def test_the_spec_of_a_batch_has_a_json_whatever_its_mode(tmp_path):
    path = QUBE.save(tmp_path / "rig.json")
    envs = gymnasium.make_vec("FurutaBalance-v0", num_envs=2, plant=path, autoreset_mode=AutoresetMode.SAME_STEP)
    again = gymnasium.make_vec(gymnasium.envs.registration.EnvSpec.from_json(envs.spec.to_json()), num_envs=2)
    assert again.unwrapped.autoreset_mode is AutoresetMode.SAME_STEP


def test_the_mask_of_a_reset_stays_the_callers():
    envs = FurutaVectorEnv(3, "qube")
    envs.reset(seed=0)
    mask = np.array([True, False, True])
    info = envs.reset(options={"reset_mask": mask})[1]
    mask[:] = False
    for key in ("_state", "_measured_state", "_command"):
        assert info[key].tolist() == [True, False, True], key
    info["_state"][:] = False
    assert info["_command"].any()


def test_a_container_has_the_cores_of_its_quota(monkeypatch, tmp_path):
    for text, most in (("200000 100000\n", 2), ("50000 100000\n", 1), ("max 100000\n", 64), ("", 64)):
        (tmp_path / "cpu.max").write_text(text)
        monkeypatch.setattr(counted, "_QUOTA", tmp_path / "cpu.max")
        monkeypatch.setattr(counted.os, "sched_getaffinity", lambda _: set(range(64)), raising=False)
        assert counted.cores() == most
    monkeypatch.setattr(counted, "_QUOTA", tmp_path / "none")
    assert counted.cores() == 64


def test_a_plant_shares_nothing_that_can_be_changed():
    given = {"encoder_counts": np.int64(2048), "noise_std": [0.1, 0.2]}
    plant = QUBE.replace(sensors=given)
    told = plant.to_dict()
    given["noise_std"][0] = 9.0
    told["sensors"]["noise_std"][0] = 9.0
    assert plant.sensors["noise_std"] == [0.1, 0.2]
    assert Plant.from_dict(plant.to_dict()) == plant
    assert '"encoder_counts": 2048' in plant.to_json()
