"""The race of suspects by itself: who runs again, from where, and whose name stands in the end."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import identification.diagnosis.naming.discrete as stepping_module
import identification.diagnosis.naming.forward as naming_module
import identification.diagnosis.naming.multistart as race_module
import identification.diagnosis.naming.search as search_module
from furuta_gym.plant import EFFECTS, TABLE_3, Effect
from identification.diagnosis.naming.multistart import added, chase, resized, retry
from identification.diagnosis.naming.scores import Score
from tests.factories import loop_log
from tests.identification.diagnosis.fits import a_fit, ranked


def test_a_leader_that_is_overtaken_follows_from_the_new_leaders_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stuck first leader must not lose its name to a look-alike that found the right θ from it."""
    plant = TABLE_3

    def fitted(name: str, value: float) -> Any:
        own = plant.with_effects(plant.default_effect(name))
        return SimpleNamespace(plant=own, noise=np.ones(4), value=value, samples=1000, records=())

    values = {"arm_spring": 50.0, "arm_ripple": 60.0}
    reached = {"arm_spring": 5.0, "arm_ripple": 20.0}  # from another's θ
    asked: list[list[str]] = []

    def race(entries: Any, current: Any, anchor: Any, ahead: float = math.inf, **k: Any) -> dict[str, Any]:
        if any(" " in entry for entry in entries):  # other sizes: bring nothing here
            return {}
        asked.append(list(entries))
        told = values if math.isinf(ahead) else reached
        return {name: fitted(name if name in told else "arm_ripple", told.get(name, math.inf)) for name in entries}

    for module in (search_module, race_module, stepping_module):
        monkeypatch.setattr(module, "race", race)
    monkeypatch.setattr(search_module, "fit", lambda p, *a, **k: fitted(p.effects[-1].name, 5.0) if p.effects else left)
    left: Any = SimpleNamespace(plant=plant, noise=np.ones(4), value=100.0, samples=1000, records=())
    table = {name: Score(name, 40.0, plant.default_effect(name), 0.0) for name in values}
    search = search_module.Search(plant, None, lambda text: None)
    _, ranking = search.refits(left, list(values), table)
    assert asked == [["arm_spring", "arm_ripple"], ["arm_ripple"], ["arm_spring"], ["-1", "+1"]]
    assert ranking[0].name == "arm_spring"
    assert ranking[0].gain == pytest.approx(95.0)


@pytest.mark.parametrize("name", list(EFFECTS))
def test_another_size_is_within_bounds_or_none(name: str) -> None:
    start = TABLE_3.default_effect(name)
    for factor in (3.0, 0.6, -1.0):
        other = resized(start, factor)
        for p in start.type.parameters if other else ():
            assert p.lower <= other.parameters[p.name] <= p.upper
            if p.role == "shape" or p.integer:
                assert other.parameters[p.name] == start.parameters[p.name]


def test_more_of_a_limit_is_a_lower_limit() -> None:
    for name, size in (("input_saturation", "m"), ("arm_presliding", "σ0")):
        start = TABLE_3.default_effect(name)
        more = resized(start, 2.0)
        assert more is not None
        assert more.parameters[size] == pytest.approx(0.5 * start.parameters[size])
        assert resized(start, -1.0) is None
    assert resized(Effect("payload_step", {"m": 0.1, "t0": 7.0}), -1.0) == Effect(
        "payload_step", {"m": -0.1, "t0": 7.0}
    )


def test_the_added_effect_is_found_wherever_the_library_keeps_it() -> None:
    """A plant keeps its effects in the library's order, so the last is not the newest."""
    both = a_fit("arm_backlash", "input_delay")
    assert added(both, a_fit("arm_backlash")).name == "input_delay"
    assert added(both, a_fit("input_delay")).name == "arm_backlash"


