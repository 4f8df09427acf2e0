"""The planned swing-up: the plan keeps the plant's equations and limits, and a rig can follow it."""

import sys

import numpy as np
import pytest

from controllers import make_controller
from controllers.base import DesignError
from controllers.comparison.trials import run_trials, swing_up_starts
from controllers.design import design_model
from controllers.exports.c import c_header
from controllers.swing_up.planned import BALANCING, CALMING, _moved_by_torque, _slopes, design_planned
from controllers.swing_up.planning import MARGIN, SHARPEST, on_symbols, plan_swing_up
from furuta_gym.plant import QUBE, Effect, Plant
from furuta_gym.plant.advance import advance
from furuta_gym.plant.dynamics import acceleration

COARSE = 40  # intervals; quick, and within a per cent of the plan's time
LAGGED = QUBE.replace(u_max=6.0).with_effects(Effect("actuator_lag", {"T": 0.01}))


@pytest.fixture
def casadi():
    return pytest.importorskip("casadi", reason="planning needs the extra `plan`")


def test_symbols_give_what_the_compiled_kernel_gives(casadi) -> None:
    move = on_symbols(acceleration, sincos=lambda q: (casadi.sin(q), casadi.cos(q)), tanh=casadi.tanh)
    x = casadi.SX.sym("x", 4)
    f = casadi.Function("f", [x], list(move(*(x[i] for i in range(4)), 0.1, *QUBE.theta, 30.0, 30.0)))
    for q2, v1, v2, u in np.random.default_rng(0).normal(0, 3, (20, 4)):
        expected = acceleration(q2, v1, v2, u, 0.1, *QUBE.theta, 30.0, 30.0)
        assert [float(a) for a in f([q2, v1, v2, u])] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("rig", [QUBE.replace(u_max=6.0), LAGGED], ids=["plain", "lagged"])
def test_a_plan_keeps_the_equations_and_the_limits(casadi, rig: Plant) -> None:
    plan = plan_swing_up(rig, COARSE)
    assert plan.state[:2, 0] == pytest.approx([0.0, np.pi])
    assert np.cos(plan.state[1, -1]) == pytest.approx(1.0)
    assert plan.state[2:4, -1] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert np.abs(plan.torque).max() <= MARGIN * rig.u_max * (1 + 1e-6)
    assert 0.3 < plan.duration < 1.0
    # every interval again, by the plant's own integrator, from the node before it
    smooth = rig.replace(friction_sharpness=SHARPEST)
    p, codes, rows = smooth.packed()
    n, parts, h = plan.t.size - 1, 50, plan.t[1]
    X, P, W = plan.state[:, :-1].copy(), np.repeat(p[:, None], n, axis=1), np.zeros((2, n))
    assert rows == X.shape[0]
    for i in range(parts):
        U = plan.torque_at(plan.t[:-1] + h * (i + 0.5) / parts)[None]
        advance(X, 0.0, h / parts, np.zeros(1), U, 0, W, P, codes, 1e-3)
    scale = np.array([1.0, 1.0, 10.0, 10.0, rig.u_max])[:rows, None]
    assert np.median(np.abs(X - plan.state[:, 1:]) / scale) < 2e-3
    assert np.abs((X - plan.state[:, 1:]) / scale).max() < 0.05


