"""The likelihood through the Kalman filter's innovations: derivatives, known truth from wrong starts, error bars."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Effect, Plant
from identification.estimation.estimate import Estimate
from identification.estimation.identify import identify
from identification.estimation.optimise import minimise
from identification.estimation.pool import shared_pool
from identification.estimation.prediction_error import PredictionError, quietest
from identification.kalman.coordinates import noise_coordinates, plant_coordinates, zero_coordinates
from identification.kalman.likelihood import whiten
from identification.kalman.noise_model import Noise
from identification.kalman.record import Record
from identification.logs.log import Log
from tests.factories import loop_log, noisy_log, paper_log

TRUTH = np.array([*TABLE_3.theta, 100.0])
NOISE = Noise((1e-3, 1e-5))


@pytest.fixture(scope="module")
def log() -> Log:
    return noisy_log(0)


@pytest.fixture(scope="module")
def fitted(log: Log) -> Estimate:
    """The log by itself, from a start that is right."""
    return identify(log, "table3")


def problem(log: Log, plant: Plant = TABLE_3) -> PredictionError:
    return PredictionError(plant, [Record.from_log(log)], plant_coordinates(plant) + noise_coordinates(), NOISE)


def test_a_step_leads_as_far_as_a_factor_or_as_the_value_itself(log: Log) -> None:
    """Friction may start far below its size; what is a logarithm has its size left out."""
    p = problem(log.slice(0.0, 1.0))
    names = [c.name for c in p.coordinates]
    z = p.start()
    z[names.index("theta7")], z[names.index("theta8")] = 45.0, 0.2
    reach = dict(zip(names, p.reach(z), strict=True))
    assert reach["theta7"] == 45.0
    assert reach["theta8"] == reach["theta5"] == reach["r"] == reach["torque_noise1"] == 1.0


@pytest.mark.parametrize(("free", "central", "parts"), [(2, False, 2), (2, True, 2), (7, True, 6), (100, True, 6)])
def test_a_bank_is_dealt_to_threads_only_where_others_are_free(
    log: Log, free: int, central: bool, parts: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a thread of the pool all parts would run one after the other, each with a leader of its own."""
    monkeypatch.setattr("identification.estimation.prediction_error.threads", lambda: free)
    pool, banks = shared_pool(), []

    class Counted(PredictionError):
        def _filter(self, *arguments: Any) -> Any:
            banks.append(len(arguments[1]))
            return super()._filter(*arguments)

    p = problem(log.slice(0.0, 1.0))
    counted = Counted(TABLE_3, p.records, p.coordinates, NOISE, pool=pool)
    here = counted.expand(counted.start(), exact=central, central=central)
    sides, n = 1 + central, len(p.coordinates)
    assert len(banks) == parts <= sides * n
    assert sum(banks) == sides * n + parts
    banks.clear()
    there = pool.submit(counted.expand, counted.start(), exact=central, central=central).result()
    assert banks == sides * [n + 1]
    assert there.value == here.value
    np.testing.assert_array_equal(there.gradient, here.gradient)
    np.testing.assert_array_equal(there.information, here.information)


def test_the_zeros_of_another_log_take_no_filter() -> None:
    """Nor do they change what the filters of a log say."""
    banks: list[tuple[int, int]] = []

    class Counted(PredictionError):
        def _filter(self, *arguments: Any) -> Any:
            banks.append((arguments[0].log, len(arguments[1])))
            return super()._filter(*arguments)

    plant = TABLE_3.with_effects(TABLE_3.default_effect("arm_spring"))
    log, _ = paper_log(duration=2.0, plant=plant)
    records = [replace(Record.from_log(log), log=i) for i in range(2)]
    coordinates = plant_coordinates(plant) + noise_coordinates() + zero_coordinates(plant, records)
    p = Counted(plant, records, coordinates, NOISE)
    z, n = p.start(), len(coordinates)
    there = p.expand(z, exact=True, scores=True)
    own = {i: [j for j, c in enumerate(coordinates) if c.zero_of == i] for i in range(2)}
    assert own[1]
    assert banks == [(i, n + 1 - len(own[1 - i])) for i in range(2)]
    assert there.scores is not None
    for i in range(2):
        assert not there.scores[i][:, own[1 - i]].any()
        for j in own[i]:
            h = 1e-4 * np.eye(n)[j]
            slope = (p.value(z + h) - p.value(z - h)) / 2e-4
            assert there.gradient[j] == pytest.approx(slope, rel=0.02, abs=0.5)


