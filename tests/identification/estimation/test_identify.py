"""The front of identification: joint logs, uneven clocks, knowledge from outside, verdicts, and measured logs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from furuta_gym.plant import TABLE_3, Effect, Plant
from furuta_gym.plant.rigid_body import physical_consistency
from furuta_gym.simulation import LONGEST_STEP
from identification.estimation.classical import _plant
from identification.estimation.ekf import track
from identification.estimation.estimate import Estimate
from identification.estimation.identifiability import NotIdentifiable
from identification.estimation.identify import identify
from identification.estimation.start import reduced
from identification.estimation.uncertainty import profile, recommended
from identification.kalman.record import Record
from identification.kalman.rounding import counted
from identification.logs.log import Log
from identification.logs.reading import read_log
from identification.validation.gap import validate
from tests.factories import closed_loop, hanging_log, open_loop_log, paper_log


@pytest.fixture(scope="module")
def upright() -> Log:
    return paper_log(T=0.002, duration=8.0)[0]


@pytest.fixture(scope="module")
def hanging() -> Log:
    """The same plant hanging, driven by a chirp, with other sensors and another clock."""
    return hanging_log()


@pytest.fixture(scope="module")
def fitted(upright: Log) -> Estimate:
    """The upright log by itself, with nothing known."""
    return identify(upright)


def within(plant: Plant, estimate, deviations: float = 5.0) -> bool:
    truth = dict(zip([f"theta{i}" for i in range(1, 10)], plant.theta, strict=True))
    return all(
        abs(v - truth[n]) < deviations * s
        for n, v, s in zip(estimate.names, estimate.values, estimate.std, strict=True)
        if n in truth
    )


@pytest.mark.parametrize(("d", "v", "step"), [(0.3, 0.2, 2.0), (2.0, 0.3, 1.0), (-9.0, 0.3, 1.0), (0.0, 0.01, 1.0)])
def test_a_rounded_reading_leaves_the_moments_of_its_cell(d: float, v: float, step: float) -> None:
    x = np.linspace(d - step / 2, d + step / 2, 200_001)
    log_p = norm.logpdf(x, 0, np.sqrt(v))
    p = np.exp(log_p - log_p.max())
    mass = np.trapezoid(p, x)
    mean = np.trapezoid(p * x, x) / mass
    e, S, cost = counted(d, v, step)
    assert v / S * e == pytest.approx(mean, abs=1e-7)
    assert v * (1 - v / S) == pytest.approx(np.trapezoid(p * (x - mean) ** 2, x) / mass, rel=1e-5)
    assert cost == pytest.approx(-np.log(mass / step) - log_p.max() - 0.5 * np.log(2 * np.pi), abs=1e-7)


def test_a_fine_encoder_is_an_exact_reading() -> None:
    assert counted(0.5, 2.0, 0.0) == pytest.approx((0.5, 2.0, 0.5 * (0.125 + np.log(2.0))))
    assert counted(0.5, 2.0, 0.35) == pytest.approx(counted(0.5, 2.0, 0.2), rel=0.01)


def test_upright_and_hanging_together(fitted: Estimate, upright: Log, hanging: Log) -> None:
    one, both = fitted, identify([upright, hanging])
    assert both.converged
    assert within(TABLE_3, both)
    i = one.names.index("theta2")
    assert both.std[i] < 0.5 * one.std[i]  # what the upright log alone hardly shows
    assert len(both.noise.reading_std) == 2


def test_uneven_stamps_and_gaps_are_used_as_they_are() -> None:
    fine = paper_log(T=0.002, duration=8.0)[0]
    rng = np.random.default_rng(4)
    # samples taken away at random while the command was held would be wrong; here only whole stretches go
    keep = np.ones(len(fine), dtype=bool)
    for start in rng.integers(200, len(fine) - 200, 3):
        keep[start : start + 40] = False
    log = Log(fine.t[keep], fine.q1[keep], fine.q2[keep], fine.u[keep], encoder_counts=fine.encoder_counts)
    assert len(log.pieces()) >= 3
    estimate = identify(log)
    assert estimate.converged
    assert within(TABLE_3, estimate)


def test_the_constraint_gives_a_rigid_body(fitted: Estimate, upright: Log) -> None:
    free, held = fitted, identify(upright, physical=True)
    assert not physical_consistency(free.plant.theta).consistent  # Table 3 itself is none (errata, row 5)
    assert physical_consistency(held.plant.theta).consistent
    assert held.log_likelihood < free.log_likelihood
    assert held.std[1] > 0.5 * free.std[1]  # of θ2: a limit that holds is no knowledge


def test_a_start_plant_serves_where_no_stretch_is_long_enough_for_a_regression(upright: Log) -> None:
    keep = (upright.t % 0.44) < 0.4
    gaps = Log(upright.t[keep], upright.q1[keep], upright.q2[keep], upright.u[keep], encoder_counts=(4096.0, 4096.0))
    with pytest.raises(ValueError, match="no motion is long enough to be smoothed"):
        identify(gaps)
    near = TABLE_3.replace(theta=1.1 * TABLE_3.theta)
    assert within(TABLE_3, identify(gaps, start=near))


def test_a_wrong_start_does_not_matter(fitted: Estimate, upright: Log) -> None:
    far = TABLE_3.replace(theta=TABLE_3.theta * np.array([1.88, 0.56, 2.29, 0.7, 0.7, 0.46, 0.9, 1.92, 0.55]))
    given = identify(upright, start=far)
    assert given.log_likelihood == pytest.approx(fitted.log_likelihood, abs=0.5)


@pytest.mark.parametrize(
    ("spoil", "names", "word"),
    [
        (lambda log: log.slice(stop=0.5), ("theta1", "theta5"), "too short"),
        (lambda log: _scaled(log, q1=0.002, q2=0.002), ("theta1", "theta5"), "resolution"),
        (lambda log: _scaled(log, q2=0.0), ("theta2", "theta4"), "pendulum"),
        (lambda log: _scaled(log, q1=0.0), ("theta1", "theta8"), "arm"),
        (lambda log: _scaled(log, u=0.0), ("theta1",), "command"),
    ],
)
def test_unidentifiable_logs_are_named_and_not_numbered(upright: Log, spoil, names, word) -> None:
    with pytest.raises(NotIdentifiable, match=word) as caught:
        identify(spoil(upright))
    assert set(names) <= set(caught.value.verdict.unidentified)
    assert caught.value.verdict.advice


def _scaled(log: Log, **factors: float) -> Log:
    columns = {n: getattr(log, n) * factors.get(n, 1.0) for n in ("q1", "q2", "u")}
    step = 2 * np.pi / 4096
    for n in ("q1", "q2"):
        columns[n] = step * np.round(columns[n] / step)
    return Log(log.t, **columns, encoder_counts=log.encoder_counts)


def test_a_gentle_log_says_that_theta2_is_weak() -> None:
    """A rig with restless torques, near upright: a number for θ2, and a warning with it."""
    run = closed_loop(T=0.004, duration=6.0, seed=1, phases=False, torque_noise=(3e-5, 3e-7), longest_step=LONGEST_STEP)
    estimate = identify(Log.from_run(run, counts=4096))
    assert "theta2" in (*estimate.identifiability.weak, *estimate.identifiability.unidentified)
    assert any("θ2" in advice and "swing" in advice for advice in estimate.identifiability.advice)
    assert estimate.plant.checks["identifiability"]["level"] != "good"


def test_the_profile_agrees_with_the_error_bar(upright: Log) -> None:
    estimate = identify(upright, sharpness=100.0)
    i = estimate.names.index("theta8")
    scale = estimate.problem.coordinates[i].slope(estimate.optimum.z[i])
    found = profile(estimate.problem, estimate.optimum.z, "theta8", float(np.sqrt(estimate.classical[i, i])) / scale)
    low, high = found.interval
    assert low < estimate.value("theta8") < high
    assert high - low == pytest.approx(2 * 1.96 * np.sqrt(estimate.classical[i, i]), rel=0.25)


def test_the_recommended_covariance_never_narrows() -> None:
    rng = np.random.default_rng(0)
    A, B = (x @ x.T for x in rng.normal(size=(2, 5, 5)))
    chosen = recommended(A, B)
    assert np.all(np.diag(chosen) >= np.maximum(np.diag(A), np.diag(B)) - 1e-12)
    assert np.linalg.eigvalsh(chosen).min() > 0


def test_a_reduced_record_keeps_the_impulse_of_the_command(upright: Log) -> None:
    record = Record.from_log(upright)
    short = reduced(record, duration=3.0, sample_time=0.008)
    first = int(np.flatnonzero((record.y == short.y[0]).all(axis=1))[0])
    for k in (0, 50, 200):
        inside = record.u[first + 4 * k : first + 4 * k + 4, 0]
        assert short.u[k, 0] == pytest.approx(inside.mean())


def test_the_file_tells_where_the_numbers_come_from(upright: Log, tmp_path: Path) -> None:
    estimate = identify(upright, fixed={"theta6": 0.0108})
    plant = Plant.load(estimate.save(tmp_path / "rig.json"))
    assert plant.provenance["logs"][0]["samples"] == len(upright)
    assert plant.provenance["fixed"] == {"theta6": 0.0108}
    assert plant.sample_time == pytest.approx(0.002)
    assert plant.sensors["encoder_counts"] == [4096, 4096]
    assert "theta6" not in plant.covariance.names


def test_the_online_filter_settles_near_the_truth() -> None:
    log = paper_log(T=0.002, duration=16.0)[0]
    history = track(log)
    error = np.abs(history.last / TABLE_3.theta - 1.0)
    assert np.all(error[[0, 7]] < 0.05)
    assert np.all(error[[2, 3, 4]] < 0.35)
    assert history.std[-1, 0] < history.std[500, 0]
    assert history.cost_per_sample < 1e-3


@pytest.mark.parametrize("method", ["recursive-ls", "ekf"])
def test_the_on_line_methods_come_through_the_same_door(method: str) -> None:
    log = paper_log(T=0.001, duration=8.0)[0]
    estimate = identify(log, method=method)
    assert estimate.method == method
    assert estimate.plant.theta[0] == pytest.approx(TABLE_3.theta[0], rel=0.1)
    assert estimate.plant.covariance is not None


@pytest.mark.parametrize("idle", [4.0, 10.0])
def test_the_online_filter_waits_for_the_command(idle: float) -> None:
    """Of seconds in which the pendulum only swings nobody can make a start."""
    t = 0.004 * np.arange(int((idle + 2.0) / 0.004))
    log = open_loop_log(np.where(t < idle, 0.0, 0.5 * np.sin(3.0 * np.pi * (t - idle))), q2=2.5)
    estimate = identify(log, method="ekf")
    assert estimate.plant.theta[0] == pytest.approx(TABLE_3.theta[0], rel=0.2)


@pytest.mark.parametrize("method", ["prediction-error", "ekf"])
def test_a_command_of_the_wrong_sign_is_refused_with_the_way_out(upright: Log, method: str) -> None:
    with pytest.raises(ValueError, match=r"does not drive the arm to the positive side.*--flip u"):
        identify([replace(upright, u=-upright.u)], method=method)


def test_values_that_no_plant_has_are_refused_with_the_way_out() -> None:
    theta = TABLE_3.theta * np.array([1, 1, 1, -1, 1, 1, 1, 1, 1])
    with pytest.raises(ValueError, match="prediction-error"):
        _plant(theta, "filtered-ls", TABLE_3)


def _real(folder: Path, name: str) -> Log:
    return read_log(folder / name, pendulum_zero="hanging", flip="q2", encoder_counts=2048)


def test_measured_hanging_chirps_give_an_honest_verdict(real_data: Path) -> None:
    logs = [_real(real_data, f"qube_darmstadt/chirp_{sign}1V5_250Hz_00.csv") for sign in "pm"]
    estimate = identify(logs)
    theta = estimate.plant.theta
    assert estimate.converged
    assert np.sqrt(theta[4] / theta[3]) / (2 * np.pi) == pytest.approx(1.755, abs=0.05)  # README of the data, Hz
    assert np.all(theta[5:] >= 0)
    assert estimate.at_bound or estimate.warnings  # model (5) alone does not hold this rig


def test_measured_upright_log(real_data: Path) -> None:
    path = "qube_mcgill/balance_prbs_20230828T161301.csv"
    estimate = identify(_real(real_data, path).slice(1.0))
    assert estimate.converged
    assert 0.05 < estimate.plant.theta[0] < 0.065
    assert 8.0**2 < estimate.plant.theta[4] / estimate.plant.theta[3] < 14.0**2


def test_an_axis_of_the_wrong_sign_is_told(real_data: Path) -> None:
    raw = real_data / "qube_darmstadt/chirp_p1V5_250Hz_00.csv"
    with pytest.warns(UserWarning, match="flip"):
        log = read_log(raw, pendulum_zero="hanging", encoder_counts=2048)
    assert any("flip" in warning for warning in identify(log).warnings)


def test_a_value_kept_at_the_starts_needs_a_start(upright: Log) -> None:
    with pytest.raises(ValueError, match="theta4 is to stay at the start plant's value, and there is no start"):
        identify(upright, fixed={"theta4": None})
    start = TABLE_3.replace(theta=TABLE_3.theta * np.where(np.arange(9) == 3, 1.1, 1.0))
    kept = identify(upright, start, fixed={"theta4": None})
    assert kept.plant.theta[3] == start.theta[3]
    assert kept.fixed == {"theta4": start.theta[3]}


@pytest.mark.parametrize("method", ["filtered-ls", "recursive-ls", "ekf"])
def test_every_method_writes_the_logs_encoders(upright: Log, method: str) -> None:
    sensors = identify(upright.slice(stop=3.0), method=method).plant.sensors
    assert sensors is not None
    assert tuple(sensors["encoder_counts"]) == upright.encoder_counts


@pytest.mark.parametrize("carried", [True, False])
def test_an_effects_parameter_can_be_fixed_or_have_a_prior(upright: Log, carried: bool) -> None:
    start = TABLE_3.with_effects(Effect("arm_spring", {"k": 0.5, "q1n": 0.3})) if carried else TABLE_3
    effects = () if carried else ("arm_spring",)
    known = {"fixed": {"arm_spring.k": 0.2}, "priors": {"arm_spring.q1n": (0.1, 1e-6)}}
    estimate = identify(upright, start, effects=effects, **known)
    assert estimate.plant.effect("arm_spring").parameters["k"] == 0.2
    assert estimate.fixed == {"arm_spring.k": 0.2}
    assert "arm_spring.k" not in estimate.names
    assert estimate.values[estimate.names.index("arm_spring.q1n")] == pytest.approx(0.1, abs=1e-5)


def test_all_parameters_may_be_given(upright: Log) -> None:
    """Then the noise alone is estimated, and nothing is called identified."""
    given = {f"theta{i}": float(value) for i, value in enumerate(TABLE_3.theta, 1)}
    estimate = identify(upright, fixed=given, sharpness=100.0)
    assert estimate.names == ()
    assert estimate.verdict.startswith("no parameter was free")
    assert np.array_equal(estimate.plant.theta, TABLE_3.theta)


def test_the_sharpness_of_one_axis_can_be_fixed(upright: Log) -> None:
    estimate = identify(upright, TABLE_3, fixed={"r1": 40.0}, priors={"r2": (300.0, 0.01)})
    assert estimate.plant.friction_sharpness == pytest.approx((40.0, 300.0), rel=1e-3)
    assert estimate.fixed == {"r1": 40.0}
    kept = identify(upright, TABLE_3.replace(friction_sharpness=(80.0, 300.0)), fixed={"r": None}, iterations=2)
    assert kept.plant.friction_sharpness == (80.0, 300.0)
    with pytest.raises(ValueError, match=r"prior on arm_spring\.k; the parameters are"):
        identify(upright, TABLE_3, priors={"arm_spring.k": (0.1, 0.1)})


def test_the_log_likelihood_is_that_of_the_log_alone(upright: Log) -> None:
    """A prior far from what the log says costs something, which is not the log's."""
    drawn = identify(upright, TABLE_3, priors={"theta5": (0.8, 0.05)})
    assert drawn.problem.prior_cost(drawn.optimum.z) > 1.0
    held = identify(upright, TABLE_3, fixed={"theta5": drawn.plant.theta[4]})
    assert drawn.log_likelihood == pytest.approx(held.log_likelihood, abs=0.1)


