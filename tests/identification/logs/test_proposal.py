"""What `propose` says of tables as strangers write them: the reading is found again, and what is wrong is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import QUBE, TABLE_3
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate
from identification import LogError
from identification.design.signals import Chirp
from identification.logs.log import Log
from identification.logs.mapping import map_table
from identification.logs.proposal import Confidence, Proposal, propose
from identification.logs.rig_mapping import RigMapping
from identification.logs.table import Table
from tests.factories import paper_log

NAMES = {
    "english": ("Time (s)", "Arm angle", "Pendulum angle", "Motor voltage"),
    "german": ("Zeit", "Arm", "Pendel", "Spannung"),
    "french": ("temps", "bras", "pendule", "tension"),
    "greek": ("t", "θ", "α", "Vm"),
    "short": ("t", "q1", "q2", "u"),
    "camel": ("timestamp", "armAngle", "pendulumAngle", "motorVoltage"),
}


def hanging() -> Log:
    """A QUBE that hangs and is driven through large angles."""
    run = simulate(
        QUBE, open_loop(), 8.0, 0.004, Sensors(2048), excitation=Chirp(2.0, 0.5, 3.0, 8.0), x0=(0, np.pi, 0, 0)
    )
    return Log.from_run(run, QUBE.unit, 2048)


LOGS = {"upright": lambda: paper_log(0.004, 8.0, 4096, TABLE_3)[0], "hanging": hanging}


def table(
    log: Log, names=NAMES["short"], angle="rad", time=1.0, zero="upright", flip=(), label=False, **changes
) -> Table:
    """A log as another laboratory would have written it, whose `read_log` mapping is known."""
    sign = {q: -1.0 if q in flip else 1.0 for q in ("q1", "q2", "u")}
    size = {"rad": 1.0, "deg": 180 / np.pi}[angle]
    q2 = sign["q2"] * log.q2 + (np.pi if zero == "hanging" else 0.0)
    signals = (log.t / time, size * sign["q1"] * log.q1, size * q2, sign["u"] * log.u)
    stated = ("", f" [{angle}]", f" [{angle}]", " [V]") if label else ("",) * 4
    columns = {f"{n}{s}": np.asarray(v) for n, s, v in zip(names, stated, signals, strict=True)}
    return Table("log.csv", columns | changes)


def read(proposal: Proposal, source: Table) -> Log:
    mapped = map_table(source, proposal.mapping)
    return Log(**mapped.signals, **mapped.facts)


def same_motion(found: Log, log: Log) -> bool:
    """Equal, or all three signs turned, which is the same rig seen from below."""
    mirror = [np.allclose(s * found.q1, log.q1) and np.allclose(s * found.u, log.u) for s in (1, -1)]
    turns = [
        np.allclose((s * found.q2 - log.q2) % (2 * np.pi), 0, atol=1e-9)
        or np.allclose((s * found.q2 - log.q2 + np.pi) % (2 * np.pi), np.pi, atol=1e-9)
        for s in (1, -1)
    ]
    return bool(np.allclose(found.t, log.t) and any(a and b for a, b in zip(mirror, turns, strict=True)))


@pytest.mark.parametrize("flip", [(), ("q1",), ("q2",), ("u",), ("q1", "q2"), ("q1", "q2", "u")], ids=str)
@pytest.mark.parametrize("zero", ["upright", "hanging"])
@pytest.mark.parametrize("kind", LOGS)
def test_zero_and_signs_are_found_from_the_motion(kind: str, zero: str, flip: tuple[str, ...]) -> None:
    log = LOGS[kind]()
    source = table(log, zero=zero, flip=flip)
    proposal = propose(source)
    assert same_motion(read(proposal, source), log)
    assert not proposal.problems
    assert proposal.item("pendulum_zero").confidence is Confidence.sure


@pytest.mark.parametrize("label", [False, True], ids=["no units", "with units"])
@pytest.mark.parametrize("time", [1.0, 1e-3, 1e-6, 1e-9], ids=["s", "ms", "us", "ns"])
@pytest.mark.parametrize("angle", ["rad", "deg"])
@pytest.mark.parametrize("kind", LOGS)
def test_units_are_found(kind: str, angle: str, time: float, label: bool) -> None:
    log = LOGS[kind]()
    source = table(log, ("clock", "theta", "alpha", "voltage"), angle, time, label=label)
    proposal = propose(source)
    assert not proposal.problems
    assert same_motion(read(proposal, source), log)
    assert not proposal.below(Confidence.sure)


@pytest.mark.parametrize("kind", LOGS)
@pytest.mark.parametrize("command", ["u_motor", "u_V", "uMotor"])
def test_a_command_whose_name_begins_with_u_is_none_of_the_arm(kind: str, command: str) -> None:
    log = LOGS[kind]()
    source = table(log, ("t", "theta_arm", "alpha_enc", command))
    proposal = propose(source)
    assert proposal.mapping.columns["u"] == command
    assert proposal.item("u").confidence is not Confidence.open
    assert same_motion(read(proposal, source), log)


@pytest.mark.parametrize("names", NAMES.values(), ids=NAMES)
@pytest.mark.parametrize("kind", LOGS)
def test_columns_are_found_by_their_names_in_any_order_beside_others(kind: str, names: tuple[str, ...]) -> None:
    log = LOGS[kind]()
    source = table(log, names)
    speed = np.gradient(log.q2, log.t)
    shuffled = {"index": np.arange(len(log)), "pendulum speed": speed, "ref": 0 * speed} | dict(
        reversed(source.columns.items())
    )
    proposal = propose(replace(source, columns=shuffled))
    assert tuple(proposal.mapping.columns.values()) == names
    assert all(proposal.item(ours).confidence is Confidence.sure for ours in ("t", "q1", "q2", "u"))


@pytest.mark.parametrize("kind", LOGS)
def test_columns_without_names_are_found_by_their_motion_and_asked_about(kind: str) -> None:
    log = LOGS[kind]()
    names = ("data.1", "data.4", "data.2", "data.3")
    proposal = propose(table(log, names, zero="hanging", angle="deg"))
    assert tuple(proposal.mapping.columns.values()) == names
    assert {i.name for i in proposal.below(Confidence.sure)} >= {"q1", "q2", "u"}


def test_counts_ask_for_the_counts_of_a_turn_and_are_read_with_them() -> None:
    log = hanging()
    whole = {q: np.round(getattr(log, q) * 2048 / (2 * np.pi)) for q in ("q1", "q2")}
    source = table(log, **whole)
    asked = propose(source)
    assert [i.name for i in asked.below(Confidence.sure) if i.option == "--encoder-counts"] == ["encoder_counts"]
    assert asked.mapping.unit_q2 == "counts"
    answered = propose(source, RigMapping(encoder_counts=(2048.0, 2048.0)))
    assert same_motion(read(answered, source), log)
    assert not [i for i in answered.below(Confidence.sure) if i.name != "input_unit"]


@pytest.mark.parametrize("kind", LOGS)
@pytest.mark.parametrize(("said", "true"), [("rad", "deg"), ("deg", "rad")])
def test_a_stated_unit_that_the_data_contradict_is_a_problem_with_its_option(kind: str, said: str, true: str) -> None:
    source = table(LOGS[kind](), ("t [s]", f"arm [{said}]", f"pendulum [{said}]", "u [V]"), true)
    found = [str(p) for p in propose(source).fatal]
    assert [f for f in found if f"--unit q2={true}" in f]
    answered = propose(source, RigMapping(unit_q1=true, unit_q2=true))
    assert not answered.fatal
    assert same_motion(read(answered, source), LOGS[kind]())


@pytest.mark.parametrize("kind", LOGS)
def test_swapped_columns_are_a_problem_with_its_option(kind: str) -> None:
    log = LOGS[kind]()
    (problem,) = propose(table(log, q1=log.q2, q2=log.q1)).fatal
    assert "swapped" in problem.text
    assert "--columns q1=q2,q2=q1" in problem.mend
    (problem,) = propose(table(log, q1=log.u, u=log.q1)).fatal
    assert "--columns q1=u,u=q1" in problem.mend


@pytest.mark.parametrize("kind", LOGS)
def test_what_is_said_of_zero_and_signs_is_held_against_the_motion(kind: str) -> None:
    log = LOGS[kind]()
    source = table(log, zero="hanging", flip=("q2",))
    assert not propose(source, RigMapping(pendulum_zero="hanging", flip=("q2",))).fatal
    (problem,) = propose(source, RigMapping(pendulum_zero="hanging", flip=())).fatal
    assert "--pendulum-zero hanging --flip q2" in problem.mend
    (problem,) = propose(source, RigMapping(pendulum_zero="upright")).fatal
    assert "--pendulum-zero hanging" in problem.mend
    (problem,) = propose(replace(source, metadata={"pendulum_zero": "upright"})).fatal
    assert problem.text.startswith("the file says")


def test_what_a_reader_would_take_without_a_word_is_held_against_the_data() -> None:
    log = hanging()
    assert not propose(table(log), assumed=True).problems
    text = "\n".join(map(str, propose(table(log, angle="deg", time=1e-3, zero="hanging"), assumed=True).fatal))
    for option in ("--time-unit ms", "--unit q1=deg", "--unit q2=deg", "--pendulum-zero hanging and no --flip"):
        assert option in text


def test_a_zero_that_is_neither_is_a_problem() -> None:
    log = hanging()
    (problem,) = propose(table(log, q2=log.q2 + np.pi / 2)).fatal
    assert "90°" in problem.text


def test_everything_wrong_is_said_at_once() -> None:
    log = hanging()
    source = table(log, angle="deg", zero="hanging", label=True, names=("t", "arm", "pendulum", "voltage"))
    columns = dict(zip(("t [s]", "arm [rad]", "pendulum [rad]", "voltage"), source.columns.values(), strict=True))
    columns["t [s]"] = columns["t [s]"] * 1000
    columns["voltage"] = np.full(len(log), 1.5)
    text = "\n".join(map(str, propose(Table("log.csv", columns)).fatal))
    for option in ("--time-unit ms", "--unit q1=deg", "--unit q2=deg", "--columns u="):
        assert option in text


def test_logs_of_two_rigs_are_told_apart_and_logs_of_one_are_not() -> None:
    (problem,) = propose([table(LOGS["upright"]()), table(hanging())]).fatal
    assert "not of one rig" in problem.text
    upright = table(paper_log(0.004, 8.0, 4096, QUBE, 3)[0], zero="upright")
    assert not propose([upright, table(hanging())]).fatal


def test_a_still_table_is_open_about_zero() -> None:
    t = np.arange(500) * 0.004
    q1, q2 = np.random.default_rng(0).normal(0, 1e-3, (2, 500))
    proposal = propose(Table("log.csv", {"t": t, "q1": q1, "q2": q2, "u": np.sin(t)}))
    assert proposal.item("pendulum_zero").confidence is Confidence.open


def test_no_table_is_refused() -> None:
    with pytest.raises(LogError, match="no log"):
        propose([])


def test_measured_logs_of_other_laboratories(real_data) -> None:
    from identification.logs.formats import read_table

    for path in sorted(real_data.glob("*/*.csv")):
        proposal = propose(read_table(path))
        assert not proposal.problems, path.name
        assert proposal.mapping.pendulum_zero == "hanging"
        assert proposal.mapping.flip == ("q2",)
        assert (proposal.mapping.unit_q1, proposal.mapping.unit_q2) == ("rad", "rad")
        assert proposal.mapping.encoder_counts == (2048.0, 2048.0)
        assert [item.name for item in proposal.below(Confidence.sure)] == ["input_unit"]
