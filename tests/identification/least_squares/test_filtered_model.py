"""Section 2.3 in discrete form, against SciPy's conversions, an ODE solver, and motions whose torque is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete, lfilter

from furuta_gym.plant import LARGE_RIG, QUBE, TABLE_3
from furuta_gym.plant.regressor import omega_a, omega_b, regressor
from identification.least_squares.filtered_model import (
    FRICTION_SHARPNESS,
    filter_regressors,
    filtered_models,
    joined_times,
    stacked,
)
from identification.logs.log import Log, LogError
from tests.factories import paper_log


def smooth_motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, q̇, q̈ (n, 2) of a motion without corners, from formulas."""
    a = np.array([[0.4, 0.2], [0.7, 0.3]])
    w = np.array([[3.0, 7.0], [4.0, 2.5]])
    p = np.array([[0.3, 1.0], [0.0, 2.0]])
    phase = w * t[:, None, None] + p
    return (a * np.sin(phase)).sum(2), (a * w * np.cos(phase)).sum(2), (-a * w**2 * np.sin(phase)).sum(2)


@pytest.mark.parametrize(("lam", "T"), [(10.0, 0.001), (30.0, 0.005), (1.0, 0.002), (100.0, 0.01)])
def test_discrete_filters_are_the_exact_conversions(lam, T):
    rng = np.random.default_rng(0)
    q, v, u = rng.normal(size=(200, 2)), rng.normal(size=(200, 2)), rng.normal(size=200)
    omega_f, u_f = filter_regressors(q, v, u, T, lam=lam)
    system = ([lam], [1.0, lam])
    b, a, _ = cont2discrete(system, T, "zoh")
    np.testing.assert_allclose(u_f[:, 0], lfilter(b[0], a, u), atol=1e-12)
    np.testing.assert_array_equal(u_f[:, 1], 0.0)
    b, a, _ = cont2discrete(system, T, "foh")
    w_b = omega_b(q, v, FRICTION_SHARPNESS)
    expected = lfilter(b[0], a, w_b - w_b[0], axis=0)  # from rest at the first value …
    decay = np.exp(-lam * T * np.arange(200))[:, None, None]
    expected += (1 - decay) * w_b[0]  # … and its step response
    w_a = omega_a(q, v)
    smoothed = lfilter(b[0], a, w_a - w_a[0], axis=0) + w_a[0]
    np.testing.assert_allclose(omega_f, lam * (w_a - smoothed) + expected, atol=1e-9)


@pytest.mark.parametrize("lam", [3.0, 30.0])
def test_filtered_model_is_the_filtered_torque_from_the_first_sample(lam):
    """Ω_f θ must be f(s) applied to the torque Y(q, q̇, q̈) θ that the motion needs, both rows, error O(T²)."""
    theta, r = TABLE_3.theta, 20.0

    def torque(t):
        q, v, a = smooth_motion(np.atleast_1d(t))
        return regressor(q, v, a, r) @ theta

    end = 1.5
    solution = solve_ivp(
        lambda t, y: lam * (torque(t)[0] - y),
        (0, end),
        np.zeros(2),
        "DOP853",
        rtol=1e-10,
        atol=1e-12,
        dense_output=True,
    )
    errors = []
    for T in (0.004, 0.002, 0.001):
        t = np.arange(round(end / T) + 1) * T
        q, v, _ = smooth_motion(t)
        omega_f, _ = filter_regressors(q, v, np.zeros(len(t)), T, lam=lam, r=r)
        errors.append(np.abs(omega_f @ theta - solution.sol(t).T).max())
    assert errors[2] < 2e-4 * np.abs(solution.y).max()
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.2)


@pytest.mark.parametrize("plant", [TABLE_3, QUBE, LARGE_RIG], ids=["table3", "qube", "large"])
def test_the_truth_solves_the_filtered_model_of_its_own_motion(plant):
    """With true states, the held command and smooth friction, what is left of u_f − Ω_f θ falls as T²."""
    plant = plant.replace(friction_sharpness=5.0)
    sizes = []
    for T in (0.002, 0.001, 0.0005):
        log, state = driven(plant, T)
        omega_f, u_f = filter_regressors(state[:, :2], state[:, 2:], log.u, T, lam=10.0, r=5.0)
        sizes.append(np.abs(u_f - omega_f @ plant.theta).max() / np.abs(u_f).max())
    assert sizes[-1] < 1e-5
    assert sizes[0] > 3 * sizes[1] > 3 * 3 * sizes[2]


