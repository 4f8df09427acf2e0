"""Learned policies: they see what the env showed them, and bad files are refused with advice."""

import json
import zipfile

import gymnasium as gym
import numpy as np
import pytest

from controllers import make_controller
from controllers.comparison.evaluation import compare
from controllers.comparison.trials import balance_starts, run_trials
from controllers.learned.layers import network_of
from controllers.learned.policy import LearnedController, load_policy
from controllers.learned.policy_file import read_policy, read_record, write_policy
from experiments.bench import Rig
from experiments.bench_runs import run_on_bench
from furuta_gym.envs import options_of
from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.plant import LARGE_RIG, QUBE, TABLE_3
from furuta_gym.simulation import simulate
from identification.design.setup import Setup


def recording(seen, actions):
    def predict(observation):
        seen.append(observation.copy())
        return np.array([[actions[len(seen) - 1]]])

    return predict


@pytest.mark.parametrize("history", [1, 3])
@pytest.mark.parametrize("observe_command", [False, True])
@pytest.mark.parametrize("normalized", [False, True])
def test_observations_are_the_envs(history, observe_command, normalized):
    """Fed with the env's own readings, the controller shows its policy the env's observations and obeys it."""
    options = {"history": history, "observe_command": observe_command, "normalize_action": normalized}
    env = gym.make("furuta_gym:FurutaID-v0", plant=QUBE, task="swing_up", **options).unwrapped
    actions = np.random.default_rng(1).uniform(-1.3, 1.3, 40) * (1.0 if normalized else QUBE.u_max)
    seen: list[np.ndarray] = []
    controller = LearnedController(
        "recorded",
        recording(seen, actions),
        QUBE,
        0.004,
        history=history,
        observe_command=observe_command,
        normalized=normalized,
    )
    observation, info = env.reset(seed=3)
    for action in actions:
        command = controller(info["measured_state"][:2])
        assert seen[-1][0] == pytest.approx(observation, abs=1e-4)
        observation, _, _, _, info = env.step(np.array([action], dtype=np.float32))
        assert command == pytest.approx(info["command"], rel=1e-6)


@pytest.mark.parametrize("limits", [{"supply": 4.0}, {"slew": 300.0}, {"supply": 4.0, "slew": 300.0}])
@pytest.mark.parametrize("every", [1, 3])
def test_the_last_command_is_what_the_rig_lets_pass(limits, every):
    """As the env shows it: within the supply, and changed by no more than the slew allows."""
    plant = QUBE.replace(limits=limits)
    env = gym.make(
        "furuta_gym:FurutaID-v0", plant=plant, task="swing_up", observe_command=True, sample_time=0.004 * every
    ).unwrapped
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, 40) * QUBE.u_max
    seen: list[np.ndarray] = []
    predict = recording(seen, actions)
    controller = LearnedController("recorded", predict, plant, 0.004, observe_command=True, every=every)
    observation, info = env.reset(seed=3)
    for action in actions:
        for _ in range(every):
            controller(info["measured_state"][:2])
        assert seen[-1][0][5] == pytest.approx(observation[5], abs=1e-6)
        observation, _, _, _, info = env.step(np.array([action], dtype=np.float32))
    assert np.ptp([frame[0][5] for frame in seen]) > 0.2


def test_many_lanes_are_many_rigs():
    """A linear policy on the observation balances, alone and side by side, and agrees with itself."""
    K = make_controller("lqr", QUBE).law.D[0], None
    gain = -np.array([-3.0, -40.0, 0.0, -1.5, -3.0])
    assert K[0] != 0
    policy = LearnedController("linear", lambda o: o @ gain[:, None].astype(np.float32), QUBE, 0.004)
    starts = balance_starts(QUBE, 10, 4.0, np.random.default_rng(0))
    assert run_trials(QUBE, policy, starts, 4.0, 0.004).success.all()
    y = np.random.default_rng(1).normal(0, 0.01, (20, 2, 4)).cumsum(axis=0)
    together = np.array([policy(step) for step in y])
    policy.reset()
    assert [policy(step[:, 2]) for step in y] == pytest.approx(together[:, 2], rel=1e-5)