def test_gradient_is_the_slope_of_the_objective(log: Log) -> None:
    p = problem(log.slice(0.0, 3.0), TABLE_3.replace(theta=TABLE_3.theta * 1.1))
    z = p.start()
    gradient = p.expand(z, exact=True).gradient
    for i in range(len(z)):
        h = 1e-4 * np.eye(len(z))[i]
        slope = (p.value(z + h) - p.value(z - h)) / 2e-4
        assert gradient[i] == pytest.approx(slope, rel=0.02, abs=0.5 + 1e-3 * np.abs(gradient).max()), p.coordinates[i]


def test_wrong_starts_reach_the_same_optimum_and_the_truth(log: Log) -> None:
    rng = np.random.default_rng(1)
    ends = []
    while len(ends) < 4:
        factor = np.exp(rng.uniform(-1, 1, 9) * np.log(3.0))
        try:
            start = TABLE_3.replace(theta=TABLE_3.theta * factor, friction_sharpness=60.0)
        except ValueError:  # no positive mass matrix
            continue
        p = problem(log, start)
        ends.append(minimise(p, p.start(), 60))
    values = np.array([end.value for end in ends])
    assert np.ptp(values) < 0.5, values
    spread = np.sqrt(np.diag(np.linalg.inv(ends[-1].expansion.information)))[:10]
    found = np.array([c.to_value(z) for c, z in zip(p.coordinates, ends[-1].z, strict=True)])[:10]
    std = spread * [c.slope(z) for c, z in zip(p.coordinates[:10], ends[-1].z[:10], strict=True)]
    assert np.all(np.abs(found - TRUTH) < 4 * std)


def test_whitened_innovations_are_white_and_no_larger_than_said(log: Log) -> None:
    p = problem(log)
    end = minimise(p, p.start())
    e, S, _ = p.run(p.records[0], end.z[None], 1)
    w = whiten(e[:, :, 0], S[:, :, 0])[50:]
    # rounding passes for white noise of q²/12, which is more than a resting angle has: their size stays below one
    assert np.all((np.std(w, axis=0) > 0.4) & (np.std(w, axis=0) < 1.1))
    correlation = np.sum(w[1:] * w[:-1], axis=0) / np.sum(w * w, axis=0)
    assert np.all(np.abs(correlation) < 0.1)


def test_error_bars_cover_the_truth() -> None:
    """z-scores of θ1 … θ5 over independent runs: neither far too wide nor far too narrow."""
    scores = []
    for seed in range(8):
        estimate = identify(noisy_log(10 + seed, T=0.004, duration=8.0), start="table3")
        scores.append((estimate.values[:9] - TABLE_3.theta) / estimate.std[:9])
    size = np.sqrt(np.mean(np.square(scores)))
    assert 0.6 < size < 1.5, size
    assert np.mean(np.abs(scores) < 1.96) > 0.85


def cable_scores(seeds: range) -> np.ndarray:
    """z-scores of a cable's k, q1n, k3, q1s in fits that start at the truth."""
    found = []
    for seed in seeds:
        log, plant = loop_log("arm_cable", T=0.008, seed=seed)
        (cable,), (true,) = identify(log, plant).plant.effects, plant.effects
        found.append([(cable.parameters[k] - x) / cable.std[k] for k, x in true.parameters.items()])
    return np.array(found)


def test_error_bars_cover_parameters_that_imitate_each_other() -> None:
    """A cable's stiffness and softest place: their answers cancel to a thousandth, and differences over longer steps
    gave a tenth of the standard deviations."""
    assert np.all(np.median(np.abs(cable_scores(range(6))), axis=0) < 1.0)


def test_differences_are_as_short_as_need_be() -> None:
    """A cable's standard deviations from steps a third and three times as long are the same; from steps of a
    thousandth they are too small. (Shorter than a tenth, rounding errors make them too small again.)"""
    log, plant = loop_log("arm_cable", duration=6.0)
    records = [Record.from_log(log)]
    coordinates = plant_coordinates(plant)
    cable = [i for i, c in enumerate(coordinates) if c.name.startswith("arm_cable")]

    def deviations(longer: float) -> np.ndarray:
        stepped = [replace(c, step=c.step * longer) for c in coordinates]
        p = PredictionError(plant, records, stepped, Noise(quietest(plant, records)))
        return np.sqrt(np.diag(np.linalg.inv(p.expand(p.start(), exact=True).information)))[cable]

    usual = deviations(1.0)
    np.testing.assert_allclose(deviations(0.3), usual, rtol=0.05)
    np.testing.assert_allclose(deviations(3.0), usual, rtol=0.05)
    assert np.all(deviations(1e3) < 0.6 * usual)


