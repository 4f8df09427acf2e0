"""The gap against known truth: one for the right plant, growing with what is missing, and closed by adding it."""

from __future__ import annotations

import json
import tracemalloc
import warnings
from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import QUBE, TABLE_3
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate
from identification.estimation.identify import identify
from identification.kalman.noise import fit_noise
from identification.kalman.noise_model import RecordNoise
from identification.kalman.one_filter import add_torque_noise
from identification.kalman.path import follow, refilter, smooth
from identification.kalman.record import Record, stretches
from identification.kalman.taken import informative
from identification.kalman.whiteness import Whitened, innovations
from identification.logs.log import Log
from identification.logs.reading import read_log
from identification.validation.closed_fraction import closed_fraction
from identification.validation.free_run import Windows, free_run
from identification.validation.gap import fit_percent, validate
from identification.validation.noise_floor import repeats
from identification.validation.predicted import predicted
from identification.validation.resimulation import resimulate
from tests.factories import TORQUE_NOISE, loop_log, open_loop_log


@pytest.mark.parametrize(("T", "counts"), [(0.002, 4096), (0.001, 2048)])
def test_the_true_plant_is_at_the_floor(T, counts):
    log, plant = loop_log(T=T, counts=counts)
    gap = validate(plant, log)
    assert gap.ratio_to_floor == pytest.approx(1.0, abs=0.15)
    assert np.all(gap.torque_share > 0.3), "these rigs' torque noise is what a prediction over half a second misses"


def test_the_ratio_grows_with_what_is_missing():
    ratios = [validate(TABLE_3, loop_log("arm_spring", size)[0]).ratio_to_floor for size in (0.03, 0.2, 1.0)]
    assert 1.2 < ratios[0] < ratios[1] / 2 < ratios[2] / 4


@pytest.mark.parametrize("effect", ["input_delay", "pendulum_encoder_offset", "periodic_torque"])
def test_a_wrong_plant_hardly_raises_its_own_floor(effect):
    log, right = loop_log(effect)
    wrong, true = validate(TABLE_3, log), validate(right, log)
    assert np.all(wrong.floor / true.floor < 1.5)
    # what the wrong plant takes for torque noise would have excused it
    naive = fit_noise(TABLE_3, Record.from_log(log)).noise.torque / fit_noise(right, Record.from_log(log)).noise.torque
    assert naive.max() > 20


def test_adding_the_effect_closes_the_gap():
    log, right = loop_log("arm_spring", 0.2)
    before, after = validate(TABLE_3, log), validate(right, log)
    closed = closed_fraction(before, after)
    assert closed.value > 0.98
    assert before.surprise[:, 2].sum() - after.surprise[:, 2].sum() > 100.0
    assert closed.interval[0] <= closed.value <= closed.interval[1]
    assert closed_fraction(before, before).value == pytest.approx(0.0)
    assert closed_fraction(before, validate(TABLE_3.replace(theta=1.3 * TABLE_3.theta), log)).value < 0.5
    with pytest.raises(ValueError, match="same logs"):
        closed_fraction(before, validate(right, log, horizon=0.2))


def test_the_fit_of_another_error_is_that_of_the_plant_which_has_it():
    log, right = loop_log("arm_spring", 0.2)
    before, after = validate(TABLE_3, log), validate(right, log)
    assert np.all(before.fit_percent < after.fit_percent - 5)
    assert before.fit_at(after.rms) == pytest.approx(after.fit_percent, abs=1e-6)
    assert after.fit_at(after.floor) == pytest.approx(after.fit_percent, abs=1)


def test_a_fit_is_about_the_mean_of_each_log():
    """Hanging and upright runs lie π apart: beside that any error would be small."""
    rng = np.random.default_rng(0)
    hanging, upright = 0.1 * rng.standard_normal((500, 2)) + np.pi, 0.02 * rng.standard_normal((500, 2))
    log = np.repeat([0, 1], 500)
    together = fit_percent(np.full(2, 0.05), np.concatenate([hanging, upright]), log)
    apart = np.concatenate([hanging - hanging.mean(axis=0), upright - upright.mean(axis=0)])
    assert together == pytest.approx(100.0 * (1.0 - 0.05 / np.sqrt(np.mean(apart**2, axis=0))))
    assert np.all(together < 35.0)
    assert fit_percent(np.full(2, 0.05), hanging, log[:500]) == pytest.approx(
        100.0 * (1.0 - 0.05 / hanging.std(axis=0))
    )


