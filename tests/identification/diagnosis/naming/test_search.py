"""How suspects are fitted and fitted again, on a landscape whose minima are known: whose name stands in the end."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Effect, Plant
from identification.diagnosis.naming.fits import FitRequest
from identification.diagnosis.naming.scores import Score
from identification.diagnosis.naming.search import Search
from identification.diagnosis.naming.suspects import Ranking, Suspect, price
from tests.identification.diagnosis.fits import PER_PARAMETER, SAMPLES, Bowl, Bowls, Scores, a_fit, ranked, search
from tests.identification.diagnosis.silence import names_found


def ranking_of(by: Search, current: Any, *names: str, **more: Any) -> Ranking:
    return by.refits(current, names, by.scorer(current, names), **more)[1]


def best_of(by: Search, current: Any, *names: str, **more: Any) -> tuple[str, float]:
    best = ranking_of(by, current, *names, **more)[0]
    return best.name, best.fit.value


def nobody_asks(without: Any, fitted: Any, beside: Any) -> bool:
    return False


STUCK = [Bowl(50.0, x=1.0), Bowl(5.0, x=-1.5)]  # from 1, and from the anchor's θ, only the first is reached


def test_a_suspect_that_is_stuck_finds_its_way_from_the_bests_parameters() -> None:
    """The right name must not lose to a look-alike that happened to find the right θ."""
    by = search({"": Bowl(100.0, x=1.0), "arm_spring": STUCK, "arm_ripple": Bowl(20.0, x=-1.5)})
    by = replace(by, scorer=Scores({"arm_spring": 50.0, "arm_ripple": 40.0}))
    ranking = ranking_of(by, a_fit(value=100.0, x=1.0), "arm_spring", "arm_ripple")
    assert [s.name for s in ranking] == ["arm_spring", "arm_ripple"]
    assert ranking[0].gain == pytest.approx(95.0, abs=0.1)
    assert ranking[0].net == pytest.approx(95.0 - 2 * PER_PARAMETER, abs=0.1)
    assert ranking[1].gain == pytest.approx(80.0, abs=0.1)
    assert (ranking[0].score, ranking[1].score) == (50.0, 40.0)
    alone = search({"": Bowl(100.0, x=1.0), "arm_spring": STUCK}, "arm_spring")
    assert best_of(alone, a_fit(value=100.0, x=1.0), "arm_spring")[1] == pytest.approx(50.0, abs=0.05)


@dataclass(frozen=True)
class Ripples(Scores):
    """The ripple starts at n periods a turn."""

    n: float = 4.0

    def __call__(self, *asked: Any, **more: Any) -> dict[str, Score]:
        table = super().__call__(*asked, **more)
        ripple = Effect("arm_ripple", TABLE_3.default_effect("arm_ripple").parameters | {"n": self.n})
        return table | {"arm_ripple": replace(table["arm_ripple"], start=ripple)}


@pytest.mark.parametrize(
    ("cable", "n", "first"),
    [
        (15.0, 4.0, "arm_cable"),  # 985 of 1000 nats, and half a period of the ripple
        (25.0, 4.0, "arm_ripple"),  # 975: the ripple explains something else
        (15.0, 16.0, "arm_ripple"),  # two periods
    ],
)
def test_a_cable_comes_before_a_ripple_that_is_not_seen_to_repeat(cable: float, n: float, first: str) -> None:
    by = search({"": 1000.0, "arm_cable": cable, "arm_ripple": 0.0, "input_offset": 500.0})
    by = replace(by, scorer=Ripples({"arm_cable": 400.0, "arm_ripple": 500.0, "input_offset": 400.0}, n=n))
    ranking = ranking_of(by, a_fit(value=1000.0), "arm_cable", "arm_ripple", "input_offset")
    assert ranking[0].name == first
    assert sorted(s.name for s in ranking) == ["arm_cable", "arm_ripple", "input_offset"]
    assert ranking[0].gain == pytest.approx(1000.0 - ranking[0].fit.value)
    naming = names_found(a_fit(value=1000.0), by, most=1)
    assert naming.names == [first]
    (effect,) = naming.found
    assert effect.equals == (("arm_ripple",) if first == "arm_cable" else ()), "it explains no less"


def test_a_look_alike_far_behind_is_tried_with_other_whole_numbers() -> None:
    """A ripple of ten periods whose score chose four: no descent would ever come there."""

    def still(plant: Plant) -> float:
        ripple = plant.effect("arm_ripple")
        return 20.0 * abs(ripple.parameters["n"] - 10.0) if ripple else 0.0

    by = search({"": 1000.0, "arm_taut_cable": 60.0, "arm_ripple": 0.0}, still=still)
    by = replace(by, scorer=Ripples({"arm_taut_cable": 400.0, "arm_ripple": 500.0}, n=4.0))
    first = ranking_of(by, a_fit(value=1000.0), "arm_taut_cable", "arm_ripple")[0]
    assert first.name == "arm_ripple"
    ripple = first.fit.plant.effect("arm_ripple")
    assert ripple is not None
    assert ripple.parameters["n"] == 10.0


def test_a_best_that_is_overtaken_follows_from_the_new_bests_parameters() -> None:
    """Ripple, spring, ripple: it ends only when the best stays the best."""
    ripple = [Bowl(20.0, x=-1.5), Bowl(1.0, x=-3.5)]
    spring = [Bowl(50.0, x=1.0), Bowl(5.0, x=-3.5)]
    by = search({"": Bowl(100.0, x=1.0), "arm_spring": spring, "arm_ripple": ripple}, "arm_spring", "arm_ripple")
    assert best_of(by, a_fit(value=100.0, x=1.0), "arm_spring", "arm_ripple") == (
        "arm_ripple",
        pytest.approx(1.0, abs=0.05),
    )


class Heard(Bowls):
    """Keeps where coarse fits start: the change of ln θ9."""

    starts: ClassVar[list[float]] = []

    def __call__(self, request: FitRequest) -> Any:
        if request.effort == "coarse":
            self.starts.append(float(np.log(request.plant.theta[8] / TABLE_3.theta[8])))
        return super().__call__(request)


def test_rivals_of_a_name_that_is_reconsidered_start_at_its_parameters() -> None:
    """And none at the model without it, whose θ is far off."""
    by_effects = {"": 1000.0, "arm_spring": 0.0, "arm_ripple": 50.0}
    by = replace(search(by_effects), fitter=Heard(by_effects))
    Heard.starts.clear()
    table = {"arm_ripple": Score("arm_ripple", 900.0, TABLE_3.default_effect("arm_ripple"), 0.0)}
    held, without = a_fit("arm_spring", value=0.0), a_fit(value=1000.0, x=5.0)
    _, ranking = by.refits(without, list(table), table, held=held, effort="full")
    assert [s.name for s in ranking] == ["arm_spring", "arm_ripple"]
    assert Heard.starts
    assert max(Heard.starts) < 1.0


class Stalling(Bowls):
    """A descent ends in the bowl it starts in, and only restarts find the lowest: a valley of the pendulum's scale."""

    def __call__(self, request: FitRequest) -> Any:
        fitted = super().__call__(request)
        lowest = min(self.bowls([e.name for e in request.plant.effects]), key=lambda bowl: bowl.value)
        if request.effort != "restarted" or fitted.value < lowest.value + 1.0:
            return fitted
        theta = TABLE_3.theta * np.exp([*8 * [0.0], lowest.x])
        return super().__call__(replace(request, plant=request.plant.replace(theta=theta)))