def test_the_objective_is_smooth_over_the_steps_of_its_derivatives() -> None:
    """Second differences over 3e-11 show rounding errors alone. With state Jacobians over 1e-6 they were 2e-6 nats,
    which differences over 1e-6 turn into slopes of whole nats."""
    log, plant = loop_log("arm_cable", T=0.004)
    records = [Record.from_log(log)]
    p = PredictionError(plant, records, plant_coordinates(plant), Noise(quietest(plant, records)))
    direction = np.eye(len(p.coordinates))[3]
    values = [p.value(p.start() + x * direction) for x in np.linspace(0.0, 1e-9, 30)]
    assert np.std(np.diff(values, 2)) < 6e-7


def test_the_log_alone_gives_the_start(log: Log) -> None:
    estimate = identify(log)
    assert estimate.converged
    assert np.all(np.abs(estimate.values[:9] - TABLE_3.theta) < 5 * estimate.std[:9])
    assert estimate.plant.covariance is not None
    assert "theta2" in str(estimate)
    vanished = replace(estimate, values=np.r_[estimate.values[:6], 1e-25, estimate.values[7:]])  # at its bound, nearly
    shown = {line.split()[0]: line for line in str(vanished).splitlines()[1:]}
    assert "%" in shown["theta6"]
    assert "%" not in shown["theta7"]
    assert Plant.from_dict(estimate.plant.to_dict()) == estimate.plant


def test_two_logs_know_more_than_one(fitted: Estimate, log: Log) -> None:
    two = identify([log, noisy_log(99)], "table3")
    assert np.all(two.std[:9] < fitted.std[:9])


def test_known_values_and_priors_are_kept(fitted: Estimate, log: Log) -> None:
    fixed = identify(log, "table3", fixed={"theta4": 0.0119})
    assert fixed.plant.theta[3] == pytest.approx(0.0119)
    assert "theta4" not in fixed.names
    prior = identify(log, "table3", priors={"theta2": (0.05, 1e-5)})
    assert abs(prior.plant.theta[1] - 0.05) < 1e-4 < abs(fitted.plant.theta[1] - 0.05)


def test_an_effect_is_estimated_along() -> None:
    plant = TABLE_3.with_effects(Effect("arm_spring", {"k": 0.4, "q1n": 0.3}))
    estimate = identify(noisy_log(3, plant), "table3", effects=["arm_spring"])
    found = estimate.plant.effect("arm_spring")
    assert found is not None
    assert abs(found.parameters["k"] - 0.4) < 5 * found.std["k"] < 0.1
    assert abs(found.parameters["q1n"] - 0.3) < 5 * found.std["q1n"]


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda log: {"u": np.full_like(log.u, 0.5)}, "command"),
        (lambda log: {"q1": np.zeros_like(log.q1)}, "arm"),
        (lambda log: {"q2": np.zeros_like(log.q2)}, "pendulum"),
    ],
)
def test_what_is_not_excited_is_named(log: Log, spoil, word: str) -> None:
    columns = {"t": log.t, "q1": log.q1, "q2": log.q2, "u": log.u} | spoil(log)
    with pytest.raises(ValueError, match=word):
        identify(Log(**columns, encoder_counts=(4096, 4096)))


def test_unknown_names_and_methods_are_refused(log: Log) -> None:
    with pytest.raises(ValueError, match="theta10"):
        identify(log, "table3", fixed={"theta10": 1.0})
    with pytest.raises(ValueError, match="filtered-ls"):
        identify(log, method="magic")


def test_perfect_sensors_and_long_samples() -> None:
    log, _ = paper_log(T=0.005, duration=10.0, counts=None)
    estimate = identify(log, "table3")
    assert estimate.plant.theta == pytest.approx(TABLE_3.theta, rel=0.05)


def test_one_side_of_a_difference_will_do_where_the_other_has_no_plant(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the edge of what is a plant, a filter that is shifted beyond it diverges."""
    log, truth = loop_log(duration=2.0)
    record = Record.from_log(log)
    problem = PredictionError(truth, [record], plant_coordinates(truth), Noise((1e-6, 1e-6)))
    z, own = problem.start(), PredictionError._differences

    def forward(self, z, sides, exact):
        return [*own(self, z, sides[:1], exact), None]

    def backward(self, z, sides, exact):
        return [None, *own(self, z, sides[:1], exact)]

    one = problem.expand(z, exact=True)
    for half in (forward, backward):
        monkeypatch.setattr(PredictionError, "_differences", half)
        there = problem.expand(z, exact=True, central=True)
        assert there.value == one.value
        np.testing.assert_array_equal(there.gradient, one.gradient)
    monkeypatch.setattr(PredictionError, "_differences", lambda *asked: [None, None])
    assert problem.expand(z, exact=True, central=True).value == np.inf
