"""The comparison: equal trials for all, figures that mean what they say, files that read back."""

import json
from dataclasses import replace

import numpy as np
import pytest

from controllers import make_controller
from controllers.comparison import conditions as conditions_module
from controllers.comparison.conditions import (
    conditions,
    map_name,
)
from controllers.comparison.evaluation import compare
from controllers.comparison.plots import draw_comparison
from controllers.comparison.result import Comparison
from controllers.comparison.statistics import Interval
from controllers.comparison.trials import PUSH_LENGTH, Starts, balance_starts, run_trials
from controllers.envelope import Guarded
from furuta_gym.plant import QUBE, Effect
from furuta_gym.plant.parameters import pendulum_frequency
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import simulate


class Idle:
    """Does nothing, and is no `Controller`."""

    name = "idle"

    def reset(self) -> None: ...

    def __call__(self, y):
        return 0.0


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compare(
        "qube",
        ["dlqr", "swing-up", "paper-lqr", Idle()],
        trials=8,
        small_trials=6,
        duration=4.0,
        groups=("balance", "push", "delay", "effects"),
        effects=["input_delay", "arm_spring"],
    )


def test_a_trial_is_what_simulate_does():
    rng = np.random.default_rng(2)
    starts = balance_starts(QUBE, 3, 2.0, rng, push=0.0)
    controller = make_controller("lqg", QUBE)
    outcome = run_trials(QUBE, controller, starts, 2.0, 0.004)
    for lane in range(3):
        run = simulate(QUBE, controller, 2.0 + 0.004, x0=starts.x0[:, lane])
        # sums in another order round otherwise, and a count that flips is no longer the last bit
        assert outcome.rms_q1[lane] == pytest.approx(np.sqrt(np.mean(run.state[:, 0] ** 2)), rel=1e-4)
        assert outcome.rms_q2[lane] == pytest.approx(np.sqrt(np.mean(run.state[:, 1] ** 2)), rel=1e-4)
        assert outcome.energy[lane] == pytest.approx(np.sum(run.command[:-1] ** 2) * 0.004, rel=1e-3)
        assert outcome.largest_q1[lane] == pytest.approx(np.abs(run.state[:, 0]).max(), rel=1e-4)
        assert outcome.roughness[lane] == pytest.approx(np.abs(np.diff(run.command[:-1])).mean() / 0.004, rel=1e-2)
        restless = np.flatnonzero(np.abs(run.state[:, 1]) > 0.05)  # rad; the push, of size zero, is at some later time
        settling = 0.004 * (restless[-1] + 1) - starts.push_time[lane] if restless.size else 0.0
        assert outcome.settling[lane] == pytest.approx(max(settling, 0.0), abs=0.0041)


class Tumbles:
    """Holds a pendulum that starts upright until `until` [s], then lets go."""

    name, sample_time, tasks = "tumbles", 0.004, ("swing_up",)

    def __init__(self, until: float) -> None:
        self.until, self.held, self.samples = until, make_controller("dlqr", QUBE, 0.004), 0

    def reset(self) -> None:
        self.held.reset()
        self.samples = 0

    def __call__(self, y):
        self.samples += 1
        return self.held(y) if self.samples * 0.004 < self.until else 10.0


@pytest.mark.parametrize(("until", "success"), [(9.99, True), (9.0, False), (5.5, False)])
def test_a_swing_up_holds_for_the_last_five_seconds(until, success):
    starts = Starts(np.array([[0.0], [0.01], [0.0], [0.0]]), np.zeros(1), np.zeros(1))
    outcome = run_trials(QUBE, Tumbles(until), starts, 10.0, 0.004, swing_up=True)
    assert bool(outcome.success[0]) is success
    late = Starts(np.array([[0.0], [0.3], [0.0], [0.0]]), np.zeros(1), np.zeros(1))
    for duration, caught in ((5.01, False), (10.0, True)):  # leaning by more than 0.2 rad within its last five seconds
        assert bool(run_trials(QUBE, Tumbles(99.0), late, duration, 0.004, swing_up=True).success[0]) is caught


def test_failure_is_where_simulate_sees_it():
    starts = Starts(np.array([[0.0], [0.2], [0.0], [0.0]]), np.zeros(1), np.zeros(1))
    outcome = run_trials(QUBE, Idle(), starts, 3.0, 0.004)
    run = simulate(QUBE, Idle(), 3.0, x0=starts.x0[:, 0], q2_limit=np.pi / 2)
    assert not outcome.success[0]
    assert outcome.failed_at[0] == pytest.approx(run.fell)


