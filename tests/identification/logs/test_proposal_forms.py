"""`propose` on forms of a log that hide the motion: wrapped angles, counts, and commands in amperes."""

from __future__ import annotations

import numpy as np
import pytest

from identification.logs import checks
from identification.logs.proposal import Confidence, propose
from identification.logs.rig_mapping import RigMapping
from identification.logs.signs import longest_piece
from identification.logs.table import Table
from identification.logs.turns import continuous
from identification.logs.vocabulary import fits, is_current

from .test_proposal import LOGS, hanging, read, same_motion, table

_PER_RADIAN = {"rad": 1.0, "deg": 180 / np.pi, "counts": 2048 / (2 * np.pi)}
_TURN = {"rad": 2 * np.pi, "deg": 360.0, "counts": 2048.0}
_COUNTS = RigMapping(encoder_counts=(2048.0, 2048.0))


@pytest.mark.filterwarnings("ignore:.*Taken as a wrapped encoder")
@pytest.mark.parametrize("low", [0.0, -0.5], ids=["from 0", "around 0"])
@pytest.mark.parametrize("unit", _TURN)
@pytest.mark.parametrize("zero", ["upright", "hanging"])
@pytest.mark.parametrize("kind", LOGS)
def test_zero_and_signs_are_found_in_a_wrapped_pendulum(kind: str, zero: str, unit: str, low: float) -> None:
    log = LOGS[kind]()
    whole = np.round if unit == "counts" else np.asarray
    turn, arm = _TURN[unit], whole(_PER_RADIAN[unit] * log.q1)
    angle = whole(_PER_RADIAN[unit] * (log.q2 + (np.pi if zero == "hanging" else 0.0)))
    wrapped = (angle - low * turn) % turn + low * turn
    given = _COUNTS if unit == "counts" else RigMapping()
    source = table(log, q1=arm, q2=wrapped, flip=("u",))
    proposal = propose(source, given)
    assert not proposal.problems
    assert [item.name for item in proposal.below(Confidence.sure)] == ["input_unit"]
    straight = table(log, q1=arm, q2=angle, flip=("u",))
    assert same_motion(read(proposal, source), read(propose(straight, given), straight))


def test_only_a_turn_is_taken_off() -> None:
    t = np.linspace(0, 1, 400)
    swing = 150 * np.sin(7 * t)
    for turn in (2 * np.pi, 360.0, 2048.0):
        angle = swing * turn / 150
        unwrapped = continuous((angle + turn / 2) % turn - turn / 2, (2048.0,))
        assert np.allclose(unwrapped - unwrapped[0], angle - angle[0])
    square = 3.1 * np.sign(np.sin(40 * t))
    noise = np.random.default_rng(1).uniform(-np.pi, np.pi, 400)
    for untouched in (swing, square[square > 0], 5 * np.sign(np.sin(40 * t)), noise):
        assert continuous(untouched, (2048.0,)) is untouched


def test_a_balanced_pendulum_in_counts_from_hanging_is_not_taken_for_swapped_columns() -> None:
    log = LOGS["upright"]()
    arm, pendulum = (np.round(_PER_RADIAN["counts"] * q) for q in (log.q1, log.q2 + np.pi))
    assert not propose(table(log, q1=arm, q2=pendulum), _COUNTS).problems


def test_swapped_columns_in_counts_are_a_problem() -> None:
    log = hanging()
    arm, pendulum = (np.round(_PER_RADIAN["counts"] * q) for q in (log.q1, log.q2))
    (problem,) = propose(table(log, q1=pendulum, q2=arm), _COUNTS).fatal
    assert "--columns q1=q2,q2=q1" in problem.mend


def test_what_waits_for_the_counts_says_so() -> None:
    log = hanging()
    whole = {q: np.round(_PER_RADIAN["counts"] * getattr(log, q)) for q in ("q1", "q2")}
    unseen = {i.name for i in propose(table(log, **whole)).items if i.waits}
    assert unseen == {"pendulum_zero", "sign_q2", "sign_u"}
    assert not [i for i in propose(table(log, **whole), _COUNTS).items if i.waits]


@pytest.mark.parametrize("name", ["i_cmd_A", "current_cmd", "Strom_soll", "iq_ref", "motorCurrentCommand", "i_set [A]"])
def test_a_commanded_current_is_found_and_asks_for_the_motors_constant(name: str) -> None:
    source = table(hanging(), ("t", "q1", "q2", name))
    proposal = propose(source)
    assert proposal.item("u").value == name
    (problem,) = proposal.fatal
    assert "--input-unit N·m --input-scale K" in problem.mend
    for scale in (0.05, 1.0):
        answered = propose(source, RigMapping(u=name, input_unit="N·m", input_scale=scale))
        assert not answered.problems
        assert answered.mapping.input_scale == scale


def test_a_measured_current_is_no_command() -> None:
    assert fits("current", "u") == fits("i_meas", "u") == fits("motor_current", "u") == 0
    assert fits("current_cmd", "u") < fits("voltage_cmd", "u")
    assert not any(map(is_current, ("current_voltage", "current_u", "set_current_angle", "i_theta_ref")))


def test_a_clock_of_numbers_comes_before_dates() -> None:
    log = hanging()
    dates = np.datetime64("2025-01-01") + (1e9 * log.t).astype("timedelta64[ns]")
    source = table(log)
    proposal = propose(Table(source.name, source.columns | {"time": dates}))
    assert (proposal.item("t").value, proposal.item("t").confidence) == ("t", Confidence.sure)


