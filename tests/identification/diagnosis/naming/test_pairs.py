"""One name or two: what two effects must show to take the place of one."""

from __future__ import annotations

from typing import Any

import pytest

import identification.diagnosis.naming.forward as naming_module
import identification.diagnosis.naming.pairs as split_module
from furuta_gym.plant import TABLE_3
from identification.diagnosis.naming.pairs import two_for_one
from identification.diagnosis.naming.search import Ranking, Search, Suspect
from tests.identification.diagnosis.fits import a_fit, ranked


def ranking(*gains: tuple[str, float]) -> Ranking:
    """A ranking over a model of value 0; every suspect with its own fit."""
    return tuple(Suspect(name, gain, gain - 5.0, a_fit(name, value=-gain)) for name, gain in gains)


TILT = ("base_tilt", 2000.0), ("input_offset", 1000.0), ("pendulum_encoder_offset", 900.0)


class Tried(Search):
    """A search whose fits end where the test says: two effects together at −`together`, one alone at −`alone`[name]."""

    def __init__(self, together: float, **alone: float) -> None:
        super().__init__(TABLE_3, None, lambda text: None)
        object.__setattr__(self, "together", together)
        object.__setattr__(self, "alone", {"input_offset": 1000.0, "pendulum_encoder_offset": 900.0} | alone)

    def fitted(self, plant: Any, start: Any) -> Any:
        names = [e.name for e in plant.effects]
        gain = self.together if len(names) == 2 else self.alone[names[0]]  # type: ignore[attr-defined]
        return a_fit(*names, value=-gain)

    def suspects(self, current: Any, found: int) -> Any:
        return [], {}

    def refits(self, current: Any, names: Any, table: Any, *a: Any, held: Any = None, **k: Any) -> Any:
        name = next(e.name for e in held.plant.effects if e.name not in {e.name for e in current.plant.effects})
        return current, ranked((name, current.value - held.value - 5.0), fit=held)


@pytest.fixture
def raced(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Pairs that were raced; each ends at −2000, as good as the one."""
    asked: list[str] = []

    def race(entries: Any, current: Any, anchor: Any, ahead: float) -> Any:
        asked.extend(entries)
        return {key: a_fit(*key.split(), value=-2000.0) for key in entries}

    monkeypatch.setattr(split_module, "race", race)
    return asked


@pytest.mark.parametrize(("together", "believed"), [(2050.0, True), (2004.0, False)])
def test_two_must_gain_as_much_more_as_one_must_to_be_believed(
    raced: list[str], together: float, believed: bool
) -> None:
    two = two_for_one(Tried(together), ranking(*TILT), a_fit())
    assert raced == ["input_offset pendulum_encoder_offset"]
    if believed:
        assert two is not None
        assert {r[0].name for r in two} == {"input_offset", "pendulum_encoder_offset"}
        assert two[-1][0].fit.value == -together
    else:
        assert two is None


def test_a_slight_one_of_two_is_not_believed(raced: list[str]) -> None:
    assert (
        two_for_one(Tried(2050.0, input_offset=1950.0, pendulum_encoder_offset=300.0), ranking(*TILT), a_fit()) is None
    )


@pytest.mark.parametrize(
    "others",
    [
        (("input_offset", 1000.0),),  # nothing to go with
        (("input_offset", 1000.0), ("arm_coulomb_asymmetry", 990.0)),  # look-alikes: the same thing twice
        (("input_offset", 1000.0), ("pendulum_encoder_offset", 300.0)),  # too little between them
        (("input_offset", 1990.0), ("pendulum_encoder_offset", 900.0)),  # one is nearly all
        (("input_offset", 1500.0), ("pendulum_encoder_offset", 150.0)),  # one is nearly nothing
    ],
)
def test_what_cannot_be_two_is_not_tried(raced: list[str], others: Any) -> None:
    assert two_for_one(Tried(2500.0), ranking(TILT[0], *others), a_fit()) is None
    assert raced == []


@pytest.mark.parametrize("most", [1, 3])
def test_two_take_the_place_of_one_and_the_search_goes_on(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """… unless one effect is all that may be found."""
    steps = {
        (): ranking(*TILT),
        ("base_tilt",): ranking(("input_delay", 2.0)),
        ("input_offset", "pendulum_encoder_offset"): ranking(("input_delay", 900.0)),
    }
    two = tuple(
        ranked((name, 1000.0), fit=a_fit("input_offset", "pendulum_encoder_offset"))
        for name in ("input_offset", "pendulum_encoder_offset")
    )
    monkeypatch.setattr(naming_module, "two_for_one", lambda *a: two)
    monkeypatch.setattr(Search, "suspects", lambda *a: ([], {}))
    monkeypatch.setattr(Search, "reconsidered", lambda self, found: found)
    monkeypatch.setattr(
        Search, "refits", lambda self, current, *a, **k: (current, steps[tuple(e.name for e in current.plant.effects)])
    )
    found = naming_module.name_effects(a_fit(), TABLE_3, most=most)
    expected = ["base_tilt"] if most == 1 else ["input_offset", "pendulum_encoder_offset", "input_delay"]
    assert [s.name for s in found.accepted] == expected


@pytest.mark.parametrize(
    ("gain", "before", "after", "believed"),
    [
        (300.0, 50.0, -4.0, True),  # what was left is gone
        (300.0, -4.0, -4.0, False),  # nothing was left: a mended form
        (300.0, 50.0, 20.0, False),  # something still is
        (90.0, 50.0, -4.0, False),  # too small even so
        (500.0, -4.0, -4.0, True),  # large enough by itself
    ],
)
def test_a_small_further_effect_must_be_just_what_was_missing(
    monkeypatch: pytest.MonkeyPatch, gain: float, before: float, after: float, believed: bool
) -> None:
    delay = (Suspect("input_delay", 2000.0, 1995.0, a_fit("input_delay")),)
    offset = (Suspect("input_offset", gain, gain - 5.0, a_fit("input_delay", "input_offset")),)
    steps = [delay, offset, ()]
    monkeypatch.setattr(naming_module, "two_for_one", lambda *a: None)
    monkeypatch.setattr(Search, "suspects", lambda *a: ([], {}))
    monkeypatch.setattr(Search, "reconsidered", lambda self, found: found)
    monkeypatch.setattr(Search, "refits", lambda self, current, *a, **k: (current, steps.pop(0)))
    left = {1: before, 2: after}
    found = naming_module.name_effects(a_fit(), TABLE_3, left=lambda plant: left[len(plant.effects)])
    assert [s.name for s in found.accepted] == ["input_delay", *(["input_offset"] if believed else [])]
    assert (found.refused is None) == believed
