"""What a floor and a share above it say where there is hardly any gap, noise or room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.kalman.record import stretches
from identification.logs.log import Log
from identification.validation.closed_fraction import closed_fraction
from identification.validation.gap import validate
from identification.validation.noise_floor import repeats
from identification.validation.predicted import predicted
from tests.factories import loop_log, made_log
from tests.identification.diagnosis.fits import a_gap

LOG = np.zeros(200, dtype=int)


@pytest.mark.parametrize("over", [0.85, 0.9, 0.95, 1.01, 1.02])
def test_nothing_is_certain_where_there_was_no_gap(over: float) -> None:
    """Errors that are alike before and after, about as large as the floor: draws without a gap have no share of it,
    and the few others would make a narrow interval."""
    certain = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        before, after = (rng.standard_normal((200, 2)) for _ in range(2))
        sizes = 0.01 * over / np.sqrt(np.mean(before**2, axis=0))
        gaps = [replace(a_gap(), errors=sizes * e, times=0.1 * np.arange(200), log=LOG) for e in (before, after)]
        low, high = closed_fraction(*gaps).interval
        certain += low > 0.0 or high < 0.0
    assert certain <= 3  # an interval of 95 % is wrong on so many on average


def test_a_run_and_its_copy_are_no_repeated_runs() -> None:
    """Two files of one recording differ by nothing, which is no noise floor."""
    log, truth = loop_log(duration=6.0, T=0.004)
    copied = Log(log.t + 1.0, log.q1, log.q2, log.u, log.input_unit, log.encoder_counts)
    gap = validate(truth, [log, copied])
    assert not gap.repeats
    assert gap.ratio_to_floor == pytest.approx(validate(truth, log).ratio_to_floor, rel=0.05)


@pytest.mark.parametrize(("apart", "repeated"), [(0.08, True), (0.12, False)])
@pytest.mark.parametrize("axis", ["q1", "q2"])
def test_runs_from_places_that_are_not_close_are_no_repeats(axis: str, apart: float, repeated: bool) -> None:
    """Further apart than a tenth of how far the axis goes."""
    one = made_log()
    angle = getattr(one, axis).copy()
    angle[0] += apart * np.ptp(angle)
    assert repeats([one, made_log(**{axis: angle})]) == ([[0, 1]] if repeated else [])


def test_a_long_horizon_of_a_fast_clock_has_windows_in_each_part() -> None:
    """A log is predicted in parts, which must be long against the horizon."""
    log, truth = loop_log(duration=9.0, T=0.002)
    (stretch,) = stretches([log])
    found = predicted(truth, stretch, (0.5, 1.0, 1.5), longest=1000)
    assert len(found.errors) > 16
