"""What is written beside a policy of stable-baselines3 about its training, held against the policy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest

from controllers import make_controller
from furuta_gym.plant import QUBE


@pytest.fixture(scope="module")
def shares(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A policy of stable-baselines3 on actions in ±1, that has learned a little."""
    sb3 = pytest.importorskip("stable_baselines3")
    env = gym.make("furuta_gym:FurutaID-v0", plant=QUBE, normalize_action=True)
    path = tmp_path_factory.mktemp("shares") / "own.zip"
    sb3.PPO("MlpPolicy", env, n_steps=32, batch_size=32, n_epochs=1, seed=5, device="cpu").learn(32).save(path)
    return path


def recorded(source: Path, folder: Path, **record: Any) -> Path:
    path = folder / "own.zip"
    path.write_bytes(source.read_bytes())
    path.with_suffix(".json").write_text(json.dumps(record))
    return path


def test_options_that_no_env_has_are_refused(shares: Path, tmp_path: Path) -> None:
    path = recorded(shares, tmp_path, env={"task": "swing_up", "sampletime": 0.02})
    with pytest.raises(ValueError, match="names options that no env has: sampletime"):
        make_controller(path, QUBE, trust=True)


def test_actions_of_another_size_are_refused(shares: Path, tmp_path: Path) -> None:
    path = recorded(shares, tmp_path, env={"normalize_action": False})
    with pytest.raises(ValueError, match=r"gives actions up to 1, .*normalize_action = false, so up to 10"):
        make_controller(path, QUBE, trust=True)
    right = recorded(shares, tmp_path, env={"normalize_action": True}, plant={"u_max": QUBE.u_max})
    assert make_controller(right, QUBE, trust=True).scale == QUBE.u_max


def test_steps_and_seed_are_those_of_the_zip_where_the_record_says_neither(shares: Path, tmp_path: Path) -> None:
    rig = {"u_max": QUBE.u_max}
    said = {"env": {"task": "balance"}, "plant": rig, "algorithm": "PPO"}
    own = make_controller(recorded(shares, tmp_path, **said), QUBE, trust=True).record
    assert own is not None
    assert (own["steps"], own["seed"]) == (32, 5)
    told = make_controller(recorded(shares, tmp_path, seed=7, **said), QUBE, trust=True).record
    assert told is not None
    assert (told["steps"], told["seed"]) == (32, 7)


def test_another_algorithm_is_refused(shares: Path, tmp_path: Path) -> None:
    path = recorded(shares, tmp_path, algorithm="SAC", env={"task": "balance"})
    with pytest.raises(ValueError, match="cannot be read as a SAC policy"):
        make_controller(path, QUBE, trust=True)


def test_what_is_assumed_without_a_record_is_told(shares: Path, tmp_path: Path) -> None:
    path = tmp_path / "own.zip"
    path.write_bytes(shares.read_bytes())
    with pytest.warns(UserWarning, match=r"task balance, a period of 0.004 s and .* shares of u_max are assumed"):
        make_controller(path, QUBE, trust=True)


def test_a_policy_that_was_saved_again_does_not_show_its_statistics(shares: Path, tmp_path: Path) -> None:
    from stable_baselines3 import PPO

    again = tmp_path / "again.zip"
    env = gym.make("furuta_gym:FurutaID-v0", plant=QUBE, normalize_action=True)
    PPO.load(shares, env=env, device="cpu").save(again)  # which forgets the observations that it saw last
    rig = {"u_max": QUBE.u_max}
    path = recorded(again, tmp_path, env={"task": "balance"}, plant=rig)
    with pytest.warns(UserWarning, match="does not show whether it learned from VecNormalize"):
        make_controller(path, QUBE, trust=True)
    known = recorded(again, tmp_path, env={"task": "balance"}, normalized_observations=False, plant=rig)
    make_controller(known, QUBE, trust=True)
    scaled = recorded(again, tmp_path, env={"task": "balance"}, normalized_observations=True)
    with pytest.raises(ValueError, match="normalised observations: its record says so"):
        make_controller(scaled, QUBE, trust=True)