def test_on_a_faster_clock_it_plays_as_trained():
    """Every third call of a three times faster clock, it sees and says what it does on its own clock."""
    gain = np.array([[3.0], [40.0], [0.0], [1.5], [3.0]], dtype=np.float32)
    own = LearnedController("own", lambda o: o @ gain, QUBE, 0.012)
    fast = LearnedController("fast", lambda o: o @ gain, QUBE, 0.004, every=3)
    y = np.random.default_rng(2).normal(0, 0.01, (10, 2)).cumsum(axis=0)
    said = [own(reading) for reading in y]
    for k in range(30):
        reading = y[k // 3] if k % 3 == 0 else y[k // 3] + 1.0  # what lies between is not looked at
        assert fast(reading) == said[k // 3]
    fast.reset()
    assert fast(y[0]) == said[0]


@pytest.fixture(scope="module")
def policy_file(tmp_path_factory):
    """A small untrained policy, as training writes it, and the model that it comes from."""
    sb3 = pytest.importorskip("stable_baselines3", reason="learned policies need the extra `rl`")
    path = tmp_path_factory.mktemp("policy") / "small.zip"
    options = {"plant": "qube", "task": "balance", "sample_time": 0.01, "history": 2, "normalize_action": True}
    env = gym.make("furuta_gym:FurutaID-v0", **options)
    model = sb3.PPO("MlpPolicy", env, n_steps=8, batch_size=8, policy_kwargs={"net_arch": [4]}, device="cpu")
    model.save(path.with_name("sb3.zip"))
    record = {"algorithm": "PPO", "env": options, "plant": {"u_max": QUBE.u_max, "unit": QUBE.unit}}
    return write_policy(path, network_of(model), record)


def rewritten(policy, path, **changes):
    """The policy with another record."""
    network, record = read_policy(policy)
    return write_policy(path, network, record | changes)


def test_policy_file_plays_what_the_model_says(policy_file):
    from stable_baselines3 import PPO

    controller = make_controller(policy_file, QUBE, 0.01)
    assert (controller.history, controller.scale, controller.sample_time) == (2, QUBE.u_max, 0.01)
    model = PPO.load(policy_file.with_name("sb3.zip"), device="cpu")
    frame = [0.2, np.sin(0.1), np.cos(0.1), 0.0, 0.0]
    expected = QUBE.u_max * np.clip(model.predict(np.float32(frame * 2), deterministic=True)[0][0], -1, 1)
    assert controller([0.2, 0.1]) == pytest.approx(expected, rel=1e-4, abs=1e-6)


def test_a_trusted_file_of_stable_baselines3_plays_the_same(policy_file):
    """With the record beside it; without trust it is refused."""
    path = policy_file.with_name("sb3.zip")
    path.with_suffix(".json").write_text(json.dumps(read_record(policy_file)))
    own = make_controller(policy_file, QUBE, 0.01)
    trusted = make_controller(path, QUBE, 0.01, trust=True)
    y = np.random.default_rng(1).normal(0, 0.1, (10, 2))
    assert [trusted(reading) for reading in y] == [own(reading) for reading in y]
    with pytest.raises(ValueError, match="--trust"):
        make_controller(path, QUBE, 0.01)


@pytest.mark.parametrize("algorithm", ["TD3", "DDPG"])
def test_a_deterministic_policy_in_the_command_s_unit(algorithm, tmp_path):
    sb3 = pytest.importorskip("stable_baselines3")
    env = gym.make("furuta_gym:FurutaID-v0", plant=QUBE)
    model = getattr(sb3, algorithm)("MlpPolicy", env, policy_kwargs={"net_arch": [8]}, seed=1, device="cpu")
    model.save(tmp_path / "own.zip")
    with pytest.warns(
        UserWarning, match=r"no record of its environment; the task balance, a period of 0.004 s .* in V"
    ):
        controller = make_controller(tmp_path / "own.zip", QUBE, trust=True)
    seen = np.float32([0.2, np.sin(0.1), np.cos(0.1), 0.0, 0.0])
    said = controller([0.2, 0.1])
    assert said == pytest.approx(model.predict(seen, deterministic=True)[0][0], rel=1e-4)
    assert 0.01 < abs(said) < QUBE.u_max


@pytest.mark.parametrize("wrapped", ["VecNormalize", "NormalizeObservation"])
def test_normalised_observations_are_refused(wrapped, tmp_path):
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    env = gym.make("furuta_gym:FurutaID-v0", plant=QUBE, history=2)
    if wrapped == "VecNormalize":
        env = VecNormalize(DummyVecEnv([lambda e=env: e]))
    else:
        env = gym.wrappers.NormalizeObservation(env)
    model = sb3.PPO("MlpPolicy", env, n_steps=32, batch_size=32, n_epochs=1, device="cpu").learn(32)
    model.save(tmp_path / "own.zip")
    with pytest.raises(ValueError, match=r"VecNormalize.*constants inside the network"):
        make_controller(tmp_path / "own.zip", QUBE, trust=True)


def test_plain_observations_are_not_taken_for_normalised(tmp_path):
    sb3 = pytest.importorskip("stable_baselines3")
    env = gym.make("furuta_gym:FurutaID-v0", plant=QUBE, history=2, observe_command=True, normalize_action=True)
    path = tmp_path / "own.zip"
    sb3.PPO("MlpPolicy", env, n_steps=32, batch_size=32, n_epochs=1, device="cpu").learn(32).save(path)
    record = {"algorithm": "PPO", "env": {"observe_command": True}}
    path.with_suffix(".json").write_text(json.dumps(record))
    with pytest.warns(UserWarning, match=r'does not say the u_max .* 10 V is assumed.*"plant": {"u_max": 10'):
        assert make_controller(path, QUBE, trust=True).history == 2
    path.with_suffix(".json").write_text(json.dumps(record | {"plant": {"u_max": 5.0, "unit": "V"}}))
    assert make_controller(path, QUBE, trust=True).scale == 5.0


class TestUnknownAlgorithms:
    def zipped(self, path, module):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("data", json.dumps({"policy_class": {"__module__": module}}))
        return path

    @pytest.mark.parametrize("module", ["__main__", "my_policies.wide", "sb3_contrib.common.maskable.policies"])
    def test_a_class_that_is_no_algorithm_s(self, module, tmp_path):
        pytest.importorskip("stable_baselines3")
        with pytest.raises(ValueError, match=r"does not tell the algorithm; write it into .*own.json, as .*algorithm"):
            make_controller(self.zipped(tmp_path / "own.zip", module), QUBE, trust=True)

    def test_a_record_that_names_none(self, tmp_path):
        pytest.importorskip("stable_baselines3")
        path = self.zipped(tmp_path / "own.zip", "__main__")
        path.with_suffix(".json").write_text('{"algorithm": "common"}')
        with pytest.raises(ValueError, match="no algorithm 'common'"):
            make_controller(path, QUBE, trust=True)

    def test_crossq_is_known_and_its_layers_are_refused(self, tmp_path):
        contrib = pytest.importorskip("sb3_contrib")
        env = gym.make("furuta_gym:FurutaID-v0", plant=QUBE)
        contrib.CrossQ("MlpPolicy", env, device="cpu").save(tmp_path / "own.zip")
        with pytest.raises(ValueError, match=r"layer .* cannot be exported"):
            make_controller(tmp_path / "own.zip", QUBE, trust=True)


def test_the_gain_of_a_policy_is_that_of_its_training(policy_file, tmp_path):
    """Shares of the trained limit, whatever the limit of the plant that it is played on, which only clips."""
    path, y = rewritten(policy_file, tmp_path / "small.zip", plant={"u_max": 10.0, "unit": "V"}), [0.02, 0.003]
    said = make_controller(path, QUBE.replace(u_max=10.0), 0.01)(y)
    assert said != 0.0
    assert make_controller(path, QUBE.replace(u_max=4.0), 0.01)(y) == pytest.approx(said)
    assert make_controller(path, QUBE.replace(u_max=0.5 * abs(said)), 0.01)(y) == pytest.approx(0.5 * said)
    with pytest.raises(ValueError, match="command is in V; this plant's is in N·m"):
        make_controller(path, LARGE_RIG, 0.01)


def test_without_a_record_of_its_arm_limit_it_sees_the_arm_as_the_env_of_its_plant_does(policy_file, tmp_path):
    path = rewritten(policy_file, tmp_path / "small.zip", env={"task": "balance", "sample_time": 0.01, "history": 2})
    for limits in (None, {"arm_travel": 2.0}):
        plant = QUBE.replace(limits=limits)
        env = FurutaEnv(plant, sample_time=0.01)
        assert 2 * make_controller(path, plant, 0.01).arm_limit == pytest.approx(env.observation_space.high[0])


def test_a_design_for_another_unit_is_refused():
    with pytest.raises(ValueError, match="design plant's command is in N·m"):
        compare(QUBE, ["lqr"], design_plant=LARGE_RIG, trials=1)


def test_without_a_sample_time_it_plays_on_the_plants_clock(policy_file):
    """An observation of differences over another period than the trained one is another observation."""
    for clock, every in ((0.005, 2), (0.01, 1), (0.004, 1), (None, 1)):
        controller = make_controller(policy_file, QUBE.replace(sample_time=clock))
        assert controller.every == every
        assert controller.every * controller.sample_time == pytest.approx(0.01)


def test_without_a_record_of_its_period_it_acts_as_often_alone_as_compared(policy_file, tmp_path):
    """At the env's own period for the plant, whatever the clock of the trials."""
    path = rewritten(policy_file, tmp_path / "small.zip", env={"task": "balance", "history": 2})
    for clock, period in ((None, 0.01), (0.004, 0.004)):
        plant = QUBE.replace(sample_time=clock)
        alone = make_controller(path, plant)
        compared = compare(plant, [path, "dlqr"], trials=1, duration=0.5, groups=("balance",)).policies["small.zip"]
        for policy in (alone, compared):
            assert policy.every * policy.sample_time == pytest.approx(period)
    with pytest.raises(ValueError, match=r"no record of its sample time, so 0.01 s are taken.*play at 0.02 s"):
        make_controller(path, QUBE.replace(sample_time=None), 0.02)
    with pytest.raises(ValueError, match=r"Give --sample-time 0.01 .*train it again by `furuta train`"):
        make_controller(path, QUBE.replace(sample_time=None), 0.02)
    foreign = tmp_path / "foreign.zip"
    foreign.write_bytes(policy_file.with_name("sb3.zip").read_bytes())
    with pytest.raises(ValueError, match=r"Write its own into .*foreign.json, as"):
        make_controller(foreign, QUBE.replace(sample_time=None), 0.02, trust=True)


def test_a_controller_is_played_at_its_own_sample_time():
    policy = make_controller("lqr", QUBE, 0.004)
    assert simulate(QUBE.replace(sample_time=None), policy, 0.1).t[1] == pytest.approx(0.004)
    starts = balance_starts(QUBE, 3, 1.0, np.random.default_rng(0))
    rig = Rig("servo")
    for play in (
        lambda: simulate(QUBE, policy, 1.0, 0.002),
        lambda: run_trials(QUBE, policy, starts, 1.0, 0.002),
        lambda: run_on_bench(rig, make_controller("lqr", QUBE, 2 * rig.period), 0, 1.0),
        lambda: Setup.of(QUBE, policy, 10.0, 0.002),
    ):
        with pytest.raises(ValueError, match=r"is made for a sample time of 0\.\d+ s and is to be played at"):
            play()
    simulate(QUBE, policy, 0.1, 0.004 * (1 + 5e-5))  # a clock from the stamps of seconds since 1970


def test_policy_file_in_a_comparison(policy_file):
    result = compare(
        QUBE.replace(sample_time=None), [policy_file, "dlqr"], trials=3, duration=1.0, groups=("balance",), jobs=1
    )
    assert result.settings["sample_time"] == pytest.approx(0.002)
    assert set(result.scores) == {"small.zip", "dlqr"}


class TestBadFiles:
    def test_missing(self, tmp_path):
        with pytest.raises(FileNotFoundError, match="furuta train"):
            make_controller(tmp_path / "no.zip", QUBE)

    def test_other_sample_time(self, policy_file):
        with pytest.raises(ValueError, match=r"trained with a sample time of 0.01 s.*play at 0.004 s"):
            make_controller(policy_file, QUBE, 0.004)

    def test_other_observation(self, policy_file, tmp_path):
        path = rewritten(policy_file, tmp_path / "other.zip", env={"history": 3})
        with pytest.raises(ValueError, match=r"shape \(10,\).*history=3 gives \(15,\)"):
            make_controller(path, QUBE)

    def test_no_policy(self, tmp_path):
        path = tmp_path / "text.zip"
        path.write_text("not a zip")
        with pytest.raises(ValueError, match="no policy that `furuta train` wrote"):
            make_controller(path, TABLE_3)
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("data", "{}")
        with pytest.raises(ValueError, match="no policy that stable-baselines3 saved"):
            make_controller(path, TABLE_3, trust=True)

    def test_broken_record(self, tmp_path):
        path = tmp_path / "policy.zip"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("policy.json", "{")
            archive.writestr("weights.safetensors", "")
        with pytest.raises(ValueError, match="training record is not JSON"):
            make_controller(path, QUBE)


def test_a_policy_of_scaled_observations_is_refused(tmp_path):
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO

    model = PPO("MlpPolicy", "FurutaSwingUp-v0", device="cpu")
    model.save(tmp_path / "up.zip")
    with pytest.raises(ValueError, match="observations that a controller does not make"):
        load_policy(tmp_path / "up.zip", QUBE, trust=True)
    write_policy(tmp_path / "own.zip", network_of(model), {"env": options_of("FurutaSwingUp-v0")})
    with pytest.raises(ValueError, match="observations that a controller does not make"):
        load_policy(tmp_path / "own.zip", QUBE)
