"""Controllers on the bench, and the experiment that makes them anew once the missing effect is found."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from controllers import make_controller
from controllers.comparison.statistics import success_rate
from experiments.bench import Rig
from experiments.bench.control import Balance, lqr_gain
from experiments.bench_runs import SWING_UP_FIGURES, Contrast, Run, contrast, run_on_bench, summary, swing_up_on_bench
from experiments.studies.hidden_rigs import SWING_UP_RIGS, as_the_lab_knows, task_named
from experiments.studies.randomized_swing_up import true_plant
from furuta_gym.plant import Covariance, Effect


class Own:
    """The bench's own controller as a policy."""

    def __init__(self, rig: Rig) -> None:
        self.rig, self.loop = rig, Balance(lqr_gain(rig.kind))

    def reset(self) -> None:
        self.loop.reset()

    def __call__(self, y: tuple[float, float]) -> float:
        return self.loop.command(y, self.rig.period)


def test_a_run_is_reproduced_and_differs_by_seed() -> None:
    rig = Rig("workshop")
    first, again, other = (run_on_bench(rig, Own(rig), seed, 2.0) for seed in (5, 5, 6))
    assert first.success
    assert first == again
    assert first.rms_q2 != other.rms_q2
    assert 0 < first.rms_q2 < 0.1


def test_figures_of_a_run_are_those_of_the_rig() -> None:
    """Recomputed from the angles and commands of a loop of its own."""
    rig, seen, sent = Rig("workshop"), [], []
    own = Own(rig)

    def policy(y: tuple[float, float]) -> float:
        seen.append(y)
        sent.append(own(y))
        return sent[-1]

    policy.reset = own.reset  # type: ignore[attr-defined]
    found = run_on_bench(rig, policy, 5, 2.0)
    readings = np.array(seen[1:])  # a count of 4096 is far below the motion
    assert found.rms_q1 == pytest.approx(np.sqrt(np.mean(readings[:, 0] ** 2)), rel=0.02)
    assert found.rms_q2 == pytest.approx(np.sqrt(np.mean(readings[:, 1] ** 2)), rel=0.05)
    commands = np.clip(sent, -rig.kind.u_max, rig.kind.u_max)
    assert found.energy == pytest.approx(np.sum(commands**2) * rig.period, rel=1e-9)


def test_a_swing_up_on_the_bench_is_one_that_stays_up() -> None:
    rig = replace(SWING_UP_RIGS["late"], effects=())
    controller = make_controller("swing-up", true_plant(rig), rig.period)
    found = swing_up_on_bench(rig, controller, 3, 6.0, hold=2.0)
    assert found.success
    assert 0.2 < found.settling < 4.0
    assert found.rms_q2 < 0.1
    assert found == swing_up_on_bench(rig, controller, 3, 6.0, hold=2.0)
    assert summary([found], SWING_UP_FIGURES)["settling"].value == found.settling
    still = swing_up_on_bench(rig, Still(), 3, 3.0, hold=1.0)
    assert not still.success
    assert np.isnan(still.settling)
    wound = swing_up_on_bench(rig, Still(10.0), 3, 3.0, hold=1.0)
    assert not wound.success


class Still:
    """Commands the same whatever it reads."""

    def __init__(self, u: float = 0.0) -> None:
        self.u = u

    def reset(self) -> None:
        pass

    def __call__(self, y: tuple[float, float]) -> float:
        return self.u


def test_tasks_have_names() -> None:
    with pytest.raises(ValueError, match="balance, swing_up"):
        task_named("juggle")


def test_too_few_pairs_say_nothing() -> None:
    before, after = runs([True] * 5, [1.0, 1.1, 1.2, 1.3, 1.4]), runs([True] * 5, [0.9, 1.0, 1.1, 1.2, 1.3])
    assert contrast(before, after).verdict == "no difference shown"
    assert np.isnan(contrast(before, after).ratios["energy"].low)


def test_a_rig_without_control_is_lost() -> None:
    rig = Rig("workshop")
    policy = Own(rig)
    policy.loop = Balance(np.zeros(4))
    lost = run_on_bench(rig, policy, 5, 5.0)
    assert not lost.success
    assert np.isnan(lost.rms_q2)


def runs(success: list[bool], rms: list[float]) -> list[Run]:
    return [
        Run(i, ok, r, r, r) if ok else Run(i, False, np.nan, np.nan, np.nan)
        for i, (ok, r) in enumerate(zip(success, rms, strict=True))
    ]


