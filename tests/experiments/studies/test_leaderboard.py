"""The leaderboard in small: trainings and blocks that are kept, intervals over seeds, and what is missed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="training needs the extra `rl`")

from controllers.comparison.conditions import conditions
from controllers.comparison.statistics import over_seeds_rate
from controllers.design import choose_sensors
from controllers.training import recipes
from experiments.studies import robust_policy, sb3_defaults
from experiments.studies.leaderboard import blocks as blocks_module
from experiments.studies.leaderboard.blocks import Block, block_file, collected, run
from experiments.studies.leaderboard.contestants import Contestant, chosen, learn, made
from experiments.studies.leaderboard.page import cells_of, draw, spent_on, tables
from experiments.studies.leaderboard.rigs import leaderboard_conditions, robust_conditions
from experiments.studies.leaderboard.summary import cell
from furuta_gym.plant import QUBE

DESIGNED, LEARNED = chosen("swing-up")[0], Contestant("tiny", "one update", algorithm="ppo", steps=1)


def small(duration: float = 6.0) -> list:
    wanted = ("0 ms late", "built ±20 %, 8 ms late")
    return [replace(c, duration=duration) for c in leaderboard_conditions(QUBE, 4) if c.name in wanted]


@pytest.mark.parametrize("backend", ["loky", "dask"])
def test_what_is_there_is_not_run_again(backend: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if backend == "dask":
        pytest.importorskip("distributed")
    go = lambda: run((DESIGNED, LEARNED), 2, QUBE, small(), tmp_path, command="test", backend=backend)  # noqa: E731
    found = go()
    assert [(b.contestant, b.seed, len(b.success)) for b in found] == [
        ("swing-up", 0, 4),
        ("swing-up", 0, 4),
        ("tiny", 0, 4),
        ("tiny", 0, 4),
        ("tiny", 1, 4),
        ("tiny", 1, 4),
    ]
    assert all(found[0].success)
    assert not any(found[2].success)
    lost = block_file(tmp_path, LEARNED, 1, "built ±20 %, 8 ms late")
    cut = block_file(tmp_path, DESIGNED, 0, "0 ms late")
    before = lost.read_bytes(), cut.read_bytes()
    lost.unlink()
    cut.write_bytes(before[1][:40])
    monkeypatch.setattr("controllers.training.train.train", lambda *_, **__: pytest.fail("it was trained already"))
    assert go() == found
    assert (lost.read_bytes(), cut.read_bytes()) == before
    if backend == "loky":
        monkeypatch.setattr(blocks_module, "play", lambda *_: pytest.fail("it was played already"))
        assert go() == found
        cells = cells_of((DESIGNED, LEARNED), small(), found, 6.0)
        spent = spent_on((DESIGNED, LEARNED), 2, tmp_path)
        assert set(spent) == {"tiny"}
        text = tables((LEARNED, DESIGNED, chosen("tqc")[0]), small(), cells, spent, QUBE)
        assert "Not run, or not possible on this rig: TQC, one rig." in text
        assert text.index("designed: energy") < text.index("one update")  # the better one first
        assert "| designed: energy, then LQR | one update (2 seeds) |" in text
        draw((DESIGNED, LEARNED), small(), cells, tmp_path / "board.png")
        assert (tmp_path / "board.png").stat().st_size > 5000


def test_what_was_made_with_something_else_is_refused(tmp_path: Path) -> None:
    """Another plant, number of trials, duration, or recipe: nothing is run, and the message names what differs."""
    rows = small()[:1]
    run((DESIGNED, LEARNED), 1, QUBE, rows, tmp_path, command="test")
    heavier = QUBE.replace(theta=QUBE.theta * np.array([1.2, 1, 1, 1, 1, 1, 1, 1, 1]))
    refused: list[tuple[Contestant, object, list, str]] = [
        (DESIGNED, heavier, rows, "played with plant_sha256"),
        (DESIGNED, QUBE, [replace(rows[0], trials=5)], "played with trials = 4, and now 5 is asked for"),
        (DESIGNED, QUBE, [replace(rows[0], duration=7.0)], "duration = 6.0, and now 7.0"),
        (LEARNED, heavier, rows, "trained with plant_sha256"),
        (replace(LEARNED, steps=20_000), QUBE, rows, "trained with steps = 8192, and now 20000"),
        (replace(LEARNED, recipe="robust"), QUBE, rows, "tiny-0.zip was trained with"),
    ]
    for contestant, plant, others, words in refused:
        for go in (
            lambda c=contestant, p=plant, r=others: run((c,), 1, p, r, tmp_path, command="test"),
            lambda c=contestant, p=plant, r=others: collected((c,), 1, p, r, tmp_path),
        ):
            with pytest.raises(ValueError, match=words) as error:
                go()
            assert "choose another --work" in str(error.value)
    assert len(collected((DESIGNED, LEARNED), 1, QUBE, rows, tmp_path)) == 2


def test_only_who_played_every_rig_is_ranked(tmp_path: Path) -> None:
    rows = small()
    played = {"rows": [0.9, 0.5], "few": [1.0]}
    who = [Contestant(name, f"who has {name}", design="swing-up") for name in played]
    blocks = [
        replace(block(row.name, share), contestant=name)
        for name, shares in played.items()
        for row, share in zip(rows, shares, strict=False)
    ]
    learned = Contestant("late", "who misses a seed", algorithm="ppo")
    blocks += [replace(block(row.name, 1.0), contestant="late", seed=seed) for row in rows for seed in (0, 1)][:3]
    text = tables([*who, learned], rows, cells_of([*who, learned], rows, blocks, 15.0), {}, QUBE)
    assert "| rig | who has rows |" in text
    assert "| mean | 70.0 |" in text
    assert "Not ranked, as trials are missing: who has few; who misses a seed." in text
    assert "of these" not in text  # nobody who is ranked was trained
    blocks += [replace(block(rows[1].name, 1.0), contestant="late", seed=1)]
    text = tables([learned], rows, cells_of([learned], rows, blocks, 15.0), {}, QUBE)
    assert "with its 95 % interval of these 2 trainings" in text


def test_seeds_that_differ_widen_the_interval() -> None:
    good, bad = np.ones(200), np.zeros(200)
    alike = over_seeds_rate([np.r_[np.ones(100), np.zeros(100)]] * 4)
    apart = over_seeds_rate([good, bad, good, bad])
    assert alike.value == apart.value == 0.5
    assert alike.high - alike.low < 0.15
    assert apart.high - apart.low > 0.8
    perfect = over_seeds_rate([good] * 5)
    assert 0.99 < perfect.low < perfect.high == 1.0


def block(name: str, success: float, settling: float = 0.6, roughness: float = 12.0, left: bool = False) -> Block:
    won = [i < 200 * success for i in range(200)]
    figures = {"settling": settling, "largest_q1": 2.0, "roughness": roughness, "energy": 9.0}
    return Block("ppo-robust", 0, name, won, [left] * 200, {key: [x] * 200 for key, x in figures.items()}, {})


def test_what_is_missed_is_said_of_the_worst_seed() -> None:
    missed = lambda *some, spent=(90.0,): robust_policy.misses([cell(list(some), 15.0)], spent)  # noqa: E731
    assert missed(block("24 ms late", 0.95), block("24 ms late", 1.0)) == []
    assert "90.0 %, asked for are 95 %" in missed(block("24 ms late", 0.9), block("24 ms late", 1.0))[0]
    assert missed(block("built ±20 %, 8 ms late", 0.8)) == []
    assert len(missed(block("built ±20 %, 8 ms late", 0.79))) == 1
    assert len(missed(block("cable 0.5 V/rad", 0.94))) == 1
    assert "roughness is 21.0" in missed(block("16 ms late", 1.0, roughness=21.0))[0]
    assert missed(block("12 ms late", 1.0, roughness=21.0)) == []
    assert "upright after 1.10 s" in missed(block("0 ms late", 1.0, settling=1.1))[0]
    assert "200 of 200" in missed(block("0 ms late", 1.0, left=True))[0]
    assert "601 s of CPU" in missed(block("0 ms late", 1.0), spent=(90.0, 601.0))[0]
    text = robust_policy.report([cell([block("24 ms late", 0.9)], 15.0)], [90.0], "V")
    assert "| 24 ms late | 90 (" in text
    assert "- nothing." not in text


def test_conditions_are_what_they_are_called() -> None:
    rows = {c.name: c for c in robust_conditions(QUBE, 3)}
    assert rows["20 ms late"].plants.effect("input_delay").parameters["d"] == pytest.approx(0.02)
    assert rows["cable 0.5 V/rad"].plants.effect("arm_spring").parameters["k"] == pytest.approx(0.5)
    assert {"0 ms late", "supply 60 %", "noise 3 mrad", "pushed"} <= {c.name for c in leaderboard_conditions(QUBE, 3)}


def test_a_weak_and_a_noisy_rig_are_those_of_the_comparison() -> None:
    """Of the supply that the motor gets, and with the rig's own noise."""
    plant = QUBE.replace(limits={"supply": 5.0}, sensors={"noise_std": 0.004})
    sensors = choose_sensors(plant, None)
    compared = {c.name: c for c in conditions(plant, sensors, 3, 3, 15.0, groups=("swing_up",), effects=())}
    ours = {c.name: c for c in leaderboard_conditions(plant, 3)}
    assert ours["supply 60 %"].plants == compared["swing-up, supply 60 %"].plants
    assert ours["supply 60 %"].plants.supply == pytest.approx(3.0)
    assert ours["noise 3 mrad"].sensors == compared["swing-up, noise 3 mrad"].sensors
    assert ours["noise 3 mrad"].sensors.noise_std == pytest.approx((0.005, 0.005))


