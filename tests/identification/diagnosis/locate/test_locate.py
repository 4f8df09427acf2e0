"""Where a model fails, against known truth: the right row, variable and time, and silence where nothing is missing."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.bench import Rig
from furuta_gym.plant import QUBE, TABLE_3
from identification.diagnosis.locate.constancy import constancy, tail
from identification.diagnosis.locate.laws import own_variables
from identification.diagnosis.locate.locate import _count, _sentence, locate, of_effects
from identification.diagnosis.locate.location import MissingTorque, Suspicion
from identification.diagnosis.locate.structure import largest_line, predictable
from identification.discrepancy.basis import Knots, Signals, families
from identification.discrepancy.correction import flexible
from identification.discrepancy.dependence import Channel, Variable
from identification.kalman.record import Record
from identification.logs.reading import read_log
from tests.factories import bench_log, changing_gain_log, loop_log


@pytest.fixture(scope="module")
def spring():
    return locate(TABLE_3, loop_log("arm_spring")[0])


@pytest.fixture(scope="module")
def wave():
    return locate(TABLE_3, loop_log("periodic_torque")[0])


@pytest.mark.parametrize("seed", [0, 1])
def test_nothing_is_left_of_a_right_model(seed):
    log, plant = loop_log(seed=seed)
    found = locate(plant, log)
    assert not found.found
    assert found.channel is None
    assert found.intervals_s == ((),)
    assert "Nothing is left" in found.sentence
    assert found.predictable.max() < 0.15
    assert found.constancy.joint_p > 1e-3


@pytest.mark.parametrize("seed", [11, 303])
def test_nothing_is_left_on_logs_of_another_simulator(seed):
    """Logs on which chance looked like a finding: 11, an error of the reading that was a function of its own noise;
    303, the best two of some hundred frequencies at the price of two."""
    found = locate(TABLE_3, bench_log(Rig("table3", torque_noise=(2e-6, 1e-8)), seed=seed))
    assert not found.found
    assert found.evidence < 4


def test_a_search_for_frequencies_is_paid_for():
    log, plant = loop_log()
    found = flexible(plant, Record.from_log(log))
    assert found.peaks.looked_at == pytest.approx(25 * log.duration, rel=0.05)
    assert found.peaks.price == pytest.approx(2 * np.log(found.peaks.looked_at))
    signals = Signals.of(found.uncorrected)
    columns = families(signals, plant, Knots.of([signals]), found.peaks)
    assert {f.price for f in columns if f.variable == "frequency"} == {found.peaks.price}
    assert {f.price for f in columns if f.variable != "frequency"} == {0.0}


def test_a_spring_is_a_torque_on_the_arm_against_its_angle(spring):
    assert (spring.channel, spring.variable) == ("arm", "arm angle")
    assert spring.predictable[0] > 0.8 > spring.predictable[1]
    assert "arm's row" in spring.sentence


@pytest.mark.parametrize(
    ("effect", "channel", "variable"),
    [
        ("input_delay", "input", "change of the command"),
        ("pendulum_encoder_offset", "sensor", "constant"),
        ("pendulum_stribeck", "pendulum", "pendulum speed"),
    ],
)
def test_the_right_channel(effect, channel, variable):
    found = locate(TABLE_3, loop_log(effect, duration=20.0)[0])
    assert (found.channel, found.variable) == (channel, variable)


def test_a_zero_that_moves_is_found_in_the_reading():
    """An encoder that loses four counts after nine seconds and six more later."""
    log, _ = loop_log(duration=20.0)
    lost = 4 * (log.t > 9.0) + 6 * (log.t > 15.0)
    found = locate(TABLE_3, replace(log, q2=log.q2 + 2 * np.pi / 4096 * lost))
    assert (found.channel, found.variable) == ("sensor", "time (zero of the pendulum)")
    assert "in the reading of the pendulum angle" in found.sentence
    assert "lost counts" in found.sentence


def test_a_periodic_torque_has_a_frequency_and_is_smoothed_with_bands_that_cover(wave):
    assert (wave.channel, wave.variable) == ("arm", "frequency")
    assert wave.line[0] > 0.5
    assert wave.frequencies[0] == pytest.approx(3.3, abs=0.06)
    torque = wave.torques[0]
    p = TABLE_3.default_effect("periodic_torque").parameters
    true = p["A"] * np.sin(2 * np.pi * p["f"] * torque.t + p["φ"])
    inner = slice(500, -500)
    error = (torque.mean[:, 0] - true)[inner]
    assert np.corrcoef(torque.mean[inner, 0], true[inner])[0, 1] > 0.95
    assert np.mean(np.abs(error) < 1.96 * torque.std[inner, 0]) > 0.8
    assert np.mean(np.abs(torque.mean[inner, 1]) < 3 * torque.std[inner, 1] + 1e-4) > 0.9


def test_the_map_of_a_spring_is_its_characteristic(spring):
    log, _ = loop_log("arm_spring")
    found = next(m for m in spring.maps if (m.row, m.variable) == ("arm", "arm angle"))
    p = TABLE_3.default_effect("arm_spring").parameters
    at = np.clip(np.searchsorted(found.edges, log.q1, side="right") - 1, 0, len(found.mean) - 1)
    angle = np.array([log.q1[at == b].mean() for b in range(len(found.mean))])
    assert np.polyfit(angle, found.mean, 1)[0] == pytest.approx(-p["k"], rel=0.05)
    beyond = (found.mean + p["k"] * (angle - p["q1n"])) / found.std
    assert np.abs(beyond).max() < 4
    assert np.mean(np.abs(beyond) < 1.96) > 0.7


def test_a_driver_that_switches_is_a_gain_that_changes_in_time():
    found = locate(TABLE_3, changing_gain_log(lambda t: 1.0 if t < 4.0 else 0.9))
    assert (found.channel, found.variable) == ("input", "time (gain)")
    assert "is a gain of the command that changes in time" in found.sentence


def test_what_changes_in_time_is_found_in_time():
    log, _ = loop_log("payload_step", 2.0, duration=20.0)  # at 8 s
    found = locate(TABLE_3, log)
    assert found.variable == "time (masses)"
    spans = found.intervals_s[0]
    assert spans[0][0] > 7.0
    assert found.constancy.joint_p < 1e-3
    assert found.changing
    assert found.structured
    assert found.drift_counts.max() > 1.0
    moved = np.abs(found.constancy.moved[:, 3])  # of θ4
    before, after = moved[:3], moved[4:]  # eighths of the log; the step falls into the fourth
    assert after.min() > before.max()
    assert after.mean() > 2 * before.mean()


@pytest.mark.parametrize(("size", "matters"), [(0.01, False), (0.05, True)])
def test_parameters_that_change_matter_by_what_they_change_of_predictions(size, matters):
    """A payload of a gram or less, without torque noise and with fine encoders: certain, but what of it."""
    log, _ = loop_log("payload_step", size, duration=20.0, noise=False, counts=16384)
    found = locate(TABLE_3, log)
    assert found.constancy.joint_p < 1e-3
    assert found.changing is matters
    assert found.drift_counts.max() == pytest.approx(found.counts.max(), rel=0.2)  # the same, found as a torque


@pytest.mark.parametrize(("size", "matters"), [(0.003, False), (0.012, True)])
def test_a_torque_matters_by_what_it_changes_of_predictions(size, matters):
    """Springs of a few ten-thousandths of the command on a quiet rig: tens of nats prove both, and one is half a
    count."""
    log, _ = loop_log("arm_spring", size, noise=False, counts=16384)
    found = locate(TABLE_3, log)
    assert found.found
    assert found.evidence > 50.0
    assert bool(found.counts.max() > 0.5) is matters
    assert found.matters is matters
    assert found.structured is (matters or found.changing)
    assert f"{found.counts.max():.2g} counts" in found.sentence


def test_it_goes_to_a_file(spring):
    where = spring.to_dict()
    json.dumps(where, allow_nan=False)
    assert {"channel", "intervals_s", "variable", "map"} <= set(where)
    assert where["channel"] in ("arm", "pendulum", "input", "sensor")


@pytest.mark.parametrize(
    ("x", "dimension", "p"), [(0.470, 1, 0.05), (0.748, 1, 0.01), (1.01, 3, 0.05), (2.82, 9, 0.01)]
)
def test_tail_probabilities_are_those_of_hansens_table(x, dimension, p):
    assert tail(x, dimension) == pytest.approx(p, rel=0.07)


def test_a_drifting_parameter_is_told_from_a_constant_one():
    rng = np.random.default_rng(0)
    D = rng.standard_normal((4000, 2, 2))
    drift = np.linspace(-0.15, 0.15, 4000)
    w = rng.standard_normal((4000, 2)) + D[:, :, 1] * drift[:, None]
    found = constancy(D, w, ("still", "drifting"))
    assert found.p[0] > 0.01 > 1e-4 > found.p[1]
    level = [constancy(D, rng.standard_normal((4000, 2)), ("a", "b")).joint_p for _ in range(150)]
    assert 0.02 < np.mean(np.array(level) < 0.1) < 0.25
    assert 0.4 < np.median(level) < 0.65, "half of the statistic would make it 0.8, twice the dimensions 0.95"


def test_structure_of_a_series():
    rng = np.random.default_rng(1)
    X = rng.standard_normal((4000, 4))
    assert predictable(np.tanh(X[:, 0]) + 0.3 * X[:, 1], X) > 0.8
    wandering = np.cumsum(rng.standard_normal(4000))
    assert predictable(wandering, X) < 0.1
    t = np.arange(4000) * 0.005
    g, f = largest_line(np.sin(2 * np.pi * 4.0 * t) + 0.5 * rng.standard_normal(4000), 0.005)
    assert g > 0.3
    assert f == pytest.approx(4.0, abs=0.1)
    drifting = np.sin(2 * np.pi * 4.0 * t) + 3.0 * np.sin(2 * np.pi * 0.8 * t / t[-1])
    assert largest_line(drifting, 0.005)[1] == pytest.approx(4.0, abs=0.1), "what repeats, not what drifts"


@pytest.mark.parametrize(("size", "low", "high", "left"), [(0.012, 4.0, 8.0, False), (0.016, 8.0, 16.0, True)])
def test_eight_nats_say_that_something_is_left(size, low, high, left):
    """Two faint springs, one on either side of the threshold."""
    found = locate(TABLE_3, loop_log("arm_spring", size, duration=6.0)[0])
    assert low < found.evidence < high
    assert found.found is left
    assert (found.channel == "arm") is left


def test_bad_input_is_refused():
    log, plant = loop_log()
    with pytest.raises(ValueError, match="no stretch of 1 s without a gap"):
        locate(plant, log.slice(stop=0.5))


def test_measured_logs_have_something_left(real_data):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        read = lambda name: read_log(real_data / name, pendulum_zero="hanging", flip="q2", encoder_counts=2048)  # noqa: E731
        chirp = read("qube_darmstadt/chirp_p1V5_250Hz_00.csv")
        balance = read("qube_mcgill/balance_prbs_20230828T161334.csv").slice(1.0, 9.0)
    for log in (chirp, balance):
        found = locate(QUBE, log)
        assert found.found
        assert found.channel in ("arm", "pendulum", "input", "sensor")


def test_a_log_in_another_unit_than_the_plants_is_refused():
    log, plant = loop_log()
    with pytest.raises(ValueError, match="they must agree"):
        locate(plant, replace(log, input_unit="N·m"))


def test_stretches_of_two_logs_of_one_name_are_told_apart(spring) -> None:
    """intervals_s of diagnosis.json are those of the first log."""
    (torque,) = spring.torques
    two = replace(
        spring,
        torques=(torque, replace(torque, log=1)),
        intervals_s=(((0.0, 1.0),), ((2.0, 3.0),)),
    )
    assert two.to_dict()["intervals_s"] == [[0.0, 1.0]]


def test_a_count_does_not_depend_on_the_order_of_the_logs() -> None:
    """An arm at rest shows no count; another log of the rig does."""
    looks = [
        SimpleNamespace(plain=SimpleNamespace(record=SimpleNamespace(quantum=np.array(q), variance=np.array(v))))
        for q, v in (([0.0, 2e-3], [1e-12, 1e-7]), ([1e-3, 2e-3], [1e-7, 1e-7]))
    ]
    np.testing.assert_allclose(_count(looks), [1e-3, 2e-3])
    np.testing.assert_allclose(_count(looks[::-1]), [1e-3, 2e-3])
    unknown = SimpleNamespace(record=SimpleNamespace(quantum=np.zeros(2), variance=np.array([3e-6, 12e-6])))
    np.testing.assert_allclose(_count([SimpleNamespace(plain=unknown)]), [6e-3, 12e-3])


def _said(channel: str, variable: str, sources: tuple[str, ...] = ("run1.csv",)) -> str:
    """What is said of a torque that stands out from 3.2 to 4.5 s of each log, 0.4 V on the arm and 0.1 V beside it."""
    t = np.arange(1000) * 0.01
    mean = np.tile([0.4, 0.1], (len(t), 1))
    torques = [MissingTorque(i, source, t, mean, mean) for i, source in enumerate(sources)]
    spans = [((3.2, 4.5),) for _ in sources]
    best = Suspicion(Channel(channel), Variable(variable), 50.0, 45.0, 0.6)
    return _sentence(best, spans, torques, np.array([1.0, 2.0]), 40.0, np.array([0.5, 2.0]), "V")


def test_a_reading_that_is_wrong_has_no_torque():
    told = _said("sensor", "pendulum angle")
    assert "fails in the reading of the pendulum angle" in told
    assert "rms" not in told
    assert "it changes a prediction 0.3 s ahead by 2 counts" in told
    assert "smoothed, it is 0.1 V rms, which changes a prediction" in _said("pendulum", "pendulum speed")


def test_of_several_logs_it_is_said_which_one():
    assert "most at 3.20 to 4.50 s; smoothed" in _said("arm", "arm angle")
    told = _said("arm", "arm angle", ("run1.csv", "run2.csv"))
    assert "most at 3.20 to 4.50 s of run1.csv, 3.20 to 4.50 s of run2.csv; smoothed" in told


def test_of_effects_that_were_named_the_place_is_known_where_no_function_is_believed() -> None:
    """A faint delay: a fit sees it, and no free function does."""
    nothing = locate(TABLE_3, [loop_log()[0]])
    assert nothing.channel is None
    late = of_effects(nothing, ["input_delay"])
    assert (late.channel, late.variable) == ("input", "change of the command")
    assert "goes with the change of the command (input)" in late.sentence
    tilted = of_effects(nothing, ["base_tilt"])
    assert (tilted.channel, tilted.variable) in {("sensor", "constant"), *own_variables("base_tilt")}
    assert not tilted.found
    assert of_effects(nothing, []) is nothing
    pulled = locate(TABLE_3, [loop_log("arm_spring")[0]])
    assert of_effects(pulled, ["input_delay"]) is pulled