def test_summary_leaves_lost_runs_out() -> None:
    found = summary(runs([True, True, False], [1.0, 3.0, 9.0]))
    assert found["success"].value == pytest.approx(2 / 3)
    assert found["rms_q1"].n == 2
    assert found["rms_q1"].value == pytest.approx(2.0)


def test_contrast_says_either_way() -> None:
    n = 20
    base = np.linspace(1.0, 2.0, n)
    before = runs([True] * n, list(base))
    half = contrast(before, runs([True] * n, list(0.5 * base)))
    assert half.ratios["rms_q2"].value == pytest.approx(0.5)
    assert half.verdict == "rms_q1 -50 %, rms_q2 -50 %, energy -50 %"
    assert contrast(before, runs([True] * n, list(1.2 * base))).verdict.startswith("rms_q1 +20 %")
    noise = np.exp(0.2 * np.random.default_rng(1).standard_normal(n))
    assert (
        contrast(before, runs([True] * n, list(base * noise / np.exp(np.log(noise).mean())))).verdict
        == "no difference shown"
    )
    fell = runs([False] * n, list(base))
    assert contrast(before, fell).verdict == "worse: it falls now"
    assert contrast(fell, before).verdict == "better: it holds now"
    with pytest.raises(ValueError, match="same seeds"):
        contrast(before, before[1:])


def test_verdict_counts_only_what_intervals_allow() -> None:
    some, more = success_rate([True] * 3 + [False]), success_rate([True] * 4)
    assert "better" not in Contrast(some, more, {}).verdict


@pytest.mark.thorough
@pytest.mark.timeout(900)
def test_the_experiment_in_small(tmp_path: Path) -> None:
    from experiments.studies.reidentify_retrain import Arguments, run, table

    pytest.importorskip("stable_baselines3", reason="training needs the extra `rl`")
    (story,) = run(Arguments.quick(), tmp_path, say=lambda text: None)
    assert story.verdict == "named"
    assert [text.split("(")[0] for text in story.found] == ["input_delay"]
    assert set(story.runs) == {"lqr", "lqg", "lqg-friction", "ppo"}
    assert all(set(stages) == {"before", "after"} for stages in story.runs.values())
    assert all(run.success for stage in story.runs["lqg"].values() for run in stage)
    saved = json.loads((tmp_path / "results.json").read_text())
    assert saved["rigs"]["late"]["controllers"]["lqg"]["after"]["success"]["value"] == 1.0
    assert (tmp_path / "late" / "after-0.zip").exists()
    assert table(story).row_count == 4
    with pytest.raises(ValueError, match="exists"):
        run(Arguments.quick(), tmp_path)


def found_on(rig: Rig) -> SimpleNamespace:
    """What a diagnosis of the rig would find, without the diagnosis."""
    before = true_plant(rig)
    named = before.with_effects(Effect("input_delay", {"d": 0.016}))
    return SimpleNamespace(before=SimpleNamespace(plant=before), plant=named, verdict="named")


def test_swing_ups_before_and_after_in_small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from experiments.studies import reidentify_retrain as study

    pytest.importorskip("stable_baselines3", reason="training needs the extra `rl`")
    rig = SWING_UP_RIGS["late"]
    monkeypatch.setattr(study, "recorded", lambda *_: [])
    monkeypatch.setattr(study, "diagnose", lambda *_, **__: found_on(rig))
    (story,) = study.run(study.Arguments.quick("swing_up"), tmp_path, say=lambda text: None)
    assert set(story.runs) == {"swing-up", "ppo"}
    assert [text.split("(")[0] for text in story.found] == ["input_delay"]
    assert all(run.success for run in story.runs["swing-up"]["after"])
    saved = json.loads((tmp_path / "results.json").read_text())
    assert saved["arguments"]["task"] == "swing_up"
    figures = saved["rigs"]["late"]["controllers"]["swing-up"]["after"]
    assert set(figures) == {"success", *SWING_UP_FIGURES, "success_by_run"}
    assert figures["success"]["value"] == 1.0
    assert study.table(story).row_count == 2