def test_a_rival_chases_with_its_own_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    started: dict[str, Any] = {}
    monkeypatch.setattr(race_module, "race", lambda entries, *a, **k: started.update(entries) or {})
    fits = {
        "input_delay": a_fit("arm_backlash", "input_delay"),
        "actuator_lag": a_fit("arm_backlash", "actuator_lag", value=9),
    }
    chase("input_delay", fits, a_fit("arm_backlash"), TABLE_3, lambda text: None)
    plant, _ = started["actuator_lag"]
    assert {e.name for e in plant.effects} == {"arm_backlash", "actuator_lag"}


def test_other_sizes_of_a_later_effect_also_start_with_less_of_the_earlier(monkeypatch: pytest.MonkeyPatch) -> None:
    started: dict[str, Any] = {}

    def race(entries: Any, *a: Any, **k: Any) -> dict[str, Any]:
        started.update(entries)
        return {"payload_step mirrored": a_fit("arm_spring", "payload_step", value=-50.0)}

    monkeypatch.setattr(race_module, "race", race)
    fits = {"payload_step": a_fit("arm_spring", "payload_step")}
    retry(
        ["payload_step"],
        {"payload_step": TABLE_3.default_effect("payload_step")},
        fits,
        a_fit("arm_spring"),
        TABLE_3,
        print,
    )
    kinds = {entry.split()[1]: {e.name: e for e in plant.effects} for entry, (plant, _) in started.items()}
    assert set(kinds) == {"larger", "afresh", "mirrored", "shared"}
    k, m = TABLE_3.default_effect("arm_spring").parameters["k"], TABLE_3.default_effect("payload_step").parameters["m"]
    assert kinds["shared"]["arm_spring"].parameters["k"] == pytest.approx(0.6 * k)
    assert kinds["larger"]["arm_spring"].parameters["k"] == k
    assert kinds["mirrored"]["payload_step"].parameters["m"] == -m
    assert fits["payload_step"].value == -50.0  # what is better is kept


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> Any:
    """No whole numbers are stepped, unless a test says how."""
    monkeypatch.setattr(search_module, "stepped", lambda found, *a: found)
    return search_module.Search(TABLE_3, None, lambda text: None)


def refitted(value: float) -> Any:
    """In place of `fit`: the plant as it is, at a value."""
    return lambda plant, *a, **k: a_fit(*(e.name for e in plant.effects), value=value)