def driven(plant, T):
    from furuta_gym.sensors import Sensors
    from furuta_gym.simulation import open_loop, simulate

    command = 0.3 * plant.u_max * np.sin(4.0 * np.floor(np.arange(round(3 / T)) * T / 0.01) * 0.01)
    run = simulate(
        plant, open_loop(command), 3.0, T, Sensors(encoder_counts=None), x0=(0, np.pi, 0, 0), longest_step=2.5e-4
    )
    return Log.from_run(run), run.state


def test_errata_the_printed_16_does_not_hold():
    """Eq. (16) prints s f(s) Ω_b: with it the truth leaves errors as large as the torque itself."""
    log, state = paper_log(0.001, 3.0, None)
    q, v, lam, T = state[:, :2], state[:, 2:], 10.0, 0.001
    omega_f, u_f = filter_regressors(q, v, log.u, T, lam=lam)
    w_b = omega_b(q, v, FRICTION_SHARPNESS)
    b, a, _ = cont2discrete(([lam], [1.0, lam]), T, "foh")
    f_w_b = lfilter(b[0], a, w_b, axis=0)
    printed = omega_f - f_w_b + lam * (w_b - f_w_b)
    size = np.sqrt(np.mean(u_f**2))
    assert np.sqrt(np.mean((u_f - omega_f @ TABLE_3.theta) ** 2)) < 1e-3 * size
    assert np.sqrt(np.mean((u_f - printed @ TABLE_3.theta) ** 2)) > 0.3 * size


def test_models_of_gaps_and_uneven_clocks():
    log, _ = paper_log(0.002, 10.0)
    keep = np.ones(len(log), dtype=bool)
    keep[2000:2040] = keep[2100] = False  # the 60 samples between two gaps are too few for the filter
    broken = log.taken(keep)
    models = filtered_models(broken, lam=5.0)
    assert [len(m.t) for m in models] == [2000, len(log) - 2101]
    (whole,) = filtered_models(log, lam=5.0)
    np.testing.assert_allclose(models[0].omega_f[:1800], whole.omega_f[:1800], atol=1e-9)
    Y, u = stacked(models)
    assert Y.shape == (2 * sum(len(m.t) for m in models), 9)
    assert len(u) == len(Y)
    times = joined_times(models)
    assert times[0] == 0
    assert (np.diff(times) > 0).all()
    assert np.ptp(np.diff(times)) < 1e-9


def test_stamps_with_jitter_are_used():
    """Samples taken late, with stamps that say so, give the same regression; stamps on a false grid do not."""
    log, _ = paper_log(0.001, 6.0, None)
    late = 0.3e-3 * np.sin(40 * log.t)
    t = log.t + late
    jittered = Log(t, np.interp(t, log.t, log.q1), np.interp(t, log.t, log.q2), log.u)
    (reference,) = filtered_models(log)
    (stamped,) = filtered_models(jittered)
    (ignored,) = filtered_models(Log(log.t, jittered.q1, jittered.q2, log.u))
    inner, n = slice(200, -200), len(reference.t)

    def distance(model):
        scale = np.abs(reference.omega_f[inner]).max(axis=(0, 1)) + 1e-9
        return np.max(np.abs(model.omega_f[:n][inner] - reference.omega_f[inner]) / scale)

    assert distance(stamped) < 0.5 * distance(ignored)


def test_resampling_to_a_given_T():
    log, _ = paper_log(0.002, 10.0)
    (model,) = filtered_models(log, T=0.004)
    assert pytest.approx(0.004) == model.T
    assert len(model.t) == 2500


@pytest.mark.parametrize(
    ("options", "message"),
    [({"lam": 0.0}, "lam = 0"), ({"r": -1.0}, "r = -1"), ({"lam": np.nan}, "positive"), ({"wc": 2.0}, "Nyquist")],
)
def test_settings_that_make_no_sense(options, message):
    log, _ = paper_log()
    with pytest.raises(ValueError, match=message):
        filtered_models(log, **options)


def test_logs_that_are_too_short_for_the_filter():
    log, _ = paper_log()
    with pytest.raises(LogError, match="more than 90 samples"):
        filtered_models(log.slice(0, 0.1))
    with pytest.raises(LogError, match="none given"):
        filtered_models([])
