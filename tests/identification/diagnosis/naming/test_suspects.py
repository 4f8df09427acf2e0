"""Which effects are worth a fit, what they cost, and when a small one counts beside a large one."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from furuta_gym.plant import TABLE_3
from identification.diagnosis.naming.scores import Score
from identification.diagnosis.naming.search import Search
from identification.diagnosis.naming.suspects import price, shortlist, slight_beside
from identification.diagnosis.policy import DecisionPolicy
from identification.estimation.prediction_error import quietest
from identification.kalman.noise_model import Noise
from tests.identification.diagnosis.fits import RECORD, Scores, a_fit, suspect

POLICY = DecisionPolicy()


def test_a_frequency_and_an_instant_cost_more_than_a_size() -> None:
    n = math.log(20_000)
    assert price("input_offset", 20_000) == pytest.approx(0.5 * n)
    assert price("periodic_torque", 20_000) == pytest.approx(2.5 * n)  # Djuric 1998: 5/2 ln N for a sinusoid
    assert price("payload_step", 20_000) == pytest.approx(1.5 * n)


@pytest.mark.parametrize(("share", "is_slight"), [(0.15, True), (0.3, False)])
def test_a_further_effect_must_explain_its_share(share: float, is_slight: bool) -> None:
    drag, offset = (suspect("pendulum_quadratic_drag", 1000.0),), (suspect("input_offset", 30.0),)
    beside = ("pendulum_quadratic_drag",) if is_slight else ()
    assert slight_beside("input_delay", share * 1000.0, [drag], POLICY) == beside
    assert slight_beside("input_delay", share * 1000.0, [offset, drag], POLICY) == beside
    assert slight_beside("input_delay", 15.0, [], POLICY) == ()


@pytest.mark.parametrize(("share", "is_slight"), [(0.35, True), (0.7, False)])
def test_a_look_alike_must_explain_half(share: float, is_slight: bool) -> None:
    """Two lags in series, fitted as one, leave what looks like a delay. The other share does not matter here."""
    lag = (suspect("actuator_lag", 1000.0),)
    beside = ("actuator_lag",) if is_slight else ()
    assert slight_beside("input_delay", share * 1000.0, [lag], POLICY) == beside
    assert slight_beside("input_delay", share * 1000.0, [lag], POLICY, share=0.01) == beside


def test_another_policy_decides_otherwise() -> None:
    drag = (suspect("pendulum_quadratic_drag", 1000.0),)
    assert not slight_beside("input_delay", 150.0, [drag], replace(POLICY, own_share=0.1))


def table(gains: dict[str, float]) -> dict[str, Score]:
    return {n: Score(n, g, TABLE_3.default_effect(n), 0.0) for n, g in gains.items()}


def test_the_short_list_is_near_the_best_and_above_the_price() -> None:
    near = {"input_delay": 100.0, "pendulum_stribeck": 25.0, "input_cubic_gain": 10.0}  # 0.15 of the best is the limit
    assert shortlist(table(near), 20_000, 0.5, POLICY) == ["input_delay", "pendulum_stribeck"]
    cheap = price("input_offset", 20_000)
    assert shortlist(table({"input_offset": 0.35 * cheap}), 20_000, 0.5, POLICY) == []
    assert shortlist(table({"input_offset": 0.7 * cheap}), 20_000, 0.5, POLICY) == ["input_offset"]


def test_the_short_list_holds_the_best_six_and_the_look_alikes_of_three() -> None:
    names = ["input_offset", "input_delay", "input_dead_zone", "arm_spring", "pendulum_stribeck", "arm_viscous_drift"]
    gains = {name: 200.0 - i for i, name in enumerate([*names, "base_tilt"])}
    gains |= {"actuator_lag": 20.0, "pendulum_quadratic_drag": 20.0}  # of the second and of the fifth
    assert shortlist(table(gains), 20_000, 0.5, POLICY) == [*names, "actuator_lag"]


def suspected(scorer: Scores, noise: float, found: int = 0, *effects: str) -> list[str]:
    """Names that a search suspects where the torque noise is a multiple of the least."""
    current: Any = a_fit(*effects)
    least = quietest(current.plant, (RECORD,))
    current = replace(current, noise=Noise(noise * least))
    return Search(TABLE_3, scorer=scorer).suspects(current, found)[0]


def test_a_further_effect_needs_a_better_score_than_a_first() -> None:
    one = price("input_delay", 1000)
    for times, first, further in ((0.35, False, False), (0.7, True, False), (1.1, True, False), (2.1, True, True)):
        scorer = Scores({"input_delay": times * one})
        assert (suspected(scorer, 1.0) == ["input_delay"]) is first
        assert (suspected(scorer, 1.0, 1, "arm_spring") == ["input_delay"]) is further


@pytest.mark.parametrize(
    ("noise", "gain", "looked_again"),
    [
        (14.0, 5.0, True),
        (7.0, 5.0, False),  # little noise hides nothing
        (14.0, 10.0, True),
        (14.0, 17.0, False),  # what is suspected convinces by itself: a price of 3.5 and 10 nats
    ],
)
def test_where_noise_may_hide_an_effect_the_scores_at_less_noise_choose_too(
    noise: float, gain: float, looked_again: bool
) -> None:
    scorer = Scores({"input_delay": gain, "input_offset": 0.1}, quiet={"input_offset": 1000.0, "input_delay": 0.0})
    assert suspected(scorer, noise) == ["input_delay", *(["input_offset"] if looked_again else [])]


def test_what_no_score_can_suspect_is_fitted_where_something_is_missing() -> None:
    """A play before sliding changes nothing to first order."""
    assert suspected(Scores({"input_delay": 50.0, "arm_presliding": 0.0}), 1.0) == ["input_delay", "arm_presliding"]
    assert suspected(Scores({"input_delay": 0.0, "arm_presliding": 0.0}), 1.0) == []


def test_a_filter_that_is_lost_at_less_noise_ends_no_search() -> None:
    def scorer(current: Any, only: Any, quieter: float = 1.0, policy: Any = None) -> dict[str, Any]:
        if quieter < 1.0:
            raise ValueError("the filter diverges at the fitted model; the fit has not converged")
        return Scores({"input_delay": 5.0})(current, only, policy=policy)

    assert suspected(scorer, 14.0) == ["input_delay"]  # type: ignore[arg-type]
