"""The policies that come with the project do what they are there for, on starts that training never saw."""

import hashlib
import json

import numpy as np
import pytest

from controllers import make_controller
from controllers.comparison.trials import balance_starts, run_trials, swing_up_starts
from controllers.policies import FOLDER, SHIPPED
from furuta_gym.plant import PLANTS

TRIALS = 200


@pytest.mark.parametrize("name", SHIPPED)
def test_it_holds(name):
    """At least 95 % of 200 swing-ups from hanging, at least 99 % of 200 balances with a push."""
    where, task, _ = SHIPPED[name]
    plant = PLANTS[where]
    T = plant.sample_time or 0.002
    policy = make_controller(FOLDER / f"{name}.zip", plant, T)
    rng = np.random.default_rng(20_261)
    if task == "swing_up":
        outcome = run_trials(plant, policy, swing_up_starts(TRIALS, rng), 10.0, T, swing_up=True)
        assert outcome.success.mean() >= 0.95
        assert np.median(outcome.settling) < 2.0
    else:
        outcome = run_trials(plant, policy, balance_starts(plant, TRIALS, 8.0, rng), 8.0, T)
        assert outcome.success.mean() >= 0.99


@pytest.mark.parametrize("name", SHIPPED)
def test_its_record_belongs_to_it(name):
    where, task, steps = SHIPPED[name]
    record = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    assert record["plant_sha256"] == hashlib.sha256(PLANTS[where].to_json().encode()).hexdigest()
    assert (record["task"], record["seed"], record["env"]["randomize"]) == (task, 0, False)
    assert record["steps"] <= 1.05 * steps
    assert f"--plant {where} --task {task} --steps {steps}" in record["command"]
    assert record["spent"]["cpu_s"] < 600
