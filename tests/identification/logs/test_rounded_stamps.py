"""Stamps of an even clock that are rounded coarsely, and clocks that lose samples."""

from __future__ import annotations

import numpy as np
import pytest

from identification.logs.checks import LogWarning
from identification.logs.gaps import evened, gaps
from identification.logs.mapping import map_table
from identification.logs.reading import read_log
from identification.logs.rig_mapping import RigMapping
from tests.factories import paper_log

from .test_proposal import table


@pytest.mark.parametrize("rate", [800.0, 667.0, 400.0, 300.0, 130.0])
@pytest.mark.parametrize("floor", [False, True])
def test_milliseconds_of_an_even_clock_are_evened(rate: float, floor: bool) -> None:
    true = np.arange(3000) / rate
    stamps = (np.floor if floor else np.round)(1e3 * true) / 1e3
    found = evened(stamps)
    assert found is not stamps
    assert np.diff(found) == pytest.approx(1.0 / rate, rel=1e-3)
    assert np.abs(found - stamps).max() < 1.1e-3
    assert not gaps(found).any()


@pytest.mark.parametrize("lost", [1, 10, 60])
def test_rounded_stamps_of_a_clock_that_lost_samples_are_evened_part_by_part(lost: int) -> None:
    rng = np.random.default_rng(lost)
    true = np.delete(np.arange(6000) / 400.0, rng.choice(np.arange(20, 5980, 20), lost, replace=False))
    stamps = np.round(1e3 * true) / 1e3
    found = evened(stamps)
    assert found is not stamps
    assert np.abs(found - true - np.mean(found - true)).max() < 6e-4
    assert gaps(found).sum() == lost
    assert (np.diff(found) > 0.0).all()


@pytest.mark.parametrize("lost", [1, 5, 12, 40, 300])
def test_a_clock_that_lost_samples_keeps_its_stamps(lost: int) -> None:
    rng = np.random.default_rng(lost)
    t = np.delete(0.002 * np.arange(5000), rng.choice(np.arange(1, 4999), lost, replace=False))
    assert evened(t) is t
    assert 0 < gaps(t).sum() <= lost


@pytest.mark.parametrize("every", [20, 128, 512])
def test_a_logger_that_pauses_regularly_loses_samples(every: int) -> None:
    """As one that writes a block to a card: nothing is rounded there."""
    k = np.arange(8000)
    t = 0.001 * k[k % every != every - 1]
    assert evened(t) is t
    assert gaps(t).sum() == pytest.approx(8000 / every, abs=1)


def test_other_clocks_are_left_alone() -> None:
    even = 0.002 * np.arange(500)
    assert evened(even) is even
    jittering = np.sort(even + np.random.default_rng(0).normal(size=500) * 2e-4)
    assert evened(jittering) is jittering
    fine = np.round(np.arange(500) / 300.0, 6)
    assert evened(fine) is fine


def test_a_log_stamped_in_milliseconds_at_800_hz_is_read(tmp_path) -> None:
    log = paper_log(1.25e-3, 5.0)[0]
    file = tmp_path / "log.csv"
    rows = np.c_[np.floor(1e3 * log.t) / 1e3, log.q1, log.q2, log.u]
    np.savetxt(file, rows, delimiter=",", header="t,q1,q2,u", comments="", fmt="%.6f")
    with pytest.warns(LogWarning, match=r"is rounded, by up to .* ms. Without that it is an even clock of 1\.25 ms"):
        found = read_log(file, encoder_counts=4096)
    assert found.sample_time == pytest.approx(1.25e-3, rel=1e-4)
    assert not gaps(found.t).any()
    assert np.allclose(found.q2, log.q2, atol=1e-5)


def test_columns_that_are_read_are_those_that_are_checked() -> None:
    """Beside t, q1, q2 and u, columns of other names and units are nobody's business."""
    from identification.logs.proposal import propose

    log = paper_log(0.005, 8.0)[0]
    source = table(log, timestamp=1.7e12 + 1e3 * log.t, theta=np.rad2deg(log.q1), alpha=np.rad2deg(log.q2))
    found = propose([source], RigMapping(), assumed=True)
    assert not found.fatal
    assert not found.problems
    assert {ours: found.mapping.columns[ours] for ours in ("t", "q1", "q2", "u")} == {
        c: c for c in ("t", "q1", "q2", "u")
    }
    mapped = map_table(source, RigMapping())
    assert mapped.signals["t"][1] == pytest.approx(0.005)
