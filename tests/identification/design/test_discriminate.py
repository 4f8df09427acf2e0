"""Which experiment tells two effects apart: the prediction against real fits, and what is known of look-alikes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from controllers import make_controller
from furuta_gym.plant import QUBE, TABLE_3, Effect
from identification.design import discriminate, next_experiment
from identification.design.d_optimal import design
from identification.design.discriminate import Separation, Trial, between
from identification.design.next_experiment import excite
from identification.design.setup import Limits, Setup
from identification.estimation.identify import identify
from identification.logs.log import Log
from tests.factories import PaperPolicy

T = 0.004


@pytest.fixture(scope="module")
def delay_or_lag() -> Separation:
    return between(TABLE_3, ["input_delay", "actuator_lag"], PaperPolicy(T), duration=6.0, sample_time=T)


@pytest.fixture(scope="module")
def asymmetry_or_offset() -> Separation:
    return between(TABLE_3, ["arm_coulomb_asymmetry", "input_offset"], PaperPolicy(T), duration=6.0, sample_time=T)


def test_the_chosen_experiment_has_the_largest_worst_case(delay_or_lag: Separation) -> None:
    assert delay_or_lag.nats == max(t.worst for t in delay_or_lag.trials)
    assert delay_or_lag.best.entry.name in delay_or_lag.sentence
    assert "input_delay" in delay_or_lag.sentence


def test_amplitude_is_not_what_tells_look_alikes_apart(
    delay_or_lag: Separation, asymmetry_or_offset: Separation
) -> None:
    """Large steps never win, by far."""
    for found in (delay_or_lag, asymmetry_or_offset):
        steps = next(t for t in found.trials if t.entry.name == "large steps")
        assert found.nats > 3.0 * max(steps.worst, 1.0)


def test_only_a_free_decay_says_where_the_pendulum_starts(delay_or_lag: Separation) -> None:
    """Every balancing design starts a little off the top; that is none of the user's business."""
    decay = next(t for t in delay_or_lag.trials if t.entry.name == "hanging free decay")
    assert replace(delay_or_lag, best=decay).facts["start_from_hanging_rad"] == "1.2"
    for trial in delay_or_lag.trials:
        assert ("start_from_hanging_rad" in replace(delay_or_lag, best=trial).facts) == (trial is decay)


def test_without_a_command_nothing_tells_delay_from_lag(delay_or_lag: Separation) -> None:
    decay = next(t for t in delay_or_lag.trials if t.entry.name == "hanging free decay")
    assert decay.worst < 10.0


def test_the_predicted_separation_is_that_of_fits_to_new_data(delay_or_lag: Separation) -> None:
    """Both effects fitted by `identify` to a log with other noise: within a factor 1.5 of what was predicted."""
    trial = delay_or_lag.best
    for truth, other in (("input_delay", "actuator_lag"), ("actuator_lag", "input_delay")):
        run = trial.setup.run(trial.signal, 77, TABLE_3.with_effects(TABLE_3.default_effect(truth)))
        log = Log.from_run(run, counts=4096)
        right, wrong = (identify(log, TABLE_3, effects=[e], sharpness=100.0).log_likelihood for e in (truth, other))
        assert 1 / 1.5 < (right - wrong) / trial.separations[truth, other] < 1.5


def test_what_the_plant_says_of_its_rig_is_kept() -> None:
    """By both kinds of design."""
    rig = TABLE_3.replace(limits={"arm_travel": 0.3, "slew": 1500.0, "supply": 0.5 * TABLE_3.u_max})
    bounds = np.array([0.3, 0.5 * TABLE_3.u_max, 1500.0])
    setup = Setup.of(rig, PaperPolicy(T), 2.0, T)
    optimal = design(setup, evaluations=36)
    separation = between(rig, ["input_delay", "actuator_lag"], PaperPolicy(T), duration=2.0, sample_time=T)
    driven = [t for t in separation.trials if t.signal is not None and not t.problem]
    assert driven
    for run in [optimal.run, *(t.setup.run(t.signal) for t in driven)]:
        assert (run.largest[[0, 2, 3]] <= 1.02 * bounds).all()