@pytest.mark.parametrize("method", ["filtered-ls", "ekf"])
def test_classical_results_are_of_the_model_they_fitted(upright: Log, method: str) -> None:
    start = TABLE_3.with_effects(Effect("arm_spring", {"k": 0.3, "q1n": 0.0})).replace(friction_sharpness=60.0)
    estimate = identify(upright, start, method=method)
    assert estimate.plant.effects == ()
    assert any("arm_spring is left out" in w for w in estimate.warnings)
    assert estimate.plant.friction_sharpness == (60.0 if method == "ekf" else 100.0)
    assert estimate.fixed == {"r": estimate.plant.friction_sharpness}


@pytest.mark.parametrize("method", ["filtered-ls", "recursive-ls", "ekf"])
def test_error_bars_that_are_too_small_say_so_everywhere(upright: Log, fitted: Estimate, method: str) -> None:
    estimate = identify(upright, method=method)
    assert "too small" in estimate.error_bars
    assert f"! {method}: {estimate.error_bars}" in str(estimate)
    assert estimate.to_dict()["error_bars"] == estimate.plant.checks["error_bars"] == estimate.error_bars
    assert fitted.to_dict()["error_bars"] is None
    assert "error_bars" not in fitted.plant.checks


def test_relative_std_is_what_the_page_on_json_says(upright: Log, fitted: Estimate) -> None:
    """The arm's friction is large here and the pendulum's small, so both kinds of size occur."""
    found, told = dict(zip(fitted.names, fitted.std_if_right, strict=True)), fitted.identifiability.relative_std
    theta = dict(zip(fitted.names, np.abs(fitted.values), strict=True))
    v1, v2 = (np.sqrt(np.mean((np.diff(q[::10]) / np.diff(upright.t[::10])) ** 2)) for q in (upright.q1, upright.q2))
    arm = 0.1 * (theta["theta8"] + theta["theta6"] * v1)
    least = {"theta8": arm, "theta6": arm / v1, "theta9": 0.01 * theta["theta5"], "theta7": 0.01 * theta["theta5"] / v2}
    sizes = {name: max(theta[name], least.get(name, 0.0)) for name in theta}
    assert told == pytest.approx({name: found[name] / sizes[name] for name in theta})
    assert any(sizes[name] > theta[name] for name in least)