def test_windows_start_from_the_states_and_integrate_as_the_simulator_does():
    run = simulate(
        TABLE_3, open_loop(0.1), 3.0, 0.002, Sensors(None), x0=(0.2, 3.0, 0.0, 0.0), longest_step=1e-3, seed=0
    )
    record = Record.from_log(Log.from_run(run))
    path = follow(TABLE_3, record, RecordNoise((1e-8, 1e-10), (1e-12, 1e-12)))
    path.filtered[:] = run.state
    windows = Windows.over(record.t, (0.1, 0.3), settle=0.2)
    errors = free_run(path, windows)
    assert np.abs(errors).max() < 1e-6
    assert record.t[windows.targets[:, 1]] - record.t[windows.starts] == pytest.approx(0.3)


@pytest.mark.parametrize("unread", [(), (10, 25)], ids=["both angles", "one at a time"])
def test_the_smoother_equals_least_squares_over_the_whole_trajectory(unread):
    log, plant = loop_log(duration=1.0)
    record = Record.from_log(log.slice(stop=0.12))
    noise = RecordNoise(1e3 * np.array(TORQUE_NOISE), record.variance)
    path = follow(plant, record, noise)
    if unread:
        first, last = unread
        used = path.used.copy()
        used[first:last, 0] = used[last - 5 : last + 10, 1] = False
        path = refilter(replace(path, used=used), noise)
    N, n = path.filtered.shape
    # unknowns: all states; rows: the first state, the motion, the readings, each divided by its standard deviation
    rows, right = [], []

    def add(block, value, covariance):
        L = np.linalg.inv(np.linalg.cholesky(covariance))
        rows.append(L @ block)
        right.append(L @ value)

    first = np.zeros((n, N * n))
    first[:, :n] = np.eye(n)
    add(first, path.carried[0], path.first)
    for k in range(N):
        reading = np.zeros((2, N * n))
        reading[:, k * n : k * n + n] = path.reading[k]
        if (rows_read := path.used[k]).any():
            right_side = path.misread[k] + path.reading[k] @ path.carried[k]
            add(reading[rows_read], right_side[rows_read], np.diag(noise.variance[rows_read]))
        if k + 1 < N:
            motion = np.zeros((n, N * n))
            motion[:, (k + 1) * n : (k + 2) * n] = np.eye(n)
            motion[:, k * n : (k + 1) * n] = -path.transition[k]
            Q = np.zeros((n, n))
            add_torque_noise(Q, path.about[k, 1], plant.theta[:4], noise.packed(), record.t[k + 1] - record.t[k])
            add(motion, path.carried[k + 1] - path.transition[k] @ path.about[k], Q)
    A = np.concatenate(rows)
    best = np.linalg.lstsq(A, np.concatenate(right), rcond=None)[0].reshape(N, n)
    variance = np.diag(np.linalg.inv(A.T @ A)).reshape(N, n)
    smoothed = smooth(path)
    assert smoothed.mean == pytest.approx(best, rel=1e-5, abs=1e-9)
    assert smoothed.variance == pytest.approx(variance, rel=1e-3)


def test_the_noise_of_the_true_plant_is_found():
    log, plant = loop_log(duration=20.0)
    found = fit_noise(plant, Record.from_log(log))
    assert 0.5 < found.noise.torque[0] / TORQUE_NOISE[0] < 2.0
    assert 0.4 < found.noise.torque[1] / TORQUE_NOISE[1] < 2.5


def test_repeated_counts_are_read_less_often():
    fine, coarse = (Record.from_log(loop_log(T=0.001, counts=counts)[0]) for counts in (65536, 1024))
    assert informative(fine).all()
    assert informative(coarse).mean() < 0.5


def test_innovations_tell_a_late_command():
    paths = [fit_noise(TABLE_3, Record.from_log(loop_log(effect)[0])).path for effect in (None, "input_delay")]
    white, late = (innovations(Whitened.of(path)) for path in paths)
    assert white.p_command.min() > 1e-4
    assert late.p_command.min() < 1e-12


