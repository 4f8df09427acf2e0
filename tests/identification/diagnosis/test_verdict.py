"""The decision rules by themselves, on values made by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from furuta_gym.plant import TABLE_3
from identification.diagnosis.diagnose import CONSTANT, Diagnosis, _anchor, _verdict, structured
from identification.diagnosis.naming.forward import Naming, unsettled
from identification.diagnosis.naming.scores import Score
from identification.diagnosis.naming.search import Suspect, price, shortlist, slight
from tests.factories import loop_log


def suspect(name: str, gain: float) -> Suspect:
    return Suspect(name, gain, gain - 5.0, fit=None)  # type: ignore[arg-type]


def naming(*found: Suspect, equals: tuple[tuple[str, ...], ...] | None = None, refused: Suspect | None = None) -> Any:
    return SimpleNamespace(accepted=found, equals=equals or tuple(() for _ in found), refused=refused)


def rest(evidence: float = -4.0, p: float = 0.5) -> Any:
    return SimpleNamespace(
        found=evidence > 8.0,
        evidence=evidence,
        channel="arm",
        variable="arm angle",
        constancy=SimpleNamespace(joint_p=p),
    )


@pytest.mark.parametrize(
    ("found", "left", "verdict"),
    [
        (naming(), rest(), "none"),
        (naming(), rest(evidence=50.0), "unknown"),
        (naming(), rest(p=0.1 * CONSTANT), "unknown"),
        (naming(suspect("arm_spring", 200.0)), rest(), "named"),
        (naming(suspect("arm_spring", 200.0)), rest(evidence=50.0), "named"),
        (naming(suspect("arm_spring", 200.0)), rest(evidence=300.0), "unknown"),
        (naming(suspect("input_delay", 200.0), equals=(("actuator_lag",),)), rest(), "ambiguous"),
    ],
)
def test_the_verdict(found: Any, left: Any, verdict: str) -> None:
    said, sentence = _verdict(found, left)
    assert said == verdict
    assert structured(left) == ("remains" in sentence)


def test_a_frequency_and_an_instant_cost_more_than_a_size() -> None:
    n = math.log(20_000)
    assert price("input_offset", 20_000) == pytest.approx(0.5 * n)
    assert price("periodic_torque", 20_000) == pytest.approx(2.5 * n)  # Djuric 1998: 5/2 ln N for a sinusoid
    assert price("payload_step", 20_000) == pytest.approx(1.5 * n)


def test_a_further_effect_must_explain_its_share() -> None:
    drag, offset = (suspect("pendulum_quadratic_drag", 1900.0),), (suspect("input_offset", 60.0),)
    assert slight("input_delay", 370.0, [drag])
    assert slight("input_delay", 50.0, [offset, drag])
    assert not slight("input_delay", 400.0, [drag])
    assert not slight("input_delay", 15.0, [])


def test_a_look_alike_must_explain_half() -> None:
    """Two lags in series, fitted as one, leave what looks like a delay."""
    lag = (suspect("actuator_lag", 1650.0),)
    assert slight("input_delay", 800.0, [lag])
    assert not slight("input_delay", 850.0, [lag])


def test_what_is_refused_is_left_over_and_told() -> None:
    found = naming(suspect("arm_spring", 900.0), refused=suspect("input_delay", 40.0))
    said, sentence = _verdict(found, rest())
    assert said == "named"
    assert "input_delay would take up a little more (40 nats)" in sentence
    parts: Any = (None, None, found, rest())
    assert Diagnosis(said, sentence, *parts, 0.0, 1.0, 1.0).leftover


def test_the_short_list_is_near_the_best_and_above_the_price() -> None:
    gains = {"arm_spring": 100.0, "arm_ripple": 90.0, "input_delay": 14.0, "input_offset": 2.0}
    table = {n: Score(n, g, TABLE_3.default_effect(n), 0.0) for n, g in gains.items()}
    assert shortlist(table, 20_000, 0.5) == ["arm_spring", "arm_ripple"]
    assert shortlist({"input_offset": table["input_offset"]}, 20_000, 0.5) == []


def test_a_veto_takes_the_name_and_the_plant_back() -> None:
    before, after = SimpleNamespace(plant="without"), SimpleNamespace(plant="with")
    parts: Any = (before, after, naming(suspect("arm_spring", 200.0)), rest())
    found = Diagnosis("named", "…", *parts, 0.0, 1.0, 1.0)
    assert found.plant == "with"
    assert not found.timed
    vetoed = found.vetoed()
    assert vetoed.verdict == "unknown"
    assert vetoed.plant == "without"
    drift: Any = (before, after, naming(suspect("arm_friction_drift", 200.0)), rest())
    assert Diagnosis("named", "…", *drift, 0.0, 1.0, 1.0).timed


@pytest.mark.parametrize(
    ("names", "timed", "repeating"),
    [
        (("arm_spring",), False, False),
        (("periodic_torque", "arm_spring"), True, True),
        (("payload_step",), True, False),
        (("periodic_torque", "arm_friction_drift"), True, False),
    ],
)
def test_what_follows_the_clock_and_what_repeats(names: tuple[str, ...], timed: bool, repeating: bool) -> None:
    parts: Any = (None, None, naming(*(suspect(name, 200.0) for name in names)), rest())
    found = Diagnosis("named", "…", *parts, 0.0, 1.0, 1.0)
    assert (found.timed, found.repeating) == (timed, repeating)


def test_the_search_starts_off_every_bound() -> None:
    """A fit without the missing effect may end with no friction and no θ2; from there nothing comes back."""
    stuck = TABLE_3.replace(theta=[0.07, 3e-5, 0.024, 0.024, 0.67, 0.0, 0.0, 0.0, 0.0])
    theta = _anchor(stuck).theta
    assert (theta[5:] > 0).all()
    assert theta[1] == pytest.approx(0.3 * 0.024)
    assert _anchor(TABLE_3).theta[1] == TABLE_3.theta[1]


@pytest.mark.parametrize(
    ("channel", "variable", "rival", "equals"),
    [
        ("input", "command", ("input_cubic_gain", 1950.0), ("input_cubic_gain",)),
        ("input", "command", ("input_cubic_gain", 1700.0), ()),  # explains much less
        ("input", "command", ("input_gain_asymmetry", 1950.0), ()),  # no look-alike
        ("arm", "arm speed", ("input_cubic_gain", 1950.0), ()),  # the form of the saturation may be right
    ],
)
def test_a_form_that_is_wrong_does_not_settle_the_name(
    channel: str, variable: str, rival: tuple[str, float], equals: tuple[str, ...]
) -> None:
    winner = suspect("input_saturation", 2000.0)
    names = Naming(None, None, (winner,), ((),), ((winner, suspect(*rival)),), {})  # type: ignore[arg-type]
    left: Any = SimpleNamespace(found=True, channel=channel, variable=variable)
    assert unsettled(names, left).equals == (equals,)
    left.found = False
    assert unsettled(names, left).equals == ((),)


def test_a_start_with_effects_is_compared_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was found before is for the search to find again, and for held-out data to judge."""
    import identification.diagnosis.diagnose as module

    def asked(logs: Any, start: Any) -> Any:
        raise LookupError(start)

    monkeypatch.setattr(module, "identify", asked)
    with pytest.raises(LookupError) as error:
        module.diagnose([loop_log(duration=2.0)[0]], TABLE_3.with_effects(TABLE_3.default_effect("arm_spring")))
    assert error.value.args == (TABLE_3,)
