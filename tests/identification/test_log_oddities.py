"""What is odd about a file and yet right: comments that look like metadata, very fine and very coarse encoders."""

from __future__ import annotations

import numpy as np
import pytest

from identification.logs import LogWarning, read_log
from tests.identification.rigs import paper_log
from tests.identification.test_log_errors import csv, warned


@pytest.mark.parametrize(
    "comment", ["2024-05-01 12:33:05", "12:30 started", "1. channel: arm", ": nothing", "t: seconds", "q1: the arm"]
)
def test_a_comment_that_only_looks_like_metadata_is_harmless(tmp_path, comment):
    log = read_log(csv(tmp_path, head=f"# {comment}\n"))
    assert len(log.metadata) <= 1
    assert all(key.isidentifier() for key in log.metadata)


def test_known_facts_may_be_written_with_blanks(tmp_path):
    log = read_log(csv(tmp_path, head="# encoder counts: 4096\n# input unit: Nm\n"))
    assert log.encoder_counts == (4096, 4096)
    assert log.input_unit == "N·m"


@pytest.mark.parametrize("declared", [None, 20000])
def test_fine_encoders_in_degrees_are_believed_and_unwrapped(tmp_path, declared):
    """5000 lines, all four edges; hanging zero, so that balancing wraps at ±180°."""
    log, _ = paper_log(counts=20000)
    hanging = np.rad2deg(np.remainder(log.q2, 2 * np.pi)) - 180.0  # 0 where the pendulum hangs
    table = {"t": log.t, "q1": np.rad2deg(log.q1), "q2": hanging, "u": log.u}
    with pytest.warns(LogWarning, match="Taken as a wrapped encoder"):
        read = read_log(csv(tmp_path, table), unit="deg", pendulum_zero="hanging", encoder_counts=declared)
    assert np.ptp(read.q2) == pytest.approx(np.ptp(log.q2), abs=1e-6)


def test_coarse_encoders_in_radians_are_believed_where_they_are_declared(tmp_path):
    log, _ = paper_log(counts=300)
    table = {"t": log.t, "q1": log.q1, "q2": log.q2, "u": log.u}
    assert "looks like degrees" in warned(csv(tmp_path, table))
    assert "looks like degrees" not in warned(csv(tmp_path, table), encoder_counts=300)