def test_a_recurrent_policy_is_kept_and_remembers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import copy

    recurrent = replace(chosen("recurrent")[0], steps=1)
    monkeypatch.setattr(recipes, "_RECURRENT", recipes._RECURRENT | {"n_steps": 4, "batch_size": 512})
    learn(recurrent, 0, QUBE, tmp_path, "test")
    policy = made(recurrent, 0, QUBE, tmp_path, 0.004)
    assert policy.predict.cells.beside  # the observation passes beside the cells
    assert (policy.history, policy.observe_command) == (1, True)
    reading = np.array([[0.1, 0.2], [3.0, 2.0]])
    first = [policy(reading) for _ in range(11)]
    assert (first[0] == first[4]).all()  # it acts at every fifth sample
    assert (first[0] != first[5]).all()  # and remembers what it saw
    twin = copy.deepcopy(policy)
    assert (twin(reading) == first[0]).all()
    assert (policy(reading) == first[10]).all()
    policy.reset()
    assert (policy(reading) == first[0]).all()


def test_defaults_are_judged_kept_and_tabulated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sb3_defaults, "EVALUATIONS", 2)
    monkeypatch.setattr(sb3_defaults, "STARTS", 3)
    file = tmp_path / "sac.json"
    sb3_defaults.learn("sac", "FurutaSwingUp-v0", 0, 40, file)
    run_ = sb3_defaults.read_run(file)
    assert run_ is not None
    assert [steps for steps, _, _ in run_.evaluations] == [20, 40]
    assert not run_.stays
    good = replace(run_, evaluations=[(1, 0.1, 0.5), (2, 0.2, 0.96), (3, 0.3, 1.0), (4, 0.4, 0.96)])
    assert (good.stays, good.reached_at) == (True, 2)
    text = sb3_defaults.table([run_, good])
    assert "**no**" in text
    assert "1 of 2 runs stay" in text
    file.write_text(json.dumps({"schema": "furuta-sb3-defaults/1"}))
    assert sb3_defaults.read_run(file) is None


def test_success_of_the_defaults_is_that_of_the_pendulum(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing falls over, and an LQR on the env's own state holds the pendulum."""
    monkeypatch.setattr(sb3_defaults, "STARTS", 4)
    still = lambda seen: np.zeros((len(seen), 1), dtype=np.float32)  # noqa: E731
    assert sb3_defaults.success(still, "FurutaSwingUp-v0") == 0.0
    assert sb3_defaults.success(still, "FurutaBalance-v0") == 0.0
    from controllers import make_controller

    q1, v1, q2, v2 = make_controller("lqr", QUBE.replace(sample_time=0.02)).feedback_gain
    pace = np.sqrt(QUBE.theta[4] / QUBE.theta[3])

    def lqr(seen: np.ndarray) -> np.ndarray:
        x = np.stack([seen[:, 0], np.arctan2(seen[:, 1], seen[:, 2]), seen[:, 3] * pace, seen[:, 4] * pace])
        return np.clip(-(np.array([[q1, q2, v1, v2]]) @ x).T / QUBE.u_max, -1, 1).astype(np.float32)

    assert sb3_defaults.success(lqr, "FurutaBalance-v0") == 1.0
