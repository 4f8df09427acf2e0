"""Ranged randomisation: the grammar, what is drawn, and that no drawn rig is impossible."""

import numpy as np
import pytest

from furuta_gym.envs import kernels as k
from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.ranges import as_mapping, draws, never_drawn
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import EFFECTS, LARGE_RIG, QUBE, TABLE_3, Effect, Plant, physical_consistency

ALL = (
    "theta=physical:0.2 input_delay=uniform:0,0.03 arm_spring.k=chance:0.5:uniform:0.1,0.5 "
    "actuator_lag=loguniform:1e-3,0.02 noise_std=uniform:0,0.002 encoder_offset=normal:0,0.01 u_max=uniform:6,10 "
    "jitter=uniform:0,0.2 push=uniform:0,3 push_rate=2 arm_backlash=chance:0.3"
)


def test_one_grammar_for_words_lists_mappings_and_files(tmp_path):
    as_map = as_mapping(ALL)
    file = QUBE.replace(randomize=as_map).save(tmp_path / "rig.json")
    assert Plant.load(file).randomize == as_map
    first = [FurutaEnv("qube", randomize=given).reset(seed=3)[1] for given in (ALL, ALL.split(), as_map)]
    first.append(FurutaEnv(str(file), randomize=True).reset(seed=3)[1])
    for other in first[1:]:
        np.testing.assert_array_equal(first[0]["plant"]["theta"], other["plant"]["theta"])
        assert str(first[0]) == str(other)
    assert "plant" not in FurutaEnv(str(file)).reset(seed=3)[1]
    assert draws(np.True_, Plant.load(file)) == draws(True, Plant.load(file))


def test_what_is_drawn_has_its_distribution():
    n = 4000
    batch = FurutaVectorEnv(n, "qube", randomize=ALL)
    info = batch.reset(seed=0)[1]
    effects, rig = info["plant"]["effects"], info["rig"]
    d = effects["input_delay"]["d"]
    assert d.min() >= 0.0
    assert np.histogram(d, 10, (0, 0.03))[0].std() < 3 * np.sqrt(n / 10)
    k = effects["arm_spring"]["k"]
    assert (k == 0).mean() == pytest.approx(0.5, abs=0.04)
    assert ((k == 0) | ((k >= 0.1) & (k <= 0.5))).all()
    lag = np.log(effects["actuator_lag"]["T"])
    assert lag.mean() == pytest.approx(np.log(1e-3 * 0.02) / 2, abs=0.05)
    assert rig["noise_std"].shape == (n, 2)
    assert abs(np.corrcoef(rig["noise_std"].T)[0, 1]) < 0.06
    assert rig["encoder_offset"].std() == pytest.approx(0.01, rel=0.05)
    assert (rig["u_max"].min(), rig["u_max"].max()) == pytest.approx((6, 10), abs=0.02)
    assert (rig["push_rate"] == 2).all()
    assert (effects["arm_backlash"]["b"] > 0).mean() == pytest.approx(0.3, abs=0.03)


def with_theta2(value):
    """A plant as a log that hardly shows θ2 gives it."""
    return QUBE.replace(theta=[QUBE.theta[0], value, *QUBE.theta[2:]])


@pytest.mark.parametrize("plant", [QUBE, LARGE_RIG, TABLE_3, with_theta2(0.002), with_theta2(0.0), with_theta2(-0.05)])
@pytest.mark.parametrize("share", [0.2, 0.5])
def test_physical_draws_are_rigs_that_can_be_built(plant, share):
    theta = FurutaVectorEnv(3000, plant, randomize={"theta": f"physical:{share}"}).reset(seed=1)[1]["plant"]["theta"]
    assert (theta[:, 0] * theta[:, 3] > theta[:, 2] ** 2).all()
    assert (theta[:, 0] + theta[:, 1] > 0).all()
    assert (theta[:, [0, 3, 4, 5, 6, 7, 8]] > 0).all()
    if physical_consistency(plant.theta).consistent:
        assert all(physical_consistency(row).consistent for row in theta)
        assert (theta[:, 3] >= theta[:, 1]).all()
    gain_and_friction = theta[:, 5] / plant.theta[5]
    assert (1 - share) ** 2 <= gain_and_friction.min() < (1 - 0.8 * share) ** 2
    assert (1 + 0.7 * share) ** 2 < gain_and_friction.max() <= (1 + share) ** 2
    np.testing.assert_allclose(theta.mean(axis=0)[[4, 5, 7]], plant.theta[[4, 5, 7]], rtol=0.03)