def test_a_push_changes_the_speed_by_its_size():
    free = QUBE.replace(theta=[*QUBE.theta[:4], 1e-9, 0.0, 0.0, 0.0, 0.0])
    starts = Starts(np.zeros((4, 2)), np.array([0.15, -0.05]), np.array([0.1, 0.2]))
    outcome = run_trials(free, Idle(), starts, 0.3 + PUSH_LENGTH, 0.004, Sensors(None))
    # coasting at speed v from the middle of the push on: the mean square of a ramp
    for lane, (v, start) in enumerate(zip((0.15, 0.05), (0.1, 0.2), strict=True)):
        coasting = 0.3 + PUSH_LENGTH - (start + PUSH_LENGTH / 2)
        expected = np.sqrt((v * coasting) ** 2 / 3 * coasting / (0.3 + PUSH_LENGTH))
        assert outcome.rms_q2[lane] == pytest.approx(expected, rel=0.05)


def test_lanes_may_be_different_plants():
    heavier = QUBE.replace(theta=QUBE.theta * np.array([1.2, 1, 1, 1, 1, 1, 1, 1, 1]))
    starts = balance_starts(QUBE, 2, 2.0, np.random.default_rng(0))
    controller = make_controller("dlqr", QUBE)
    mixed = run_trials([QUBE, heavier], controller, starts, 2.0, 0.004)
    alone = [run_trials(p, controller, starts, 2.0, 0.004).rms_q1[k] for k, p in enumerate((QUBE, heavier))]
    assert mixed.rms_q1 == pytest.approx(alone, rel=1e-9)
    with pytest.raises(ValueError, match="same effects"):
        run_trials([QUBE, QUBE.with_effects(QUBE.default_effect("arm_spring"))], controller, starts, 2.0, 0.004)


def test_equal_seeds_give_equal_figures(comparison):
    again = compare("qube", ["dlqr"], trials=8, small_trials=6, duration=4.0, groups=("balance",))
    assert again.scores["dlqr"]["balance"] == comparison.scores["dlqr"]["balance"]
    other = compare("qube", ["dlqr"], trials=8, small_trials=6, duration=4.0, groups=("balance",), seed=1)
    assert other.scores["dlqr"]["balance"] != comparison.scores["dlqr"]["balance"]


def test_order_and_company_do_not_matter():
    options = {"trials": 5, "small_trials": 5, "duration": 3.0, "groups": ("balance", "quantisation")}
    one = compare("qube", ["lqg", "dlqr"], **options)
    two = compare("qube", ["dlqr", "lqg"], jobs=2, **options)
    assert one.to_dict()["controllers"] == two.to_dict()["controllers"]


def test_figures_tell_the_controllers_apart(comparison):
    dlqr, idle = comparison.scores["dlqr"], comparison.scores["idle"]
    assert dlqr["balance"]["success"].value == 1.0
    assert idle["balance"]["success"].value == 0.0
    assert np.isnan(idle["balance"]["rms_q2"].value)
    assert dlqr["push"]["largest_push"].value > 0.5 * pendulum_frequency(QUBE.theta)
    assert idle["push"]["largest_push"].value < 0.05 * pendulum_frequency(QUBE.theta)
    assert dlqr["arm_spring"]["success"].value == 0.0  # unknown to it, and stronger than its hold on the arm
    assert dlqr["delay 4 ms"]["success"].value == 1.0


def test_a_controller_that_does_not_apply_is_left_out_with_its_reason(comparison):
    assert "paper-lqr" not in comparison.scores
    assert "does not apply" in comparison.skipped["paper-lqr"]


def test_swing_up_group_takes_those_that_can(monkeypatch):
    monkeypatch.setattr(conditions_module, "_harder", lambda plain, trials, *rest: [replace(plain, name="again")])
    result = compare("qube", ["dlqr", "swing-up"], trials=4, duration=5.0, groups=("swing_up",))
    assert result.scores["dlqr"] == {}
    rows = result.scores["swing-up"]
    assert set(rows) == set(result.groups) == {"swing-up", "again"}
    assert rows["swing-up"]["success"].value == 1.0
    assert "nan" not in str(result)  # of four trials the worst have no interval
    told = result.to_dict()["groups"]["swing_up"]["swing-up"]
    assert set(told) == {"swing-up"}
    assert {"success", "worst_settling", "worst_largest_q1"} <= set(told["swing-up"])
    assert rows["swing-up"]["worst_settling"].value >= rows["swing-up"]["settling"].value
    assert "worst 5 %" in str(result)


