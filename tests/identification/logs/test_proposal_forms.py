"""`propose` on forms of a log that hide the motion: wrapped angles, counts, and commands in amperes."""

from __future__ import annotations

import numpy as np
import pytest

from identification.logs.proposal import AFTER_COUNTS, Confidence, propose
from identification.logs.rig_mapping import RigMapping
from identification.logs.vocabulary import fits
from identification.logs.wrapping import continuous

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
    unseen = {i.name for i in propose(table(log, **whole)).items if i.reason == AFTER_COUNTS}
    assert unseen == {"pendulum_zero", "sign_q2", "sign_u"}
    assert not [i for i in propose(table(log, **whole), _COUNTS).items if i.reason == AFTER_COUNTS]


@pytest.mark.parametrize("name", ["i_cmd_A", "current_cmd", "Strom_soll", "iq_ref", "motorCurrentCommand", "i_set [A]"])
def test_a_commanded_current_is_found_and_asks_for_the_motors_constant(name: str) -> None:
    source = table(hanging(), ("t", "q1", "q2", name))
    proposal = propose(source)
    assert proposal.item("u").value == name
    (problem,) = proposal.fatal
    assert "--input-unit N·m --input-scale K" in problem.mend
    assert not propose(source, RigMapping(u=name, input_unit="N·m", input_scale=0.05)).problems


def test_a_measured_current_is_no_command() -> None:
    assert fits("current", "u") == fits("i_meas", "u") == fits("motor_current", "u") == 0
    assert fits("current_cmd", "u") < fits("voltage_cmd", "u")
