"""Evaluations on the way of a training: levels, who fell, and policies with a memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controllers import make_controller
from furuta_gym.declared import checked
from furuta_gym.plant import QUBE
from tests.controllers.chance import recurrent_network


def test_levels_follow_success() -> None:
    from controllers.training.curriculum import Curriculum, Evaluation, reached

    rule = Curriculum(threshold=0.8, first=0.2, step=0.5, evaluations=2)
    past: list[Evaluation] = []
    levels = []
    for success in (1.0, 0.5, 0.9, 0.7, 1.0, 1.0, 0.9, 0.0):
        past.append(Evaluation(len(past), rule.level(past), 1.0, 0.0, success))
        levels.append(past[-1].level)
    assert levels == [0.2, 0.2, 0.2, 0.2, 0.7, 0.7, 1.0, 1.0]
    assert (rule.level(past), reached(None, past)) == (1.0, 1.0)
    assert checked(past[0].to_dict(), Evaluation) == past[0]


def test_a_load_arrives_within_the_episode() -> None:
    from controllers.training.train import Training

    training = Training(QUBE, effect_probabilities={"payload_step": 1.0})
    for batch in (training.batch(4).batch, training.judges(4)):
        end = batch.setup.longest * batch.setup.action_period
        batch.reset(seed=0)
        times = [p.effect("payload_step").parameters["t0"] for p in batch.plants()]  # type: ignore[union-attr]
        assert max(times) <= end <= 15.0


def test_a_recipe_fits_a_narrow_travel() -> None:
    from controllers.training.setup import Training

    narrow = QUBE.replace(limits={"arm_travel": 0.8})
    assert Training.of_recipe(narrow, "robust").arm_margin == 0.4
    assert Training.of_recipe(QUBE, "robust").arm_margin == 1.0


def test_a_plant_without_weight_has_a_scale() -> None:
    from controllers.training.recipes import observation_scale

    weightless = QUBE.replace(theta=[*QUBE.theta[:4], 0.0, *QUBE.theta[5:]])
    assert observation_scale(weightless, 1, False) == [1.0] * 5


def test_an_evaluation_counts_who_fell_and_who_came_up_late() -> None:
    """One episode for each rig: of balancers those that stay, of swing-ups those that end upright."""
    from controllers.training.curriculum import play
    from controllers.training.train import Training

    still = lambda seen: np.zeros((len(seen), 1), dtype=np.float32)  # noqa: E731
    total, success = play(still, Training(QUBE).judges(8), 0, 1.0)
    assert not success.any()
    assert (total > 0).all()
    assert (total < 100).all()
    hanging = Training(QUBE, "swing_up").judges(8)
    total, success = play(still, hanging, 0, 1.0)
    assert not success.any()
    swing_up = make_controller("controllers/policies/swing-up-qube.zip", QUBE, 0.02)
    total, success = play(lambda seen: swing_up.predict(seen), hanging, 0, 1.0)
    assert success.all()
    assert (total > 300).all()


def test_an_evaluation_lets_a_policy_remember() -> None:
    """Step by step what the network says that has seen the whole episode, twice the same."""
    from controllers.training.curriculum import evaluation
    from controllers.training.train import Training

    network, rigs = recurrent_network(), Training(QUBE, observe_command=True).judges(8)
    found = [evaluation(network, rigs, 0, 0, 1.0) for _ in range(2)]
    act, total, going = network.begin(), np.zeros(8), np.ones(8, dtype=bool)
    seen, _ = rigs.reset(seed=0)
    while going.any():
        seen, reward, terminated, truncated, _ = rigs.step(act(seen))
        total += np.where(going, reward, 0.0)
        going &= ~(terminated | truncated)
    assert found[0] == found[1]
    assert found[0].mean == pytest.approx(total.mean(), rel=1e-12)
    assert found[0].worst == pytest.approx(total.min(), rel=1e-12)  # 5 % of eight are one
    other = evaluation(replace(network, cells=replace(network.cells, r=0 * network.cells.r)), rigs, 0, 0, 1.0)
    assert other.mean != found[0].mean


def test_a_finished_policy_fills_an_empty_memory_before_it_learns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sb3 = pytest.importorskip("stable_baselines3", reason="training needs the extra `rl`")
    from controllers.training import recipes
    from controllers.training import record as training_record
    from controllers.training.train import Training, train

    monkeypatch.setattr(training_record, "TRIALS", 2)
    monkeypatch.setattr(recipes, "_OFF_POLICY", recipes._OFF_POLICY | {"learning_starts": 160})
    path, learned, learn = tmp_path / "policy.zip", [], sb3.SAC.train
    train(Training(QUBE, algorithm="sac", steps=320), path)

    def watched(model, *args, **options):
        learned.append(model.num_timesteps)
        return learn(model, *args, **options)

    monkeypatch.setattr(sb3.SAC, "train", watched)
    record = train(Training(QUBE, algorithm="sac", steps=640), path, resume=True)
    assert min(learned) == record["resumed_at"][0] + 160 + 16


def test_the_record_s_level_is_that_of_its_last_evaluation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("stable_baselines3", reason="training needs the extra `rl`")
    from controllers.training import record as training_record
    from controllers.training.curriculum import Curriculum
    from controllers.training.train import Training, train

    monkeypatch.setattr(training_record, "TRIALS", 2)
    rule = Curriculum(threshold=1e-9, first=0.2, step=0.3, evaluations=1)
    monkeypatch.setattr("controllers.training.train.reached", lambda curriculum, past: 0.2 if not past else 0.5)
    training = Training(QUBE, steps=8192, randomize={"theta": "physical:0.1"}, curriculum=rule)
    record = train(training, tmp_path / "policy.zip")
    assert record["level"] == record["evaluations"][-1]["level"] == 0.2