def test_a_limit_that_is_given_takes_the_place_of_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    """Even where the plant file's is less; the others stay."""
    received: list[Limits] = []
    monkeypatch.setattr(next_experiment, "design", lambda setup, limits, *_, **__: received.append(limits))
    rig = TABLE_3.replace(limits={"arm_travel": 0.3, "slew": 1500.0})
    for limits in ({"q1": 0.6}, {"q2": 1.0}):
        excite(rig, policy=PaperPolicy(T), limits=limits)
    assert received == [
        Limits(q1=0.6, q2=0.3, u=TABLE_3.u_max, u_rate=1500.0),
        Limits(q1=0.3, q2=1.0, u=TABLE_3.u_max, u_rate=1500.0),
    ]


@pytest.mark.parametrize(("policy", "q2"), [(PaperPolicy(T), 0.3), (None, 1.5)])
def test_default_limits_are_those_of_the_page(policy: PaperPolicy | None, q2: float) -> None:
    """docs/how-to/excite.md: the pendulum may go less far about upright than hanging."""
    assert Setup.of(TABLE_3, policy).usual_limits == Limits(q1=1.5, q2=q2, u=TABLE_3.u_max, u_rate=np.inf)


def test_the_chosen_experiment_stays_upright_with_each_suspect(delay_or_lag: Separation) -> None:
    trial = delay_or_lag.best
    for name in delay_or_lag.names:
        run = trial.setup.run(trial.signal, 5, TABLE_3.with_effects(TABLE_3.default_effect(name)))
        assert run.fell is None


def test_limits_hold_for_a_pendulum_that_is_let_go() -> None:
    """A free decay has no command that could be made smaller: beyond a limit it is no experiment."""
    found = between(QUBE, ["arm_spring", "input_offset"], None, duration=3.0, limits=Limits(q2=0.3))
    (decay,) = [t for t in found.trials if t.signal is None]
    assert "the pendulum swings 1.2 rad, more than the limit of 0.3" in decay.problem
    assert found.best is not decay
    narrow = between(QUBE.replace(limits={"arm_travel": 0.1}), ["arm_spring", "input_offset"], None, duration=3.0)
    (decay,) = [t for t in narrow.trials if t.signal is None]
    assert "the arm turns" in decay.problem


def test_without_a_controller_the_pendulum_hangs() -> None:
    found = between(TABLE_3, ["arm_spring", "input_offset"], None, duration=4.0, sample_time=T)
    assert found.whole_command
    assert all(t.entry.hanging for t in found.trials)
    t, u = found.samples()
    assert t.shape == u.shape == (1000,)
    assert np.isfinite(u).all()


@pytest.mark.parametrize(
    ("names", "word"),
    [
        (["input_delay"], "two or more"),
        (["input_delay", "input_delay"], "different"),
        (["input_delay", "gremlin"], "gremlin: no such effect. `furuta effects`"),
    ],
)
def test_bad_suspects_are_refused(names: list[str], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        between(TABLE_3, names, None)


def test_a_plant_that_a_diagnosis_wrote_brings_its_own_suspect() -> None:
    lag = Effect("actuator_lag", {"T": 0.004})
    found = between(TABLE_3.with_effects(lag), ("actuator_lag", "input_delay"), duration=2.0)
    given = between(TABLE_3, (lag, "input_delay"), duration=2.0)
    assert found.nats == pytest.approx(given.nats)


@pytest.mark.parametrize("policy", [None, "lqr"])
def test_a_limit_of_the_pendulum_is_about_where_the_rig_rests(
    monkeypatch: pytest.MonkeyPatch, policy: str | None
) -> None:
    """Hanging without a controller, where it was once forgotten; upright with one."""
    seen: list[tuple[float, float]] = []

    def refuse(setup: Any, signal: Any, allowed: Limits, seed: int, most: float) -> Any:
        seen.append((allowed.q1, allowed.q2))
        raise ValueError("not tried")

    monkeypatch.setattr(discriminate, "within_limits", refuse)
    monkeypatch.setattr(discriminate, "_separations", lambda s, entry, *_: Trial(entry, s, None, {}, "not tried"))
    with pytest.raises(ValueError, match="no experiment can be run"):
        excite(
            QUBE,
            ["arm_spring", "input_offset"],
            None if policy is None else make_controller(policy, QUBE),
            limits={"q2": 0.3},
        )
    assert {max(q2, 0.3) for _, q2 in seen} == {0.3}
    # a limit that is not given is that of the experiment
    assert max(q1 for q1, _ in seen) == (1.5 if policy is None else 2.0)