def stalling(by_effects: dict[str, Any], *names: str) -> Search:
    return replace(search(by_effects, *names), fitter=Stalling(by_effects))


def test_the_best_suspect_is_restarted_where_its_fit_may_have_stalled() -> None:
    """380 nats below the optimum, and said to have converged."""
    spring = [Bowl(50.0, x=1.0), Bowl(-330.0, x=-9.0)]
    by = stalling({"": Bowl(100.0, x=1.0), "arm_spring": spring}, "arm_spring")
    assert best_of(by, a_fit(value=100.0, x=1.0), "arm_spring") == ("arm_spring", pytest.approx(-330.0, abs=0.1))


def test_the_right_name_is_found_from_the_parameters_of_a_best_that_was_restarted() -> None:
    """The ripple leads, and its restart arrives at θ from which the cable is better: 183 nats on a rig of its own."""
    by_effects = {
        "": Bowl(1000.0, x=1.0),
        "arm_ripple": [Bowl(20.0, x=1.0), Bowl(-100.0, x=-9.0)],
        "arm_spring": [Bowl(50.0, x=1.0), Bowl(-283.0, x=-9.0)],
    }
    by = stalling(by_effects, "arm_spring", "arm_ripple")
    best = best_of(by, a_fit(value=1000.0, x=1.0), "arm_spring", "arm_ripple")
    assert best == ("arm_spring", pytest.approx(-283.0, abs=0.1))


