"""A swing-up planned offline by direct collocation: the fastest within the motor's limits and the arm's travel.

Hermite–Simpson collocation (Kelly, "An introduction to trajectory optimization", SIAM Review 59 (2017)), solved by
CasADi and IPOPT (extra `plan`). The equations are the plant's own kernels, run on CasADi's symbols.
"""

import types
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.extras import install
from furuta_gym.plant import Plant
from furuta_gym.plant.dynamics import acceleration
from furuta_gym.plant.parameters import pendulum_frequency
from furuta_gym.plant.plant_file import ARM_TRAVEL

from ..base import DesignError
from ..known_effects import KnownEffects

INTERVALS = 80
MARGIN = 0.9  # of the motor's torque and of its slew; the rest is the feedback's
SHARPEST = 20.0  # s/rad, of friction in the plan: a corner that the optimiser cannot step over
GUESSES = ((1.0, 0.0), (1.5, 2 * np.pi))  # swings of the pendulum, and where it ends [rad]
LONG_GUESSES = ((4.0, 0.0), (8.0, 0.0), (16.0, 0.0))  # tried where those lead to nothing
CALM = 0.02  # weight of the mean squared torque, as a share of its limit, against the time
_KNOWN = ("input", "sensor")  # places of effects that need no plan of their own, beside the lag


