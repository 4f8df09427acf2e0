"""What controllers are compared in: rigs, limits, pushes and seeds are what their names say."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controllers import make_controller
from controllers.comparison.conditions import (
    GROUPS,
    MAP_DELAYS,
    MAP_ERRORS,
    SWING_UP_EFFECTS,
    conditions,
    map_name,
    nominal,
)
from controllers.comparison.trials import Starts, balance_starts, built_plants, run_trials
from furuta_gym.plant import EFFECTS, QUBE, TABLE_3, Covariance, Effect, Plant
from furuta_gym.plant.parameters import pendulum_frequency
from furuta_gym.sensors import Sensors


@pytest.mark.parametrize("task", ["balance", "swing_up"])
def test_trials_start_within_the_arms_travel(task):
    narrow = QUBE.replace(limits={"arm_travel": 0.2})
    for plant, widest in ((QUBE, 0.5), (narrow, 0.05)):
        starts = nominal(plant, Sensors(), task, 400, 8.0).starts(0)
        assert 0.9 * widest < np.abs(starts.x0[0]).max() <= widest


def test_conditions_are_what_their_names_say():
    late = QUBE.with_effects(Effect("input_delay", {"d": 0.0135}))
    for plant, own in ((QUBE, 0.0), (late, 0.0135)):
        rows = conditions(plant, Sensors(), 20, 400, 20.0, groups=("delay", "quantisation", "parameters"))
        for row in (r for r in rows if r.group == "delay"):
            ms = float(row.name.split()[1])
            assert row.plants.effect("input_delay").parameters["d"] == pytest.approx(own + 1e-3 * ms)
        for row in (r for r in rows if r.group == "quantisation"):
            assert row.sensors.encoder_counts == (int(row.name.split()[0]),) * 2
        for row in (r for r in rows if r.group == "parameters"):
            share = float(re.search(r"±(\d+) %", row.name).group(1)) / 100
            spread = np.std([np.log(p.theta / plant.theta) for p in row.plants], axis=0)
            assert np.median(spread) == pytest.approx(share, rel=0.15)


def test_swing_ups_are_played_on_the_rigs_that_their_names_say():
    late = QUBE.with_effects(Effect("input_delay", {"d": 0.005}))
    rows = {r.name: r for r in conditions(late, Sensors(), 20, 7, 10.0, groups=("swing_up",))}
    assert {r.group for r in rows.values()} == {r.kind for r in rows.values()} == {"swing_up"}
    assert (rows["swing-up"].trials, rows["swing-up"].duration) == (20, 15.0)
    assert {r.trials for name, r in rows.items() if name != "swing-up"} == {7}
    for ms in (4, 8, 16, 24):
        delay = rows[f"swing-up, {ms} ms late"].plants.effect("input_delay")
        assert delay.parameters["d"] == pytest.approx(0.005 + 1e-3 * ms)
    assert rows["swing-up, supply 60 %"].plants.u_max == pytest.approx(6.0)
    weak = QUBE.replace(limits={"supply": 5.0})
    rows = {r.name: r for r in conditions(weak, Sensors(), 20, 7, 10.0, groups=("swing_up",))}
    assert rows["swing-up, supply 60 %"].plants.supply == pytest.approx(3.0)
    rows = {r.name: r for r in conditions(late, Sensors(), 20, 7, 10.0, groups=("swing_up",))}
    assert len(rows["swing-up, θ ±20 %"].plants) == 7
    assert rows["swing-up, noise 3 mrad"].sensors.noise_std == pytest.approx((0.003, 0.003))
    for name in SWING_UP_EFFECTS:
        assert rows[f"swing-up, {name}"].plants == late.with_effects(late.default_effect(name))


def test_effects_may_be_given_once():
    groups, names = ("effects", "swing_up"), ["arm_spring", "input_offset"]
    rows = conditions(QUBE, Sensors(), 4, 4, 5.0, groups, effects=iter(names))
    assert [row.name for row in rows if row.name in names] == names
    assert {f"swing-up, {name}" for name in names} <= {row.name for row in rows}


def test_swing_ups_with_rigs_that_could_be_built_coarse_encoders_and_a_push():
    rows = {row.name: row for row in conditions(QUBE, Sensors(), 20, 40, 15.0, groups=("swing_up", "map"))}
    for name in ("swing-up, built ±20 %", "swing-up, built ±20 %, 8 ms late"):
        rigs = rows[name].plants
        theta = np.array([rig.theta for rig in rigs])
        assert len(rigs) == 40
        assert (theta[:, 0] * theta[:, 3] > theta[:, 2] ** 2).all()
        assert 0.1 < np.abs(theta[:, 4] / QUBE.theta[4] - 1).max() < 1.2**3 - 1
        late = [rig.effect("input_delay") for rig in rigs]
        assert late == ([None] * 40 if "late" not in name else [Effect("input_delay", {"d": 0.008})] * 40)
    assert rows["swing-up, 512 counts"].sensors.encoder_counts == (512, 512)
    pushed = rows["swing-up, pushed"].starts(0)
    assert np.abs(pushed.push) == pytest.approx(0.5 * pendulum_frequency(QUBE.theta))
    assert set(np.sign(pushed.push)) == {-1.0, 1.0}
    assert ((pushed.push_time >= 5.0) & (pushed.push_time <= 7.5)).all()
    assert len([row for row in rows.values() if row.group == "map"]) == len(MAP_DELAYS) * len(MAP_ERRORS)
    corner = rows[map_name(24, 30)]
    assert len({rig.theta.tobytes() for rig in corner.plants}) == 40
    assert rows[map_name(0, 0)].plants == [QUBE] * 40


def test_a_push_is_swung_back_and_timed():
    """The designed swing-up comes back after it; one who is up before is not told the time of its swing-up."""
    rows = {row.name: row for row in conditions(QUBE, Sensors(), 3, 3, 15.0, groups=("swing_up",))}
    scores = replace(rows["swing-up, pushed"], tap=0.8).score(make_controller("swing-up", QUBE), 0.004, 0)
    assert scores["success"].value == 1.0
    assert 0.01 < scores["settling"].value < 2.0


def test_who_left_the_travel_is_told_from_who_fell():
    spin = lambda y: 10.0  # noqa: E731
    starts = balance_starts(QUBE, 4, 2.0, np.random.default_rng(0), push=0.0)
    fell = run_trials(QUBE, spin, starts, 2.0, 0.004)
    assert not fell.success.any()
    assert not fell.left_travel.any()
    hanging = Starts(np.array([[0.0], [np.pi], [0.0], [0.0]]), np.zeros(1), np.zeros(1))
    out = run_trials(QUBE, spin, hanging, 6.0, 0.004, swing_up=True)
    assert out.left_travel.all()
    assert out.failed_at[0] < 1.0


@pytest.mark.parametrize("kind", ["balance", "swing_up"])
@pytest.mark.parametrize(("limit", "kept", "left"), [("arm_travel", 6.0, 0.3), ("arm_speed", 200.0, 1.0)])
def test_a_rig_s_limits_of_the_arm_decide(kind, limit, kept, left):
    """Designed without them, a controller exceeds the narrow ones in every trial; each rig has its own."""
    policy = make_controller("swing-up" if kind == "swing_up" else "dlqr", QUBE)
    wide, narrow = (QUBE.replace(limits={limit: x}) for x in (kept, left))
    row = replace(nominal(QUBE, Sensors(), kind, 4, 5.0), plants=[wide, narrow, QUBE, narrow])
    starts = replace(row.starts(0), x0=row.starts(0).x0 + np.array([[0.4], [0.0], [0.0], [0.0]]))
    outcome = row.play(policy, starts, 0.004, 0)
    assert outcome.success.tolist() == [True, False, True, False]
    assert outcome.left_travel.tolist() == [False, limit == "arm_travel"] * 2
    assert replace(row, plants=narrow, arm_travel=6.0).play(policy, starts, 0.004, 0).success.all() == (
        limit == "arm_travel"
    )


def test_a_training_is_judged_within_its_own_limit_of_the_arm(monkeypatch):
    from controllers.training import record as training_record
    from controllers.training.setup import Training

    monkeypatch.setattr(training_record, "TRIALS", 5)
    policy = Path("controllers/policies/swing-up-qube.zip")
    narrow, wide = (
        training_record.evaluate(policy, Training(QUBE, "swing_up", arm_limit=limit))["success"]["value"]
        for limit in (0.3, None)
    )
    assert (narrow, wide) == (0.0, 1.0)


def test_a_covariance_too_wide_to_draw_from_costs_one_row_and_no_training(monkeypatch):
    from controllers.training import record as training_record
    from controllers.training.setup import Training

    vague = QUBE.replace(covariance=Covariance(("theta3",), np.array([[1e8]])))
    with pytest.warns(UserWarning, match="goes without its row 'θ as uncertain as identified': none of 1000 draws"):
        rows = conditions(vague, Sensors(), 4, 4, 5.0, ("balance", "parameters"))
    assert [row.name for row in rows] == ["balance", "θ ±10 %", "θ ±20 %"]
    monkeypatch.setattr(training_record, "TRIALS", 2)
    found = training_record.evaluate(Path("controllers/policies/swing-up-qube.zip"), Training(vague, "swing_up"))
    assert found["success"]["n"] == 2


def test_built_rigs_are_none_that_a_training_meets():
    from controllers.training.setup import Training

    batch = Training(QUBE, "swing_up", randomize={"theta": "physical:0.2"}, seed=0).judges(64)
    batch.reset(seed=0)
    met = {rig.theta.tobytes() for rig in batch.plants()}
    assert met.isdisjoint(rig.theta.tobytes() for rig in built_plants(0.2, QUBE, 64, 0))


def test_conditions_cover_the_library_and_the_covariance():
    known = TABLE_3.replace(covariance=Covariance(("theta1",), np.array([[1e-6]])))
    rows = conditions(known, Sensors(), 20, 5, 20.0, GROUPS)
    assert {row.group for row in rows} == set(GROUPS)
    assert {row.name for row in rows if row.group == "effects"} == set(EFFECTS)
    assert any("identified" in row.name for row in rows)
    assert len({row.name for row in rows}) == len(rows)


def test_a_trial_that_never_settles_has_no_settling_time():
    row = nominal(QUBE, Sensors(), "balance", 6, 6.0)
    swaying = make_controller("dlqr", QUBE, reference=lambda t: 0.8 * np.sin(6.0 * t))
    scores = row.score(swaying, swaying.sample_time, 0)
    assert scores["success"].value == 1.0
    assert scores["settling"].n == 0
    assert scores["worst_settling"].value == row.duration
    assert scores["rms_q2"].n == 6


def test_a_rig_that_is_very_late_has_no_row_for_what_cannot_be_later():
    late = QUBE.with_effects(Effect("input_delay", {"d": 0.08}))
    rows = conditions(late, Sensors(), 4, 4, 5.0, ("delay", "swing_up", "map"))
    for row in (r for r in rows if re.search(r"\d ms", r.name)):
        rig = row.plants if isinstance(row.plants, Plant) else row.plants[0]
        ms = float(re.search(r"(\d+) ms", row.name).group(1))
        assert rig.effect("input_delay").parameters["d"] == pytest.approx(0.08 + 1e-3 * ms)
    assert [row.name for row in rows if row.group == "delay"] == ["delay 4 ms", "delay 8 ms", "delay 16 ms"]
    latest = QUBE.with_effects(Effect("input_delay", {"d": 0.096}))
    assert [row.name for row in conditions(latest, Sensors(), 4, 4, 5.0, ("delay",))] == ["delay 4 ms"]