def drawn_effect(name, asked, n=2000, level=1.0, **options):
    env = FurutaVectorEnv(n, options.pop("plant", "qube"), randomize=asked, **options)
    env.set_level(level)
    found = env.reset(seed=2)[1]["plant"]["effects"][name]
    env.plants(range(20))  # every draw is a valid Plant
    return found


@pytest.mark.parametrize("way", ["arm_spring=chance:0.5 ", ""])
def test_an_effect_with_a_chance_and_ranges_acts_so_often_and_then_as_they_draw_it(way):
    options = {} if way else {"effect_probabilities": {"arm_spring": 0.5}}
    for plant in ("qube", QUBE.with_effects(Effect("arm_spring", {"k": 5.0, "q1n": 0.0}))):
        asked = way + "arm_spring.k=uniform:0.1,1 arm_spring.q1n=uniform:1,2"
        found = drawn_effect("arm_spring", asked, plant=plant, **options)
        acts = found["k"] != 0.0
        assert acts.mean() == pytest.approx(0.5, abs=0.04)
        assert ((found["k"][acts] >= 0.1) & (found["k"][acts] <= 1.0)).all()
        assert found["k"][acts].std() == pytest.approx(0.9 / np.sqrt(12), rel=0.1)
        assert ((found["q1n"] >= 1.0) & (found["q1n"] <= 2.0)).all()


def test_all_sizes_of_an_effect_act_together():
    sizes = "arm_position_friction.a=uniform:0.1,0.2 arm_position_friction.b=uniform:0.3,0.4"
    found = drawn_effect("arm_position_friction", "arm_position_friction=chance:0.3 " + sizes)
    np.testing.assert_array_equal(found["a"] == 0.0, found["b"] == 0.0)
    assert (found["a"] > 0.0).mean() == pytest.approx(0.3, abs=0.04)
    never = drawn_effect("arm_position_friction", sizes, effect_probabilities={"arm_position_friction": 0.0})
    assert not never["a"].any()
    assert not never["b"].any()


def test_a_chance_gives_the_size_that_no_range_draws():
    found = drawn_effect("arm_spring", "arm_spring=chance:0.5 arm_spring.q1n=uniform:1,2")
    largest = QUBE.default_effect("arm_spring").parameters["k"]
    assert (found["k"] > 0.0).mean() == pytest.approx(0.5, abs=0.04)
    assert 0.9 * largest < found["k"].max() <= largest
    assert ((found["q1n"] >= 1.0) & (found["q1n"] <= 2.0)).all()


def test_a_chance_and_its_ranges_both_widen_with_the_level():
    found = drawn_effect("arm_spring", "arm_spring=chance:0.8 arm_spring.k=uniform:0,1", level=0.5)["k"]
    assert (found > 0.0).mean() == pytest.approx(0.4, abs=0.04)
    assert found.max() == pytest.approx(0.5, abs=0.02)


def test_the_chance_of_a_range_falls_with_the_level():
    """For an effect and for the rig; in the other episodes the rig has its own value."""
    asked = "arm_spring.k=chance:0.8:uniform:0.5,1 noise_std=chance:0.8:0.01"
    env = FurutaVectorEnv(2000, "qube", randomize=asked, noise_std=0.001)
    for level in (1.0, 0.5, 0.0):
        env.set_level(level)
        info = env.reset(seed=2)[1]
        acts, noise = info["plant"]["effects"]["arm_spring"]["k"] > 0.0, info["rig"]["noise_std"][:, 0]
        assert acts.mean() == pytest.approx(0.8 * level, abs=0.04)
        assert (noise > 0.001).mean() == pytest.approx(0.8 * level, abs=0.04)
        assert noise.min() == 0.001


