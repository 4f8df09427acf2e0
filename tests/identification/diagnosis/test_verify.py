"""When held-out data take a name back."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Effect
from furuta_gym.plant.covariance import Covariance
from identification.diagnosis import verify
from identification.diagnosis.diagnose import diagnose
from identification.diagnosis.gap_change import speaks_against
from identification.diagnosis.held_out import HeldOut, _of_tails
from identification.diagnosis.naming.fits import FitRequest, fit
from identification.diagnosis.naming.forward import START_NOISE
from identification.diagnosis.naming.found import FoundEffect
from identification.diagnosis.outcome import Diagnosis
from identification.diagnosis.policy import DecisionPolicy
from identification.diagnosis.verify import (
    _of_no_size,
    _one_value,
    _sharpness_alone,
    _with_usual_sharpness,
    judged,
    measure_gap,
    verified,
)
from identification.estimation.estimate import GainChange, NoiseReport
from identification.kalman.noise import LostLog
from identification.kalman.record import Record
from identification.logs.log import Log
from identification.validation.gap import validate
from tests.factories import loop_log, made_log, open_loop_log, paper_log
from tests.identification.diagnosis.fits import a_change, a_diagnosis, a_gap, an_estimate, naming, rest, suspect

POLICY = DecisionPolicy()


@pytest.mark.parametrize(
    ("closed", "likelier", "against"),
    [
        ((0.3, 1.0), 0.0, False),
        ((-0.2, 1.0), 0.0, True),
        ((-0.2, 1.0), 7.0, True),
        ((-0.2, 1.0), 14.0, False),  # the gap is lost in noise, the likelihood is not
        ((math.nan, math.nan), 0.0, True),
        ((math.nan, math.nan), 14.0, False),
        ((-1.2, -0.3), 40.0, True),  # likelier by a step, farther off over a horizon
        ((0.3, 1.0), -40.0, False),
    ],
)
def test_a_name_that_closes_nothing_is_taken_back(closed: tuple[float, float], likelier: float, against: bool) -> None:
    gap = a_change(closed, likelier)
    assert speaks_against(gap, POLICY) is against
    found = judged(a_diagnosis("arm_spring"), gap)
    assert found.verdict == ("unknown" if against else "named")
    assert found.confirmed is not against


def test_where_no_effect_was_found_nothing_is_taken_back() -> None:
    near = a_gap(1.0)
    none = replace(a_change((0.0, 0.0), 0.0), before=near, after=near)
    assert not none.changed
    assert not speaks_against(none, POLICY)
    found = a_diagnosis(verdict="none")
    assert judged(found, none) is found


@pytest.mark.parametrize(
    ("before", "after", "together", "verdict", "told"),
    [
        ("none", 1.4, 9.0, "none", None),
        ("none", 2.6, 1.1, "none", "searched logs alone say too little about them"),
        (
            "none",
            2.6,
            2.2,
            "unknown",
            "2.2 times with the parameters fitted to all logs together: something is missing",
        ),
        ("none", 2.6, None, "none", "2.6 times the noise floor"),
        ("unknown", 2.6, 1.1, "unknown", "still 2.6 times the noise floor"),
        ("unknown", 1.4, 1.1, "unknown", None),
    ],
)
def test_where_nothing_was_named_and_predictions_are_far_off(
    before: str, after: float, together: float | None, verdict: str, told: str | None
) -> None:
    """A fit to all logs tells poor parameters from something that the searched logs do not show."""
    gap = a_gap(after)
    said = a_diagnosis(verdict=before)
    found = judged(said, replace(a_change(), before=gap, after=gap), lambda: together)
    assert found.verdict == verdict
    assert (found is said) is (told is None)
    assert (told or "") in found.summary
    assert found.leftover is (verdict == "unknown" and after > POLICY.far)


def test_all_logs_are_fitted_only_where_it_matters() -> None:
    """It takes seconds: not where predictions are near, nor where the verdict is "unknown" anyway."""
    asked: list[float] = []
    for verdict, ratio in (("none", 1.4), ("unknown", 2.6), ("none", 2.6)):
        gap = a_gap(ratio)
        judged(a_diagnosis(verdict=verdict), replace(a_change(), before=gap, after=gap), lambda: asked.append(1.0))
    assert asked == [1.0]


@pytest.mark.parametrize(
    ("name", "together", "off", "told"),
    [
        ("arm_spring", 1.1, 1.0, "say too little about them"),
        ("arm_spring", 1.8, 2.1, "1.8 times with the parameters fitted to all logs together: something is missing"),
        ("arm_spring", None, 2.1, "still 2.1 times the noise floor"),
    ],
)
def test_a_fit_to_all_logs_tells_uncertain_parameters_from_a_part_that_is_missing(
    name: str, together: float | None, off: float, told: str
) -> None:
    found = judged(a_diagnosis(name), a_change(after=2.1), lambda: together)
    assert found.verdict == "named"
    assert found.still_off == pytest.approx(off)
    assert found.leftover is (off > 1.0)
    assert found.uncertain is (told == "say too little about them")
    assert told in found.summary


@pytest.mark.parametrize(("after", "told"), [(1.05, False), (2.1, True)])
def test_what_names_leave_of_the_gap_is_told(after: float, told: bool) -> None:
    found = judged(a_diagnosis("arm_spring"), a_change(after=after))
    assert found.verdict == "named"
    assert found.leftover is told
    assert found.still_off == pytest.approx(after if told else 1.0)


USELESS: dict[str, Any] = {"closed": (-0.2, 1.0), "likelier": 0.0}


@pytest.mark.parametrize(
    ("gap", "verdict"),
    [
        (a_change(**USELESS, after=9.0), "named"),  # another log, in which a drift starts anew
        (a_change(**USELESS, tail=0.3), "unknown"),
        (a_change(own_tail=a_change(**USELESS, tail=0.3)), "unknown"),
        (a_change(**USELESS, own_tail=a_change(tail=0.3)), "named"),
    ],
)
def test_what_follows_a_logs_own_clock_is_judged_on_its_tail_only(gap: Any, verdict: str) -> None:
    """A drift starts anew in another log; what repeats must go on in the rest of its own."""
    found = judged(a_diagnosis("periodic_torque"), gap)
    assert found.verdict == verdict
    assert found.leftover is (verdict == "unknown")
    assert judged(a_diagnosis("arm_spring"), gap).verdict == ("unknown" if speaks_against(gap, POLICY) else "named")


@pytest.mark.parametrize(
    ("closed", "likelier", "told"), [(-0.5, -40.0, True), (-0.5, 40.0, False), (0.5, -40.0, False)]
)
def test_a_drift_with_which_other_logs_are_predicted_worse_says_so(closed: float, likelier: float, told: bool) -> None:
    gap = a_change((closed - 0.3, closed + 0.3), likelier, after=6.0)
    found = judged(a_diagnosis("arm_viscous_drift", "input_delay"), gap)
    assert found.verdict == "named"
    assert ("are predicted worse with what was found: 6.0 times the noise floor, 5.0 before" in found.summary) is told
    assert ("(arm_viscous_drift) follows the clock" in found.summary) is told


def test_what_a_tail_leaves_is_told_too() -> None:
    gap = a_change(own_tail=a_change(tail=0.3, after=2.1))
    # also where a fit to all logs would mend it: another log has another clock
    assert judged(a_diagnosis("periodic_torque"), gap, lambda: 1.1).still_off == pytest.approx(2.1)
    assert judged(a_diagnosis("arm_spring"), gap).still_off == 1.0


def test_another_policy_judges_otherwise() -> None:
    lenient = a_diagnosis("arm_spring", policy=replace(POLICY, likelier=5.0, far=3.0))
    assert judged(lenient, a_change((-0.2, 1.0), 7.0)).verdict == "named"
    assert judged(lenient, a_change(after=2.1)).still_off == 1.0


def test_the_likelihood_of_a_tail_is_the_tails() -> None:
    """What was fitted must not vouch for itself."""
    log = loop_log(duration=12.0)[0]
    tail = _of_tails(TABLE_3, [log], 0.3)
    cut = log.t[0] + 0.7 * log.duration
    assert tail.surprise[:, 1].min() >= cut
    assert tail.surprise[:, 1].max() > log.t[-1] - 0.1


def test_whether_an_angle_rests_is_asked_of_the_tail() -> None:
    """A rig that rests for the first seven seconds of ten, and moves in the last three."""
    t = np.arange(2500) * 0.004
    log = open_loop_log(np.where(t > 6.5, 0.5 * np.sin(2 * np.pi * t), 0.0), torque_noise=(1e-10, 1e-12))
    tail = _of_tails(TABLE_3, [log], 0.3)
    assert tail.resting.max() < 0.1
    assert tail.still.shape == tail.errors.shape


def test_a_small_torque_that_repeats_is_seen_to_go_on_in_the_last_three_tenths() -> None:
    """The refit to the first part of the log must not lose it again in the noise that it starts from."""
    log, truth = loop_log("periodic_torque", 0.2, duration=12.0)
    final: Any = fit(FitRequest(truth, START_NOISE, [Record.from_log(log)], anchor=TABLE_3))
    found = a_diagnosis("periodic_torque")
    after: Any = SimpleNamespace(plant=final.plant, zeros={})
    found = replace(found, after=after, naming=naming(suspect("periodic_torque", 200.0), final=final))
    gap = measure_gap(found, HeldOut((log,), (), POLICY))
    assert gap.tail == 0.3
    starts = gap.before.times - gap.before.horizon
    assert 0.7 * log.duration <= starts.min() - log.t[0] < 0.7 * log.duration + 0.1
    assert gap.likelier > 10.0
    assert not speaks_against(gap, POLICY)
    other, _ = loop_log("periodic_torque", 0.2, duration=12.0, seed=5)
    both = measure_gap(found, HeldOut((log,), (other,), POLICY))
    assert both.tail is None
    assert both.own_tail is not None
    assert both.own_tail.likelier == pytest.approx(gap.likelier)
    assert both.to_dict()["own_tail"]["tail"] == 0.3


def test_without_a_plant_there_is_nothing_to_verify() -> None:
    found = a_diagnosis(verdict="insufficient_excitation", before=None, after=None)
    log = loop_log(duration=2.0)[0]
    assert verified(found, HeldOut((log,), (), POLICY)) is found
    with pytest.raises(ValueError, match="no plant"):
        measure_gap(found, HeldOut((log,), (), POLICY))


def test_where_no_gap_can_be_had_the_verdict_stays_and_says_why() -> None:
    log = loop_log(duration=0.6)[0]
    found = verified(a_diagnosis("arm_spring"), HeldOut((loop_log(duration=2.0)[0],), (log,), POLICY))
    assert (found.verdict, found.gap) == ("named", None)
    assert found.gap_remark


def test_another_sharpness_that_shows_in_no_prediction_is_no_name() -> None:
    """Friction of r = 40: found with certainty, without a gap. r is fitted then like the other parameters."""
    rig = TABLE_3.replace(friction_sharpness=40.0)
    fitted, held_out = (paper_log(plant=rig, seed=seed, T=0.004)[0] for seed in (0, 1))
    found = diagnose(fitted, held_out, only=["friction_sharpness", "arm_stribeck"])
    assert found.naming is not None
    assert found.naming.rankings[0][0].name == "friction_sharpness"
    assert found.naming.rankings[0][0].net > POLICY.believed
    assert (found.verdict, found.named, found.added) == ("none", (), False)
    assert "another sharpness" in found.summary
    assert found.plant is not None
    assert found.plant.sharpness[0] == pytest.approx(40.0, rel=0.2)
    assert found.plant.provenance["start"] == "the search for missing effects"
    assert found.plant.provenance["u_max"] == "guessed from the logs' largest command"
    assert found.to_dict()["effects"] == []
    assert found.rest is not None
    named = replace(found, naming=replace(found.naming, found=(FoundEffect(found.naming.rankings[0]),)))
    assert _sharpness_alone(named)
    assert not _sharpness_alone(replace(named, still_off=2.0))  # something is left: the name stays


def decays(r: float) -> list[Log]:
    """Two logs of chirps, after which a rig whose friction has the sharpness r decays freely."""
    t = np.arange(2000) * 0.004
    chirps = [0.2 * np.sin(2 * np.pi * (f + 0.2 * t) * t) * (t < 4.0) for f in (0.3, 0.5)]
    rig = TABLE_3.replace(friction_sharpness=r)
    return [open_loop_log(u, seed=seed, plant=rig, torque_noise=(1e-9, 1e-11)) for seed, u in enumerate(chirps)]


def test_a_sharpness_near_the_papers_is_a_parameter_though_it_shows() -> None:
    """Friction of r = 40 in free decays: with r = 100 the error is twice the noise floor."""
    logs = decays(40.0)
    found = diagnose(logs[0], logs[1], only=["friction_sharpness", "arm_stribeck"])
    assert validate(TABLE_3, logs[1]).ratio_to_floor > 1.5
    assert (found.verdict, found.named, found.added) == ("none", (), False)
    assert "r = 40" in found.summary
    assert found.plant is not None
    assert found.plant.sharpness[0] == pytest.approx(40.0, rel=0.1)


def test_friction_that_is_another_only_near_rest_is_a_sharpness() -> None:
    """Friction of r = 250 in free decays, which Stribeck friction below 0.03 rad/s describes with r = 100."""
    logs = decays(250.0)
    found = diagnose(logs[0], logs[1], only=["arm_stribeck", "pendulum_stribeck"])
    assert found.naming is not None
    first = found.naming.rankings[0][0]
    assert (first.name, first.net > POLICY.believed) == ("arm_stribeck", True)
    assert (found.verdict, found.named, found.added) == ("none", (), False)
    assert "another sharpness" in found.summary
    assert found.plant is not None
    assert found.plant.sharpness[0] == pytest.approx(250.0, rel=0.1)
    assert found.after is not None
    assert found.gap is not None

    def named(vs: float, policy: DecisionPolicy = POLICY) -> Diagnosis:
        plant = TABLE_3.with_effects(Effect("arm_stribeck", {"ΔF": 0.1, "vs": vs}))
        assert found.naming is not None
        assert found.after is not None
        naming = replace(found.naming, found=(FoundEffect(found.naming.rankings[0]),))
        return replace(found, naming=naming, after=replace(found.after, plant=plant), policy=policy)

    assert _sharpness_alone(named(0.02))
    assert not _sharpness_alone(named(0.3))
    held = HeldOut((logs[0],), (logs[1],), POLICY)
    usual = _with_usual_sharpness(named(0.02), held, found.gap)
    assert usual is not None
    assert (usual.verdict, "Friction sets in at r = 2" in usual.summary) == ("none", True)
    strict = replace(POLICY, usual_sharpness=2.0)  # 250 is then far from the paper's 100
    assert _with_usual_sharpness(named(0.02, strict), held, found.gap) is None


@pytest.mark.parametrize(("std", "one"), [(1.0, False), (20.0, True)])
def test_two_sharpnesses_may_be_one_where_their_intervals_overlap(std: float, one: bool) -> None:
    assert _one_value(Effect("friction_sharpness", {"r1": 60.0, "r2": 40.0}, {"r1": std, "r2": std})) is one


def test_a_name_whose_size_may_be_zero_is_none_where_model_5_is_adequate() -> None:
    held = HeldOut((loop_log(duration=6.0)[0],), (loop_log(duration=6.0, seed=1)[0],), POLICY)
    assert not _of_no_size(_a_drift_known_within(1e-6))
    assert _of_no_size(_a_drift_known_within(1.0, "input_gain_drift"))  # its other size is not in play
    assert _of_no_size(_a_drift_known_within(1.0, "arm_spring"))  # k ≥ 0: its interval begins at zero
    assert not _of_no_size(_a_drift_known_within(1e-6, "arm_spring"))
    told = verified(_a_drift_known_within(1.0), held)
    assert (told.verdict, told.named, told.added) == ("none", (), False)
    assert "may as well be zero" in told.summary
    assert told.gap is not None
    assert told.gap.before.ratio_to_floor < 1.1
    # what is left is that of the plant that is given, not of the one with the drift
    assert told.rest is not None
    assert "Nothing is left" in told.rest.sentence
    assert told.left_over == pytest.approx(math.sqrt(3e-7 / 0.1))
    assert not told.leftover


@pytest.mark.parametrize("where", ["with it", "without it"])
def test_a_name_is_not_needless_where_structure_is_left(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing named, and something left that matters, would be "unknown"."""
    monkeypatch.setattr(verify, "locate", lambda *_: rest(40.0))
    gap = replace(a_change(), before=a_gap(1.0))
    monkeypatch.setattr(verify, "measure_gap", lambda *_: gap)
    found = _a_drift_known_within(1.0)
    if where == "with it":
        found = replace(found, rest=rest(40.0))
        monkeypatch.setattr(verify, "locate", lambda *_: pytest.fail("a plant that is not asked for"))
    told = verified(found, HeldOut((loop_log(duration=2.0)[0],), (loop_log(duration=2.0, seed=1)[0],), POLICY))
    assert told.verdict == "named"
    assert told.rest is found.rest