def test_runs_of_one_input_give_a_floor_without_a_noise_model():
    t = np.arange(1500) * 0.004
    u = 0.5 * np.sin(2 * np.pi * (0.3 + 0.2 * t) * t)
    logs = [open_loop_log(u, torque_noise=(1e-5, 1e-7), seed=seed) for seed in range(3)]
    gap = validate(TABLE_3, logs)
    assert gap.repeats
    assert gap.ratio_to_floor == pytest.approx(1.0, abs=0.15)
    wrong = validate(TABLE_3.replace(theta=TABLE_3.theta * np.r_[np.ones(4), 1.1, np.ones(4)]), logs)
    assert wrong.ratio_to_floor > 1.5 * gap.ratio_to_floor
    wild = open_loop_log(8.0 * u, torque_noise=(1e-3, 1e-5), seed=9)
    mixed = validate(TABLE_3, [*logs, wild])  # the spread is no floor for a log that was not repeated
    assert not mixed.repeats
    assert mixed.ratio_to_floor == pytest.approx(1.0, abs=0.3)
    assert np.all(mixed.floor > 2.0 * gap.floor)


@pytest.mark.parametrize(("jitter", "pace", "repeated"), [(0.1, 1.0, True), (0.0, 1.001, False)])
def test_runs_repeat_each_other_whatever_a_clock_that_is_read_jitters(jitter, pace, repeated):
    t = np.arange(1500) * 0.004
    u = 0.5 * np.sin(2 * np.pi * (0.3 + 0.2 * t) * t)
    rng, logs = np.random.default_rng(0), []
    for seed in range(3):
        log = open_loop_log(u, torque_noise=(1e-5, 1e-7), seed=seed)
        logs.append(replace(log, t=log.t * pace**seed + 0.004 * rng.uniform(-jitter, jitter, len(log.t))))
    assert repeats(logs) == ([[0, 1, 2]] if repeated else [])
    assert validate(TABLE_3, logs).repeats == repeated


def test_free_decays_from_different_places_are_no_repeats():
    """Nor may a wrong plant's own errors pass for their spread."""
    near = [open_loop_log(np.zeros(1500), q2, seed=seed) for seed, q2 in enumerate((np.pi + 1.0, np.pi + 1.07))]
    assert repeats(near) == []  # let go by hand: nearly the same start, and out of step after some swings
    logs = [open_loop_log(np.zeros(1500), q2, seed=seed) for seed, q2 in enumerate((np.pi + 1.0, np.pi - 0.7))]
    wrong = TABLE_3.replace(theta=TABLE_3.theta * np.r_[np.ones(4), 1.1, np.ones(4)])
    gap = validate(wrong, logs)
    assert not gap.repeats
    assert gap.ratio_to_floor > 2.0
    assert repeats([logs[0], logs[0]]) == [[0, 1]]


def test_the_file_has_the_names_that_were_agreed():
    log, plant = loop_log()
    gap = validate(plant, log).to_dict()["gap"]
    json.dumps(gap, allow_nan=False)
    names = "rms_q1 rms_q2 fit_percent_q1 fit_percent_q2 horizon_s noise_floor_q1 noise_floor_q2 ratio_to_floor"
    assert set(names.split()) <= set(gap)


def test_the_closed_loop_runs_again():
    log, plant = loop_log(noise=False)
    assert np.all(resimulate(plant, log).fit_percent > 95)
    assert resimulate(TABLE_3.with_effects(TABLE_3.default_effect("arm_spring")), log).fit_percent[0] < 90
    unknown = Log(log.t, log.q1, log.q2, log.u)
    with pytest.raises(ValueError, match="controller_gain"):
        resimulate(plant, unknown)


def test_bad_input_is_refused():
    log, plant = loop_log()
    with pytest.raises(ValueError, match="long enough"):
        validate(plant, log.slice(stop=0.9))
    with pytest.raises(ValueError, match="horizon"):
        validate(plant, log, horizon=-1.0)
    log, _ = loop_log()
    with pytest.raises(ValueError, match=r"the plant's command is in V, that of .* in N·m; they must agree"):
        validate(TABLE_3, replace(log, input_unit="N·m"))
    with pytest.raises(ValueError, match="at least one log"):
        validate(plant, [])


def test_a_log_given_twice_is_no_repeated_run():
    """Its spread is zero, and any error infinitely many times that floor."""
    log = replace(loop_log(duration=4.0)[0], sha256="0123", source="run.csv")
    for twice in ([log, log], [log, replace(log, source="copy.csv")], [log.slice(stop=3.0), log.slice(2.0)]):
        with pytest.raises(ValueError, match=r"run\.csv is given twice; expected each log once"):
            validate(TABLE_3, twice)
    parts = validate(TABLE_3, log.split(0.5))  # one file in parts is no log twice
    assert set(parts.log.tolist()) == {0, 1}