@pytest.mark.parametrize("kind", ["uniform:5,8", "loguniform:5,8", "normal:6,1", "7"])
def test_what_counts_is_drawn_in_whole_numbers(kind):
    n = drawn_effect("arm_ripple", f"arm_ripple.A=0.1 arm_ripple.n={kind}")["n"]
    values, often = np.unique(n, return_counts=True)
    assert (values == np.round(values)).all()
    if kind == "7":
        assert values.tolist() == [7.0]
    elif kind == "normal:6,1":
        assert n.mean() == pytest.approx(6.0, abs=0.1)
    else:
        assert values.tolist() == [5.0, 6.0, 7.0, 8.0]
        assert often.min() > 350  # the ends as often as what lies between
    assert drawn_effect("arm_ripple", f"arm_ripple.A=0.1 arm_ripple.n={kind}", level=0.3)["n"].std() <= n.std()


def test_a_low_supply_cuts_the_command_and_leaves_the_scale():
    env = FurutaEnv("qube", randomize="u_max=4", normalize_action=True)
    env.reset(seed=0)
    assert env.step([1.0])[4]["command"] == 4.0
    assert env.step([0.2])[4]["command"] == pytest.approx(2.0)


@pytest.mark.parametrize("vector", [False, True])
def test_ranges_widen_with_the_level(vector):
    """Level 0 is the plant itself, or the end of a range that is next to it; 1 is what was asked for."""
    rig = QUBE.replace(u_max=10.0)
    asked = (
        "theta=physical:0.3 input_delay=uniform:0,0.03 actuator_lag=uniform:0.01,0.02 u_max=uniform:4,8 "
        "noise_std=normal:0.002,0.0001 arm_backlash=chance:0.8 jitter=loguniform:0.01,0.1"
    )

    def drawn(level):
        if vector:
            env = FurutaVectorEnv(300, rig, "swing_up", randomize=asked)
            env.set_level(level)
            info = env.reset(seed=1)[1]
            effects, rig_ = info["plant"]["effects"], info["rig"]
            theta = info["plant"]["theta"]
        else:
            env = FurutaEnv(rig, "swing_up", randomize=asked)
            env.set_level(level)
            infos = [env.reset(seed=seed)[1] for seed in range(300)]
            effects = {
                name: {key: np.array([i["plant"]["effects"][name][key] for i in infos]) for key in values}
                for name, values in infos[0]["plant"]["effects"].items()
            }
            rig_ = {name: np.array([i["rig"][name] for i in infos]) for name in infos[0]["rig"]}
            theta = np.array([i["plant"]["theta"] for i in infos])
        slack = (effects["arm_backlash"]["b"] > 0).astype(float)
        return {
            "delay": effects["input_delay"]["d"],
            "lag": effects["actuator_lag"]["T"],
            "u_max": rig_["u_max"],
            "noise": rig_["noise_std"],
            "jitter": rig_["jitter"],
            "mass": theta[:, 4] / rig.theta[4],
            "slack": slack,
        }

    wide = {name: (v.min(), v.max()) for name, v in drawn(1.0).items()}
    half, none = drawn(0.5), drawn(0.0)
    ends = {"delay": 0.0, "lag": 0.01, "u_max": 8.0, "noise": 0.0, "jitter": 0.01, "mass": 1.0, "slack": 0.0}
    for name, value in ends.items():
        np.testing.assert_allclose(none[name], value, rtol=1e-12, atol=1e-15)
        assert wide[name][0] < wide[name][1]
    assert half["delay"].max() == pytest.approx(0.015, rel=0.05)
    assert half["lag"].max() == pytest.approx(0.015, rel=0.05)
    assert half["u_max"].min() == pytest.approx(6.0, rel=0.05)
    assert half["noise"].mean() == pytest.approx(0.001, rel=0.05)
    assert half["jitter"].max() == pytest.approx(np.sqrt(0.001), rel=0.1)
    assert 0.15 < np.abs(half["mass"] - 1).max() < (1.15**3 - 1) * 1.01
    assert half["slack"].mean() == pytest.approx(0.4, abs=0.08)
    with pytest.raises(ValueError, match="level must lie"):
        drawn(1.5)


