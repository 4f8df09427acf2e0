"""A foreign training script: it gets an id alone, and the environment says how its episodes ended."""

from __future__ import annotations

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import furuta_gym  # noqa: F401  (registers the ids)
from controllers import make_controller
from experiments.studies import learner_script
from experiments.studies.mean_action import mean_policy, wrappers_of
from experiments.studies.watched_env import PREFIX
from furuta_gym.plant import QUBE

SCRIPT = """
import argparse, gymnasium
parser = argparse.ArgumentParser()
parser.add_argument("--env-id")
parser.add_argument("--seed", type=int)
parser.add_argument("--total-timesteps", type=int)
o = parser.parse_args()
env = gymnasium.make(o.env_id)
env.reset(seed=o.seed)
for step in range(1, o.total_timesteps + 1):
    _, _, terminated, truncated, _ = env.step(env.action_space.sample())
    if terminated or truncated:
        env.reset()
"""

CLEANRL = """
import argparse, gymnasium, numpy, torch
parser = argparse.ArgumentParser()
parser.add_argument("--env-id")
parser.add_argument("--seed", type=int)
parser.add_argument("--total-timesteps", type=int)
o = parser.parse_args()
torch.manual_seed(o.seed)

class Agent(torch.nn.Module):
    def __init__(self, n):
        super().__init__()
        self.actor_mean = torch.nn.Linear(n, 1)

def made():
    env = gymnasium.wrappers.FlattenObservation(gymnasium.make(o.env_id))
    env = gymnasium.wrappers.NormalizeObservation(gymnasium.wrappers.ClipAction(env))
    return gymnasium.wrappers.TransformObservation(env, lambda x: numpy.clip(x, -10, 10), env.observation_space)

if __name__ == "__main__":
    envs = gymnasium.vector.SyncVectorEnv([made, made])
    agent = Agent(envs.single_observation_space.shape[0])
    seen, _ = envs.reset(seed=o.seed)
    for _ in range(o.total_timesteps // 2):
        mean = agent.actor_mean(torch.Tensor(seen)).detach()
        seen, *_ = envs.step(torch.normal(mean, 1.0).numpy())
    print("count:", envs.envs[0].env.obs_rms.count, "last:", repr(seen.tolist()))
    envs.close()
"""


@pytest.fixture
def script(tmp_path: Path) -> Path:
    file = tmp_path / "mine.py"
    file.write_text(SCRIPT)
    return file


def run(*arguments: object):
    app = typer.Typer()
    app.command()(learner_script.main)
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_a_script_gets_an_id_and_its_episodes_are_counted(script: Path, tmp_path: Path):
    found = run(script, "--seeds", 1, "--steps", 1000, "--work", tmp_path / "w", "-o", tmp_path / "o")
    assert found.exit_code == 0, found.output
    (one,) = json.loads((tmp_path / "o" / "learner_script.json").read_text())["runs"]
    assert one["env_id"] == "FurutaSwingUp-v0"
    assert one["cpu_s"] > 0.0
    ended = [share for share in one["good"] if share is not None]
    assert set(ended) == {0.0}
    assert len(ended) >= 4, "an episode has 250 steps at most"
    assert not one["stays"]
    assert "0 of 1 runs stay" in found.output


def test_a_run_that_is_there_is_not_made_again(script: Path, tmp_path: Path):
    (tmp_path / "w").mkdir()
    good = "".join(f"watched: step={250 * k}, held=1\n" for k in range(1, 81))
    (tmp_path / "w" / "mine-swing_up-1-20000.txt").write_text(good + "cpu_s=12.5\n")
    found = run(script, "--seeds", 1, "--steps", 20000, "--work", tmp_path / "w", "-o", tmp_path / "o")
    assert found.exit_code == 0, found.output
    (one,) = json.loads((tmp_path / "o" / "learner_script.json").read_text())["runs"]
    assert one["good"] == [1.0] * 20
    assert one["stays"]
    assert one["cpu_s"] == 12.5


def test_the_mean_action_is_judged_and_the_training_does_not_notice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("torch", reason="the script's network needs the extra `rl`")
    file = tmp_path / "clean.py"
    file.write_text(CLEANRL)
    found = run(file, "--seeds", 1, "--steps", 1040, "--work", tmp_path / "w", "-o", tmp_path / "o")
    assert found.exit_code == 0, found.output
    (one,) = json.loads((tmp_path / "o" / "learner_script.json").read_text())["runs"]
    *steps, last = [steps for steps, _ in one["evaluations"]]
    assert steps == list(range(52, 989, 52))
    assert 988 < last <= 1040, "judged at the end too; a step that begins an episode does not reach the environment"
    assert {rate for _, rate in one["evaluations"]} == {0.0}
    assert one["reached_at"] is None
    judged = (tmp_path / "w" / "clean-swing_up-1-1040.txt").read_text()
    monkeypatch.setattr(learner_script, "BLOCKS", 1)  # a single judgement, at the end
    assert run(file, "--seeds", 1, "--steps", 1040, "--work", tmp_path / "v", "-o", tmp_path / "o").exit_code == 0
    alone = (tmp_path / "v" / "clean-swing_up-1-1040.txt").read_text()
    ended = lambda text: [line for line in text.splitlines() if line.startswith("count:")]  # noqa: E731
    assert ended(judged) == ended(alone) != []


