"""Descents on functions whose minimum is known."""

from __future__ import annotations

import numpy as np
import pytest

from identification.estimation.optimise import Expansion, Optimum, minimise, promised

Array = np.ndarray


class Valley:
    """½ zᵀ A z of two coordinates that imitate each other: their sum is known a hundred thousand times worse than their
    difference."""

    low, high = np.full(2, -10.0), np.full(2, 10.0)
    noisy = np.zeros(2, dtype=bool)
    A = np.array([[1.0, -1.0], [-1.0, 1.0]]) * 1e10 + np.ones((2, 2))

    def value(self, z: Array) -> float:
        return float(0.5 * z @ self.A @ z)

    def expand(self, z: Array, exact: bool = False, scores: bool = False, central: bool = False) -> Expansion:
        return Expansion(self.value(z), self.A @ z, self.A)

    def moved(self, z: Array, step: Array, information: Array) -> Array:
        return np.clip(z + step, self.low, self.high)

    def axes(self, z: Array) -> Array:
        return np.eye(len(z))

    def reach(self, z: Array) -> Array:
        return np.ones(len(z))


def test_a_descent_arrives_along_what_the_data_hardly_see() -> None:
    """Damping holds back this direction first: two small steps in a row used to end a fit a nat above its optimum."""
    found = minimise(Valley(), np.array([0.7, 0.7]))
    assert found.converged
    assert found.value == pytest.approx(0.0, abs=0.02)
    assert np.abs(found.z).max() < 0.1


class Promised(Valley):
    """A minimum at which the derivatives promise some nats more, as they may at a bound or a kink."""

    def __init__(self, nats: float) -> None:
        self.slope = np.array([np.sqrt(2.0 * nats), 0.0])

    A = np.eye(2)

    def expand(self, z: Array, exact: bool = False, scores: bool = False, central: bool = False) -> Expansion:
        return Expansion(self.value(z), self.A @ z + self.slope, self.A)


@pytest.mark.parametrize(("nats", "converged"), [(0.35, True), (0.8, False)])
def test_where_no_step_comes_lower_half_a_nat_may_be_promised_still(nats: float, converged: bool) -> None:
    """Less is no whole standard deviation in any direction; more would leave the error bars without meaning."""
    found = minimise(Promised(nats), np.zeros(2))
    assert found.value == 0.0
    assert found.converged is converged
    assert found.message == ("converged" if converged else "no further descent")


@pytest.mark.parametrize("nats", [0.0, 0.35, 40.0])
def test_what_is_promised_is_half_the_slope_by_the_step(nats: float) -> None:
    """Within the ridge, which holds back a step of unit length by a tenth of a nat; towards a bound nothing is."""
    problem, z = Promised(nats), np.zeros(2)
    assert promised(problem, Optimum(z, 0.0, problem.expand(z), 4, False, "")) == pytest.approx(nats, rel=0.1)
    problem.low = np.zeros(2)
    assert promised(problem, Optimum(z, 0.0, problem.expand(z), 4, False, "")) == 0.0


class Banana(Valley):
    """A valley whose floor y = 0.009 x² curves: a straight step along it ends high on the wall."""

    def __init__(self) -> None:
        self.expanded = 0

    def residuals(self, z: Array) -> Array:
        return np.array([1e3 * (z[1] - 0.009 * z[0] ** 2), 3.0 * (1.0 - z[0])])

    def value(self, z: Array) -> float:
        return float(0.5 * np.sum(self.residuals(z) ** 2))

    def expand(self, z: Array, exact: bool = False, scores: bool = False, central: bool = False) -> Expansion:
        self.expanded += 1
        J = np.array([[-18.0 * z[0], 1e3], [-3.0, 0.0]])
        return Expansion(self.value(z), J.T @ self.residuals(z), J.T @ J)


def test_a_step_that_left_a_curved_valley_goes_back_to_its_floor() -> None:
    problem = Banana()
    found = minimise(problem, np.array([0.1, 0.00009]))
    assert found.converged
    assert found.value == pytest.approx(0.0, abs=0.01)
    assert problem.expanded < 8  # 13 with damping alone


class Faint(Valley):
    """A minimum 45 scales from the start, in a coordinate that the data know to ± 10 scales only."""

    low, high = np.zeros(2), np.full(2, 1e3)
    A = np.diag([1e6, 1e-2])
    lowest = np.array([1.0, 45.0])

    def __init__(self) -> None:
        self.expanded = 0

    def value(self, z: Array) -> float:
        return float(0.5 * (z - self.lowest) @ self.A @ (z - self.lowest))

    def expand(self, z: Array, exact: bool = False, scores: bool = False, central: bool = False) -> Expansion:
        self.expanded += 1
        return Expansion(self.value(z), self.A @ (z - self.lowest), self.A)

    def reach(self, z: Array) -> Array:
        return np.maximum(1.0, np.abs(z))


def test_a_descent_goes_far_from_a_small_start_in_few_steps() -> None:
    """As friction does that starts near zero: steps of its first size, and a ridge of that size, took forty-four."""
    problem = Faint()
    found = minimise(problem, np.array([1.0, 1.0]))
    assert found.converged
    assert found.value == pytest.approx(0.0, abs=0.02)
    assert problem.expanded < 12


class Twins(Valley):
    """Two coordinates that imitate each other to a billionth, seen as sharply as by readings without noise."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        first = 1e7 * rng.standard_normal(50)
        self.J = np.column_stack([first, first * (1.0 + 1e-9 * rng.standard_normal(50))])
        self.A = self.J.T @ self.J

    def reach(self, z: Array) -> Array:
        return np.full(len(z), 1e3)


@pytest.mark.parametrize("seed", range(60))
def test_parameters_that_imitate_each_other_exactly_end_no_fit(seed: int) -> None:
    """The information is singular to the last digit; a solution of it would raise LinAlgError in one of ten."""
    found = minimise(Twins(seed), np.array([0.5, -0.4]))
    assert np.isfinite(found.value)
    assert found.value <= Twins(seed).value(np.array([0.5, -0.4]))
