"""A comparison says how each learned policy was trained, as its file records it and no more."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controllers.comparison.evaluation import compare
from controllers.comparison.result import Comparison
from controllers.comparison.trained import TrainedEntry
from controllers.envelope import Guarded
from controllers.learned.policy import LearnedController, load_policy
from controllers.learned.policy_file import read_record
from furuta_gym.plant import QUBE

SHIPPED = Path(__file__).resolve().parents[2] / "controllers" / "policies" / "balance-qube.zip"
DRAWN = {"theta": "0.2", "input_delay": "uniform:0,0.03"}


def test_a_comparison_says_how_its_policies_were_trained(tmp_path: Path) -> None:
    own = LearnedController("own", lambda seen: np.zeros((len(seen), 1)), QUBE, 0.02)
    guarded = Guarded(load_policy(SHIPPED, QUBE, 0.02))
    result = compare(QUBE, ["lqr", guarded, own], trials=2, duration=1.0, groups=("balance",), sample_time=0.02)
    assert set(result.trained) == {SHIPPED.name, "own"}
    record, told = read_record(SHIPPED), result.to_dict()["trained"][SHIPPED.name]
    for key in ("algorithm", "steps", "seed", "plant_sha256"):
        assert told[key] == record[key] is not None
    assert (told["randomize"], told["effect_probabilities"]) == (False, {})
    assert not any(result.to_dict()["trained"]["own"].values())
    text = " ".join(str(result).split())
    assert f"training of {SHIPPED.name}: PPO, {record['steps']} steps, seed 0, nothing drawn" in text
    assert f"plant {record['plant_sha256'][:12]}" in text
    assert "training of own: not recorded" in text
    result.save(tmp_path)
    assert Comparison.load(tmp_path / "comparison.json").to_dict() == result.to_dict()
    earlier = json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"))
    del earlier["trained"]
    assert Comparison.from_dict(earlier).trained == {}


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ({}, "not recorded"),
        ({"algorithm": "SAC"}, "SAC; not recorded: steps, seed, ranges, plant"),
        ({"seed": 2, "earlier_seeds": [0, 1]}, "seeds 0, 1, 2; not recorded: algorithm, steps, ranges, plant"),
        ({"env": {"randomize": DRAWN}}, "drawn: theta, input_delay;"),
        ({"env": {"randomize": "theta=0.2"}}, "drawn: theta;"),
        ({"env": {"randomize": {f"p{i}": "0.1" for i in range(9)}}}, "drawn: p0, p1, p2, p3, p4, p5 and 3 more;"),
        ({"env": {"effect_probabilities": {"arm_spring": 0.5}}}, "drawn: arm_spring;"),
        ({"env": {"randomize": True}}, "drawn within the plant's error bars;"),
        ({"env": {"randomize": True}, "plant": {"randomize": DRAWN}}, "drawn: theta, input_delay;"),
        ({"algorithm": "P\x1b[2JPO", "steps": "many", "seed": None}, "P[2JPO; not recorded: steps, seed"),
        ({"env": {"randomize": "theta"}, "plant": []}, "not recorded"),
    ],
)
def test_what_a_record_does_not_say_is_not_recorded(record: dict[str, Any], words: str) -> None:
    assert str(TrainedEntry.of(record)).startswith(words)


def test_ranges_are_those_of_the_record() -> None:
    assert TrainedEntry.of({"env": {"randomize": DRAWN}}).randomize == DRAWN
    chances = {"arm_spring": 0.5, "cable": "often"}
    assert TrainedEntry.of({"env": {"effect_probabilities": chances}}).effect_probabilities == {"arm_spring": 0.5}