def test_a_controller_inside_its_envelope_swings_up_at_its_own_period(monkeypatch):
    monkeypatch.setattr(conditions_module, "_harder", lambda plain, trials, *rest: [])
    plant = QUBE.replace(sample_time=None)
    inside = Guarded(make_controller("swing-up", plant, 0.004))
    result = compare(plant, [inside], trials=2, duration=5.0, groups=("swing_up",))
    assert result.settings["sample_time"] == 0.004
    assert result.scores["swing-up"]["swing-up"]["success"].value == 1.0


def test_trials_are_read_by_the_encoders_of_the_plant_file():
    rig = QUBE.replace(sensors={"offset": [0.3, 0.0], "encoder_counts": 512})
    policy = make_controller("dlqr", rig)
    starts = balance_starts(rig, 3, 2.0, np.random.default_rng(0))
    told, given = (run_trials(rig, policy, starts, 2.0, 0.004, s) for s in (None, Sensors.of_file(rig.sensors)))
    np.testing.assert_array_equal(told.rms_q1, given.rms_q1)
    others = [rig, QUBE, QUBE]
    with pytest.raises(ValueError, match="sensors None: the plants differ in them"):
        run_trials(others, policy, starts, 2.0, 0.004)
    assert run_trials(others, policy, starts, 2.0, 0.004, Sensors(512)).success.all()


def test_who_is_never_up_took_the_whole_trial():
    row = {r.name: r for r in conditions(QUBE, Sensors(), 3, 3, 5.0, groups=("swing_up",))}["swing-up, arm_spring"]
    scores = replace(row, duration=6.0).score(Idle(), 0.004, 0)
    assert scores["success"].value == 0.0
    assert scores["worst_settling"].value == 6.0
    assert np.isnan(scores["worst_largest_q1"].value)


def test_design_from_another_plant():
    spring = QUBE.with_effects(QUBE.default_effect("arm_spring"))
    options = {"trials": 6, "duration": 4.0, "groups": ("balance",)}
    knowing = compare(spring, ["dlqr"], **options)
    ignorant = compare(spring, ["dlqr"], design_plant=QUBE, **options)
    assert knowing.scores["dlqr"]["balance"]["success"].value == 1.0
    assert ignorant.scores["dlqr"]["balance"]["success"].value < 0.5
    assert (knowing.settings["designed_for_this_plant"], ignorant.settings["designed_for_this_plant"]) == (True, False)


def test_the_map_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(conditions_module, "MAP_DELAYS", (0, 16))
    monkeypatch.setattr(conditions_module, "MAP_ERRORS", (0, 20))
    monkeypatch.setattr("controllers.comparison.plots.MAP_DELAYS", (0, 16))
    monkeypatch.setattr("controllers.comparison.plots.MAP_ERRORS", (0, 20))
    result = compare("qube", ["swing-up"], trials=4, small_trials=4, groups=("map",))
    assert list(result.scores["swing-up"]) == [map_name(ms, e) for e in (0, 20) for ms in (0, 16)]
    assert result.scores["swing-up"][map_name(0, 0)]["success"].value == 1.0
    assert "map: as is" in str(result)
    (path,) = draw_comparison(result, tmp_path)
    assert path.name == "comparison_map.png"


def test_the_largest_push_is_the_largest(comparison):
    """What is reported is survived, and a fifth more is not, played anew from the definition."""
    policy, pushed = make_controller("dlqr", QUBE), comparison.scores["dlqr"]["push"]["largest_push"].value
    for factor, survives in ((0.8, True), (1.25, False)):
        starts = Starts(np.zeros((4, 1)), np.array([factor * pushed]), np.array([0.5]))
        assert bool(run_trials(QUBE, policy, starts, 5.0, policy.sample_time).success[0]) is survives