def test_a_horizon_below_two_samples_is_told_and_how_long_it_must_be():
    log, plant = loop_log(duration=4.0)  # at 2 ms, compared at thirds of the horizon
    with pytest.raises(ValueError, match=r"less than two samples of 2 ms\. Choose a longer horizon: 12 ms") as raised:
        validate(plant, log, horizon=0.01)
    assert "shorter" not in str(raised.value)
    assert "longer log" not in str(raised.value)
    assert validate(plant, log, horizon=0.012).horizon == 0.012


def test_a_stretch_too_short_for_its_clock_does_not_end_the_validation():
    """At 50 Hz it lasts long enough for a horizon of 0.15 s, but fewer windows start in it than are asked for."""
    log, plant = loop_log(T=0.02, duration=12.0)
    keep = np.ones(len(log), dtype=bool)
    keep[45:47] = False
    broken = log.taken(keep)
    short, rest = broken.pieces()
    assert short.duration > 0.5 + 2 * 0.15
    gap = validate(plant, broken, horizon=0.15, own_zeros=False)
    assert gap.times.min() > rest.t[0]
    with pytest.raises(ValueError, match=r"no log is long enough.* 16 samples"):
        validate(plant, short, horizon=0.15, own_zeros=False)


def test_measured_repeats_and_swing_ups(real_data):
    folder = real_data / "qube_darmstadt"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        read = lambda name: read_log(folder / name, pendulum_zero="hanging", flip="q2", encoder_counts=2048)  # noqa: E731
        chirps = [read(f"chirp_p1V5_250Hz_0{i}.csv") for i in range(2)]
        swing = read("swingup_250Hz_5s_00.csv")
    gap = validate(QUBE, chirps)
    assert gap.repeats
    assert gap.ratio_to_floor > 2  # a plant of the right size, not of this rig
    assert np.isfinite(validate(QUBE, swing).rms).all()


def test_a_floor_of_torque_noise_is_not_taken_for_a_good_plant():
    """What the plant misses can raise its own floor; then a small ratio is no praise, and the verdict says so."""
    log, plant = loop_log()
    gap = validate(plant, log)
    assert np.all(gap.torque_share < 0.85)
    assert "nothing of size" in gap.verdict
    raised = replace(gap, floor=10.0 * gap.reading_floor, rms=12.0 * gap.reading_floor)
    assert raised.ratio_to_floor == pytest.approx(1.2)
    assert "says little" in raised.verdict
    assert "12 times too large" in raised.verdict
    assert f"readings alone {1e3 * gap.reading_floor[0]:.3g}" in str(raised)
    assert "says little" not in replace(raised, repeats=True).verdict  # the spread of runs is a floor to trust
    assert raised.to_dict()["gap"]["torque_noise_share_q1"] == pytest.approx(0.99)


def test_the_verdict_on_a_measured_balancing_run(real_data):
    """McGill's rig has a spring and a delay that model (5) lacks; most of the floor is what they leave as torques."""
    files = sorted((real_data / "qube_mcgill").glob("*.csv"))
    if len(files) < 2:
        pytest.skip("no balancing runs among the measured logs")
    read = [read_log(f, pendulum_zero="hanging", flip="q2", encoder_counts=2048) for f in files[:2]]
    fitted, held_out = (log.slice(float(log.t[0]) + 1.0) for log in read)  # the first second is the hand-over
    gap = validate(identify(fitted).plant, held_out)
    assert gap.torque_share.max() > 0.95
    assert "torque noise fitted to these logs" in gap.verdict


