"""The contract of FurutaID-v0: what Gymnasium, its users and INTERFACE ask of one environment."""

import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import furuta_gym
from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import EFFECTS, LARGE_RIG, QUBE, TABLE_3
from furuta_gym.plant.advance import advance
from furuta_gym.plant.sets import SPREAD
from furuta_gym.sensors import FilteredDifference, Sensors

from .helpers import OPTION_SETS

NORMALIZE = "We recommend you to use a symmetric and normalized|we recommend using a symmetric and normalized"


def made(**options):
    return gym.make("FurutaID-v0", **options)


def test_importing_registers_once_and_loads_neither_compiler_nor_learner():
    code = (
        "import sys, warnings; warnings.simplefilter('error')\n"
        "import gymnasium as gym, furuta_gym; furuta_gym.envs.register(); furuta_gym.envs.register()\n"
        "assert 'FurutaID-v0' in gym.registry\n"
        "assert not {'numba', 'scipy', 'pygame', 'torch', 'stable_baselines3'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_made_as_the_interface_says(tmp_path):
    pytest.importorskip("pygame", reason="it draws a picture")
    file = QUBE.save(tmp_path / "rig.json")
    env = made()
    assert env.action_space == gym.spaces.Box(-TABLE_3.u_max, TABLE_3.u_max, (1,), np.float32)
    assert env.unwrapped.plant == TABLE_3
    assert env.spec.max_episode_steps == furuta_gym.envs.MAX_EPISODE_STEPS
    env = made(plant=str(file), task="swing_up")
    assert env.unwrapped.plant == QUBE
    assert env.unwrapped.setup.sample_time == QUBE.sample_time
    env = gym.make("furuta_gym:FurutaID-v0", task="balance", randomize=True, render_mode="rgb_array")
    drawn = [env.reset(seed=seed)[1]["plant"]["theta"] for seed in (0, 1)]
    assert not np.array_equal(*drawn)
    assert np.all(np.abs(drawn / TABLE_3.theta - 1) < 5 * SPREAD)
    assert env.render().ndim == 3
    env = gym.make("furuta_gym:FurutaID-v0", plant=LARGE_RIG)
    assert env.action_space.high[0] == LARGE_RIG.u_max


@pytest.mark.parametrize("name", ["default", "swing_up", "frames", "delay_and_jitter", "randomized_effects"])
def test_both_checkers_are_silent(name):
    """With the action in the plant's unit their one remark is that learners prefer [-1, 1]; it stands alone."""
    from stable_baselines3.common.env_checker import check_env as sb3_check_env

    for normalize in (True, False):
        env = made(**OPTION_SETS[name] | {"normalize_action": normalize}).unwrapped
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            if not normalize:
                warnings.filterwarnings("ignore", NORMALIZE)
                warnings.filterwarnings("ignore", f".*({NORMALIZE})")
            check_env(env)
            sb3_check_env(env, warn=True, skip_render_check=False)


@pytest.mark.parametrize("name", OPTION_SETS)
def test_contract(name):
    """Over every option set: spaces, types, info, reward range, and that the two ways to end stay apart."""
    env = made(**OPTION_SETS[name], max_episode_steps=200)
    rng = np.random.default_rng(0)
    ends = set()
    for episode in range(6):
        observation, info = env.reset(seed=episode)
        assert observation in env.observation_space
        assert info["command"] == 0.0
        push = rng.uniform(-1, 1) * env.action_space.high
        quiet = episode % 2
        for step in range(1, 201):
            action = env.action_space.high * 0 if quiet else push
            observation, reward, terminated, truncated, info = env.step(action.astype(np.float32))
            assert observation in env.observation_space
            assert observation.dtype == np.float32
            assert type(reward) is float
            assert 0.0 <= reward <= 1.0
            assert info["state"].shape == info["measured_state"].shape == (4,)
            assert type(terminated) is bool
            setup = env.unwrapped.setup
            limit = setup.options.pendulum_limit or (0.5 if setup.options.task == "balance" else np.inf)
            q1, q2 = info["state"][:2]
            assert terminated == (abs(q1) > setup.arm_limit or abs(q2) > limit)
            assert truncated == (step == 200)
            if terminated or truncated:
                ends.add((terminated, truncated))
                break
    assert (True, False) in ends or name in ("swing_up", "qube", "randomized")


@pytest.mark.parametrize("name", OPTION_SETS)
def test_seed_reproduces_every_episode_that_follows(name):
    def run(seed):
        env = made(**OPTION_SETS[name], max_episode_steps=15)
        rng = np.random.default_rng(1)
        record = []
        for episode in range(3):
            observation, info = env.reset(seed=seed if episode == 0 else None)
            record += [observation, info["state"], *info.get("plant", {}).get("theta", [])]
            for _ in range(15):
                observation, reward, *_ = env.step(rng.uniform(-1, 1, 1).astype(np.float32))
                record += [observation, reward]
        return np.concatenate([np.ravel(v) for v in record])

    np.testing.assert_array_equal(run(3), run(3))
    assert not np.array_equal(run(3), run(4))
    first, second, _ = run(3).reshape(3, -1)
    assert not np.array_equal(first, second), "the episodes of one run must differ from each other"


def test_start_states_are_as_documented():
    for task, centre, spread in (("balance", 0.0, (0.2, 0.1, 0.2, 0.2)), ("swing_up", np.pi, (0.2, 0.05, 0.0, 0.0))):
        env = FurutaEnv(task=task)
        states = np.array([env.reset(seed=i)[1]["state"] for i in range(400)])
        states[:, 1] -= centre
        assert (np.abs(states) <= spread).all()
        for column, width in zip(states.T, spread, strict=True):
            if width:  # uniform: mean 0, standard deviation width/√3
                assert abs(column.mean()) < 4 * width / np.sqrt(3 * 400)
                assert column.std() == pytest.approx(width / np.sqrt(3), rel=0.1)


@pytest.mark.parametrize("name", ["none", *EFFECTS])
def test_step_equals_the_core_of_the_plant(name):
    """With each effect: states against `advance`, readings against `Sensors`, velocities against the filter."""
    plant = TABLE_3 if name == "none" else TABLE_3.with_effects(TABLE_3.default_effect(name))
    T, n = 0.01, 60
    env = FurutaEnv(plant, "swing_up", sample_time=T, longest_step=2e-4, noise_std=0.0, velocity_cutoff=60.0)
    x0 = [0.1, 0.2, -0.3, 0.4]
    _, info = env.reset(seed=0, options={"state": x0})
    np.testing.assert_array_equal(info["state"], x0)
    rng = np.random.default_rng(2)
    commands = np.concatenate([[0.0], rng.uniform(-6, 6, n).astype(np.float32)])[:, None]
    t_u = np.concatenate([[-1.0], np.arange(n) * T])
    p, codes, rows = plant.packed()
    X = np.zeros((rows, 1))
    X[:4, 0] = x0
    sensors, speed = Sensors(), FilteredDifference(60.0)
    reading = sensors.read(X, p[:, None], codes, rng)[:, 0]
    np.testing.assert_array_equal(info["measured_state"], [*reading, 0.0, 0.0])
    speed.update(*reading, T)
    for i in range(n):
        advance(X, t_u[i + 1], t_u[i + 1] + T, t_u, commands, i + 1, np.zeros((2, 1)), p[:, None], codes, 2e-4)
        observation, _, terminated, _, info = env.step(commands[i + 1])
        np.testing.assert_allclose(info["state"], X[:4, 0], atol=2e-8, rtol=0)
        reading = info["measured_state"][:2]
        np.testing.assert_allclose(reading, sensors.read(X, p[:, None], codes, rng)[:, 0], atol=1e-3)
        np.testing.assert_allclose(info["measured_state"][2:], speed.update(*reading, T), rtol=1e-9, atol=1e-9)
        q1, q2, v1, v2 = info["measured_state"]
        np.testing.assert_allclose(observation, [q1, np.sin(q2), np.cos(q2), v1, v2], rtol=1e-6, atol=1e-7)
        if terminated:
            break


def test_memory_of_effects_starts_anew_with_each_episode():
    env = FurutaEnv(**OPTION_SETS["memory"])
    runs = []
    for _ in range(2):
        env.reset(options={"state": [0, 0.05, 0, 0]})
        runs.append([env.step([3.0])[0] for _ in range(20)])
    np.testing.assert_array_equal(*runs)


def test_history_and_command_frames():
    env = FurutaEnv(history=3, observe_command=True)
    first, _ = env.reset(seed=0)
    frames = [first[:6]] * 3
    np.testing.assert_array_equal(first, np.concatenate(frames))
    for u in (1.0, -4.0, 2.5, 20.0):
        observation, *_ = env.step([u])
        frames = [*frames[1:], observation[-6:]]
        np.testing.assert_array_equal(observation, np.concatenate(frames))
        assert observation[-1] == np.float32(min(u / 10, 1.0))


def test_normalized_action_is_a_share_of_u_max():
    states = []
    for normalize, u in ((False, 4.0), (True, 0.4)):
        env = FurutaEnv(normalize_action=normalize)
        env.reset(seed=0)
        states.append(env.step([u])[4]["state"])
    np.testing.assert_allclose(*states, rtol=1e-14)


def test_delay_of_whole_samples_shifts_the_commands():
    rng = np.random.default_rng(0)
    commands = rng.uniform(-5, 5, 30)
    late, prompt = FurutaEnv(task="swing_up", delay=0.03), FurutaEnv(task="swing_up")
    late.reset(options={"state": [0, 3.0, 0, 0]})
    prompt.reset(options={"state": [0, 3.0, 0, 0]})
    for u, u_before in zip(commands, np.concatenate([np.zeros(3), commands]), strict=False):
        a, b = late.step([u])[4]["state"], prompt.step([u_before])[4]["state"]
        np.testing.assert_allclose(a, b, atol=1e-9)


def test_jitter_changes_the_period_but_not_its_mean():
    """A pendulum at constant speed shows how long each sample lasted."""
    free = TABLE_3.replace(theta=[0.2, 0.04, 0.0, 0.04, 0.0, 0.0, 0.0, 0.0, 0.0])
    env = FurutaEnv(free, "swing_up", jitter=0.3, sample_time=0.01)
    env.reset(seed=0, options={"state": [0, 0, 0, 1.0]})
    angle = np.array([0.0] + [env.step([0.0])[4]["state"][1] for _ in range(2000)])
    periods = np.diff(angle)
    assert 0.007 <= periods.min() < 0.0072
    assert 0.0128 < periods.max() <= 0.013
    assert periods.mean() == pytest.approx(0.01, rel=0.01)


def test_noise_and_counts_act_on_readings_only():
    env = FurutaEnv(noise_std=(0.0, 0.01), encoder_counts=(0, 0), task="swing_up", delay=0.0)
    quiet = FurutaEnv(encoder_counts=(0, 0), task="swing_up", delay=0.0)
    env.reset(seed=0, options={"state": [0.1, np.pi, 0, 0]})
    quiet.reset(seed=0, options={"state": [0.1, np.pi, 0, 0]})
    errors = []
    for _ in range(2000):
        info, still = env.step([0.0])[4], quiet.step([0.0])[4]
        np.testing.assert_array_equal(info["state"], still["state"])
        errors.append(info["measured_state"][:2] - info["state"][:2])
    errors = np.array(errors)
    assert (errors[:, 0] == 0).all()
    assert errors[:, 1].std() == pytest.approx(0.01, rel=0.06)
    assert abs(errors[:, 1].mean()) < 0.001


def test_sensors_come_from_the_plant_file_unless_overruled():
    plant = QUBE.replace(sensors={"encoder_counts": [2048, 512], "noise_std": 1e-3, "fitted_by": "someone"})
    assert FurutaEnv(plant).setup.sensors.encoder_counts == (2048, 512)
    sensors = FurutaEnv(plant, encoder_counts=1000).setup.sensors
    assert sensors.encoder_counts == (1000, 1000)
    assert sensors.noise_std == (1e-3, 1e-3)


def test_a_state_that_leaves_all_bounds_terminates():
    """A plant file with negative friction is allowed; its env ends the episode and stays inside its spaces."""
    wild = TABLE_3.replace(theta=[*TABLE_3.theta[:5], -30.0, -5.0, 0.1, 0.01])
    env = FurutaEnv(wild, "swing_up", arm_limit=1000.0)
    env.reset(seed=0)
    for _ in range(200):
        observation, reward, terminated, _, _ = env.step([10.0])
        assert observation in env.observation_space
        assert 0.0 <= reward <= 1.0
        if terminated:
            return
    pytest.fail("did not terminate")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"task": "juggle"}, "balance, swing_up"),
        ({"plant": "no-such-rig"}, "table3, qube, large"),
        ({"plant": TABLE_3.replace(u_max=9.0), "randomize": True}, "covariance"),
        ({"effect_probabilities": {"gremlins": 0.5}}, "`furuta effects` lists the library"),
        ({"effect_probabilities": {"arm_spring": 1.5}}, r"\[0, 1\]"),
        ({"effect_probabilities": ["arm_spring"]}, "map effect names"),
        ({"sample_time": 0}, "sample_time must lie in"),
        ({"sample_time": float("nan")}, "sample_time must lie in"),
        ({"jitter": 0.5}, "jitter must lie in"),
        ({"delay": -0.01}, "delay must lie in"),
        ({"delay": "long"}, "delay must lie in"),
        ({"history": 0}, "history must be a whole number"),
        ({"encoder_counts": -5}, "encoder_counts"),
        ({"noise_std": float("nan")}, "noise_std"),
        ({"velocity_cutoff": 0.0}, "velocity_cutoff"),
        ({"encoder_offset": (1, 2, 3)}, "offset"),
        ({"arm_limit": -1}, "arm_limit must lie in"),
        ({"pendulum_limit": float("inf")}, "pendulum_limit must lie in"),
        ({"longest_step": 1.0}, "longest_step must lie in"),
        ({"normalize_action": "yes"}, "True or False"),
        ({"render_mode": "ansi"}, "rgb_array"),
    ],
)
def test_bad_options_say_what_is_allowed(options, message):
    with pytest.raises((ValueError, FileNotFoundError), match=message):
        FurutaEnv(**options)


