"""From logs to a verified verdict: what is held out decides."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.bench import HiddenEffect, Rig, record
from furuta_gym.plant import EFFECTS, TABLE_3
from identification.diagnosis import searched as module
from identification.diagnosis.diagnose import diagnose
from identification.diagnosis.held_out import HeldOut
from identification.diagnosis.naming.fits import FitRequest
from identification.diagnosis.outcome import Diagnosis
from identification.diagnosis.policy import DecisionPolicy
from identification.diagnosis.searched import searched
from identification.estimation.identify import identify
from identification.logs.log import Log
from identification.logs.reading import read_log
from identification.validation.gap import validate
from tests.factories import changing_gain_log, loop_log, scaled_effect

POLICY = replace(DecisionPolicy(), tail=0.4)
LIMITS = {"arm_travel": 1.2, "arm_speed": 9.0}


# not at the import, with which every worker begins: where nothing is compiled yet, all of them would compile
def spring() -> Log:
    return loop_log("arm_spring", duration=6.0)[0]


def plain() -> Log:
    return loop_log(duration=4.0, seed=1)[0]


def diagnosed(*held_out: object) -> Diagnosis:
    """From a start that has a cable of another stiffness, which is not to be believed, and limits of the rig."""
    start = TABLE_3.replace(limits=LIMITS).with_effects(scaled_effect("arm_spring", 5.0))
    return diagnose([spring()], held_out, start, most=1, only=["arm_spring"], policy=POLICY)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def alone() -> Diagnosis:
    return diagnosed()


def test_a_cable_is_named_and_its_tail_agrees(alone: Diagnosis) -> None:
    assert alone.verdict == "named", str(alone)
    assert alone.gap is not None
    assert alone.gap.tail == 0.4
    assert alone.gap.closed.value > 0.9
    assert alone.runtime_s > 0.0
    assert alone.plant is not None
    assert alone.plant.provenance["start"] == "the search for missing effects"
    assert alone.before is not None
    assert alone.plant.provenance["u_max"] == alone.before.plant.provenance["u_max"]


def test_a_start_with_effects_is_compared_without_them(alone: Diagnosis) -> None:
    """What was found before is for the search to find again, and for held-out data to judge."""
    assert alone.before is not None
    assert alone.before.plant.effects == ()
    assert alone.added
    assert alone.plant is not None
    found, true = alone.plant.effect("arm_spring"), TABLE_3.default_effect("arm_spring")
    assert found is not None
    assert found.parameters["k"] == pytest.approx(true.parameters["k"], rel=0.1)


def test_the_limits_of_the_rig_stay_in_its_plant(alone: Diagnosis) -> None:
    """A controller made from the plant that was found must keep to them."""
    assert alone.before is not None
    assert alone.after is not None
    assert alone.plant is not None
    for plant in (alone.before.plant, alone.after.plant, alone.plant):
        assert plant.limits == LIMITS


def test_a_held_out_log_of_a_rig_without_the_cable_takes_the_name_back(alone: Diagnosis) -> None:
    """The last part of the log itself would have confirmed it."""
    found = diagnosed(plain())
    assert alone.verdict == "named"
    assert found.verdict == "unknown", str(found)
    assert [s.name for s in found.found] == ["arm_spring"]
    assert found.plant is not None
    assert found.plant.effects == ()
    assert found.plant.limits == LIMITS
    assert found.gap is not None
    assert found.gap.tail is None
    assert found.gap.logs == (plain(),)


def test_a_held_out_log_that_counts_from_another_zero_takes_no_name_back() -> None:
    """As a person sets the arm and the pendulum anew before each run: with one zero for both a right name is vetoed."""
    other = loop_log("arm_spring", duration=6.0, seed=3)[0].moved(-0.6, -2.0 * math.pi / 4096)
    found = diagnosed(other)
    assert found.verdict == "named", str(found)
    assert found.gap is not None
    assert found.gap.tail is None
    assert found.gap.closed.value > 0.9
    assert found.gap.after.zeros[0][0] == pytest.approx(0.6, abs=0.05)
    with_one_zero = validate(found.plant, other, own_zeros=False)
    assert np.any(with_one_zero.rms > found.gap.before.rms), "as if the cable were none"


def test_the_thresholds_used_are_told(alone: Diagnosis) -> None:
    assert alone.policy is POLICY
    assert alone.to_dict()["policy"]["tail"] == 0.4


@pytest.mark.parametrize(
    ("held_out", "message"),
    [
        (spring, "loop arm_spring is searched and held out at once"),
        (
            lambda: replace(plain(), sha256="of the file", source="again.csv"),
            "again.csv is searched and held out at once",
        ),
        (lambda: replace(plain(), input_unit="N·m"), "must agree"),
        (lambda: [plain(), plain()], "loop as modelled is given twice; expected each log once"),
    ],
)
def test_what_cannot_be_held_out_is_refused_before_the_search(held_out: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        diagnose([spring(), replace(spring(), sha256="of the file")], held_out())


def test_the_rest_of_a_log_may_be_held_out() -> None:
    first, rest = replace(spring(), sha256="of the file").split(0.7)
    with pytest.raises(ValueError, match="must agree"):  # what is asked next
        diagnose([first], replace(rest, input_unit="N·m"))


def test_bad_arguments_are_refused_before_the_search() -> None:
    with pytest.raises(ValueError, match="at least one log"):
        diagnose([])
    with pytest.raises(ValueError, match="most must be at least 1"):
        diagnose([spring()], most=0)
    with pytest.raises(ValueError, match="arm_sprung: no such effect; did you mean arm_spring") as raised:
        diagnose([spring()], only=["arm_sprung"])
    assert str(raised.value).endswith("? `furuta effects` lists the library"), "not the whole library"


def test_a_pendulum_set_to_zero_a_count_off_is_nothing_unknown():
    """The search lets the zero of a log move by a count or two; what is left is looked for with that zero."""
    log, _ = loop_log(duration=6.0)
    off = replace(log, q2=log.q2 + 1.6 * 2.0 * math.pi / 4096)
    found = diagnose(off, start=TABLE_3, only=["arm_spring"])
    assert found.verdict == "none", found.summary
    assert "zero in the first log is off by 1." in found.summary
    assert found.plant.theta == pytest.approx(diagnose(log, start=TABLE_3, only=["arm_spring"]).plant.theta, rel=0.05)


class _Asked(Exception):
    """A fit was asked for with this anchor."""


@pytest.mark.parametrize(("torque", "dragged"), [(1e-9, False), (1e-3, True)])
def test_no_prior_holds_the_search_where_what_is_missing_has_dragged_the_pendulum(
    monkeypatch: pytest.MonkeyPatch, torque: float, dragged: bool
) -> None:
    """Several effects at once take the pendulum out of model (5): its row can end at a hundredth of its scale."""
    known = module.identify([plain()])
    collapsed = known.plant.replace(theta=TABLE_3.theta * np.array([1, *4 * [0.01], 1, 0.01, 1, 0.01]), covariance=None)
    assert known.noise is not None
    told = replace(known, plant=collapsed, noise=replace(known.noise, torque=(torque, 1e-9)))
    monkeypatch.setattr(module, "identify", lambda *_: told)

    def fitter(request: FitRequest) -> Any:
        anchor = request.anchor
        assert anchor is not None
        raise _Asked(*(anchor.theta[2:5] / TABLE_3.theta[2:5]))

    with pytest.raises(_Asked) as found:
        searched(HeldOut((plain(),), (), POLICY), None, 1, None, lambda text: None, fitter)
    scale = np.array(found.value.args)
    assert np.all((scale > 0.2) & (scale < 5.0)) if dragged else scale == pytest.approx(0.01)


def test_of_long_logs_a_part_is_searched_and_said() -> None:
    log, _ = loop_log("arm_spring", duration=60.0, T=0.01)
    policy = replace(DecisionPolicy(), samples=len(log) * 3 // 4)
    found = diagnose(log, start=TABLE_3, most=1, only=["arm_spring"], policy=policy)
    assert found.verdict == "named", str(found)
    (spans,) = found.stretches  # of two of its three stretches of 20 s
    assert sum(b - a for a, b in spans) == pytest.approx(40.0, abs=0.1)
    assert found.gap is not None
    assert sum(map(len, found.gap.logs)) == 4000
    assert "searched on" in str(found)
    assert found.to_dict()["stretches_s"] == [[list(span) for span in spans]]


def test_the_plant_of_a_name_is_at_the_optimum_of_its_parameters(tmp_path: Path) -> None:
    """The search holds θ near that of model (5), which the cable had dragged to a sixteenth of the pendulum's: it ended
    79 nats above this optimum, with a third of the stiffness."""
    rig = Rig("table3", [HiddenEffect("arm_spring", strength=1.0)], torque_noise=(2e-6, 1e-8))
    record(rig, "paper", seed=1, sample_time=0.008).write(tmp_path / "log.csv")
    log = read_log(tmp_path / "log.csv").slice(stop=10.0)
    found = diagnose(log, only=["arm_spring"])
    best = identify(log, effects=["arm_spring"])
    assert found.after is not None
    assert found.after.log_likelihood > best.log_likelihood - 1.0
    true = rig.truth()["effects"][0]["parameters"]["k"]["value"]
    assert found.after.value("arm_spring.k") == pytest.approx(true, rel=0.1)


def test_a_motor_that_weakens_is_named_among_what_else_drifts() -> None:
    log = changing_gain_log(lambda t: 1.0 - 0.02 * t)
    found = diagnose(log, only=[name for name in EFFECTS if name.endswith("_drift")])
    assert [suspect.name for suspect in found.named] == ["input_gain_drift"]
    assert not found.leftover
    assert found.after is not None
    assert found.after.value("input_gain_drift.a") == pytest.approx(-0.02, rel=0.02)
    assert "the command does about" not in str(found)  # the effect says it
