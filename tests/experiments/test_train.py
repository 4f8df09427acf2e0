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
from controllers.recipes import discount, observation_scale, recipe, training_period
from controllers.trials import balance_starts, run_trials
from furuta_gym.plant import LARGE_RIG, QUBE, TABLE_3
from tests.commands import furuta, refused

pytestmark = pytest.mark.skipif(find_spec("stable_baselines3") is None, reason="training needs the extra `rl`")


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A balancer of the small rig after 18 updates: not good, but trained."""
    path = tmp_path_factory.mktemp("train") / "policy.zip"
    result = furuta("train", "--plant", "qube", "--steps", 147_456, "--seed", 3, "-o", path, "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout) == json.loads(path.with_suffix(".json").read_text())
    return path


def test_the_record_says_how_it_was_made(trained: Path) -> None:
    record = json.loads(trained.with_suffix(".json").read_text())
    assert record["schema"] == "furuta-policy/1"
    assert (record["algorithm"], record["task"], record["seed"], record["steps"]) == ("PPO", "balance", 3, 147_456)
    assert record["plant_sha256"] == hashlib.sha256(QUBE.to_json().encode()).hexdigest()
    assert record["env"]["sample_time"] == 0.02
    assert record["env"]["normalize_action"] is True
    assert record["evaluation"]["trials"] == 200
    assert {"torch", "stable-baselines3", "numpy"} <= set(record["versions"])
    assert record["spent"]["cpu_s"] > 0
    assert [f.name for f in trained.parent.iterdir() if "checkpoint" in f.name] == []


def test_it_learns(trained: Path) -> None:
    """Eighteen updates make it last longer than no control does, on other starts than the record's."""
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
    refused(furuta(*again, "--steps", 147_000), "has 147456 steps already")  # though the best network may be older
    refused(furuta(*again, "--steps", 400_000, "--history", 2), "observation_size", "10", "5")
    refused(furuta(*again, "--steps", 400_000, "--task", "swing_up"), "task", "balance")
    pytest.importorskip("tensorboard")
    result = furuta(*again, "--steps", 160_000, "--tensorboard", tmp_path / "logs", "--json")
    assert result.exit_code == 0, result.output
    assert list((tmp_path / "logs").glob("balance-ppo*/events*"))
    record = json.loads(result.stdout)
    assert record["steps"] >= 160_000
    assert len(record["resumed_at"]) == 1
    before = json.loads(trained.with_suffix(".json").read_text())
    assert record["best_return"] >= before["best_return"]


def test_an_interrupted_run_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    from controllers.training import Training, train

    path = tmp_path / "policy.zip"
    training = Training(QUBE, algorithm="sac", steps=2400)

    def stop(done: int, of: int) -> None:
        if done > 2000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(training, path, progress=stop)
    assert not path.exists()
    assert [len(list(kept.iterdir())) for kept in path.with_suffix(".checkpoint").iterdir()] == [4, 4]
    refused(furuta("train", "--plant", "qube", "--algo", "sac", "-o", path), "exists", "--resume")
    record = train(training, path, resume=True)
    assert 1000 < record["resumed_at"][0] <= 2000
    assert record["steps"] == 2400
    assert not path.with_suffix(".checkpoint").exists()


def test_a_run_that_was_killed_before_its_first_checkpoint_is_given_again(tmp_path: Path) -> None:
    (tmp_path / "policy.checkpoint" / "new").mkdir(parents=True)
    result = furuta("train", "--plant", "qube", "--steps", 1, "-o", tmp_path / "policy.zip")
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["policy.json", "policy.zip"]


def test_a_run_that_was_stopped_in_its_last_trials_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from controllers import training

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
    from controllers.learning_state import put_parameters
    from controllers.policy_file import read_learning, read_policy
    from controllers.training import Training, _model

    model = _model(Training(QUBE))
    put_parameters(model, read_learning(trained))
    path = tmp_path / "policy.zip"
    model.save(path)
    path.with_suffix(".json").write_text(trained.with_suffix(".json").read_text())
    again = ("train", "--plant", "qube", "--seed", 3, "--steps", 160_000, "-o", path, "--resume")
    refused(furuta(*again), "runs any code", "--trust")
    result = furuta(*again, "--trust", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["resumed_at"] == [147_456]
    assert read_policy(path)[1]["steps"] >= 160_000


def test_one_run_at_a_time(tmp_path: Path) -> None:
    from furuta_gym.files import locked

    with locked(tmp_path / "policy.zip"):
        refused(furuta("train", "--plant", "qube", "-o", tmp_path / "policy.zip"), "being written by another furuta")
    assert list(tmp_path.iterdir()) == []


REFUSED = {
    "plant": (("--plant", "none.json"), ("none.json", "table3")),
    "algo": (("--plant", "large", "--algo", "ddpg"), ("ddpg", "ppo, sac, tqc")),
    "task": (("--plant", "large", "--task", "juggle"), ("juggle", "balance, swing_up")),
    "effect": (("--plant", "large", "--effect-chance", "arm_spring"), ("arm_spring", "NAME=p")),
    "no effect": (("--plant", "large", "--effect-chance", "spring=0.5"), ("spring", "arm_spring")),
    "range": (("--plant", "large", "--randomize", "input_delay=gauss:1,2"), ("input_delay", "uniform:LOW,HIGH")),
    "range alone": (("--plant", "large", "input_delay=0.01"), ("--randomize",)),
    "resume": (("--plant", "large", "--resume"), ("neither", "policy.zip")),
    "sample time": (("--plant", "large", "--sample-time", "3"), ("sample_time",)),
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
    refused(furuta("train", "--plant", rig, "--randomize", "-o", tmp_path / "p.zip"), "covariance", "furuta identify")
    assert list(tmp_path.iterdir()) == [rig]


def test_other_names_are_refused(tmp_path: Path) -> None:
    refused(furuta("train", "--plant", "large", "-o", tmp_path / "policy.pt"), ".zip")
    old = tmp_path / "old.zip"
    old.write_text("mine")
    refused(furuta("train", "--plant", "large", "-o", old), "exists", "--resume")
    assert old.read_text() == "mine"


def test_an_early_stop_leaves_nothing(tmp_path: Path) -> None:
    from controllers.training import Training, train

    def stop(done: int, of: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(Training(LARGE_RIG), tmp_path / "policy.zip", progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_without_stable_baselines3_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    refused(furuta("train", "--plant", "large", "-o", tmp_path / "policy.zip"), "pip install 'furuta-gym[rl]'")
    assert list(tmp_path.iterdir()) == []


def test_recipes() -> None:
    assert training_period(TABLE_3, None) == 0.02
    assert training_period(QUBE.replace(sample_time=0.003), None) == pytest.approx(0.021)
    assert training_period(QUBE, 0.01) == 0.01
    assert discount(0.01) ** 2 == pytest.approx(discount(0.02))
    assert len(observation_scale(QUBE, 3, True)) == 18
    assert recipe("sac", "balance").off_policy
    assert not recipe("ppo", "balance").off_policy
