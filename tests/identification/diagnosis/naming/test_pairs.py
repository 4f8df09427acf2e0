"""One name or two: what two effects must show to take the place of one."""

from __future__ import annotations

from typing import Any

import pytest

from identification.diagnosis.naming.pairs import two_for_one
from identification.diagnosis.naming.suspects import Ranking
from tests.identification.diagnosis.fits import PER_PARAMETER, Bowl, a_fit, search, suspect

TILT, OFFSET, ZERO = ("base_tilt", 2000.0), ("input_offset", 1000.0), ("pendulum_encoder_offset", 900.0)
BOTH = "input_offset pendulum_encoder_offset"


def ranking(*gains: tuple[str, float]) -> Ranking:
    """A ranking over a model of value 0; every suspect with its own fit."""
    return tuple(suspect(name, gain) for name, gain in gains)


def tried(both: Any, *suspects: tuple[str, float]) -> tuple[Ranking, ...] | None:
    """Two in place of a tilted base of 2000 nats; V of any two is `both`, of one what its gain says."""
    pairs = {f"{a} {b}": both for a, _ in suspects for b, _ in suspects if a < b}
    by = search({"": 0.0, "base_tilt": -2000.0, **{name: -gain for name, gain in suspects}, **pairs})
    return two_for_one(by, ranking(TILT, *suspects), a_fit())


@pytest.mark.parametrize(("more", "believed"), [(7.0, False), (14.0, True)])
def test_two_must_gain_as_much_more_as_one_must_to_be_believed(more: float, believed: bool) -> None:
    """Net: the tilt has three parameters, the two have one each."""
    two = tried(-2000.0 - more + PER_PARAMETER, OFFSET, ZERO)
    if not believed:
        assert two is None
        return
    assert two is not None
    assert {r[0].name for r in two} == {"input_offset", "pendulum_encoder_offset"}
    assert [e.name for e in two[-1][0].fit.plant.effects] == ["input_offset", "pendulum_encoder_offset"]
    gains = {r[0].name: r[0].gain for r in two}
    assert gains["input_offset"] == pytest.approx(1100.0 + more - PER_PARAMETER, abs=0.2)  # beside the other
    assert gains["pendulum_encoder_offset"] == pytest.approx(1000.0 + more - PER_PARAMETER, abs=0.2)


def test_a_pair_that_ends_far_behind_is_not_fitted_to_the_end() -> None:
    """An end that only a long descent would find is not looked for, 25 nats behind."""
    slow = Bowl(-2500.0, x=5.0, rate=0.9999)
    assert tried(slow, OFFSET, ZERO) is None
    assert tried(Bowl(-2500.0), OFFSET, ZERO) is not None


@pytest.mark.parametrize(("share", "believed"), [(0.15, False), (0.3, True)])
def test_a_slight_one_of_two_is_not_believed(share: float, believed: bool) -> None:
    """Beside each other one may have little left to explain."""
    offset = 2100.0 * (1.0 - share)
    two = two_for_one(
        search(
            {"": 0.0, "base_tilt": -2000.0, "input_offset": -offset, "pendulum_encoder_offset": -50.0, BOTH: -2100.0}
        ),
        ranking(TILT, OFFSET, ZERO),
        a_fit(),
    )
    assert (two is not None) is believed


@pytest.mark.parametrize(
    ("others", "may"),
    [
        ((OFFSET, ZERO), True),
        ((OFFSET,), False),  # nothing to go with
        ((OFFSET, ("arm_coulomb_asymmetry", 990.0)), False),  # look-alikes: the same thing twice
        ((OFFSET, ("pendulum_encoder_offset", 450.0)), False),  # too little between them
        ((("input_offset", 1990.0), ZERO), False),  # one is nearly all
        ((("input_offset", 1400.0), ("pendulum_encoder_offset", 300.0)), False),  # one is nearly nothing
    ],
)
def test_what_cannot_be_two_is_not_tried(others: Any, may: bool) -> None:
    """However well the two would do."""
    assert (tried(-2500.0, *others) is not None) is may
