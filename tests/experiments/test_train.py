"""`furuta train`: a policy with its record, resumption, and refusals that leave nothing behind."""

from __future__ import annotations

import hashlib
import json
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from controllers import make_controller
from controllers.comparison.seeds import BUILT_SEED, FINAL_SEED, OTHER_SEED
from controllers.comparison.trials import balance_starts, run_trials
from controllers.training.recipes import discount, observation_scale, recipe, training_period
from furuta_gym.plant import LARGE_RIG, QUBE, TABLE_3
from tests.commands import furuta, refused

pytestmark = pytest.mark.skipif(find_spec("stable_baselines3") is None, reason="training needs the extra `rl`")


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A balancer of the small rig after twelve updates: not good, but trained."""
    path = tmp_path_factory.mktemp("train") / "policy.zip"
    result = furuta("train", "--plant", "qube", "--steps", 98_304, "--seed", 3, "-o", path, "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout) == json.loads(path.with_suffix(".json").read_text())
    return path


def test_the_record_says_how_it_was_made(trained: Path) -> None:
    record = json.loads(trained.with_suffix(".json").read_text())
    assert record["schema"] == "furuta-policy/1"
    assert (record["algorithm"], record["task"], record["seed"], record["steps"]) == ("PPO", "balance", 3, 98_304)
    assert record["plant_sha256"] == hashlib.sha256(QUBE.to_json().encode()).hexdigest()
    assert record["env"]["sample_time"] == 0.02
    assert record["env"]["normalize_action"] is True
    assert record["evaluation"]["trials"] == 200
    chose = record["seed"] + OTHER_SEED
    assert record["evaluation"]["seed"] not in (record["seed"], chose), "new trials judge what others chose"
    assert {"torch", "stable-baselines3", "numpy"} <= set(record["versions"])
    assert record["spent"]["cpu_s"] > 0
    assert [f.name for f in trained.parent.iterdir() if "checkpoint" in f.name] == []


def test_it_learns(trained: Path) -> None:
    """Twelve updates make it last longer than no control does, on other starts than the record's."""
    starts = balance_starts(QUBE, 50, 4.0, np.random.default_rng(5), push=0.0)
    policy = make_controller(trained, QUBE, 0.004)
    learned = run_trials(QUBE, policy, starts, 4.0, 0.004).failed_at
    nothing = run_trials(QUBE, lambda y: 0.0, starts, 4.0, 0.004).failed_at
    assert np.median(learned) > 1.5 * np.median(nothing)


def test_a_finished_policy_goes_on(trained: Path, tmp_path: Path) -> None:
    path = tmp_path / "policy.zip"
    path.write_bytes(trained.read_bytes())
    path.with_suffix(".json").write_text(trained.with_suffix(".json").read_text())
    again = ("train", "--plant", "qube", "--seed", 3, "-o", path, "--resume")
    refused(furuta(*again, "--steps", 50_000), "has", "steps already", "--steps")
    refused(furuta(*again, "--steps", 98_000), "has 98304 steps already")  # though the best network may be older
    refused(furuta(*again, "--steps", 400_000, "--history", 2), "observation_size", "10", "5")
    refused(furuta(*again, "--steps", 400_000, "--task", "swing_up"), "task", "balance")
    pytest.importorskip("tensorboard")
    result = furuta(*again, "--steps", 105_000, "--tensorboard", tmp_path / "logs", "--json")
    assert result.exit_code == 0, result.output
    assert list((tmp_path / "logs").glob("balance-ppo*/events*"))
    record = json.loads(result.stdout)
    assert record["steps"] >= 105_000
    assert len(record["resumed_at"]) == 1
    before = json.loads(trained.with_suffix(".json").read_text())
    assert record["best_return"] >= before["best_return"]
    assert (record["seed"], record["earlier_seeds"]) == (3, [3])
    assert record["spent"]["cpu_s"] > before["spent"]["cpu_s"], "of both sittings"


