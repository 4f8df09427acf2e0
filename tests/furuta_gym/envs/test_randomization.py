"""Plants drawn at reset: against `Covariance.draw`, whose compiled twin they come from, and effects by chance."""

import numpy as np
import pytest

from controllers.training.setup import Training
from furuta_gym.envs.draws import draw_parameters
from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.randomization import randomization
from furuta_gym.envs.streams import normal_pair, uniform
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import EFFECTS, PLANTS, QUBE, TABLE_3, THETA_NAMES, Covariance, Effect
from furuta_gym.plant.sampling import _shifted, sampled_plants
from furuta_gym.plant.sets import SPREAD

from .helpers import SPRING, uncertain


def test_streams_are_uniform_and_normal_and_differ():
    streams = np.array([1, 2], dtype=np.uint64)
    u = np.array([[uniform(streams, k) for _ in range(20_000)] for k in range(2)])
    assert u.min() >= 0.0
    assert u.max() < 1.0
    assert np.histogram(u[0], 20, (0, 1))[0].std() < 60  # sd of a bin's count: 31
    assert abs(np.corrcoef(u)[0, 1]) < 0.03
    z = np.array([normal_pair(streams, 0) for _ in range(20_000)])
    assert np.abs(z.mean(axis=0)).max() < 0.03
    np.testing.assert_allclose(np.cov(z.T), np.eye(2), atol=0.03)
    assert (z**4).mean() == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize("share", [0.05, 0.6])
def test_compiled_draw_is_the_plants_own(share):
    """From the same normal numbers both give the same plant, or both refuse it and draw again."""
    carried = TABLE_3.with_effects(SPRING, Effect("actuator_lag", {"T": 0.01}))
    plant = uncertain(carried, share, "r", "arm_spring.k", "actuator_lag.T")
    tables = randomization(plant, True, {})
    streams, twin = np.array([9], dtype=np.uint64), np.array([9], dtype=np.uint64)
    P = np.zeros((tables.table.shape[1], 1))
    values, vectors = np.linalg.eigh(plant.covariance.matrix)
    factor = vectors * np.sqrt(np.maximum(values, 0))
    refused = 0
    for _ in range(200):
        draw_parameters(P, 0, streams, 0, tables.table, tables.root, tables.switches)
        while True:
            z = np.array([normal_pair(twin, 0)[0] for _ in plant.covariance.names])
            expected = _shifted(plant, dict(zip(plant.covariance.names, factor @ z, strict=True)))
            if expected is not None:
                break
            refused += 1
        np.testing.assert_allclose(P[:, 0], expected.packed().p, rtol=1e-10)
        assert tables.drawn_plant(P[:, 0]).theta == pytest.approx(expected.theta)
        np.testing.assert_array_equal(streams, twin)
    assert (refused > 50) == (share > 0.5)


def test_drawn_plants_have_the_covariance_of_the_file():
    plant = uncertain(QUBE, 0.03)
    batch = FurutaVectorEnv(4000, plant=plant, randomize=True)
    theta = batch.reset(seed=0)[1]["plant"]["theta"]
    scale = np.sqrt(np.diag(plant.covariance.matrix))
    np.testing.assert_allclose((theta.mean(axis=0) - plant.theta) / scale, 0, atol=0.07)
    np.testing.assert_allclose(np.cov((theta / scale).T), plant.covariance.matrix / np.outer(scale, scale), atol=0.1)
    drawn = np.array([p.theta for p in sampled_plants(plant, 2000, np.random.default_rng(0))])
    np.testing.assert_allclose(theta.std(axis=0), drawn.std(axis=0), rtol=0.08)


def test_what_the_log_did_not_show_is_drawn_as_the_plants_own_draws_have_it():
    """Of θ2 and θ8 the log said nothing: the one stays where a rigid body has it, the other near its value."""
    wide = np.where(np.isin(np.arange(9), (1, 7)), 20.0, 0.01) * QUBE.theta
    plant = QUBE.replace(
        covariance=Covariance(THETA_NAMES, np.diag(wide**2)),
        checks={"identifiability": {"not_identified": ["theta2", "theta8"]}},
    )
    batch = FurutaVectorEnv(2000, plant=plant, randomize=True)
    theta = batch.reset(seed=0)[1]["plant"]["theta"]
    drawn = np.array([p.theta for p in sampled_plants(plant, 2000, np.random.default_rng(0))])
    assert QUBE.theta[2] ** 2 / QUBE.theta[0] <= theta[:, 1].min()
    assert theta[:, 1].max() <= QUBE.theta[3]
    assert theta[:, 7].std() == pytest.approx(0.25 * QUBE.theta[7], rel=0.1)
    np.testing.assert_allclose(theta.std(axis=0), drawn.std(axis=0), rtol=0.08)
    assert Training(plant, randomize=True).drawn_otherwise.startswith("The log did not show every parameter.")
    assert Training(plant, randomize="theta=physical:0.1").drawn_otherwise == ""


@pytest.mark.parametrize("name", PLANTS)
def test_sets_without_covariance_vary_by_the_stated_spread(name):
    theta = FurutaVectorEnv(4000, plant=name, randomize=True).reset(seed=0)[1]["plant"]["theta"]
    np.testing.assert_allclose(theta.std(axis=0) / PLANTS[name].theta, SPREAD, rtol=0.05)
    np.testing.assert_allclose(np.corrcoef(theta.T), np.eye(9), atol=0.06)
    assert PLANTS[name].covariance is None, "the set itself states no covariance that nobody has measured"