def test_a_lag_of_no_length_is_none(casadi, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = QUBE.replace(u_max=6.0)
    monkeypatch.setattr("controllers.swing_up.planned.plan_swing_up", lambda plant: plan_swing_up(plant, COARSE))
    carried = rig.with_effects(Effect("actuator_lag", {"T": 0.0}), Effect("arm_spring", {"k": 0.0}))
    assert design_planned(carried).plan.duration == pytest.approx(design_planned(rig).plan.duration)
    with pytest.raises(DesignError, match="the plan has 5 states and the plant 4"):
        design_planned(rig, plan=plan_swing_up(LAGGED, COARSE))


def test_less_torque_takes_longer(casadi) -> None:
    times = [plan_swing_up(QUBE.replace(u_max=u), COARSE).duration for u in (6.0, 10.0)]
    assert times[0] > 1.3 * times[1]


def test_a_motor_that_is_slow_to_change_its_torque_takes_longer(casadi) -> None:
    free = plan_swing_up(QUBE, COARSE)
    slew = 0.5 * float(np.abs(_rates(free)).max())
    plan = plan_swing_up(QUBE.replace(limits={"slew": slew}), COARSE)
    assert np.abs(_rates(plan)).max() <= MARGIN * slew * (1 + 1e-3)
    assert plan.torque[0] == pytest.approx(0.0, abs=1e-6)
    assert free.duration < plan.duration < 2.0


def _rates(plan) -> np.ndarray:
    """dτ/dt all along a plan, by differences."""
    t = np.linspace(0.0, plan.duration, 4001)
    return np.diff(plan.torque_at(t)) / t[1]


@pytest.mark.parametrize("delay", [0.0, 0.010])
def test_a_rig_follows_the_plan(casadi, delay: float) -> None:
    rig = LAGGED.with_effects(Effect("input_delay", {"d": delay})) if delay else LAGGED
    controller = design_planned(rig, plan=plan_swing_up(LAGGED, COARSE))
    starts = swing_up_starts(40, np.random.default_rng(5))
    outcome = run_trials(rig, controller, starts, 8.0, 0.004, swing_up=True)
    assert outcome.success.all()
    # it is up (within 0.2 rad) a little before the plan ends
    assert outcome.settling.max() == pytest.approx(controller.plan.duration + delay, abs=0.1)
    assert outcome.largest_q1.max() < controller.plan.largest_q1 + 0.5 + 0.6  # the start's arm angle, and the catch


def test_a_pendulum_that_swings_is_calmed_first(casadi) -> None:
    starts = swing_up_starts(10, np.random.default_rng(5))
    starts.x0[1] += 1.0
    plan = plan_swing_up(LAGGED, COARSE)
    outcome = run_trials(LAGGED, design_planned(LAGGED, plan=plan), starts, 12.0, 0.004, swing_up=True)
    assert outcome.success.all()
    assert outcome.settling.min() > plan.duration


def test_a_narrow_travel_is_kept_from_every_start(casadi) -> None:
    """A plan from where the arm is would leave it: the arm is brought towards zero first."""
    narrow = QUBE.replace(limits={"arm_travel": 1.6})
    plan = plan_swing_up(narrow, COARSE)
    starts = swing_up_starts(40, np.random.default_rng(5))
    assert (np.abs(starts.x0[0] + plan.state[0][:, None]).max(axis=0) > 1.6).any()
    outcome = run_trials(narrow, design_planned(narrow, plan=plan), starts, 8.0, 0.004, swing_up=True)
    assert outcome.success.all()
    assert outcome.largest_q1.max() < 1.6


def test_it_catches_where_the_arm_has_room(casadi) -> None:
    narrow = QUBE.replace(limits={"arm_travel": 1.6})
    controller = design_planned(narrow, plan=plan_swing_up(narrow, COARSE))
    controller(np.array([[0.1, 1.5], [0.02, 0.02]]))
    assert controller.phase.tolist() == [BALANCING, CALMING]


def test_slopes_upright_are_those_of_the_linear_plant() -> None:
    smooth = LAGGED.replace(theta=[*QUBE.theta[:7], 0.0, 0.0])
    model = design_model(smooth, 0.004)
    A, B = _slopes(_moved_by_torque(smooth), np.zeros(5), 0.0, 0.004)
    assert pytest.approx(model.A, abs=1e-6) == A
    assert pytest.approx(model.B, abs=1e-6) == B


class TestRefusals:
    def test_effects_that_no_plan_knows(self, casadi) -> None:
        with pytest.raises(DesignError, match="not input_gain_drift"):
            plan_swing_up(QUBE.with_effects(QUBE.default_effect("input_gain_drift")))
        with pytest.raises(DesignError, match="not arm_spring"):
            make_controller("planned", QUBE.with_effects(QUBE.default_effect("arm_spring")))
        with pytest.raises(DesignError, match="not arm_learned"):
            make_controller("planned", QUBE.with_effects(Effect("arm_learned", {"c00": 0.1})))

    def test_a_plan_that_leaves_the_travel(self, casadi) -> None:
        wide, narrow = plan_swing_up(LAGGED, COARSE), LAGGED.replace(limits={"arm_travel": 0.5})
        with pytest.raises(DesignError, match=r"beyond 0.9 of its travel of 0.5 rad; give another plan"):
            design_planned(narrow, plan=wide)

    def test_without_casadi(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "casadi", None)
        with pytest.raises(DesignError, match=r"pip install .\.\[plan\]"):
            make_controller("planned", QUBE.replace(u_max=9.0))

    def test_no_c(self, casadi) -> None:
        with pytest.raises(ValueError, match="planned is not linear and has no C export"):
            c_header(make_controller("planned", LAGGED, plan=plan_swing_up(LAGGED, COARSE)))
