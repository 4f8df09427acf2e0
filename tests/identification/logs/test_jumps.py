"""Readings that stand out and jumps that stay are told, and nothing that a rig does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.logs.jumps import Jump, jumps
from identification.logs.log import Log
from identification.logs.proposal import propose
from tests.factories import paper_log
from tests.files import csv, warned

from .test_proposal import hanging, table

_COUNT = 2 * np.pi / 4096


def columns(log: Log) -> dict[str, np.ndarray]:
    return {"t": log.t, "q1": log.q1, "q2": log.q2, "u": log.u}


def bent(q: np.ndarray, size: float, *rows: int) -> np.ndarray:
    """The angle with `size` [rad] more in some rows."""
    q = q.copy()
    q[list(rows)] += size
    return q


@pytest.mark.parametrize("size", [0.05, -0.5, 3.0])
def test_one_reading_that_stands_out_is_told_when_the_log_is_read(tmp_path, size: float) -> None:
    log, _ = paper_log()
    path = csv(tmp_path, columns(log), q2=bent(log.q2, size, 2500))
    said = warned(path)
    assert f"one reading of q2 at t = 5 s ({abs(size):.2g} rad from its neighbours) stands out" in said
    assert "--cut 4.999:5.001" in said


def test_what_stands_out_is_gone_with_the_cut_that_the_message_names(tmp_path) -> None:
    log, _ = paper_log()
    cut = log.taken(np.arange(len(log)) != 2500)
    assert jumps(log.t, bent(log.q2, 0.5, 2500)) == [Jump(2500, pytest.approx(0.5, abs=0.005), 2501)]
    assert jumps(cut.t, cut.q2) == []


def test_counts_that_are_lost_in_a_log_are_told(tmp_path) -> None:
    log, _ = paper_log()
    lost = log.q2 + 40 * _COUNT * (log.t >= 5.0)
    said = warned(csv(tmp_path, columns(log), q2=lost))
    assert "q2 jumps by 0.06" in said
    assert "at t = 5 s and the angle stays there: lost counts" in said
    assert "--cut 5:9.998" in said


def test_at_most_three_places_are_named(tmp_path) -> None:
    log, _ = paper_log()
    said = warned(csv(tmp_path, columns(log), q1=bent(log.q1, 0.4, 500, 1500, 2500, 3500, 4500)))
    assert said.count("reading of q1") == 3
    assert "and 2 more places, stand out" in said


def test_init_tells_both(tmp_path) -> None:
    log = hanging()
    q1, q2 = bent(log.q1, 0.5, 900), log.q2 + 0.2 * (log.t >= 3.0)
    texts = [p.text + p.mend for p in propose(table(replace(log, t=log.t + 100.0), q1=q1, q2=q2)).problems]
    assert any("one reading of q1 at" in text and "--cut 10" in text for text in texts)
    assert any("q2 jumps by 0.2 rad at t = 103 s" in text for text in texts)
    assert not any("jumps" in p.text for p in propose(table(log)).problems)


def swing_up(T: float) -> tuple[np.ndarray, np.ndarray]:
    """An angle that turns to and fro with up to 30 rad/s."""
    t = np.arange(0.0, 10.0, T)
    return t, 10.0 * np.sin(3.0 * t) + 0.3 * np.sin(17.0 * t)


@pytest.mark.parametrize("T", [2e-4, 0.002, 0.01, 0.02])
@pytest.mark.parametrize("counts", [400, 4096, None])
def test_a_fast_motion_is_no_jump_however_it_is_read(T: float, counts: int | None) -> None:
    t, q = swing_up(T)
    rng = np.random.default_rng(0)
    if counts:
        q = np.round(q * counts / (2 * np.pi)) * 2 * np.pi / counts
    kept = rng.random(len(t)) > 0.05
    assert jumps(t, q, counts) == []
    assert jumps(t, q) == []
    assert jumps(t[kept], q[kept], counts) == []  # lost samples
    assert jumps(t + T * rng.uniform(-0.1, 0.1, len(t)), q, counts) == []
    assert jumps(t, q[np.arange(len(t)) // 3 * 3], counts) == []  # held over three rows
    assert jumps(t, np.remainder(q, 2 * np.pi), counts) == []


@pytest.mark.parametrize("T", [0.001, 0.01])
def test_an_end_stop_is_no_jump(T: float) -> None:
    t = np.arange(0.0, 10.0, T)
    q = np.abs(np.remainder(8.0 * t, 4.0) - 2.0)  # at 8 rad/s to and fro between two stops
    assert jumps(t, np.round(q / _COUNT) * _COUNT, 4096) == []


def test_what_moves_over_a_gap_is_no_jump() -> None:
    log, _ = paper_log()
    kept = np.ones(len(log), bool)
    kept[1000:1100] = False
    assert jumps(log.t[kept], log.q1[kept] + 0.3 * (log.t[kept] > 2.1), 4096) == []