@dataclass(frozen=True)
class Plan:
    """A swing-up from rest hanging at q1 = 0 to rest upright, q2 from π to 0 or 2π.

    t (n,) [s]; state (4 or 5, n): q1, q2, q̇1, q̇2 [rad, rad/s] and, with `actuator_lag`, the lagged torque. torque
    (2n − 1,): what is asked of the motor, in the command's unit, at these times and half-way between.
    """

    t: NDArray[np.float64]
    state: NDArray[np.float64]
    torque: NDArray[np.float64]

    @property
    def duration(self) -> float:
        return float(self.t[-1])

    def torque_at(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """The torque at times t [s]: in each interval the parabola that the collocation integrates."""
        steps = np.asarray(t) / self.t[1]
        k = np.clip(steps.astype(int), 0, self.t.size - 2)
        s = np.clip(steps - k, 0.0, 1.0)
        first, middle, last = (self.torque[2 * k + i] for i in range(3))
        return 2 * (s - 0.5) * (s - 1) * first - 4 * s * (s - 1) * middle + 2 * s * (s - 0.5) * last

    @property
    def effort(self) -> float:
        """∫τ² dt [{u}² s]."""
        return float(np.mean(self.torque_at(np.linspace(0.0, self.duration, 2001)) ** 2)) * self.duration

    @property
    def largest_q1(self) -> float:
        return float(np.abs(self.state[0]).max())


def on_symbols(kernel: Any, **instead: Callable[..., Any]) -> Callable[..., Any]:
    """A compiled kernel of straight-line code as a Python function, which also takes CasADi's symbols.

    The kernels that it calls are treated alike; `instead` gives functions for those that cannot be, by name.
    """
    source = kernel.py_func
    names = dict(source.__globals__)
    for name in source.__code__.co_names:
        if name in instead:
            names[name] = instead[name]
        elif hasattr(names.get(name), "py_func"):
            names[name] = on_symbols(names[name], **instead)
    return types.FunctionType(source.__code__, names, source.__name__)


def require_casadi() -> Any:
    """The module casadi. Raises DesignError without it."""
    try:
        import casadi
    except ImportError:
        raise DesignError(f"planning a swing-up needs CasADi: {install('plan')}") from None
    return casadi


@lru_cache(maxsize=32)
def plan_swing_up(plant: Plant, intervals: int = INTERVALS) -> Plan:
    """The fastest swing-up of `plant` that was found, within 0.9 of the motor's torque and 0.8 of the arm's travel.

    Where the plant's limits have a slew, the torque changes by at most 0.9 of it, from none at the start. A delay of
    the command changes no plan: it begins so much later. intervals: of the collocation. Each of several first guesses
    leads to a local minimum; the fastest is taken. Takes some seconds. Raises DesignError where none leads to a
    swing-up (which proves nothing), where the plant carries effects that add torques, which plans do not know, and
    without CasADi.
    """
    ca = require_casadi()
    strange = [e.name for e in plant.effects if e.type.place not in _KNOWN or "torque" in e.type.kernels]
    if strange:
        raise DesignError(f"plans know delay, lag and static maps of the command, not {', '.join(strange)}")
    for guesses in (GUESSES, LONG_GUESSES):
        problems = [(Collocation(ca, plant, intervals, end), swings) for swings, end in guesses]
        found = [plan for problem, swings in problems if (plan := problem.solve(swings=swings)) is not None]
        if found:
            break
    else:
        raise DesignError(
            f"no swing-up was found within commands of {plant.supply:g} {plant.unit} and the arm's travel; more of "
            "either may make one possible"
        )
    return min(found, key=lambda p: p.duration)


class Collocation:
    """The optimisation problem of a plan that ends upright at q2 = `end`, built once and solved from many starts."""

    def __init__(self, ca: Any, plant: Plant, intervals: int, end: float) -> None:
        low, high = KnownEffects(plant).torque_limits
        self._largest, self._end = MARGIN * min(-low, high), end
        self._pace, N = pendulum_frequency(plant.theta), intervals
        travel = 0.8 * plant.limit("arm_travel", ARM_TRAVEL)
        n = 4 + (plant.effect("actuator_lag") is not None)
        self._scale = np.array([1.0, 1.0, self._pace, self._pace, self._largest][:n])
        f, opti = _equations(ca, plant, n), ca.Opti()
        X, U, T = opti.variable(n, N + 1), opti.variable(2 * N + 1), opti.variable()
        start, h, scale = opti.parameter(n), T / N, self._scale
        for k in range(N):
            a, b = X[:, k] * scale, X[:, k + 1] * scale
            ua, um, ub = (U[2 * k + i] * self._largest for i in range(3))
            fa, fb = f(a, ua), f(b, ub)
            middle = 0.5 * (a + b) + h / 8 * (fa - fb)
            opti.subject_to((b - a - h / 6 * (fa + 4 * f(middle, um) + fb)) / scale == 0)
        opti.subject_to(opti.bounded(-1, U, 1))
        if (slew := plant.limit("slew", np.inf)) < np.inf:
            opti.subject_to(U[0] == 0)  # of a motor that was at rest
            most = MARGIN * slew / self._largest * h
            for k in range(N):  # a parabola is steepest at its ends
                a, m, b = (U[2 * k + i] for i in range(3))
                for rise in (4 * m - 3 * a - b, 3 * b + a - 4 * m):
                    opti.subject_to(rise <= most)
                    opti.subject_to(rise >= -most)
        opti.subject_to(opti.bounded(-travel, X[0, 1:], travel))
        opti.subject_to(opti.bounded(0.01 / self._pace, T, 80 / self._pace))
        opti.subject_to(X[:, 0] == start)
        opti.subject_to(X[1, N] == end)
        opti.subject_to(X[2:4, N] == 0)
        opti.subject_to(opti.bounded(-0.5 * travel, X[0, N], 0.5 * travel))
        opti.minimize(T * (1 + CALM * ca.sumsqr(U) / (2 * N + 1)))
        quiet = {"print_level": 0, "sb": "yes", "max_iter": 600, "tol": 1e-6}
        opti.solver("ipopt", {"print_time": False, "expand": True}, quiet)
        self._opti, self._variables, self._start = opti, (X, U, T), start

    def solve(
        self, start: NDArray[np.float64] | None = None, *, swings: float = 1.5, near: Plan | None = None
    ) -> Plan | None:
        """A local minimum from the state `start` (n,), by default hanging at rest; None where IPOPT gives up.

        The first guess is a pendulum whose swings grow to the end, so many, or the plan `near`.
        """
        (X, U, T), opti, scale = self._variables, self._opti, self._scale
        N = X.shape[1] - 1
        rest = np.array([0.0, np.pi, 0.0, 0.0, 0.0][: scale.size])
        opti.set_value(self._start, (rest if start is None else start) / scale)
        length, side = swings * 2 * np.pi / self._pace, 1.0 if self._end > np.pi else -1.0
        s = np.linspace(0, 1, N + 1)
        q2 = np.pi + side * np.pi * s * np.cos(2 * np.pi * swings * (1 - s))
        state = np.zeros((scale.size, N + 1))
        state[1], state[3] = q2, np.gradient(q2, length / N)
        torque = np.zeros(2 * N + 1)
        if near is not None:
            length, state, torque = near.duration, near.state, near.torque
        opti.set_initial(T, length)
        opti.set_initial(X, state / scale[:, None])
        opti.set_initial(U, torque / self._largest)
        try:
            solution = opti.solve()
        except RuntimeError:
            return None
        t = np.linspace(0, float(solution.value(T)), N + 1)
        return Plan(t, solution.value(X) * scale[:, None], np.asarray(solution.value(U)) * self._largest)


def _equations(ca: Any, plant: Plant, n: int) -> Any:
    """ẋ = f(x, τ) of the plant's kernel as a CasADi function."""
    move = on_symbols(acceleration, sincos=lambda q: (ca.sin(q), ca.cos(q)), tanh=ca.tanh)
    x, u = ca.SX.sym("x", n), ca.SX.sym("u")
    sharpness = (min(r, SHARPEST) for r in plant.sharpness)
    torque = x[4] if n == 5 else u
    a1, a2 = move(x[1], x[2], x[3], torque, 0.0, *(float(v) for v in plant.theta), *sharpness)
    rows = [x[2], x[3], a1, a2]
    if (lag := plant.effect("actuator_lag")) is not None:
        rows.append((u - x[4]) / max(lag.parameters["T"], 1e-4))
    return ca.Function("f", [x, u], [ca.vertcat(*rows)])