def test_an_unknown_option_of_reset_is_refused():
    with pytest.raises(ValueError, match="no option 'sate'; it takes 'state'"):
        FurutaEnv().reset(options={"sate": [0, 3.0, 0, 0]})


def test_an_unknown_option_lists_those_that_exist():
    with pytest.raises(TypeError, match="no option gravity; there are render_mode, plant, task, randomize"):
        FurutaEnv(gravity=9.81)


@pytest.mark.parametrize("action", [[float("nan")], [1.0, 2.0], 3.0, [], "push", None])
def test_bad_actions_are_refused(action):
    env = FurutaEnv()
    env.reset(seed=0)
    with pytest.raises(ValueError, match="action"):
        env.step(action)


@pytest.mark.parametrize("action", [0.5, np.array(0.5)], ids=["float", "0-d"])
def test_an_action_without_its_brackets_is_told_how_to_be_given(action):
    env = FurutaEnv()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"shape \(1,\), as \[0\.5\], got"):
        env.step(action)


def test_order_is_enforced_and_bad_starts_are_refused():
    env = FurutaEnv(render_mode="rgb_array")
    for call in (lambda: env.step([0.0]), env.render):
        with pytest.raises(ResetNeeded, match="reset"):
            call()
    for state in ([0, 0], [[0, 0, 0, 0]], [0, 0, 0, float("inf")], "upright"):
        with pytest.raises(ValueError, match="finite q1, q2"):
            env.reset(options={"state": state})