def test_stamps_in_bursts_take_no_longer_than_others() -> None:
    t = np.repeat(0.016 * np.arange(2500), 4) + np.tile(5e-5 * np.arange(4), 2500)
    longest, window = longest_piece(t)
    assert len(longest) <= 4
    assert window == 0


def test_a_coarse_encoder_that_turns_evenly_is_not_held() -> None:
    log = hanging()
    even = np.floor(np.arange(len(log)) / 2 + 0.25) * 2 * np.pi / 1000
    assert not any("row only" in problem.text for problem in propose(table(log, q1=even)).problems)


@pytest.mark.parametrize("name", ["sample", "index", "k", "n", "cycle", ""])
def test_a_column_that_counts_is_no_clock_in_milliseconds(name: str) -> None:
    log = hanging()
    source = table(log, (name or "column 1", "q1", "q2", "u"), time=0.004)
    proposal = propose(source)
    time = proposal.item("time_unit")
    assert (time.value, time.confidence) == (None, Confidence.open)
    assert proposal.item("pendulum_zero").waits
    kept = np.arange(len(log)) != 700
    lossy = Table(source.name, {column: values[kept] for column, values in source.columns.items()})
    assert propose(lossy).item("time_unit").value is None
    assert not propose(lossy, RigMapping(time_unit="0.004"), assumed=True).fatal
    answered = propose(source, RigMapping(time_unit="0.004"))
    assert [item.name for item in answered.below(Confidence.sure)] == ["input_unit"]
    assert same_motion(read(answered, source), log)


def test_a_clock_that_counts_milliseconds_is_asked_about() -> None:
    log = LOGS["upright"]()
    source = table(log, ("time", "q1", "q2", "u"), time=0.004)
    time = propose(source).item("time_unit")
    assert (time.value, time.confidence) == ("ms", Confidence.likely)
    assert propose(table(log, ("time_ms", "q1", "q2", "u"), time=0.004)).item("time_unit").confidence is Confidence.sure


@pytest.mark.parametrize("lost", [0.01, 0.05])
@pytest.mark.parametrize("zero", ["upright", "hanging"])
@pytest.mark.parametrize("kind", LOGS)
def test_lost_samples_hide_neither_zero_nor_signs(kind: str, zero: str, lost: float) -> None:
    source = table(LOGS[kind](), zero=zero, flip=("q2",), names=("t", "q1", "q2", "motor voltage"))
    kept = np.random.default_rng(5).random(len(source.columns["t"])) > lost
    proposal = propose(Table(source.name, {name: values[kept] for name, values in source.columns.items()}))
    assert not proposal.below(Confidence.sure)
    assert not proposal.fatal
    assert (proposal.mapping.pendulum_zero, proposal.mapping.flip) == (
        propose(source).mapping.pendulum_zero,
        propose(source).mapping.flip,
    )


def test_a_log_without_a_long_stretch_is_refused() -> None:
    source = table(hanging())
    kept = np.arange(len(source.columns["t"])) % 40 < 38
    holey = Table(source.name, {name: values[kept] for name, values in source.columns.items()})
    (problem,) = propose(holey).fatal
    assert "longest stretch without a gap lasts 0.148 s" in problem.text


def test_columns_that_are_said_stay_said() -> None:
    log = hanging()
    proposal = propose(table(log, q1=log.q2, q2=log.q1), RigMapping(t="t", q1="q1", q2="q2", u="u", input_unit="V"))
    assert "swapped" in proposal.fatal[0].text
    assert {proposal.item(ours).confidence for ours in ("q1", "q2", "u")} == {Confidence.sure}


def test_readings_that_are_held_are_noted() -> None:
    log = hanging()
    fast = table(log, **{q: np.repeat(getattr(log, q)[::4], 4)[: len(log)] for q in ("q1", "q2")})
    assert "q1 changes in every 4th row only, and q2 changes in every 4th row only" in propose(fast).problems[0].text
    pendulum = table(log, q2=np.repeat(log.q2[::2], 2)[: len(log)])
    assert "q2 changes in every 2nd row only" in propose(pendulum).problems[0].text


@pytest.mark.parametrize("factor", [1.0, 1e-3, 1e-6, 1e-9], ids=["s", "ms", "us", "ns"])
def test_stamps_since_1970_are_a_clock(factor: float) -> None:
    log = hanging()
    source = table(log, t=np.round((1_714_771_200.0 + log.t) / factor))
    if factor == 1.0:
        source = table(log, t=1_714_771_200.0 + log.t)
    proposal = propose(source)
    assert not proposal.problems
    assert np.allclose(read(proposal, source).t, log.t, atol=1e-6)


@pytest.mark.parametrize("name", ["duty", "pwm_cmd"])
def test_a_duty_asks_for_the_volts(name: str) -> None:
    (problem,) = propose(table(hanging(), ("t", "q1", "q2", name))).fatal
    assert "--input-unit V --input-scale K" in problem.mend


def test_an_arm_that_spins_is_in_radians_where_its_encoder_says_so() -> None:
    """At 62 rad/s only the declared counts tell radians from degrees."""
    log = hanging()
    count = 2 * np.pi / 2048
    spun = np.round((62.0 * log.t + 0.5 * log.t * np.sin(log.t)) / count) * count
    for unit, column in (("rad", spun), ("deg", np.rad2deg(spun))):
        source = table(log, q1=column)
        assert (propose(source, _COUNTS).item("unit_q1").value == "rad") == (unit == "rad")
        fatal = [p.text for p in propose(source, _COUNTS, assumed=True).fatal]
        assert any("is in deg" in text for text in fatal) == (unit == "deg")
    assert not checks.check_angle_unit("log", "q1", log.t, spun, "rad", 2048)
