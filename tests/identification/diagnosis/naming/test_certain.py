"""Names whose size is not certain."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from furuta_gym.plant import TABLE_3, Effect, Plant
from furuta_gym.plant.covariance import Covariance
from identification.diagnosis.naming.certain import may_be_absent, perhaps_absent, without_absent
from identification.diagnosis.sentences import misses
from tests.identification.diagnosis.fits import POLICY, Told, a_fit, naming, search, suspect
from tests.identification.diagnosis.silence import names_found

VALUES = {
    "input_delay": -2000.0,
    "input_delay base_tilt": -3500.0,
    "base_tilt": -1400.0,
    "input_delay arm_spring": -3000.0,
    "base_tilt arm_spring": -2600.0,
    "input_delay base_tilt arm_spring": -4500.0,
}


def known(effect: Effect, spread: dict[str, float], correlation: float = 0.0) -> Plant:
    """A plant with an effect of which some parameters have error bars, all correlated alike."""
    std = np.array(list(spread.values()))
    matrix = np.outer(std, std) * (correlation + (1.0 - correlation) * np.eye(len(std)))
    names = tuple(f"{effect.name}.{p}" for p in spread)
    carried = Effect(effect.name, effect.parameters, spread)
    return TABLE_3.with_effects(carried).replace(covariance=Covariance(names, matrix))


@pytest.mark.parametrize("sigmas", [0.1, 1.9, 2.0, 10.0])
def test_one_size_is_certain_from_two_standard_deviations(sigmas: float) -> None:
    spring = Effect("arm_spring", {"k": 0.1, "q1n": 0.3})
    plant = known(spring, {"k": 0.1 / sigmas, "q1n": 5.0})  # a shape says nothing of whether it is there
    assert may_be_absent(plant, "arm_spring", POLICY.present) is (sigmas < 1.96)


@pytest.mark.parametrize(("correlation", "absent"), [(0.0, True), (-0.95, False), (0.95, True)])
def test_sizes_are_judged_together(correlation: float, absent: bool) -> None:
    """A cable whose stiffness and rise imitate each other: either may be zero, and both cannot."""
    cable = Effect("arm_cable", {"k": 0.1, "k3": 0.1})
    plant = known(cable, {"k": 0.08, "k3": 0.08}, correlation)
    distance = 2 * (0.1 / 0.08) ** 2 / (1.0 + correlation)  # along the first eigenvector
    assert bool(distance < chi2.ppf(0.95, 2)) is absent
    assert may_be_absent(plant, "arm_cable", POLICY.present) is absent


def test_the_test_holds_its_level() -> None:
    """Of tilts that are not there, with errors of a known covariance, one in twenty is called certain."""
    rng = np.random.default_rng(0)
    std = {"αx": 0.01, "αy": 0.002}
    matrix = np.array([[1e-4, -1.4e-5], [-1.4e-5, 4e-6]])
    drawn = rng.multivariate_normal([0.0, 0.0], matrix, 600)
    plants = [known(Effect("base_tilt", {"αx": x, "αy": y}), std, -0.7) for x, y in drawn]
    certain = sum(not may_be_absent(plant, "base_tilt", POLICY.present) for plant in plants)
    assert 15 < certain < 48  # 30 of a binomial distribution, and three of its deviations to either side


def test_without_an_error_bar_nobody_can_say() -> None:
    assert not may_be_absent(TABLE_3.with_effects(TABLE_3.default_effect("arm_spring")), "arm_spring", POLICY.present)
    assert not may_be_absent(TABLE_3, "arm_spring", POLICY.present)
    # a play's width has no error bar: its likelihood is rough
    plant = known(TABLE_3.default_effect("arm_backlash"), {"ρ": 10.0})
    assert not may_be_absent(plant, "arm_backlash", POLICY.present)


@pytest.mark.parametrize(("needed", "goes"), [((), True), (("base_tilt",), True), (("arm_spring",), False)])
def test_a_name_that_may_be_absent_goes_unless_held_out_data_ask_for_it(needed: tuple[str, ...], goes: bool) -> None:
    by = search({"": 0.0, **VALUES}, "input_delay", "arm_spring", "base_tilt")
    found = names_found(a_fit(), by)
    assert {*found.names} == {"input_delay", "arm_spring", "base_tilt"}
    spring = known(Effect("arm_spring", {"k": 0.1}), {"k": 0.09})
    plant = spring.with_effects(*(TABLE_3.default_effect(name) for name in ("input_delay", "base_tilt")))
    fewer = without_absent(found, plant, by, Told(far_off=False, needed=needed), ())
    assert (fewer is not None) is goes
    if fewer is None:
        return
    assert {*fewer.names} == {"input_delay", "base_tilt"} == set(_effects(fewer.final.plant))
    assert [s.name for s in fewer.perhaps_absent] == ["arm_spring"]
    assert "(arm_spring) would make these logs likelier, but its size may as well be zero" in misses(fewer)
    assert without_absent(fewer, fewer.final.plant, by, Told(far_off=False), ()) is None


@pytest.mark.parametrize(
    ("needed", "goes"), [((), "base_tilt"), (("base_tilt",), "input_delay"), (("base_tilt", "input_delay"), None)]
)
def test_of_two_that_may_be_absent_the_one_that_is_missed_least_goes(needed: tuple[str, ...], goes: str | None) -> None:
    """And whichever was found first: without the tilt 1500 nats are lost, without the delay 1900."""
    by = search({"": 0.0, **VALUES}, "input_delay", "arm_spring", "base_tilt")
    found = names_found(a_fit(), by)
    plant = known(Effect("input_delay", {"d": 0.005}), {"d": 0.004})
    plant = _both(plant, known(Effect("base_tilt", {"αx": 0.01, "αy": 0.0}), {"αx": 0.02, "αy": 0.02}))
    fewer = without_absent(found, plant, by, Told(far_off=False), needed)
    assert (fewer and fewer.perhaps_absent[-1].name) == goes


def _both(one: Plant, other: Plant) -> Plant:
    """Effects and error bars of both."""
    a, b = one.covariance, other.covariance
    matrix = np.block(
        [[a.matrix, np.zeros((len(a.names), len(b.names)))], [np.zeros((len(b.names), len(a.names))), b.matrix]]
    )
    return one.with_effects(*other.effects).replace(covariance=Covariance((*a.names, *b.names), matrix))


def test_a_name_alone_or_with_a_law_of_its_own_is_not_asked() -> None:
    """The last name is judged by predictions without it; a law without its effect would become a name."""
    plant = known(Effect("arm_spring", {"k": 0.1}), {"k": 0.09})
    spring, delay, ripple = (suspect(name, 200.0) for name in ("arm_spring", "input_delay", "arm_ripple"))
    assert perhaps_absent(naming(spring), plant, POLICY.present) == []
    assert [e.name for e in perhaps_absent(naming(delay, spring), plant, POLICY.present)] == ["arm_spring"]
    assert perhaps_absent(naming(delay, spring, ripple, laws={"arm_ripple": "arm_spring"}), plant, POLICY.present) == []
    assert perhaps_absent(naming(delay, ripple, spring, laws={"arm_spring": "arm_ripple"}), plant, POLICY.present) == []


def _effects(plant: Plant) -> list[str]:
    return [effect.name for effect in plant.effects]