def test_swing_ups_on_drawn_plants_in_small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from experiments.studies import randomized_swing_up as study

    pytest.importorskip("stable_baselines3", reason="training needs the extra `rl`")
    rig = SWING_UP_RIGS["late"]
    plant = as_the_lab_knows(true_plant(rig), rig)
    names = tuple(f"theta{i}" for i in range(1, 10))
    spread = Covariance(names, np.diag((0.01 * plant.theta) ** 2))
    named = found_on(rig).plant
    for name, one in (("long", plant), ("short", plant.replace(covariance=spread)), ("named", named)):
        one.save(tmp_path / f"{name}.json")
    (tmp_path / study.MADE_WITH).write_text(json.dumps({"rig": "late", "most": 1}))
    some = {n: study.ARMS[n] for n in ("ranged", "with the named effects", "posterior, poor log")}
    monkeypatch.setattr(study, "ARMS", some)
    scores = study.run(study.Size.quick(), tmp_path, say=lambda text: None)
    assert set(scores) == set(some)
    for places in scores.values():
        assert places[study.RIG]["success"].n == 1
        assert places[study.OTHERS]["success"].n == 4
        assert places[study.OTHERS]["worst"].value == 6.0, "twenty thousand steps teach nothing"
    record = json.loads((tmp_path / "posterior-poor-log-20000-0.json").read_text())
    assert record["env"]["randomize"] == {"theta": "posterior"}
    assert record["recipe"] == "robust"
    record = json.loads((tmp_path / "ranged-20000-0.json").read_text())
    assert set(record["env"]["randomize"]) == {"theta", "input_delay", "arm_spring.k", "arm_spring.q1n"}
    assert study.table(scores).row_count == 3
    monkeypatch.setattr(study, "train", lambda *_, **__: pytest.fail("it was trained already"))
    assert study.run(study.Size.quick(), tmp_path, say=lambda text: None) == scores


@pytest.mark.parametrize(("rig", "most"), [("cable", 1), ("late", 6), (None, None)])
def test_plants_of_another_rig_or_size_are_refused(tmp_path: Path, rig: str | None, most: int | None) -> None:
    from experiments.studies import randomized_swing_up as study

    for name in ("long", "short", "named"):
        true_plant(SWING_UP_RIGS["late"]).save(tmp_path / f"{name}.json")
    if rig is not None:
        (tmp_path / study.MADE_WITH).write_text(json.dumps({"rig": rig, "most": most}))
    with pytest.raises(ValueError, match="take another --out"):
        study.run(study.Size.quick(), tmp_path, say=lambda text: None)


def test_what_the_plants_were_made_with_is_kept_beside_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from experiments.studies import randomized_swing_up as study

    rig = SWING_UP_RIGS["late"]
    monkeypatch.setattr(study, "recorded", lambda *_, **__: [])
    monkeypatch.setattr(study, "diagnose", lambda *_, **__: found_on(rig))
    monkeypatch.setattr(study, "identify", lambda *_: found_on(rig))
    size = study.Size.quick()
    made = study._plants(rig, size, tmp_path, lambda text: None)
    assert json.loads((tmp_path / study.MADE_WITH).read_text()) == {"rig": "late", "most": 1}
    assert study._plants(rig, size, tmp_path, lambda text: pytest.fail(text)).keys() == made.keys()


def test_ranges_that_do_not_reach_what_was_found_leave_it_as_it_is() -> None:
    from experiments.studies.randomized_swing_up import ranges_around

    plant = true_plant(SWING_UP_RIGS["cable"])
    usual = {"theta", "input_delay", "arm_spring.k", "arm_spring.q1n"}
    assert set(ranges_around(plant)) == usual
    assert set(ranges_around(plant.with_effects(Effect("input_delay", {"d": 0.016})))) == usual
    strong = plant.with_effects(Effect("arm_spring", {"k": 2.0, "q1n": 0.3}))
    assert set(ranges_around(strong)) == {"theta", "input_delay"}


def test_the_slowest_count_failures_with_the_whole_duration() -> None:
    from experiments.studies.randomized_swing_up import figures

    won = np.array([True] * 38 + [False] * 2)
    found = figures([won, won], [np.full(40, 1.0)] * 2, 15.0)
    assert found["success"].value == 0.95
    assert found["typical"].value == 1.0
    assert found["worst"].value == 15.0, "4 of 80 failed, and the worst 5 % are 4"


@pytest.mark.timeout(300)
def test_randomized_training_in_small(tmp_path: Path) -> None:
    from experiments.studies.randomized_training import KINDS, Size, run

    pytest.importorskip("stable_baselines3", reason="training needs the extra `rl`")
    scores = run(Size.quick(), tmp_path, say=lambda text: None)
    assert set(scores) == set(KINDS)
    for kind, rows in scores.items():
        assert set(rows) == {"drawn plants", "θ ±20 %", "the rig"}
        assert rows["drawn plants"]["success"].n == 5
        record = json.loads((tmp_path / f"{kind.replace(', ', '-').replace(' ', '-')}-0.json").read_text())
        assert record["env"]["randomize"] is (kind != "nominal")
        assert (record["env"]["effect_probabilities"] != {}) is (kind == "drawn, with effects")
    with pytest.raises(ValueError, match="earlier run"):
        run(Size.quick(), tmp_path)