def test_options_of_the_environment_have_runs_of_their_own(script: Path, tmp_path: Path):
    given = ("--seeds", 1, "--steps", 200, "--work", tmp_path / "w", "-o", tmp_path / "o")
    found = run(script, *given, "--env-option", "time_limit=0.5", "--env-option", "observe_command=true")
    assert found.exit_code == 0, found.output
    text = (tmp_path / "w" / "mine-time_limit=0.5-observe_command=True-swing_up-1-200.txt").read_text()
    assert text.count("watched:") >= 8, "an episode has 25 steps"
    (one,) = json.loads((tmp_path / "o" / "learner_script.json").read_text())["runs"]
    assert one["env_options"] == {"time_limit": 0.5, "observe_command": True}
    assert "FurutaSwingUp-v0, time_limit=0.5" in found.output
    found = run(script, *given, "--env-option", "time_limit")
    assert found.exit_code != 0
    assert "expected NAME=VALUE" in found.output


def test_the_mean_action_decides_where_it_is_known():
    text = "watched: step=10, held=0\njudged: step=10, success=1.0, cpu_s=0.5\ncpu_s=2.0\n"
    found = learner_script.measured(text, "mine", "swing_up", 1, 100, {})
    assert found.stays, "its noise may throw the pendulum over"
    assert found.cpu_s == 1.5, "without the judgements"
    assert found.reached_at == 10


def test_only_what_is_understood_is_judged():
    made = lambda: gymnasium.make("FurutaSwingUp-v0")  # noqa: E731
    plain = gymnasium.vector.SyncVectorEnv([made])
    own = plain.envs[0].unwrapped
    names = [type(w).__name__ for w in wrappers_of(plain, own) or []]
    assert names == ["PassiveEnvChecker", "OrderEnforcing"]
    assert wrappers_of(gymnasium.wrappers.vector.NormalizeObservation(plain), own) is None
    low, high = np.float32([-0.5]), np.float32([0.5])
    halved = gymnasium.vector.SyncVectorEnv([lambda: gymnasium.wrappers.RescaleAction(made(), low, high)])
    assert wrappers_of(halved, halved.envs[0].unwrapped) is None
    stacked = gymnasium.vector.SyncVectorEnv([lambda: gymnasium.wrappers.FrameStackObservation(made(), 2)])
    assert wrappers_of(stacked, stacked.envs[0].unwrapped) is None
    assert wrappers_of(plain, stacked.envs[0].unwrapped) is None
    with mean_policy(own) as found:
        assert found is None, "the tests keep no agent"


def test_who_stops_it_is_told_what_is_kept(script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(learner_script, "learn", interrupted)
    found = run(script, "--seeds", 1, "--steps", 1000, "--work", tmp_path / "w", "-o", tmp_path / "o")
    assert found.exit_code == 130
    assert "goes on from there" in found.output
    assert not (tmp_path / "o" / "learner_script.json").exists()


def test_the_last_three_twentieths_decide():
    held = [1] * 79 + [0]
    text = "".join(f"watched: step={250 * k}, held={h}\n" for k, h in enumerate(held, 1))
    found = learner_script.measured(text, "mine", "swing_up", 1, 20000, {})
    assert found.good[-1] == 0.75
    assert not found.stays
    assert found.cpu_s is None


def test_scripts_that_fail_or_do_not_train_are_refused(tmp_path: Path):
    file = tmp_path / "other.py"
    file.write_text("print('reward 5')\n")
    found = run(file, "--seeds", 1, "--steps", 100, "--work", tmp_path / "w", "-o", tmp_path / "o")
    assert found.exit_code != 0
    assert "no episode ended" in found.output
    file.write_text("raise SystemExit('no such id')\n")
    found = run(file, "--seeds", 1, "--steps", 200, "--work", tmp_path / "w", "-o", tmp_path / "o")
    assert found.exit_code != 0
    assert "no such id" in found.output


def test_a_watched_environment_is_the_same_and_knows_what_upright_is(capsys: pytest.CaptureFixture):
    plain = gymnasium.make("FurutaBalance-v0")
    watched = gymnasium.make(f"experiments.studies.watched_env:{PREFIX}FurutaBalance-v0")
    lqr = make_controller("lqr", QUBE, 0.02)
    (one, _), (two, info) = (env.reset(seed=5) for env in (plain, watched))
    assert np.array_equal(one, two)
    state, ended = info["state"], False
    while not ended:
        u = np.array([lqr(state[:2]) / QUBE.u_max], dtype=np.float32)
        (one, _, *_), (two, _, terminated, truncated, info) = plain.step(u), watched.step(u)
        assert np.array_equal(one, two)
        state, ended = info["state"], terminated or truncated
    assert "watched: step=1000, held=1" in capsys.readouterr().out
    watched.reset(seed=6)
    for _ in range(1000):
        *_, terminated, truncated, _ = watched.step(np.zeros(1, dtype=np.float32))
        if terminated or truncated:
            break
    assert "held=0" in capsys.readouterr().out