def test_a_set_with_a_delay_varies_too():
    env = FurutaEnv(plant="qube", randomize=True, delay=0.01)
    drawn = [env.reset(seed=seed)[1]["plant"] for seed in (0, 1)]
    assert np.all(drawn[0]["theta"] != drawn[1]["theta"])


def test_a_delay_that_is_given_is_not_drawn():
    plant = uncertain(QUBE.with_effects(Effect("input_delay", {"d": 0.01})), 0.1, "input_delay.d")
    for delay in (None, 0.0, 0.02):
        drawn = FurutaVectorEnv(50, plant, randomize=True, delay=delay).reset(seed=0)[1]["plant"]
        assert drawn["theta"].std(axis=0).min() > 0.0
        if delay is None:
            assert drawn["effects"]["input_delay"]["d"].std() > 0.0
        else:
            assert (drawn["effects"]["input_delay"]["d"] == delay).all()


def test_the_drawn_plant_is_the_one_that_moves():
    """Stepping the plant that info names, as a fixed plant, gives the same motion."""
    same = {"task": "swing_up", "longest_step": 2e-4}  # one step for all, whatever their friction
    chances = {"arm_spring": 0.5, "actuator_lag": 0.5}
    random = FurutaEnv(uncertain(), randomize=True, effect_probabilities=chances, **same)
    thetas, motions = set(), 0
    for episode in range(6):
        _, info = random.reset(seed=episode)
        thetas.add(tuple(info["plant"]["theta"]))
        fixed = FurutaEnv(random.plant, **same)
        fixed.reset(options={"state": info["state"]})
        for u in (3.0, -5.0, 2.0, 8.0):
            a, b = random.step([u])[4]["state"], fixed.step([u])[4]["state"]
            np.testing.assert_array_equal(a, b)
            motions += 1
    assert len(thetas) == 6
    assert motions == 24


@pytest.mark.parametrize("name", EFFECTS)
def test_effect_by_chance(name):
    """On as often as asked, sizes inside the declaration's range, exactly neutral when off."""
    batch = FurutaVectorEnv(3000, effect_probabilities={name: 0.3})
    drawn = batch.reset(seed=1)[1]["plant"]["effects"][name]
    default, neutral = TABLE_3.default_effect(name), EFFECTS[name].neutral()
    sizes = [p.name for p in EFFECTS[name].parameters if p.role == "size"]
    on = drawn[sizes[0]] != neutral[sizes[0]]
    assert on.mean() == pytest.approx(0.3, abs=0.03)
    for p in EFFECTS[name].parameters:
        values = drawn[p.name]
        if p.instant:  # within the episode, see test_drawn_cases
            continue
        assert (values[~on] == (neutral[p.name] if p.role == "size" else default.parameters[p.name])).all()
        size = 0.025 if name == "input_delay" else default.parameters[p.name]
        if p.role == "shape":
            assert (values == size).all()
        elif np.isinf(p.neutral):
            assert (values[on] >= size).all()
        elif name == "friction_sharpness":
            assert ((values[on] >= size) & (values[on] <= 100.0)).all()
        else:
            assert (np.abs(values[on]) <= abs(size)).all()
            assert (values[on] < 0).any() == (not p.positive)
    batch.plants([0, 1, 2])  # every draw is a valid Plant


def test_a_carried_effect_acts_at_its_own_size():
    batch = FurutaVectorEnv(500, TABLE_3.with_effects(SPRING), effect_probabilities={"arm_spring": 0.5})
    k = batch.reset(seed=0)[1]["plant"]["effects"]["arm_spring"]["k"]
    assert set(k) == {0.0, 0.3}


def test_off_equals_absent():
    """Candidates with probability zero leave the motion where it was."""
    plain = FurutaEnv()
    other = FurutaEnv(effect_probabilities=dict.fromkeys(EFFECTS, 0.0))
    for env in (plain, other):
        env.reset(options={"state": [0.1, 0.05, 0.3, -0.2]})
    rng = np.random.default_rng(0)
    for _ in range(30):
        u = rng.uniform(-3, 3)
        a, b = plain.step([u])[4]["state"], other.step([u])[4]["state"]
        np.testing.assert_allclose(a, b, atol=1e-9)


def test_without_randomisation_info_has_no_plant():
    assert "plant" not in FurutaEnv(uncertain()).reset(seed=0)[1]


def test_every_autoreset_draws_anew():
    batch = FurutaVectorEnv(3, plant=uncertain(), randomize=True, max_episode_steps=2)
    before = batch.reset(seed=0)[1]["plant"]["theta"]
    for _ in range(2):
        info = batch.step(np.zeros((3, 1)))[4]
        assert "plant" not in info
    info = batch.step(np.zeros((3, 1)))[4]
    assert info["_plant"].all()
    assert (info["plant"]["theta"] != before).all()


def test_a_covariance_without_possible_plants_is_refused():
    hopeless = QUBE.replace(covariance=Covariance(("theta3",), [[1e6]]))
    with pytest.raises(ValueError, match="too uncertain to randomise over"):
        FurutaEnv(hopeless, randomize=True)