def test_memory_stays_flat():
    import tracemalloc

    env = made(max_episode_steps=100, jitter=0.1, delay=0.01)

    def run(n):
        env.reset(seed=0)
        for _ in range(n):
            _, _, terminated, truncated, _ = env.step(np.zeros(1, dtype=np.float32))
            if terminated or truncated:
                env.reset()

    run(2000)
    tracemalloc.start()
    run(2000)
    before, _ = tracemalloc.get_traced_memory()
    run(10_000)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after - before < 20_000


def test_a_reset_that_is_refused_changes_nothing() -> None:
    """Noise and what follows are those of the episode that runs."""
    options = {"noise_std": 1e-3, "jitter": 0.1}
    one, other = (FurutaEnv(QUBE, **options) for _ in range(2))
    for env in (one, other):
        env.reset(seed=3)
    with pytest.raises(ValueError, match="state"):
        one.reset(seed=5, options={"state": [0.0, 0.0]})
    seen = [[env.step([0.1])[0] for _ in range(5)] for env in (one, other)]
    np.testing.assert_array_equal(*seen)


def test_a_first_reset_of_a_part_of_a_batch_is_refused_and_changes_nothing() -> None:
    one, other = (FurutaVectorEnv(2, QUBE, noise_std=1e-3) for _ in range(2))
    with pytest.raises(ResetNeeded):
        one.reset(seed=0, options={"reset_mask": np.array([True, False])})
    np.testing.assert_array_equal(one.reset(seed=7)[0], other.reset(seed=7)[0])


@pytest.mark.parametrize("name", ["jitter", "arm_margin", "longest_step"])
def test_a_text_is_no_number(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must lie in"):
        FurutaEnv(QUBE, **{name: "0.1"})


def test_batches_of_every_env_step_by_one_compiled_kernel() -> None:
    """A limit of steps that is once a float and once a whole number would compile it twice."""
    kinds = {type(FurutaVectorEnv(1, QUBE, max_episode_steps=n)._max_steps) for n in (None, 1000)}
    assert kinds == {float}