LARGE = [Bowl(0.0), Bowl(-300.0, sizes={"input_delay": 3.0})]


@pytest.mark.parametrize(
    ("others", "delay", "thorough", "winner"),
    [
        (-60.0, 0.0, False, "arm_spring"),  # what is behind is left where it is
        (-60.0, 0.0, True, "input_delay"),
        (17.0, 24.0, False, "arm_spring"),  # 17 nats worse than without any: may be a rough likelihood
        (35.0, 38.0, False, "input_delay"),  # 35: all of them went astray
    ],
)
def test_other_sizes_are_tried_of_all_where_all_went_astray(
    others: float, delay: float, thorough: bool, winner: str
) -> None:
    """The delay's good minimum is at three times its suggested size."""
    bowls = {"arm_spring": others, "input_delay": [Bowl(delay), LARGE[1]]}
    by = replace(search({"": 0.0, **bowls}), scorer=Scores(dict.fromkeys(bowls, 40.0)))
    assert ranking_of(by, a_fit(), *bowls, thorough=thorough)[0].name == winner


@pytest.mark.parametrize(("first", "left", "tried"), [(-3.0, False, False), (-3.0, True, True), (-40.0, False, True)])
def test_where_nothing_is_left_other_sizes_are_tried_of_what_pays_its_price_only(
    first: float, left: bool, tried: bool
) -> None:
    """The spring has a deep minimum at three times its suggested size. A spring that explains as much leaves nothing
    and pays its price at once; one of 3 nats is worth a second look only while something is left."""
    spring = [Bowl(first), Bowl(-300.0, sizes={"arm_spring": 3.0})]
    by = search({"": 0.0, "arm_spring": spring}, "arm_spring")
    found = ranking_of(by, a_fit(), "arm_spring", nothing_left=not left)
    assert (found[0].gain > 200.0) is tried


def test_the_best_suspects_are_fitted_to_the_end_unless_they_gain_too_little() -> None:
    slow = Bowl(-400.0, x=1.0, rate=0.97)  # an end that eight rounds of four do not reach
    by = search({"": 0.0, "arm_spring": slow}, "arm_spring")
    assert (
        best_of(by, a_fit(), "arm_spring")[1]
        < best_of(by, a_fit(), "arm_spring", worth=lambda gain: gain > 1000.0)[1] - 1e-6
    )


def test_the_model_without_any_is_fitted_again_from_the_bests_parameters() -> None:
    """Or an effect would be credited with what θ can do."""
    without = [Bowl(100.0, x=1.0), Bowl(60.0, x=-0.5)]
    by = search({"": without, "arm_spring": Bowl(0.0, x=-0.5)}, "arm_spring")
    current, ranking = by.refits(a_fit(value=100.0, x=1.0), ["arm_spring"], by.scorer(a_fit(), None))
    assert current.value == pytest.approx(60.0, abs=0.1)
    assert ranking[0].gain == pytest.approx(60.0, abs=0.1)


