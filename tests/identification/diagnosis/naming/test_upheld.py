"""Names verified one by one on data that no fit saw, on landscapes whose minima are known."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from furuta_gym.plant import Effect
from identification.diagnosis.naming.fits import FitRequest
from identification.diagnosis.naming.found import Naming
from identification.diagnosis.naming.upheld import preferred, upheld
from tests.identification.diagnosis.fits import Bowls, Told, a_fit, naming, search, suspect
from tests.identification.diagnosis.silence import names_found

THREE = {
    "input_delay": -2000.0,
    "input_delay base_tilt": -3500.0,
    "base_tilt": -1400.0,
    "input_delay pendulum_stribeck": -3000.0,
    "base_tilt pendulum_stribeck": -2600.0,
    "input_delay base_tilt pendulum_stribeck": -4500.0,
}


def verified(values: dict[str, float], witness: Any, *names: str) -> Naming:
    by = search({"": 0.0, **values}, *names)
    return upheld(names_found(a_fit(), by), by, witness)


@pytest.mark.parametrize("false", [(), ("base_tilt",), ("input_delay", "base_tilt")])
def test_a_false_name_goes_and_the_right_ones_stay(false: tuple[str, ...]) -> None:
    names = ("input_delay", "base_tilt", "pendulum_stribeck")
    found = verified(THREE, Told(far_off=False, false=false), *names)
    kept = [name for name in names if name not in false]
    assert found.names == kept
    assert sorted(s.name for s in found.taken_back) == sorted(false)
    assert {e.name for e in found.final.plant.effects} == set(kept)


@pytest.mark.parametrize(("elsewhere", "kept"), [("base_tilt", True), ("input_delay", False)])
def test_a_name_of_which_held_out_data_cannot_judge_stays(elsewhere: str, kept: bool) -> None:
    witness = Told(far_off=False, false=("base_tilt",), elsewhere=(elsewhere,))
    found = verified(THREE, witness, "input_delay", "base_tilt", "pendulum_stribeck")
    assert ("base_tilt" in found.names) is kept
    assert len(found.taken_back) == (not kept)


def test_of_two_that_held_out_data_speak_against_only_what_they_can_judge_goes() -> None:
    witness = Told(far_off=False, false=("input_delay", "base_tilt"), elsewhere=("input_delay",))
    found = verified(THREE, witness, "input_delay", "base_tilt", "pendulum_stribeck")
    assert found.names == ["input_delay", "pendulum_stribeck"]


DRIFTING = {
    "arm_viscous_drift": -1000.0,
    "arm_viscous_drift input_cubic_gain": -1800.0,
    "arm_viscous_drift input_cubic_gain base_tilt": -2800.0,
    "arm_viscous_drift base_tilt": -1900.0,
    "input_cubic_gain": -700.0,
    "base_tilt": -900.0,
    "input_cubic_gain base_tilt": -1700.0,
}


@pytest.mark.parametrize("same_clock", [False, True])
def test_names_are_verified_without_what_follows_the_clock_of_the_fitted_log(same_clock: bool) -> None:
    """A drift is not repeated in another log. With it in the fit, nothing that another log says is worth anything."""
    drift = "arm_viscous_drift"
    witness = Told(far_off=False, false=("input_cubic_gain",), same_clock=same_clock, spoilt=drift)
    found = verified(DRIFTING, witness, drift, "input_cubic_gain", "base_tilt")
    kept = {drift, "base_tilt"} | ({"input_cubic_gain"} if same_clock else set())
    assert {*found.names} == kept
    assert [s.name for s in found.taken_back] == ([] if same_clock else ["input_cubic_gain"])


CABLES = {
    "input_delay": -2000.0,
    "input_delay arm_taut_cable": -2225.0 - 2000.0,
    "input_delay arm_spring": -2214.0 - 2000.0,
    "input_delay arm_ripple": -1000.0 - 2000.0,
    "arm_taut_cable": -1990.0,
    "arm_spring": -1980.0,
}


@pytest.mark.parametrize(
    ("false", "kept"),
    [
        ((), ["input_delay", "arm_taut_cable"]),
        (("arm_taut_cable",), ["input_delay", "arm_spring"]),  # explains nearly as much, and carries over
        (("arm_taut_cable", "arm_spring"), ["input_delay"]),  # a ripple explains much less
    ],
)
def test_a_look_alike_that_carries_over_takes_the_place_of_a_form_that_does_not(
    false: tuple[str, ...], kept: list[str]
) -> None:
    found = verified(
        CABLES, Told(far_off=False, false=false), "input_delay", "arm_taut_cable", "arm_spring", "arm_ripple"
    )
    assert sorted(found.names) == sorted(kept)
    assert {e.name for e in found.final.plant.effects} == set(kept)
    assert found.final.value == pytest.approx(CABLES[" ".join(kept)], abs=0.1)
    assert [s.name for s in found.taken_back] == (["arm_taut_cable"] if false else [])


FORMS = ("arm_taut_cable", "arm_spring")


def test_a_look_alike_that_held_out_data_agree_with_comes_before_a_name_that_they_cannot_judge() -> None:
    witness = Told(far_off=False, false=("arm_taut_cable",), elsewhere=("arm_taut_cable",))
    found = verified(CABLES, witness, "input_delay", "arm_taut_cable", "arm_spring", "arm_ripple")
    assert sorted(found.names) == ["arm_spring", "input_delay"]


@pytest.mark.parametrize(("n", "kept"), [(1.0, "arm_spring"), (16.0, "arm_ripple")])
def test_a_ripple_of_less_than_a_period_does_not_take_the_place_of_a_spring(n: float, kept: str) -> None:
    """Held-out data would have it, but nobody can say from a part of a period that a torque repeats."""
    ripple = suspect("arm_ripple", 199.0)
    ripple = replace(ripple, fit=a_fit(Effect("arm_ripple", {"A": 0.1, "n": n, "φ": 0.0}), value=-199.0))
    spring = suspect("arm_spring", 200.0)
    found = naming(spring, final=spring.fit, rivals=((ripple,),))
    by = search({"": 0.0, "arm_spring": -200.0, "arm_ripple": -199.0})
    after = preferred(found, by, Told(needed=("arm_ripple",)))
    assert after.names == [kept]


BOTH_FORMS = ("arm_presliding", "arm_hysteresis")
FRICTION = {
    "input_delay": -2000.0,
    "arm_presliding": -150.0,
    "arm_hysteresis": -145.0,
    "input_delay arm_presliding": -2600.0,
    "input_delay arm_hysteresis": -2580.0,
}


@pytest.mark.parametrize(
    ("false", "kept"), [((), "arm_presliding"), (("arm_presliding",), "arm_hysteresis"), (BOTH_FORMS, None)]
)
def test_which_form_of_friction_that_remembers_is_right_is_for_held_out_data_to_say(
    false: tuple[str, ...], kept: str | None
) -> None:
    found = verified(FRICTION, Told(far_off=False, false=false), "input_delay", *BOTH_FORMS)
    assert sorted(found.names) == sorted(["input_delay", *([kept] if kept else [])])


@pytest.mark.parametrize("asked_for", [False, True])
def test_a_name_that_pays_nothing_beside_those_found_after_it_goes_unless_held_out_data_ask_for_it(
    asked_for: bool,
) -> None:
    """They need not speak against it: of what follows a clock they cannot."""
    names = ("input_delay", "base_tilt", "pendulum_stribeck")
    found = names_found(a_fit(), search({"": 0.0, **THREE}, *names))
    better = search({"": 0.0, **THREE, "input_delay base_tilt": -4499.0}, *names)
    left = upheld(found, better, Told(far_off=False, needed=("pendulum_stribeck",) if asked_for else ()))
    assert found.names == list(names)
    assert left.names == [*names[:2], *(["pendulum_stribeck"] if asked_for else [])]
    assert left.taken_back == ()
    assert (left.final.plant.effect("pendulum_stribeck") is not None) == asked_for


@pytest.mark.parametrize(
    ("far", "needed", "lost", "gained", "kept"),
    [
        (True, ("arm_spring",), 8.0, 10.0, "arm_spring"),  # the fitted logs do not mind, held-out data ask for it
        (False, ("arm_spring",), 8.0, 10.0, "arm_taut_cable"),  # nobody asks where predictions are good
        (True, (), 8.0, 10.0, "arm_taut_cable"),
        (True, ("arm_spring",), 12.0, 10.0, "arm_taut_cable"),  # the fitted logs mind
        (True, ("arm_spring",), 12.0, 13.0, "arm_spring"),  # … but held-out data mind the other form more
        (True, ("arm_ripple",), 8.0, 10.0, "arm_taut_cable"),  # explains much less
    ],
)
def test_held_out_data_choose_among_look_alikes(
    far: bool, needed: tuple[str, ...], lost: float, gained: float, kept: str
) -> None:
    names = ("input_delay", "arm_taut_cable", "arm_spring", "arm_ripple")
    by = search({"": 0.0, **CABLES, "input_delay arm_spring": CABLES["input_delay arm_taut_cable"] + lost}, *names)
    found = preferred(names_found(a_fit(), by), by, Told(far_off=far, needed=needed, by=gained))
    assert found.names == ["input_delay", kept]
    assert {e.name for e in found.final.plant.effects} == {"input_delay", kept}
    assert found.found[1].suspect.fit is found.final
    assert found.taken_back == ()


@pytest.mark.parametrize(
    ("far", "share", "gained", "kept"),
    [
        (True, 0.54, 1100.0, "arm_spring"),
        (True, 0.54, 900.0, "arm_taut_cable"),  # the fitted logs mind more
        (True, 0.2, 5000.0, "arm_taut_cable"),  # too little to be fitted at all
        (False, 0.54, 1100.0, "arm_taut_cable"),  # predictions are a little off
    ],
)
def test_of_predictions_that_are_far_off_any_look_alike_is_asked(
    far: bool, share: float, gained: float, kept: str
) -> None:
    """A taut cable fits the searched angles of a stiffening one, and pulls far too hard beyond them."""
    both = CABLES["input_delay arm_taut_cable"]
    alone = CABLES["input_delay"]
    by = search({"": 0.0, **CABLES, "input_delay arm_spring": alone + share * (both - alone)}, "input_delay", *FORMS)
    witness = Told(far_off=far, a_little_off=True, needed=("arm_spring",), by=gained)
    found = preferred(names_found(a_fit(), by), by, witness)
    assert found.names == ["input_delay", kept]


@dataclass(frozen=True)
class Rough(Bowls):
    """Quick fits end 150 nats above the bottom, and believe to have arrived."""

    efforts: list[tuple[str, str]] = field(default_factory=list)

    def __call__(self, request: FitRequest) -> Any:
        self.efforts.append((" ".join(e.name for e in request.plant.effects), request.effort))
        fitted = super().__call__(request)
        return replace(fitted, value=fitted.value + 150.0) if request.effort == "quick" else fitted


@pytest.mark.parametrize(("needed", "kept"), [(("arm_spring",), "arm_spring"), ((), "arm_taut_cable")])
def test_what_held_out_data_may_prefer_is_judged_by_a_fit_to_the_end(needed: tuple[str, ...], kept: str) -> None:
    """They ask for it by 1100 nats, and the fitted logs mind 1020: a rough fit would say 1170."""
    both, beside = CABLES["input_delay arm_taut_cable"], "input_delay arm_spring"
    by = search({"": 0.0, **CABLES, beside: both + 1020.0}, "input_delay", *FORMS)
    found = names_found(a_fit(), by)
    fitter = Rough({"": 0.0, **CABLES, beside: both + 1020.0})
    after = preferred(found, replace(by, fitter=fitter), Told(needed=needed, by=1100.0))
    assert after.names == ["input_delay", kept]
    asked = [effort for names, effort in fitter.efforts if set(names.split()) == set(beside.split())]
    assert asked == ["quick", *(["full"] if needed else [])]
    if needed:
        assert after.final.value == pytest.approx(both + 1020.0, abs=0.1)
        assert after.found[1].suspect.gain == pytest.approx(found.found[1].suspect.gain - 1020.0, abs=0.1)


def test_held_out_data_are_not_asked_where_nothing_else_may_be_named() -> None:
    class Asked(Told):
        def off(self, fitted: Any) -> bool:
            pytest.fail("predictions cost seconds")

    by = search({"": 0.0, **THREE}, "input_delay", "base_tilt", "pendulum_stribeck")
    found = names_found(a_fit(), by)
    assert preferred(found, by, Asked()) is found


def test_what_describes_the_law_of_a_name_describes_that_of_its_look_alike() -> None:
    """Else it became an effect of its own, and a false name."""
    names = ("input_delay", "arm_taut_cable", "arm_spring")
    near = {"input_delay arm_spring": CABLES["input_delay arm_taut_cable"] + 8.0}
    by = search({"": 0.0, **CABLES, **near}, *names)
    found = replace(names_found(a_fit(), by), laws={"input_delay": "arm_taut_cable"})
    exchanged = preferred(found, by, Told(needed=("arm_spring",)))
    assert exchanged.names == ["input_delay", "arm_spring"]
    assert exchanged.describes("input_delay") == "arm_spring"
    assert [s.name for s in exchanged.own] == ["arm_spring"]


STOP = {
    "arm_spring": -500.0,
    "arm_hysteresis": -60.0,
    "input_delay": -300.0,
    "arm_spring input_delay": -900.0,
    "arm_hysteresis input_delay": -1000.0,
    "arm_spring arm_hysteresis input_delay": -1004.0,
}
CONTESTED = STOP | {"arm_hysteresis": -300.0}


@pytest.mark.parametrize("values", [STOP, CONTESTED], ids=["superfluous", "contested"])
@pytest.mark.parametrize(("gained", "kept"), [(90.0, "arm_hysteresis"), (110.0, "arm_spring")])
def test_what_went_when_another_joined_is_asked_again(values: dict[str, float], gained: float, kept: str) -> None:
    """A stop that hardly slips is a spring: beside it a spring has nothing left to explain. Neither is declared a
    look-alike of the other, as a rig has both."""
    found = names_found(a_fit(), by := search({"": 0.0, **values}, "arm_spring", "input_delay", "arm_hysteresis"))
    assert {*found.names} == {"input_delay", "arm_hysteresis"}
    assert [s.name for s in found.went["arm_hysteresis"]] == ["arm_spring"]
    exchanged = preferred(found, by, Told(needed=("arm_spring",), by=gained))
    assert {*exchanged.names} == {"input_delay", kept}
    assert {e.name for e in exchanged.final.plant.effects} == {"input_delay", kept}