def test_files(comparison, tmp_path):
    paths = [comparison.save(tmp_path), *draw_comparison(comparison, tmp_path)]
    assert {p.name for p in paths} == {
        "comparison.json",
        *(f"comparison_{group}.png" for group in ("balance", "push", "delay", "effects")),
    }
    assert all(p.stat().st_size > 1000 for p in paths)
    data = json.loads((tmp_path / "comparison.json").read_text())
    assert data["schema"] == "furuta-comparison/2"
    assert data["controllers"]["dlqr"]["balance"]["success"]["n"] == 8
    assert data["groups"]["balance"]["balance"]["dlqr"]["success"] == data["controllers"]["dlqr"]["balance"]["success"]
    assert set(data["groups"]["delay"]["delay 16 ms"]) == set(data["controllers"])
    again = Comparison.load(tmp_path / "comparison.json")
    assert again.to_dict() == comparison.to_dict()
    earlier = {**data, "schema": "furuta-comparison/1", "groups": dict(comparison.groups)}
    assert Comparison.from_dict(earlier).to_dict() == comparison.to_dict()
    with pytest.raises(ValueError, match="furuta-comparison/2"):
        Comparison.from_dict({"schema": "furuta-comparison/3"})
    data["controllers"]["dlqr"]["balance"]["success"]["n"] = "8"
    (tmp_path / "comparison.json").write_text(json.dumps(data))
    with pytest.raises(
        ValueError, match=r"json: .*controllers\.dlqr\.balance\.success\.n must be a whole number, got '8'"
    ):
        Comparison.load(tmp_path / "comparison.json")


def test_the_table_of_many_groups_cuts_no_heading(comparison):
    """A text has no width to keep, as a terminal has."""
    played = ("balance", "push", "θ ±20 %", "delay 16 ms", "swing-up", "swing-up, 16 ms late", "swing-up, supply 60 %")
    text = str(replace(comparison, groups=dict.fromkeys(played, "any")))
    for title in (
        "controller",
        "upright",
        "roughness",
        "settling",
        "16 ms late",
        "worst 5 %",
        "largest q1",
        "supply 60 %",
    ):
        assert title in text


def test_table_shows_everyone(comparison):
    text = str(comparison)
    for name in ("dlqr", "swing-up", "idle", "paper-lqr", "100 %"):
        assert name in text
    assert isinstance(comparison.scores["dlqr"]["balance"]["rms_q1"], Interval)


def test_the_table_shows_brackets_and_who_never_settled():
    policy = make_controller("dlqr", QUBE, reference=lambda t: 0.8 * np.sin(6.0 * t))
    policy.name = "my[best].zip"
    result = compare("qube", [policy], trials=4, duration=6.0, groups=("balance",))
    result = replace(result, skipped={"planned": "planning needs CasADi: pip install '.[plan]'"})
    text = str(result)
    assert "my[best].zip" in text
    assert "'.[plan]'" in text
    assert "0 of 4" in text
    assert "that held came to rest" in " ".join(text.split())


class TestBadInput:
    def test_unknown_group(self):
        with pytest.raises(ValueError, match="groups 'balanse': expected of balance, push"):
            compare("qube", ["dlqr"], trials=2, groups=("balanse",))

    @pytest.mark.parametrize("group", ["effects", "swing_up", "balance"])
    def test_unknown_effect(self, group):
        with pytest.raises(ValueError, match="`furuta effects` lists the library"):
            compare("qube", ["dlqr"], trials=2, groups=(group,), effects=["arm_sprig"])

    @pytest.mark.parametrize("group", ["effects", "swing_up"])
    def test_an_effect_that_the_plant_carries(self, group):
        springy = QUBE.with_effects(QUBE.default_effect("arm_spring"))
        with pytest.raises(ValueError, match="effects arm_spring: the plant carries it already"):
            compare(springy, ["lqr"], trials=2, groups=(group,), effects=["arm_spring"])

    def test_no_trial_for_this_plant(self):
        latest = QUBE.with_effects(Effect("input_delay", {"d": 0.1}))
        with pytest.raises(ValueError, match="groups delay have no trial for this plant"):
            compare(latest, [Idle()], trials=2, groups=("delay",))
        with pytest.raises(ValueError, match="cannot swing up"):
            compare(QUBE, [Idle()], trials=2, groups=("swing_up",))

    def test_nothing_left(self):
        with pytest.raises(ValueError, match=r"nothing to compare.*paper's gain"):
            compare("qube", ["paper-lqr"], trials=2)

    def test_twice_the_same(self):
        with pytest.raises(ValueError, match="given twice"):
            compare("qube", ["dlqr", "dlqr"], trials=2)

    def test_other_sample_time(self):
        with pytest.raises(ValueError, match=r"made for 0.01 s"):
            compare("qube", [make_controller("dlqr", QUBE, 0.01)], trials=2)

    @pytest.mark.parametrize("trials", [0, -3])
    def test_trials(self, trials):
        with pytest.raises(ValueError, match="at least 1"):
            compare("qube", ["dlqr"], trials=trials)
