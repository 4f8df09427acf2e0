"""Envs as values: copies, what they say of their plant, and steps that stay stable whatever is asked for."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest

from furuta_gym.envs import FurutaEnv, FurutaVectorEnv
from furuta_gym.plant import QUBE, TABLE_3, Covariance, Effect


@pytest.mark.parametrize(
    "make", [lambda: FurutaEnv(QUBE, render_mode="rgb_array"), lambda: FurutaVectorEnv(2, plant=QUBE)]
)
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_an_env_can_be_copied_after_rendering(make, copied):
    pytest.importorskip("pygame")
    env = make()
    env.reset(seed=0)
    env.render()
    twin = copied(env)
    action = np.full(env.action_space.shape, 0.3, dtype=np.float32)
    assert np.array_equal(env.step(action)[0], twin.step(action)[0])


def test_plants_and_effects_are_plain_values():
    spring = Effect("arm_spring", {"k": 0.2})
    assert {spring: 1}[Effect("arm_spring", {"k": 0.2})] == 1
    assert copy.deepcopy(QUBE) == QUBE
    spec = gym.make("furuta_gym:FurutaID-v0", plant="qube").spec
    assert spec is not None
    assert "qube" in spec.to_json()


def test_the_plant_of_an_env_that_draws_none_is_the_one_given():
    plant = QUBE.replace(covariance=Covariance(("theta1",), np.array([[1e-6]])))
    env, batch = FurutaEnv(plant), FurutaVectorEnv(2, plant=plant)
    env.reset(seed=0)
    batch.reset(seed=0)
    assert env.plant is env.setup.plant
    assert env.plant == plant
    assert batch.plants() == [plant, plant]


def test_a_bristle_stays_stable_at_the_longest_step():
    plant = TABLE_3.replace(friction_sharpness=20.0)
    plant = plant.with_effects(plant.default_effect("arm_presliding"))
    env = FurutaEnv(plant, "swing_up", sample_time=0.01, longest_step=0.05)
    env.reset(seed=0, options={"state": [0, np.pi, 0, 0]})
    for _ in range(50):
        state = env.step([2.0])[4]["state"]
    assert np.abs(state).max() < 100


def test_drawn_sharpness_shortens_the_step():
    sharp = QUBE.replace(covariance=Covariance(("r",), np.array([[100.0**2]])))
    steps = [FurutaEnv(sharp, randomize=drawn).setup._substeps() for drawn in (False, True)]
    # two standard deviations above the plant's own
    as_sharp = FurutaEnv(QUBE.replace(friction_sharpness=QUBE.sharpness[0] + 200.0)).setup._substeps()
    assert steps == [FurutaEnv(QUBE).setup._substeps(), as_sharp]
    assert steps[1] > steps[0]


def test_friction_of_effects_shortens_the_step():
    """Their own value, or what is drawn: up to the end of the range."""
    stribeck = QUBE.with_effects(Effect("arm_stribeck", {"ΔF": 25.0 * QUBE.theta[7], "vs": 0.3}))
    plain, strong = (FurutaEnv(plant).setup._substeps() for plant in (QUBE, stribeck))
    assert strong > 10 * plain
    assert FurutaEnv(QUBE, randomize="arm_stribeck.ΔF=uniform:0,3").setup._substeps() == strong


@pytest.mark.parametrize("drawn", [
    {"effect_probabilities": {"friction_sharpness": 0.01}},
    {"effect_probabilities": {"arm_presliding": 0.01}},
    {
        "plant": QUBE.with_effects(Effect("friction_sharpness", {"r1": 9.0, "r2": 9.0})),
        "randomize": "friction_sharpness.r1=chance:0.5:uniform:5,10",
    },
    {"effect_probabilities": {"friction_sharpness": 0.5, "arm_presliding": 0.5, "arm_stribeck": 0.5}},
    {"plant": QUBE.replace(theta=[*QUBE.theta[:8], 30.0 * QUBE.theta[8]]), "randomize": "theta=physical:0.2"},
])  # fmt: skip
def test_the_step_suits_every_rig_that_may_be_drawn(drawn):
    env = FurutaVectorEnv(300, **{"plant": QUBE} | drawn)
    env.reset(seed=1)
    stiffest = max(plant.friction_rate for plant in env.plants())
    h = env.setup.sample_time / env.setup.substeps
    assert h * stiffest <= 0.4 * (1 + 1e-6)
    assert h * stiffest > 0.2  # and is no finer than it needs to be


def test_a_step_that_is_asked_too_short_is_said_to_be_the_cause():
    with pytest.raises(ValueError, match=r"at most 10000 .*longest_step is 1e-05 s\. Raise it"):
        FurutaEnv(QUBE, sample_time=1.0, longest_step=1e-5)
    with pytest.raises(ValueError, match="Lower friction_sharpness"):
        FurutaEnv(QUBE.replace(friction_sharpness=1e6), sample_time=1.0)