@pytest.mark.parametrize("effect", [None, "arm_spring"])
def test_a_long_stretch_is_predicted_in_parts_as_if_at_once(effect):
    log, right = loop_log(effect, 0.2)
    (stretch,) = stretches([log])
    horizons = (0.15, 0.3)
    whole, parts = (predicted(right, stretch, horizons, longest) for longest in (len(log), len(log) // 3))
    assert len(list(stretch.parts(len(log) // 3, 0.8))) > 1
    # every reading once, in order
    assert np.array_equal(parts.surprise[:, 1], whole.surprise[:, 1])
    assert np.array_equal(parts.whitened.t, whole.whitened.t)
    steps = np.diff(parts.times)
    assert steps.min() > 0
    assert steps.max() < 2.5 * np.median(steps)
    assert parts.times[-1] == pytest.approx(whole.times[-1], abs=2 * np.median(steps))
    for name in ("errors", "floor", "readings_floor"):
        mine, theirs = (np.mean(np.abs(getattr(p, name)), axis=0) for p in (parts, whole))
        assert mine == pytest.approx(theirs, rel=0.1)
    assert parts.surprise[:, 2].sum() == pytest.approx(whole.surprise[:, 2].sum(), abs=0.01 * len(log))


def test_a_long_stretch_takes_the_memory_of_a_part():
    log, plant = loop_log()
    (stretch,) = stretches([log])
    peaks = []
    for longest in (len(log), len(log) // 8):
        tracemalloc.start()
        predicted(plant, stretch, (0.15, 0.3), longest)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 0.4 * peaks[0]


def test_the_change_of_a_rig_between_two_runs_is_no_noise_floor():
    t = np.arange(1500) * 0.004
    u = 0.5 * np.sin(2 * np.pi * (0.3 + 0.2 * t) * t)
    worn = TABLE_3.replace(theta=TABLE_3.theta * np.r_[np.ones(5), 1.3, 1.0, 1.3, 1.0])
    noise = {"torque_noise": (1e-7, 1e-9)}
    before, again = (open_loop_log(u, seed=seed, **noise) for seed in (0, 1))
    after = open_loop_log(u, seed=2, plant=worn, **noise)
    alone, both = validate(TABLE_3, after), validate(TABLE_3, [before, after])
    assert not both.repeats
    assert both.differ > 3.0
    assert both.ratio_to_floor > 2.0
    assert alone.ratio_to_floor > both.ratio_to_floor
    assert "the rig changed between them, or they are of two rigs" in str(both)
    same = validate(TABLE_3, [before, again])
    assert same.repeats
    assert same.differ is None
    assert "changed" not in str(same)


def test_counts_are_told_where_they_are_those_of_all_logs():
    fine, coarse = loop_log(duration=4.0)[0], loop_log(duration=4.0, seed=1, counts=2048)[0]
    gap = validate(TABLE_3, [coarse, fine])
    assert gap.counts.tolist() == [0.0, 0.0]
    assert gap.least_counts == pytest.approx([2 * np.pi / 4096] * 2)
    assert gap.to_dict()["gap"]["rms_counts_q1"] is None
    assert "counts" not in str(gap)
    alike = validate(TABLE_3, fine)
    assert alike.counts == pytest.approx(alike.least_counts)
    assert alike.to_dict()["gap"]["rms_counts_q1"] == pytest.approx(alike.rms[0] * 4096 / (2 * np.pi))


def test_a_logger_that_is_stopped_by_hand_gives_repeats_all_the_same():
    t = np.arange(1500) * 0.004
    u = 0.5 * np.sin(2 * np.pi * (0.3 + 0.2 * t) * t)
    logs = [open_loop_log(u, torque_noise=(1e-5, 1e-7), seed=seed) for seed in range(3)]
    uneven = [log.taken(slice(None, len(log) - short)) for log, short in zip(logs, (0, 1, 60), strict=True)]
    assert repeats(uneven) == [[0, 1, 2]]
    gap, even = validate(TABLE_3, uneven), validate(TABLE_3, logs)
    assert gap.repeats
    assert gap.ratio_to_floor == pytest.approx(even.ratio_to_floor, abs=0.05)
    assert gap.floor == pytest.approx(even.floor, rel=0.1)
    assert repeats([logs[0], logs[1].taken(slice(None, 1200))]) == []  # a fifth is missing
    late = replace(uneven[1], u=np.r_[uneven[1].u[:-1], 0.3])
    assert repeats([logs[0], late]) == []


def test_logs_are_predicted_in_turns_where_they_are_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """One alone, or as many as memory allows: the answer is the same, log by log."""
    logs = [loop_log(duration=3.0, seed=seed)[0] for seed in range(3)]
    together, turns = validate(TABLE_3, logs), []

    def counted(pool, work, items):
        turns.append(len(items))
        return map(work, items)

    monkeypatch.setattr("identification.validation.gap.mapped", counted)
    for most, asked in ((2 * len(logs[0]), [2, 1]), (1, [1, 1, 1])):
        monkeypatch.setattr("identification.validation.gap._TOGETHER", most)
        turns.clear()
        apart = validate(TABLE_3, logs)
        assert turns == asked
        np.testing.assert_array_equal(apart.errors, together.errors)
        np.testing.assert_array_equal(apart.log, together.log)
