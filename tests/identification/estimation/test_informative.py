"""Which stretches of a long log a fit takes, and that it says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification import Log, identify
from identification.estimation import identify as module
from identification.estimation.informative import informative
from identification.estimation.long_logs import part_of
from identification.kalman.record import stretches
from tests.factories import noisy_log


def quiet_then_lively(seconds: float = 60.0) -> Log:
    """At 4 ms, the paper's experiment again and again; of every 20 s only the third ones move much."""
    parts = []
    T, start = 0.004, 0.0
    for k in range(int(seconds / 20.0)):
        log = noisy_log(k, T=T, duration=20.0)
        scale = 1.0 if k % 3 == 2 else 0.02
        parts.append((log.t + start, scale * log.q1, scale * log.q2, scale * log.u))
        start += 20.0
    t, q1, q2, u = (np.concatenate(x) for x in zip(*parts, strict=True))
    return Log(t, q1, q2, u)


def test_the_lively_stretches_are_taken() -> None:
    log = quiet_then_lively(120.0)
    chosen = informative([log], budget=10_500)
    assert chosen is not None
    ((first, second),) = chosen.spans
    assert first == pytest.approx((40.0, 60.0), abs=0.01)
    assert second == pytest.approx((100.0, 120.0), abs=0.01)
    (taken,) = chosen.logs
    assert len(taken) == 10_000
    assert len(taken.pieces()) == 2  # prediction starts anew after what was left out
    inside = np.isin(log.t, taken.t)
    np.testing.assert_array_equal(taken.q1, log.q1[inside])


def test_short_logs_are_left_alone_and_every_log_keeps_something() -> None:
    log = quiet_then_lively(60.0)
    assert informative([log], budget=len(log)) is None
    still = replace(log, q1=0.01 * log.q1, q2=0.01 * log.q2, u=0.01 * log.u)
    chosen = informative([log, still], budget=5_500)
    assert chosen is not None
    assert [len(spans) for spans in chosen.spans] == [1, 1]


def test_a_share_of_the_samples_goes_all_along_the_log() -> None:
    log = quiet_then_lively(180.0)
    lively = informative([log], budget=15_500)
    both = informative([log], budget=15_500, spread=0.7)
    assert lively is not None
    assert both is not None
    assert [round(a) for a, _ in lively.spans[0]] == [40, 100, 160]
    early, late = (sum(a < t < b for a, b in both.spans[0]) for t in (50.0, 170.0))
    assert early == late == 1  # the best of the first half, and of the second
    assert len(both.logs[0]) == 15_000


def test_a_fit_says_what_it_took(monkeypatch: pytest.MonkeyPatch) -> None:
    """θ of the stretches is θ of the whole, within what both say of themselves."""
    first, second = (noisy_log(k, T=0.004, duration=20.0) for k in (1, 2))
    log = Log(
        np.concatenate([first.t, second.t + 21.0]),
        *(np.concatenate([getattr(x, n) for x in (first, second)]) for n in ("q1", "q2", "u")),
    )
    monkeypatch.setattr(module, "informative", lambda logs: informative(logs, budget=6_000))
    part, whole = identify(log), identify(log, every_sample=True)
    assert part.samples == 5_000
    assert whole.samples == len(log)
    assert whole.stretches == ()
    ((span,),) = part.stretches
    assert "fitted on" in str(part)
    assert "--all" in str(part)
    assert "fitted on" not in str(whole)
    assert part.plant.provenance["logs"][0]["stretches_s"] == [list(span)]
    assert part.to_dict()["stretches_s"] == [[list(span)]]
    assert np.all(np.abs(part.values - whole.values) < 4.0 * part.std)
    assert np.all(part.std > 0.9 * whole.std)


def test_long_logs_start_on_a_part_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """And end where a fit that knows of no parts ends."""
    from identification.estimation import long_logs

    log = noisy_log(3, T=0.004, duration=20.0)
    usual = identify(log)
    assert usual.problem is not None
    assert part_of(usual.problem) is None
    monkeypatch.setattr(long_logs, "LONG", 2_000)
    monkeypatch.setattr(long_logs, "PARTS", (1_000, 2_000))
    part = part_of(usual.problem, 1_000)
    assert part is not None
    assert sum(len(record.t) for record in part.records) == pytest.approx(1_000, abs=2)
    quick = identify(log)
    assert quick.log_likelihood == pytest.approx(usual.log_likelihood, abs=0.05)
    np.testing.assert_allclose(quick.values, usual.values, atol=0.1 * usual.std.max(), rtol=0.01)


def test_what_follows_the_clock_counts_from_the_recordings_start() -> None:
    log = quiet_then_lively(60.0)
    chosen = informative([log], budget=5_500)
    assert chosen is not None
    (first, *_) = stretches(chosen.logs)
    assert first.record.t[0] == pytest.approx(first.piece.t[0] - log.t[0])
    assert first.record.t[0] > 30.0


def test_stamps_may_count_from_long_ago() -> None:
    """Seconds since 1970 leave no room for a billionth of one."""
    short, long = noisy_log(0, T=0.004, duration=5.0), quiet_then_lively(60.0)
    late = [replace(log, t=log.t + 1.7e9) for log in (short, long)]
    chosen, early = informative(late, budget=8_000), informative([short, long], budget=8_000)
    assert chosen is not None
    assert early is not None
    assert [len(log) for log in chosen.logs] == [len(log) for log in early.logs]