def test_pushes_come_as_often_and_as_hard_as_asked():
    """Without gravity's help in one sample, q̇2 jumps by the push; the arm answers by M's coupling."""
    env = FurutaVectorEnv(1, "qube", randomize="push=5 push_rate=10", pendulum_limit=1e3, arm_limit=1e3,
                          max_episode_steps=None)  # fmt: skip
    env.reset(seed=0)
    speeds = np.array([env.step(np.zeros((1, 1)))[4]["state"][0, 3] for _ in range(5000)])
    jumps = np.abs(np.diff(speeds)) > 3.5
    assert jumps.sum() == pytest.approx(5000 * 0.004 * 10, rel=0.25)
    calm = FurutaVectorEnv(1, "qube", pendulum_limit=1e3, max_episode_steps=None)
    calm.reset(seed=0)
    quiet = np.array([calm.step(np.zeros((1, 1)))[4]["state"][0, 3] for _ in range(1000)])
    assert np.abs(np.diff(quiet)).max() < 3.5


# Without friction and coupling θ1 q̇1 is the integral of the command that acts.
FREE_ARM = QUBE.replace(theta=[QUBE.theta[0], 0.0, 0.0, *QUBE.theta[3:5], 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("asked", ["input_delay=uniform:0.02,0.1 jitter=0.3", "input_delay=0.1 jitter=normal:0.2,0.3"])
def test_every_command_acts_a_delay_after_it_was_given_whatever_the_jitter(asked):
    """Against an integral of the commands over the periods as they came."""
    n, N = 60, 200
    env = FurutaVectorEnv(N, FREE_ARM, randomize=asked, arm_limit=1e3, max_episode_steps=None)
    info = env.reset(seed=0, options={"state": np.zeros(4)})[1]
    delay, jitter = info["plant"]["effects"]["input_delay"]["d"], info["rig"]["jitter"]
    assert 0.29 < jitter.max() <= 0.3
    commands = np.random.default_rng(0).uniform(-3, 3, n).astype(np.float32)
    given, v1 = np.zeros((n + 1, N)), np.zeros((n + 1, N))
    for i, u in enumerate(commands):
        v1[i + 1] = env.step(np.full((N, 1), u))[4]["state"][:, 2]
        given[i + 1] = env._columns()[k.TIME]
    periods = np.diff(given, axis=0) / 0.004
    assert (np.abs(periods - 1.0) <= jitter + 1e-9).all()
    assert np.abs(periods - 1.0).max() > 0.29
    for i in range(n + 1):
        acted = np.minimum(given[1:] + delay, given[i]) - np.minimum(given[:-1] + delay, given[i])
        np.testing.assert_allclose(v1[i], commands @ acted / FREE_ARM.theta[0], rtol=0, atol=1e-10)


def test_an_effect_whose_other_parameters_have_usual_values_needs_no_parameter():
    """A file that was written when backlash had one parameter is read as before."""
    short = draws("arm_backlash=uniform:0.005,0.02 pendulum_quadratic_drag=0.01", QUBE)
    assert short == draws("arm_backlash.b=uniform:0.005,0.02 pendulum_quadratic_drag.c=0.01", QUBE)


def test_what_was_never_drawn_is_named():
    missing = never_drawn(draws(ALL, QUBE), QUBE, {"arm_ripple": 0.1})
    drawn = {"input_delay", "arm_spring", "actuator_lag", "arm_backlash", "arm_ripple"}
    assert set(missing) == set(EFFECTS) - drawn
    assert "arm_spring" in never_drawn(draws("arm_spring=chance:0 arm_spring.k=uniform:0,1", QUBE), QUBE, {})
    everything = never_drawn(draws(False, QUBE), QUBE, {})
    assert set(everything) == {*EFFECTS, "theta", "noise_std", "encoder_offset", "u_max", "jitter", "push"}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("gremlins=1", "nothing is called"),
        ("theta=2", "posterior, or physical"),
        ("theta=physical:0.9", "physical:S"),
        ("theta=posterior", "covariance"),
        ("input_delay=uniform:0,0.5", r"must lie in \[0, 0.1\]"),
        ("input_delay=uniform:0.02,0.01", "LOW ≤ HIGH"),
        ("input_delay=gauss:0,1", "expected uniform"),
        ("input_delay=chance:2:uniform:0,0.01", r"\[0, 1\]"),
        ("input_delay=nan", "expected uniform"),
        ("noise_std=loguniform:0,0.1", "0 < LOW"),
        ("arm_spring=0.3", "several parameters"),
        ("arm_spring.kk=0.3", "has no parameter"),
        ("push_rate=2", "give push"),
        ("arm_ripple.A=1 arm_ripple.n=uniform:5.2,5.4", "n of arm_ripple is a whole number"),
        ("arm_spring.q1n=uniform:-1,1", r"its size is not drawn; give arm_spring\.k too, or arm_spring=chance:P"),
        ("base_tilt.G1=uniform:0,1", r"give base_tilt\.αx or base_tilt\.αy too"),
        ("input_delay", "expected NAME=RANGE"),
        ("jitter=0.1 jitter=0.2", "given twice"),
        (3, "randomize must be"),
    ],
)
def test_bad_ranges_say_what_is_expected(given, message):
    plant = QUBE.replace(u_max=9.0)  # not the set, which has a stated spread
    with pytest.raises(ValueError, match=message):
        FurutaEnv(plant, randomize=given)