def _a_drift_known_within(std: float, name: str = "arm_friction_drift") -> Diagnosis:
    drift = TABLE_3.default_effect(name)
    size = drift.type.parameters[0].name
    known = TABLE_3.with_effects(Effect(drift.name, drift.parameters, {size: std}))
    after = known.replace(covariance=Covariance((f"{drift.name}.{size}",), np.array([[std**2]])))
    before = an_estimate(TABLE_3)
    before.noise = NoiseReport((3e-7, 1e-9), ())
    return a_diagnosis(drift.name, before=before, after=an_estimate(after))


def test_a_name_that_is_taken_back_takes_no_warning_with_it() -> None:
    """The drift explained the change of the gain; the plant that is left has none."""
    change = GainChange("warm.csv", 0.9, None, 12.0)
    before, after = an_estimate(TABLE_3), an_estimate(TABLE_3)
    before.gain_changes = (change,)
    named = a_diagnosis("input_gain_drift", before=before, after=after)
    assert named.gain_changes == ()
    assert replace(named, confirmed=False).gain_changes == (change,)


@pytest.mark.parametrize(
    ("name", "before", "together", "verdict"),
    [
        ("arm_spring", True, None, "unknown"),
        ("arm_spring", True, 2.0, "unknown"),
        ("arm_spring", True, 1.2, "named"),  # one plant with it explains all logs
        ("arm_spring", False, None, "named"),  # model (5) loses them as well
        ("arm_friction_drift", True, None, "named"),  # of what follows another clock they say nothing
    ],
)
def test_a_plant_that_loses_the_held_out_logs(
    monkeypatch: pytest.MonkeyPatch, name: str, before: bool, together: float | None, verdict: str
) -> None:
    def lost(*_: Any) -> Any:
        raise LostLog("the filter loses the log")

    monkeypatch.setattr(verify, "measure_gap", lost)
    monkeypatch.setattr(HeldOut, "follows", lambda *_: before)
    monkeypatch.setattr(HeldOut, "together", lambda *_: together)
    found = verified(a_diagnosis(name), HeldOut((), (made_log(),), POLICY))
    assert found.verdict == verdict
    assert found.gap_remark == "the filter loses the log"