def test_nothing_suspected_is_nothing_fitted() -> None:
    current = a_fit()
    assert search({"": 0.0}).refits(current, [], {}) == (current, ())


TWO = {"": 1500.0, "base_tilt": 100.0, "pendulum_coulomb_asymmetry": 900.0, "input_offset": 700.0}
TILT = {"base_tilt pendulum_coulomb_asymmetry": 60.0, "input_offset pendulum_coulomb_asymmetry": -300.0}


@pytest.mark.parametrize(("share", "exchanged"), [(0.2, False), (0.45, True)])
def test_a_name_that_stood_in_for_two_is_exchanged_if_it_was_contested(share: float, exchanged: bool) -> None:
    """base_tilt explains an offset and an asymmetry alone, somewhat; beside the asymmetry the offset does better."""
    by = search(TWO | TILT, "base_tilt", "input_offset")
    net = 1400.0 - 3 * PER_PARAMETER
    found = [
        ranked(("base_tilt", 1400.0), ("input_offset", share * net + PER_PARAMETER), fit=a_fit("base_tilt", value=100)),
        ranked(("pendulum_coulomb_asymmetry", 250.0), fit=a_fit("base_tilt", "pendulum_coulomb_asymmetry", value=60.0)),
    ]
    again = by.reconsidered(found, nobody_asks)
    first, value = ("input_offset", -300.0) if exchanged else ("base_tilt", 60.0)
    assert [ranking[0].name for ranking in again] == [first, "pendulum_coulomb_asymmetry"]
    assert again[1][0].fit.value == pytest.approx(value, abs=0.05)
    assert {e.name for e in again[1][0].fit.plant.effects} == {first, "pendulum_coulomb_asymmetry"}
    if exchanged:
        assert again[1][0].gain == pytest.approx(1000.0, abs=0.1), "beside the new name, not the old"


@pytest.mark.parametrize(("n", "first"), [(4.0, "arm_cable"), (16.0, "arm_ripple")])
def test_a_cable_is_contested_later_by_a_ripple_that_repeats_only(n: float, first: str) -> None:
    """Beside the delay the ripple explains 200 nats more; of four periods a turn the arm passes half a one."""
    by_effects = {"": 2000.0, "arm_cable": 1000.0, "arm_ripple": 1100.0, "input_delay": 1000.0}
    by = search(by_effects | {"arm_cable input_delay": 200.0, "arm_ripple input_delay": 0.0})
    ripple = Effect("arm_ripple", {"A": 0.5, "n": n, "φ": 0.5})
    rival = Suspect("arm_ripple", 900.0, 900.0 - price("arm_ripple", SAMPLES), a_fit(ripple, value=1100.0))
    found = [
        (*ranked(("arm_cable", 1000.0), fit=a_fit("arm_cable", value=1000.0)), rival),
        ranked(("input_delay", 800.0), fit=a_fit("arm_cable", "input_delay", value=200.0)),
    ]
    assert [ranking[0].name for ranking in by.reconsidered(found, nobody_asks)] == [first, "input_delay"]


@pytest.mark.parametrize(("net", "stays"), [(7.0, False), (14.0, True)])
def test_what_the_last_effect_makes_superfluous_goes(net: float, stays: bool) -> None:
    """A ripple of 20 nats (its share is not asked here) beside a stiction."""
    gain = net + 3 * PER_PARAMETER
    by = search({"": 100.0, "arm_ripple": 40.0, "pendulum_stribeck": gain, "arm_ripple pendulum_stribeck": 0.0})
    found = [
        ranked(("arm_ripple", 60.0), fit=a_fit("arm_ripple", value=40.0)),
        ranked(("pendulum_stribeck", 40.0), fit=a_fit("arm_ripple", "pendulum_stribeck", value=0.0)),
    ]
    names = [ranking[0].name for ranking in by.reconsidered(found, nobody_asks)]
    assert names == [*(["arm_ripple"] if stays else []), "pendulum_stribeck"]


