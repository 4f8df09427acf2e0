"""The value Log: what it checks, cuts, resamples and prints."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from identification.logs.log import LogError, write_log
from identification.logs.reading import read_log
from tests.factories import made_log, paper_log


def test_log_is_frozen_and_its_arrays_are_read_only_copies():
    u = np.sin(np.arange(200))
    log = made_log(u=u)
    with pytest.raises(ValueError, match="read-only"):
        log.u[0] = 1.0
    u[0] = 99.0
    assert log.u[0] == 0.0
    with pytest.raises(AttributeError):
        log.input_unit = "N·m"  # type: ignore[misc]


def test_log_travels_to_workers_whole():
    log = made_log(device="rig", metadata={"run": "3"}, controller_gain=(1, 2, 3, 4))
    back = pickle.loads(pickle.dumps(log))
    assert not back.q1.flags.writeable
    assert (back.device, back.metadata, back.controller_gain) == (log.device, log.metadata, log.controller_gain)
    np.testing.assert_array_equal(back.angles, log.angles)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"u": np.zeros(199)}, "u has shape .199,., t has 200"),
        ({"q1": np.zeros((200, 1))}, "q1 has shape"),
        ({"q2": np.full(200, np.nan)}, "q2 holds NaN"),
        ({"t": np.zeros(200)}, "does not increase"),
        ({"input_unit": "furlongs"}, "expected V or N·m"),
        ({"encoder_counts": (0, 4096)}, "encoder_counts"),
        ({"controller_gain": (1, 2, 3)}, "expected four numbers"),
        ({"metadata": {"device": "x"}}, "cannot be stored"),
        ({"metadata": {"note": "two\nlines"}}, "one line"),
        ({"metadata": {"mass": 0.1}}, "one line"),
        ({"device": "two\u2028lines"}, "one line"),
    ],
)
def test_log_validates_itself(changes, message):
    with pytest.raises(LogError, match=message):
        made_log(**changes)


def test_log_prints_what_a_person_looks_for():
    log, _ = paper_log(0.002, 10.0)
    text = str(replace(log, device="bench 3"))
    assert text == repr(replace(log, device="bench 3"))
    for part in ("simulated (bench 3)", "5000 samples", "2 ms", "even clock", "steps of 2π/4096", " V"):
        assert part in text
    assert len(text.splitlines()) == 5


def test_clock_properties():
    log = made_log(1001)
    assert log.sample_time == pytest.approx(0.002)
    assert log.duration == pytest.approx(2.0)
    assert log.regular
    jitter = np.random.default_rng(0).uniform(-2e-4, 2e-4, 1001)
    uneven = replace(log, t=log.t + jitter)
    assert not uneven.regular
    assert uneven.sample_time == pytest.approx(0.002, rel=0.05)
    np.testing.assert_array_equal(uneven.t, log.t + jitter)


def test_slice_and_split_partition_the_samples():
    log = made_log(1000)
    part = log.slice(0.5, 1.0)
    assert part.t[0] == pytest.approx(0.5)
    assert part.t[-1] == pytest.approx(0.998)
    assert part.source == log.source
    head, tail = log.split(0.7)
    assert len(head) + len(tail) == len(log)
    assert len(head) == pytest.approx(700, abs=1)
    np.testing.assert_array_equal(np.concatenate([head.q2, tail.q2]), log.q2)
    with pytest.raises(LogError, match=r"runs from 0 to 1.998 s"):
        log.slice(5.0)
    with pytest.raises(LogError, match="between 0 and 1"):
        log.split(1.0)


def test_logs_overlap_that_share_samples_of_one_file():
    log = replace(made_log(), sha256="of the file")
    first, rest = log.split(0.7)
    assert log.overlaps(log)
    assert log.overlaps(first)
    assert log.overlaps(rest)
    assert not first.overlaps(rest)
    assert not rest.overlaps(first)
    assert not first.overlaps(replace(first, sha256="of another"))
    assert not made_log().overlaps(made_log()), "without a file nobody knows"


def test_pieces_cut_at_dropped_samples():
    log = made_log(300)
    keep = np.ones(300, dtype=bool)
    keep[100:120] = keep[200] = False
    pieces = log.taken(keep).pieces()
    assert [len(p) for p in pieces] == [100, 80, 99]
    np.testing.assert_array_equal(np.concatenate([p.t for p in pieces]), log.t[keep])
    assert all(p.regular for p in pieces)


def test_resampling_interpolates_angles_and_holds_the_command():
    log = made_log(400, u=np.floor(np.arange(400) / 50))
    fine = log.resampled(0.0005)
    assert fine.regular
    assert fine.sample_time == pytest.approx(0.0005)
    np.testing.assert_allclose(fine.q1, 0.3 * np.sin(7 * fine.t), atol=1e-5)
    np.testing.assert_array_equal(fine.u, np.floor((np.arange(len(fine)) // 4) / 50))
    same = log.resampled()
    for name in ("t", "q1", "q2", "u"):
        np.testing.assert_allclose(getattr(same, name), getattr(log, name), atol=1e-12)
    with pytest.raises(LogError, match="sample_time"):
        log.resampled(-1.0)


@pytest.mark.parametrize("device", ["rig 50 %", "/a/b/", "rig #3!"])
def test_a_device_keeps_its_last_letters_in_text(tmp_path, device):
    write_log(tmp_path / "log.csv", made_log(device=device))
    assert read_log(tmp_path / "log.csv").device == device


def test_a_part_keeps_the_recordings_clock():
    log = made_log(t=5.0 + 0.01 * np.arange(200))
    part = log.slice(5.5, 6.5)
    assert part.begins == pytest.approx(0.5)
    assert part.slice(6.0).begins == pytest.approx(1.0)
    assert part.origin == pytest.approx(5.0)
    assert part.span == pytest.approx((0.5, 1.49))
    assert pickle.loads(pickle.dumps(part)).begins == part.begins
    with pytest.raises(LogError, match="begins = -1"):
        replace(log, begins=-1.0)