def test_a_bad_range_of_the_plant_file_is_said_to_be_there():
    plant = QUBE.replace(randomize={"theta": "wide"})
    with pytest.raises(ValueError, match='"randomize" of the plant file, theta=wide: expected posterior'):
        draws(True, plant)


def test_limits_of_the_plant_file(tmp_path):
    limits = {"arm_travel": 1.0, "arm_speed": 8.0, "slew": 200.0, "supply": 6.0}
    plant = Plant.load(QUBE.replace(limits=limits).save(tmp_path / "rig.json"))
    assert plant.limits == limits
    assert "limits" not in QUBE.to_dict()
    env = FurutaEnv(plant, "swing_up")
    assert env.observation_space.high[0] == pytest.approx(2.0)
    for state, over in (([0, 3, 0, 0], False), ([1.1, 3, 0, 0], True), ([0, 3, 9.0, 0], True)):
        env.reset(options={"state": state})
        _, _, terminated, _, info = env.step([10.0 if not over else 0.0])
        assert terminated == over
        assert abs(info["command"]) <= 6.0
    assert FurutaEnv(plant, arm_limit=3.0).setup.arm_limit == 3.0


@pytest.mark.parametrize("drawn", ["uniform:8,10", "normal:8,1", "uniform:5,10"])
@pytest.mark.parametrize("level", [1.0, 0.5])
def test_a_drawn_u_max_stays_within_the_supply_of_the_plant_file(drawn, level):
    env = FurutaVectorEnv(50, QUBE.replace(limits={"supply": 6.0}), randomize={"u_max": drawn})
    env.set_level(level)
    u_max = env.reset(seed=0)[1]["rig"]["u_max"]
    assert u_max.max() == 6.0
    np.testing.assert_array_equal(env.step(np.full((50, 1), 10.0))[4]["command"], u_max)


@pytest.mark.parametrize("limits", [{"arm": 1.0}, {"slew": 0}, {"supply": float("inf")}, {"supply": True}, [1.0]])
def test_bad_limits_are_refused(limits):
    with pytest.raises(ValueError, match="limits"):
        QUBE.replace(limits=limits)


def test_a_supply_drawn_above_u_max_gives_no_more_than_the_action_space():
    env = FurutaEnv("qube", randomize={"u_max": "uniform:12,14"}, observe_command=True)
    env.reset(seed=0)
    observation, _, _, _, info = env.step(np.array([1.5 * QUBE.u_max], dtype=np.float32))
    assert info["command"] == QUBE.u_max
    assert env.observation_space.contains(observation)