def test_what_the_last_effect_leaves_little_for_goes() -> None:
    """A delay beside a ripple stood in for the saturation that was found next: 38 nats remain to it."""
    names = ("arm_ripple", "input_delay", "input_saturation")
    by = search({"": 1400.0, "arm_ripple input_saturation": -1162.0, " ".join(names): -1200.0})
    found = [
        ranked(("arm_ripple", 1180.0), fit=a_fit("arm_ripple", value=100.0)),
        ranked(("input_delay", 400.0), fit=a_fit("arm_ripple", "input_delay", value=-300.0)),
        ranked(("input_saturation", 880.0), fit=a_fit(*names, value=-1200.0)),
    ]
    again = by.reconsidered(found, nobody_asks)
    assert [ranking[0].name for ranking in again] == ["arm_ripple", "input_saturation"]
    assert [e.name for e in again[-1][0].fit.plant.effects] == ["input_saturation", "arm_ripple"]


def test_whole_numbers_of_an_earlier_effect_are_stepped_again() -> None:
    """Thirteen periods a turn were the best while the drag was missing; with it, twelve are."""

    def still(plant: Plant) -> float:
        ripple = plant.effect("arm_ripple")
        best = 12.0 if plant.effect("arm_quadratic_drag") else 13.0
        return 100.0 * abs(ripple.parameters["n"] - best) if ripple else 0.0

    thirteen = Effect("arm_ripple", {"A": 0.5, "n": 13.0, "φ": 0.5})
    by = search({"": 1000.0, "arm_ripple arm_quadratic_drag": -700.0}, still=still)
    found = [
        ranked(("arm_ripple", 900.0), fit=a_fit(thirteen, value=100.0)),
        ranked(("arm_quadratic_drag", 700.0), fit=a_fit(thirteen, "arm_quadratic_drag", value=-600.0)),
    ]
    again = by.reconsidered(found, nobody_asks)
    assert [ranking[0].name for ranking in again] == ["arm_ripple", "arm_quadratic_drag"]
    ripple = again[-1][0].fit.plant.effect("arm_ripple")
    assert ripple.parameters["n"] == 12.0
    assert again[-1][0].fit.value == pytest.approx(-700.0)
    assert again[-1][0].gain == pytest.approx(1800.0), "twelve periods are 100 nats worse without the drag"


def test_the_search_says_what_it_fits() -> None:
    said: list[str] = []
    by = replace(search({"": 100.0, "arm_spring": 0.0}, "arm_spring", anchor=TABLE_3), progress=said.append)
    ranking_of(by, a_fit(value=100.0), "arm_spring")
    assert said[0] == "fitting arm_spring"
    assert said[-1] == "fitting the model without it"


def test_a_cable_takes_the_part_of_a_spring_that_is_dropped() -> None:
    """It starts with both their torques, where nothing is lost, and not far away with its own alone."""
    spring = Effect("arm_spring", {"k": 0.4, "q1n": 0.2})
    cable = Effect("arm_taut_cable", {"k1": 0.1, "k2": 0.6, "q1n": 0.3, "qt": 0.5})
    asked: list[Plant] = []

    def fitter(request: FitRequest) -> Any:
        asked.append(request.plant)
        return a_fit(*request.plant.effects)

    by = replace(search({"": 0.0}), fitter=fitter)
    by.reduced(a_fit(spring, cable), "arm_spring")
    (taut,) = asked[0].effects
    values = {name: pytest.approx(x) for name, x in {"k1": 0.5, "k2": 1.0, "qt": 0.5}.items()}
    assert taut.parameters == {**values, "q1n": pytest.approx(0.5 + (0.1 * -0.2 + 0.4 * -0.3) / 0.5)}
    by.reduced(a_fit(spring, cable), "arm_taut_cable")
    assert asked[-1].effects == (spring,)