def test_an_effects_parameter_may_be_known_to_be_zero(upright: Log) -> None:
    """Against itself, a spring at zero angle would never be identified."""
    spring = Effect("arm_spring", {"k": 0.3, "q1n": 0.0})
    run = closed_loop(TABLE_3.with_effects(spring), duration=8.0, phases=False, longest_step=LONGEST_STEP)
    estimate = identify(Log.from_run(run, counts=4096), TABLE_3, effects=["arm_spring"])
    i = estimate.names.index("arm_spring.q1n")
    assert estimate.std[i] < 0.05
    assert abs(estimate.values[i]) < 4 * estimate.std[i]
    assert estimate.identifiability.relative_std["arm_spring.q1n"] < 0.2
    assert "arm_spring.q1n" not in estimate.identifiability.unidentified


@pytest.mark.parametrize("start", [0.0, 3.2, 1.7e9])
def test_stamps_may_start_anywhere(upright: Log, start: float) -> None:
    """Blocks of the scores' sums may end at the last sample, whatever rounding says of it."""
    log = upright.slice(stop=float(upright.t[0]) + 5.001)
    moved = replace(log, t=np.round(log.t - log.t[0] + start, 6))
    assert (moved.t[-1] - moved.t[0] < 5.0) == (start == 3.2)  # by a bit or two
    assert identify(moved, TABLE_3, iterations=3).problem.records[0].duration == pytest.approx(5.0)