def test_a_name_that_stood_in_for_two_is_exchanged(search: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """base_tilt explains an offset and an asymmetry alone, somewhat; beside the asymmetry the offset does better."""
    tilt, both = a_fit("base_tilt", value=100.0), a_fit("base_tilt", "pendulum_coulomb_asymmetry", value=60.0)
    found = [
        ranked(("base_tilt", 1600.0), ("pendulum_coulomb_asymmetry", 1100.0), fit=tilt),
        ranked(("pendulum_coulomb_asymmetry", 250.0), fit=both),
    ]
    better = a_fit("input_offset", "pendulum_coulomb_asymmetry", value=-300.0)
    offset = ranked(("input_offset", 760.0), ("base_tilt", 400.0), fit=better)
    monkeypatch.setattr(search_module.Search, "suspects", lambda *a: ([], {}))
    monkeypatch.setattr(search_module.Search, "refits", lambda self, reduced, *a, held: (reduced, offset))
    monkeypatch.setattr(
        search_module, "fit", lambda plant, *a, **k: a_fit(*(e.name for e in plant.effects), value=900.0)
    )
    again = search.reconsidered(found)
    assert [ranking[0].name for ranking in again] == ["input_offset", "pendulum_coulomb_asymmetry"]
    assert again[1][0].gain == 1200.0  # beside the new name, not the old
    assert again[1][0].fit is better


@pytest.mark.parametrize(("runner_up", "asked"), [(100.0, False), (900.0, True)])
def test_only_a_contested_name_is_reconsidered(
    search: Any, monkeypatch: pytest.MonkeyPatch, runner_up: float, asked: bool
) -> None:
    both = a_fit("arm_spring", "arm_stribeck", value=60.0)
    found = [
        ranked(("arm_spring", 1600.0), ("arm_ripple", runner_up), fit=a_fit("arm_spring", value=100.0)),
        ranked(("arm_stribeck", 250.0), fit=both),
    ]
    same = ranked(("arm_spring", 1500.0), ("arm_ripple", 50.0), fit=both)
    calls: list[Any] = []
    monkeypatch.setattr(search_module.Search, "suspects", lambda *a: ([], {}))
    monkeypatch.setattr(search_module.Search, "refits", lambda self, r, *a, held: calls.append(held) or (r, same))
    monkeypatch.setattr(
        search_module, "fit", lambda plant, *a, **k: a_fit(*(e.name for e in plant.effects), value=1600.0)
    )
    again = search.reconsidered(found)
    assert [ranking[0].name for ranking in again] == ["arm_spring", "arm_stribeck"]
    assert calls == ([both] if asked else [])
    assert again[1][0].gain == 255.0


def test_what_the_last_effect_makes_superfluous_goes(search: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    found = [
        ranked(("arm_ripple", 60.0), fit=a_fit("arm_ripple", value=100.0)),
        ranked(("arm_spring", 250.0), fit=a_fit("arm_ripple", "arm_spring", value=-150.0)),
    ]
    monkeypatch.setattr(
        search_module, "fit", lambda plant, *a, **k: a_fit(*(e.name for e in plant.effects), value=-149.0)
    )
    again = search.reconsidered(found)
    assert [ranking[0].name for ranking in again] == ["arm_spring"]


def test_what_the_last_effect_leaves_little_for_goes(search: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A delay beside a ripple stood in for the saturation that was found next: 38 nats remain to it."""
    found = [
        ranked(("arm_ripple", 1180.0), fit=a_fit("arm_ripple", value=100.0)),
        ranked(("input_delay", 400.0), fit=a_fit("arm_ripple", "input_delay", value=-300.0)),
        ranked(("input_saturation", 880.0), fit=a_fit("arm_ripple", "input_delay", "input_saturation", value=-1200.0)),
    ]

    def fitted(plant: Any, *a: Any, **k: Any) -> Any:
        names = [e.name for e in plant.effects]
        return a_fit(*names, value={"arm_ripple": -100.0, "input_delay": -1162.0}.get(missing(names), -300.0))

    def missing(names: list[str]) -> str:
        return next(n for n in ("input_delay", "arm_ripple", "input_saturation") if n not in names)

    monkeypatch.setattr(search_module, "fit", fitted)
    again = search.reconsidered(found)
    assert [ranking[0].name for ranking in again] == ["arm_ripple", "input_saturation"]


def test_whole_numbers_of_an_earlier_effect_are_stepped_again(search: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Thirteen periods a turn were the best while the drag was missing; with it, twelve are."""
    found = [
        ranked(("arm_ripple", 900.0), fit=a_fit("arm_ripple", value=100.0)),
        ranked(("arm_quadratic_drag", 700.0), fit=a_fit("arm_ripple", "arm_quadratic_drag", value=-600.0)),
    ]
    twelve = a_fit("arm_ripple", "arm_quadratic_drag", value=-1200.0)
    monkeypatch.setattr(search_module, "stepped", lambda *a: twelve)

    def fitted(plant: Any, *a: Any, **k: Any) -> Any:
        return a_fit(*(e.name for e in plant.effects), value=-1250.0 if len(plant.effects) == 2 else 100.0)

    monkeypatch.setattr(search_module, "fit", fitted)
    again = search.reconsidered(found)
    assert [ranking[0].name for ranking in again] == ["arm_ripple", "arm_quadratic_drag"]
    assert again[-1][0].fit.value == -1250.0
    assert again[-1][0].gain == 1350.0


def test_suspects_that_all_went_astray_run_again(search: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[list[str]] = []
    table = {name: Score(name, 40.0, TABLE_3.default_effect(name), 0.0) for name in ("arm_spring", "arm_stribeck")}
    current = a_fit(value=0.0)
    for value, all_of_them in ((400.0, True), (-40.0, False)):
        tried.clear()
        monkeypatch.setattr(
            search_module, "race", lambda e, *a, v=value, **k: {n: a_fit(n, value=v + len(n)) for n in e}
        )
        monkeypatch.setattr(search_module, "retry", lambda names, *a: tried.append(list(names)))
        monkeypatch.setattr(search_module, "chase", lambda *a: None)
        monkeypatch.setattr(search_module, "stepped", lambda found, *a: found)
        monkeypatch.setattr(search_module, "fit", refitted(0.0))
        search.refits(current, list(table), table)
        assert (["arm_spring", "arm_stribeck"] in tried) == all_of_them


def test_the_search_keeps_what_was_exchanged_and_tells_what_was_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = [ranked(("base_tilt", 900.0), fit=a_fit("base_tilt")), ranked(("arm_stribeck", 800.0), fit=a_fit())]
    steps.append(ranked(("friction_sharpness", 40.0), fit=a_fit()))
    offset = ranked(("input_offset", 700.0), fit=a_fit("input_offset"))

    def reconsidered(self: Any, found: Any) -> Any:
        assert found[-1][0].name != "friction_sharpness", "too slight to look at anything again for"
        return [offset, *found[1:]]

    told: list[bool] = []
    asked: list[float] = []

    def refits(self: Any, current: Any, names: Any, table: Any, thorough: bool = False, least: float = 0.0) -> Any:
        told.append(thorough)
        asked.append(least)
        return current, steps[len(told) - 1]

    monkeypatch.setattr(search_module.Search, "suspects", lambda *a: ([], {}))
    monkeypatch.setattr(search_module.Search, "refits", refits)
    monkeypatch.setattr(search_module.Search, "reconsidered", reconsidered)
    found = naming_module.name_effects(a_fit(), TABLE_3, thorough=True)
    assert [s.name for s in found.accepted] == ["input_offset", "arm_stribeck"]
    assert found.refused is not None
    assert found.refused.name == "friction_sharpness"
    assert told == [True, True, True]
    assert asked == pytest.approx([0.0, 70.5, 80.5])  # a tenth of the largest found


@pytest.mark.parametrize(("value", "verdict"), [(-50.0, "named"), (-5.0, "unknown")])
def test_unknown_is_said_after_a_thorough_search_only(
    monkeypatch: pytest.MonkeyPatch, value: float, verdict: str
) -> None:
    import identification.diagnosis.diagnose as module

    def searched(*a: Any, thorough: bool = False) -> Any:
        final = SimpleNamespace(value=value if thorough else 0.0, noise=np.ones(4))
        return SimpleNamespace(final=final, thorough=thorough, accepted=()), None, None

    monkeypatch.setattr(module, "identify", lambda *a, **k: SimpleNamespace(plant=TABLE_3))
    monkeypatch.setattr(module, "fit", lambda *a, **k: None)
    monkeypatch.setattr(module, "_searched", searched)
    monkeypatch.setattr(module, "_verdict", lambda naming, rest: ("named" if naming.thorough else "unknown", ""))
    log = loop_log(duration=2.0)[0]
    assert module.diagnose([log]).verdict == verdict


@pytest.mark.parametrize(("name", "fixed"), [("friction_sharpness", 100.0), ("arm_spring", None)])
def test_the_model_before_a_sharpness_was_found_does_not_have_it(
    monkeypatch: pytest.MonkeyPatch, name: str, fixed: float | None
) -> None:
    """An estimate has r free; a gap from it to the same r would be none."""
    import identification.diagnosis.diagnose as module

    found = SimpleNamespace(name=name, net=50.0)
    fitted = SimpleNamespace(value=0.0, noise=np.ones(4), plant=TABLE_3)
    naming = SimpleNamespace(final=fitted, nominal=fitted, accepted=(found,), rankings=())
    monkeypatch.setattr(module, "identify", lambda *a, **k: SimpleNamespace(plant=TABLE_3, given=k))
    monkeypatch.setattr(module, "fit", lambda *a, **k: None)
    monkeypatch.setattr(module, "_searched", lambda *a, **k: (naming, None, None))
    monkeypatch.setattr(module, "_verdict", lambda *a: ("named", ""))
    log = loop_log(duration=2.0)[0]
    before: Any = module.diagnose([log]).before
    assert before.given.get("sharpness") == fixed