def test_a_finished_policy_goes_on_with_another_seed_beyond_those_of_its_judges(
    trained: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from stable_baselines3 import PPO

    path = tmp_path / "policy.zip"
    path.write_bytes(trained.read_bytes())
    seeds, set_seed = [], PPO.set_random_seed
    monkeypatch.setattr(PPO, "set_random_seed", lambda model, seed: (seeds.append(seed), set_seed(model, seed)))
    result = furuta(
        *("train", "--plant", "qube", "--seed", 5, "-o", path, "--resume", "--steps", 100_000, "--json"),
    )
    assert result.exit_code == 0, result.output
    record = json.loads(result.stdout)
    assert (record["seed"], record["earlier_seeds"]) == (5, [3])
    assert min(seeds[-1] - record["seed"] - judge for judge in (OTHER_SEED, FINAL_SEED, BUILT_SEED)) > 1_000_000


def test_an_interrupted_run_goes_on_from_its_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from controllers.training import recipes
    from controllers.training.spent import Clock
    from controllers.training.train import Training, train

    monkeypatch.setattr(recipes, "_OFF_POLICY", recipes._OFF_POLICY | {"batch_size": 16, "gradient_steps": 1})
    path = tmp_path / "policy.zip"
    training = Training(QUBE, algorithm="sac", steps=2400)

    def stop(done: int, of: int) -> None:
        if done > 2000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(training, path, progress=stop)
    assert not path.exists()
    assert [len(list(kept.iterdir())) for kept in path.with_suffix(".checkpoint").iterdir()] == [5, 5]
    again = ("train", "--plant", "qube", "--algo", "sac", "-o", path)
    refused(furuta(*again), "exists", "--resume")
    other = ("--steps", 2400, "--seed", 1, "--resume")
    refused(furuta(*again, *other), "begun with --seed 0, and now 1 is asked for", "give --seed 0")
    spent = json.loads((max(path.with_suffix(".checkpoint").iterdir()) / "state.json").read_text())["spent"]
    assert spent["cpu_s"] > 0.1
    monkeypatch.setattr(Clock, "after", lambda clock, before: {"wall_s": before.wall_s + 1, "cpu_s": before.cpu_s + 2})
    record = train(training, path, resume=True)
    assert record["spent"] == {"wall_s": spent["wall_s"] + 1, "cpu_s": spent["cpu_s"] + 2}
    assert record["earlier_seeds"] == []
    assert 1000 < record["resumed_at"][0] <= 2000
    assert record["steps"] == 2400
    assert not path.with_suffix(".checkpoint").exists()


@pytest.mark.parametrize(("algorithm", "steps"), [("ppo", 40_960), ("sac", 1600), ("recurrent", 20_480)])
def test_a_resumed_run_equals_one_that_was_never_stopped(
    algorithm: str, steps: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a curriculum, noise and jitter: streams, rigs, networks, memory and level all come back."""
    from controllers.learned.policy_file import read_learning
    from controllers.training import recipes
    from controllers.training.curriculum import Curriculum
    from controllers.training.train import Training, train

    monkeypatch.setattr(recipes, "_RECURRENT", recipes._RECURRENT | {"n_steps": 16, "batch_size": 1024})
    training = Training(
        QUBE,
        algorithm=algorithm,
        steps=steps,
        seed=4,
        randomize={"theta": "physical:0.2", "jitter": "uniform:0,0.2", "push": "uniform:0,1"},
        noise_std=1e-3,
        observe_command=True,
        curriculum=Curriculum(threshold=0.01, step=0.3, evaluations=1),
    )
    whole, stopped = tmp_path / "whole.zip", tmp_path / "stopped.zip"
    expected = train(training, whole)

    def stop(done: int, of: int) -> None:
        if done > 0.7 * of:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(training, stopped, progress=stop)
    np.random.seed(0)  # noqa: NPY002  (what another program does in between)
    record = train(training, stopped, resume=True)
    assert 0 < record["resumed_at"][0] < training.steps
    assert record["evaluations"] == expected["evaluations"]
    assert record["best_return"] == expected["best_return"]
    first, second = read_learning(whole), read_learning(stopped)
    assert {name: value.tobytes() for name, value in first.items()} == {n: v.tobytes() for n, v in second.items()}
    for key in ("evaluation", "drawn_rigs", "level"):
        assert record[key] == expected[key]


def test_the_robust_recipe_gives_what_nobody_says(tmp_path: Path) -> None:
    path = tmp_path / "policy.zip"
    limited = QUBE.replace(limits={"arm_travel": 2.5}).save(tmp_path / "rig.json")
    words = ("--recipe", "robust", "--steps", 1, "--history", 4, "--reward", "calm=0.2", "--arm-margin", 0)
    words = ("--task", "swing_up", *words)
    result = furuta("train", "--plant", limited, "-o", path, *words, "--noise", 0.001, "--curriculum", 0.8)
    assert result.exit_code == 0, result.output
    assert "200 trials of swing_up" in result.stdout
    assert json.loads(path.with_suffix(".json").read_text())["evaluation"]["worst_settling"]["value"] > 0
    assert "widened the ranges to 20 %" in result.stdout
    record = json.loads(path.with_suffix(".json").read_text())
    env = record["env"]
    assert (record["recipe"], record["settings"]["net_arch"], env["history"]) == ("robust", [64, 64], 4)
    assert env["reward_weights"] == {"gentle": 0.3, "calm": 0.2}
    assert (env["arm_limit"], env["arm_margin"], env["noise_std"]) == (2.5, 0.0, 0.001)
    assert env["randomize"]["arm_spring.k"] == "uniform:0,0.6"
    assert env["observe_command"] is True
    assert not {"theta", "input_delay", "arm_spring", "noise_std"} & set(record["not_trained_for"])
    assert record["curriculum"]["threshold"] == 0.8
    assert record["drawn_rigs"]["episodes"] == 200
    policy = make_controller(path, QUBE, 0.004)
    assert (policy.history, policy.arm_limit, policy.every) == (4, 2.5, 5)


def test_what_is_said_beats_the_recipe_and_nothing_else_changes() -> None:
    from controllers.training.train import Training

    robust = Training.of_recipe(QUBE, "robust", reward_weights={"calm": 0.2}, arm_margin=0.0)
    assert robust.env["reward_weights"] == {"gentle": 0.3, "calm": 0.2}
    assert robust.env["arm_margin"] == 0.0
    assert Training.of_recipe(QUBE, "robust", reward_weights={"gentle": 0.0}).env["reward_weights"] == {"gentle": 0.0}
    assert Training.of_recipe(QUBE, "plain", reward_weights=None).env["reward_weights"] == {}


def test_a_run_that_was_killed_before_its_first_checkpoint_is_given_again(tmp_path: Path) -> None:
    (tmp_path / "policy.checkpoint" / "new").mkdir(parents=True)
    result = furuta("train", "--plant", "qube", "--steps", 1, "-o", tmp_path / "policy.zip")
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["policy.json", "policy.zip"]


def test_a_run_that_was_stopped_in_its_last_trials_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from controllers.training import train as training

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    command = ("train", "--plant", "qube", "--steps", 20_000, "-o", tmp_path / "policy.zip")
    with monkeypatch.context() as patch:
        patch.setattr(training, "evaluate", stop)
        assert furuta(*command).exit_code == 130
    assert [path.name for path in tmp_path.iterdir()] == ["policy.checkpoint"]
    result = furuta(*command, "--resume")
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["policy.json", "policy.zip"]
    assert json.loads((tmp_path / "policy.json").read_text())["steps"] >= 20_000


def test_a_trusted_file_of_stable_baselines3_goes_on(trained: Path, tmp_path: Path) -> None:
    """As `furuta train` wrote them once: a zip of stable-baselines3 and the record beside it."""
    from controllers.learned.policy_file import read_learning, read_policy
    from controllers.training.learning_state import put_parameters
    from controllers.training.model import make_model
    from controllers.training.setup import Training

    model = make_model(Training(QUBE))
    put_parameters(model, read_learning(trained))
    path = tmp_path / "policy.zip"
    model.save(path)
    path.with_suffix(".json").write_text(trained.with_suffix(".json").read_text())
    again = ("train", "--plant", "qube", "--seed", 3, "--steps", 105_000, "-o", path, "--resume")
    refused(furuta(*again), "runs any code", "--trust")
    result = furuta(*again, "--trust", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["resumed_at"] == [98_304]
    assert read_policy(path)[1]["steps"] >= 105_000


def test_one_run_at_a_time(tmp_path: Path) -> None:
    from furuta_gym.files import locked

    with locked(tmp_path / "policy.zip"):
        refused(furuta("train", "--plant", "qube", "-o", tmp_path / "policy.zip"), "being written by another furuta")
    assert list(tmp_path.iterdir()) == []


REFUSED = {
    "recipe": (("--plant", "large", "--recipe", "stew"), ("stew", "plain, robust")),
    "reward": (("--plant", "large", "--reward", "upright=1"), ("upright", "centred, calm, sparing, gentle")),
    "weight": (("--plant", "large", "--reward", "calm"), ("calm", "gentle=0.3")),
    "margin": (("--plant", "large", "--arm-margin", "7"), ("arm_margin", "limit of 6.28")),
    "curriculum": (("--plant", "large", "--curriculum", "0.9"), ("nothing is drawn", "--randomize")),
    "threshold": (("--plant", "large", "--randomize", "--curriculum", "90"), ("--curriculum 90", "at most 1")),
    "plant": (("--plant", "none.json"), ("none.json", "table3")),
    "algo": (("--plant", "large", "--algo", "ddpg"), ("ddpg", "ppo, sac, tqc")),
    "task": (("--plant", "large", "--task", "juggle"), ("juggle", "balance, swing_up")),
    "effect": (("--plant", "large", "--effect-chance", "arm_spring"), ("arm_spring", "NAME=p")),
    "no effect": (("--plant", "large", "--effect-chance", "spring=0.5"), ("spring", "arm_spring")),
    "range": (
        ("--plant", "large", "--randomize", "input_delay=gauss:1,2"),
        ("--randomize input_delay=gauss:1,2: expected", "uniform:"),
    ),
    "word": (("--plant", "large", "--randomize", "ranges.json"), ("--randomize ranges.json: expected NAME=RANGE",)),
    "drawn twice": (
        ("--plant", "large", "--randomize", "jitter=0", "jitter=0.1"),
        ("--randomize jitter=0.1: jitter is",),
    ),
    "far": (("--plant", "large", "--randomize", "input_delay=9"), ("--randomize input_delay=9: its", "[0, 0.1] s")),
    "misspelt": (
        ("--plant", "large", "--randomize", "arm_sprng=1"),
        ("--randomize arm_sprng=1", "did you mean arm_spring"),
    ),
    "range alone": (("--plant", "large", "input_delay=0.01"), ("--randomize",)),
    "resume": (("--plant", "large", "--resume"), ("neither", "policy.zip")),
    "sample time": (("--plant", "large", "--sample-time", "3"), ("--sample-time 3.0", "seconds")),
    "off the rig's clock": (("--plant", "qube", "--sample-time", "0.01"), ("no multiple", "0.004", "such as 0.02")),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_leave_nothing(case: str, tmp_path: Path) -> None:
    arguments, words = REFUSED[case]
    refused(furuta("train", *arguments, "-o", tmp_path / "policy.zip"), *words)
    assert list(tmp_path.iterdir()) == []


def test_ranges_after_randomize_and_what_is_not_trained_for(tmp_path: Path) -> None:
    path = tmp_path / "policy.zip"
    words = ("--randomize", "input_delay=uniform:0,0.03", "theta=physical:0.2", "noise_std=0.001")
    result = furuta("train", "--plant", "qube", "--steps", 1, "-o", path, "--json", *words)
    assert result.exit_code == 0, result.output
    record = json.loads(path.with_suffix(".json").read_text())
    assert record["env"]["randomize"] == dict(word.split("=") for word in words[1:])
    assert {"arm_spring", "push", "u_max", "jitter"} <= set(record["not_trained_for"])
    assert not {"input_delay", "theta", "noise_std"} & set(record["not_trained_for"])


def test_drawing_plants_needs_a_covariance(tmp_path: Path) -> None:
    rig = LARGE_RIG.replace(u_max=5.0).save(tmp_path / "rig.json")
    refused(
        furuta("train", "--plant", rig, "--randomize", "-o", tmp_path / "p.zip"),
        "--randomize (theta from",
        "`furuta identify`",
    )
    assert list(tmp_path.iterdir()) == [rig]


def test_other_names_are_refused(tmp_path: Path) -> None:
    refused(furuta("train", "--plant", "large", "-o", tmp_path / "policy.pt"), ".zip")
    old = tmp_path / "old.zip"
    old.write_text("mine")
    refused(furuta("train", "--plant", "large", "-o", old), "exists", "--resume")
    assert old.read_text() == "mine"


def test_an_early_stop_leaves_nothing(tmp_path: Path) -> None:
    from controllers.training.train import Training, train

    def stop(done: int, of: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(Training(LARGE_RIG), tmp_path / "policy.zip", progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_without_stable_baselines3_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    refused(furuta("train", "--plant", "large", "-o", tmp_path / "policy.zip"), "pip install '.[rl]'")
    assert list(tmp_path.iterdir()) == []


def test_recipes() -> None:
    assert training_period(TABLE_3, None) == 0.02
    assert training_period(QUBE.replace(sample_time=0.003), None) == pytest.approx(0.021)
    assert training_period(QUBE, 0.01) == 0.01
    assert discount(0.01) ** 2 == pytest.approx(discount(0.02))
    assert len(observation_scale(QUBE, 3, True)) == 18
    assert recipe("sac", "balance").off_policy
    assert not recipe("ppo", "balance").off_policy