def test_parts_of_one_file_are_fitted_together_unless_they_overlap(upright: Log) -> None:
    """Of a file on the disk all parts have one digest."""
    log = replace(upright, sha256="0123")
    estimate = identify(log.split(0.5))
    assert estimate.samples == len(log)
    for overlapping in ([log, log], [log.slice(stop=4.0), log.slice(3.0)], [upright, upright]):
        with pytest.raises(ValueError, match="is given twice; expected each log once"):
            identify(overlapping)


@pytest.mark.parametrize("given", [{"fixed": {"r": 80.0}}, {"priors": {"r2": (80.0, 1.0)}}])
def test_a_sharpness_that_is_given_twice_is_refused(upright: Log, given: dict[str, dict]) -> None:
    with pytest.raises(ValueError, match=r"sharpness = 100 is r, and r2? is given too"):
        identify(upright, sharpness=100.0, **given)


def test_a_fit_that_is_not_polished_predicts_as_well(upright: Log, fitted: Estimate) -> None:
    """It ends within some nats of the optimum, and within its error bars."""
    rough = identify(upright, polished=False)
    assert -1e-3 < fitted.log_likelihood - rough.log_likelihood < 3.0
    assert np.all(np.abs(rough.values - fitted.values) < 0.5 * fitted.std)
    predicted, best = (validate(e.plant, upright).ratio_to_floor for e in (rough, fitted))
    assert predicted == pytest.approx(best, rel=0.02)
