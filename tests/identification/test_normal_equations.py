"""Normal equations against numpy's own least squares and inverses, on columns of any size and with directions lost."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.normal_equations import ScaledGram

seeds = st.integers(0, 10_000)
spreads = st.floats(0.0, 8.0)  # decades between the columns' units


def columns(seed: int, spread: float, m: int = 6, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Columns (n, m) in units that differ by 2 · spread decades, and a right side (n,)."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, m)) * 10.0 ** rng.uniform(-spread, spread, m), rng.normal(size=n)


@given(seeds, spreads)
def test_the_solution_is_that_of_least_squares_whatever_the_units(seed, spread):
    D, y = columns(seed, spread)
    length = np.linalg.norm(D, axis=0)
    expected = np.linalg.lstsq(D / length, y, rcond=None)[0] / length
    x, rank = ScaledGram.of(D.T @ D).solve(D.T @ y, 1e-9)
    assert rank == 6
    np.testing.assert_allclose(x * length, expected * length, rtol=1e-9, atol=1e-11)


@given(seeds, spreads)
def test_the_gain_is_half_of_what_the_fit_takes_from_the_sum_of_squares(seed, spread):
    D, y = columns(seed, spread)
    fit = D @ (np.linalg.lstsq(D / np.linalg.norm(D, axis=0), y, rcond=None)[0] / np.linalg.norm(D, axis=0))
    gain, rank = ScaledGram.of(D.T @ D).gain(D.T @ y, 1e-6)
    assert rank == 6
    assert gain == pytest.approx(0.5 * (y @ y - (y - fit) @ (y - fit)), rel=1e-9)


@given(seeds, spreads)
def test_a_lost_direction_is_left_out_and_not_guessed(seed, spread):
    """A column twice, and a sum of two: rank, fit and scaled length are those of numpy's least squares."""
    D, y = columns(seed, spread, m=4)
    unit = D / np.linalg.norm(D, axis=0)
    D = np.column_stack([D, 3.0 * D[:, 0], unit[:, 1] + unit[:, 2]])
    length = np.linalg.norm(D, axis=0)
    expected, _, numpys_rank, _ = np.linalg.lstsq(D / length, y, rcond=1e-6)
    equations = ScaledGram.of(D.T @ D)
    x, rank = equations.solve(D.T @ y, 1e-9)
    assert rank == numpys_rank == equations.gain(D.T @ y, 1e-9).rank == 4
    np.testing.assert_allclose(x * length, expected, atol=1e-6)
    assert equations.gain(D.T @ y, 1e-9).gain == pytest.approx(0.5 * y @ (D / length) @ expected, rel=1e-6)


@pytest.mark.parametrize(("cut", "rank"), [(1e-9, 3), (1e-4, 2), (0.6, 1)])
def test_the_cut_decides_which_directions_count(cut, rank):
    """Eigenvalues 1.5 + …: two columns that differ by 1e-3 of their length, and a third one apart."""
    D = np.array([[1.0, 1.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, 1.0]])
    assert ScaledGram.of(D.T @ D).solve(np.ones(3), cut).rank == rank


@given(seeds, spreads)
def test_the_inverse_is_numpys_where_the_data_show_everything(seed, spread):
    D, _ = columns(seed, spread)
    length = np.linalg.norm(D, axis=0)
    expected = np.linalg.pinv((D / length).T @ (D / length), hermitian=True)
    scaled = ScaledGram.of(D.T @ D).inverse(1e-13) * np.outer(length, length)
    np.testing.assert_allclose(scaled, expected, rtol=1e-8, atol=1e-9)


def test_the_inverse_states_a_huge_finite_variance_where_nothing_is_shown():
    inverse = ScaledGram.of(np.array([[4.0, 4.0], [4.0, 4.0]])).inverse(1e-13)
    assert np.isfinite(inverse).all()
    assert np.linalg.eigvalsh(inverse).max() == pytest.approx(1e13 / 4.0, rel=1e-2)
    assert np.array([1.0, 1.0]) @ inverse @ np.array([1.0, 1.0]) == pytest.approx(0.25, abs=0.01)  # of the sum: known


def test_a_column_of_zeros_gets_nothing():
    equations = ScaledGram.of(np.diag([0.0, 9.0]))
    x, rank = equations.solve(np.array([0.0, 3.0]), 1e-9)
    np.testing.assert_allclose(x, [0.0, 1.0 / 3.0])
    assert rank == 1
    assert equations.gain(np.array([0.0, 3.0]), 1e-6) == pytest.approx((0.5, 1))
    assert ScaledGram.of(np.zeros((2, 2))).solve(np.zeros(2), 1e-9).rank == 0
    assert ScaledGram.of(np.zeros((0, 0))).solve(np.zeros(0), 1e-9).rank == 0


@given(seeds, st.floats(1e-6, 10.0))
def test_a_ridge_of_the_callers_own_goes_along_and_back(seed, precision):
    D, y = columns(seed, 3.0)
    equations = ScaledGram.of(D.T @ D)
    x = equations.back(equations.along(D.T @ y) / (equations.values + precision))
    penalty = np.diag(precision * equations.scale**2)
    length = equations.scale
    system = (D.T @ D + penalty) / np.outer(length, length)
    np.testing.assert_allclose(x * length, np.linalg.solve(system, D.T @ y / length), rtol=1e-8, atol=1e-11)


@pytest.mark.parametrize("gram", [np.ones((4, 3)), np.ones(3)], ids=["columns", "vector"])
def test_what_is_no_square_matrix_is_refused(gram):
    with pytest.raises(ValueError, match=r"square.*got shape"):
        ScaledGram.of(gram)


@pytest.mark.parametrize("method", ["solve", "gain"])
def test_a_right_side_of_another_length_is_refused(method):
    with pytest.raises(ValueError, match=r"shape \(2,\)"):
        getattr(ScaledGram.of(np.eye(2)), method)(np.ones(3), 1e-9)
