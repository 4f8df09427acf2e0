"""D-optimal excitation: the d(t) whose log will say most about θ, within limits (Goodwin & Payne 1977, ch. 6).

The criterion is the determinant of the Fisher information of θ1 … θ9 that the innovations of a simulated log hold,
the same information whose inverse becomes the error bars after the experiment; r and the noise intensities are
marginalised, the first state is by the filter. Two families compete, both scaled until the limits are met: sets of
three square waves like the paper's d(t), and sums of sines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from furuta_gym.plant import THETA_NAMES, Plant

from ..estimation.most_likely import R_PRIOR
from ..estimation.pool import shared_pool
from ..estimation.prediction_error import PredictionError
from ..estimation.uncertainty import inverse_information
from ..kalman.coordinates import SHARPNESS_NAMES, Coordinate, noise_coordinates, plant_coordinates, zero_coordinates
from ..kalman.noise_model import Noise
from ..kalman.record import Record
from .setup import Limits, Run, Setup, sized, within_limits
from .signals import Signal, Sines, SquareWave, Sum, paper_signal

PERIOD = 6.0  # s: designs repeat after it, so that the search need not look further
EVALUATIONS = 70  # designs that are simulated in a search
_SCALINGS = 4  # runs that bring a design near its limits
_FEWEST = 36  # COBYLA's first simplex in 12 dimensions, twice
_LINES = 1.0 / PERIOD * np.array([1, 2, 4, 7, 13, 24])  # Hz, of the sums of sines
_FASTEST = 6.0  # Hz, of the square waves
_STEP = 0.35  # of the search: factors e^0.35 in amplitude and period, a third of a cycle in phase
_NAN = np.full(9, math.nan)


@dataclass(frozen=True)
class Precision:
    """What a log will tell of θ: predicted standard deviations (9,), and log det of their covariance in relative
    units (friction in units of its scale), lower is better."""

    std: NDArray[np.float64]
    log_volume: float


@dataclass(frozen=True)
class Design:
    """An excitation and what it promises, beside the paper's d(t) under the same limits.

    signal: d(t), or u(t) where the pendulum hangs. family: which search found it. run: a simulated run.
    """

    setup: Setup
    limits: Limits
    signal: Signal
    family: str
    run: Run = field(repr=False)
    precision: Precision
    paper: Precision
    paper_scale: float

    @property
    def gain(self) -> float:
        """The paper's over the design's geometric mean of the axes of the error ellipsoid of θ (1: no better)."""
        return math.exp((self.paper.log_volume - self.precision.log_volume) / 18.0)

    @property
    def whole_command(self) -> bool:
        """Whether the excitation is the whole command; else it is added to the controller's."""
        return self.setup.policy is None

    @property
    def facts(self) -> dict[str, str]:
        """What a command file should say of itself."""
        stds = zip(THETA_NAMES, self.precision.std, strict=True)
        return {"excitation": self.family} | {f"predicted_std_{n}": f"{s:.4g}" for n, s in stds}

    def samples(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """t (n,) [s] and the excitation (n,) at the samples."""
        return self.run.t, np.asarray(self.signal(self.run.t), dtype=float)

    def to_dict(self) -> dict[str, Any]:
        theta = self.setup.plant.theta
        return {
            "family": self.family,
            "whole_command": self.whole_command,
            "predicted": {
                n: {"value": float(v), "std": float(a), "std_paper": float(b)}
                for n, v, a, b in zip(THETA_NAMES, theta, self.precision.std, self.paper.std, strict=True)
            },
            "gain": self.gain,
            "paper_scale": self.paper_scale,
            "largest": dict(zip(("q1", "q2", "u", "u_rate"), map(float, self.run.largest), strict=True)),
        }

    def __str__(self) -> str:
        setup, largest, unit = self.setup, self.run.largest, self.setup.plant.unit
        where = "the whole command, hanging" if self.whole_command else "added to the controller's command"
        lines = [
            f"Excitation ({self.family}), {where}: {setup.duration:g} s at {1e3 * setup.sample_time:g} ms",
            f"  simulated: |q1| ≤ {largest[0]:.3g} rad, |q2| ≤ {largest[1]:.3g} rad, |u| ≤ {largest[2]:.3g} {unit}, "
            f"|u̇| ≤ {largest[3]:.3g} {unit}/s",
            f"  predicted standard deviations in %   design   paper's d(t) × {self.paper_scale:.2f}",
        ]
        for name, value, own, paper in zip(
            THETA_NAMES, setup.plant.theta, self.precision.std, self.paper.std, strict=True
        ):
            share, mark = (100.0 / abs(value), "") if value else (1.0, "  (not in %)")
            lines.append(f"    {name} = {value:<12.5g}          {own * share:10.3g} {paper * share:10.3g}{mark}")
        lines.append(
            f"  {self.gain:.3g} times as precise as the paper's d(t) within the same limits "
            "(geometric mean of the axes of the error ellipsoid)"
        )
        return "\n".join(lines)


def free_coordinates(plant: Plant, records: Sequence[Record]) -> list[Coordinate]:
    """θ first, then r, effect parameters, zeros and noise, as `identify` frees them."""
    found = plant_coordinates(plant)
    of_plant = [replace(c, weak_prior=R_PRIOR) if c.name in SHARPNESS_NAMES else c for c in found]
    return of_plant + zero_coordinates(plant, records) + noise_coordinates()


def predicted(setup: Setup, run: Run) -> Precision:
    """The precision that a simulated run promises. A run in which the pendulum fell promises nothing."""
    if run.fell is not None:
        return Precision(_NAN, math.inf)
    records = [setup.record(run)]
    coordinates = free_coordinates(setup.plant, records)
    noise = Noise(np.maximum(setup.torque_noise, 1e-20))
    problem = PredictionError(setup.plant, records, coordinates, noise, pool=shared_pool())
    z = problem.start()
    expansion = problem.expand(z)
    if not math.isfinite(expansion.value):
        return Precision(_NAN, math.inf)
    covariance = inverse_information(expansion.information)[:9, :9]
    slopes = np.array([c.slope(v) for c, v in zip(coordinates[:9], z[:9], strict=True)])
    return Precision(np.sqrt(np.diag(covariance)) * slopes, float(np.linalg.slogdet(covariance)[1]))


def design(
    setup: Setup,
    limits: Limits | None = None,
    seed: int = 0,
    evaluations: int = EVALUATIONS,
    progress: Callable[[str], None] | None = None,
) -> Design:
    """Search both families for the most informative excitation; never worse than the paper's d(t) in its criterion.

    evaluations: designs simulated, over one period. progress is told each family. Raises
    ValueError where no excitation keeps the limits.
    """
    limits = limits or setup.usual_limits
    tell = progress or (lambda text: None)
    if evaluations < _FEWEST:
        raise ValueError(f"a search needs at least {_FEWEST} evaluations, got {evaluations}")
    paper = within_limits(setup, paper_signal(), limits, seed)
    found: list[tuple[str, Signal]] = [("the paper's d(t)", paper)]
    rng = np.random.default_rng(seed)
    for name, make, draw in (
        ("three square waves", _squares, lambda: _random_squares(rng)),
        ("sum of sines", _sines, lambda: _random_sines(rng)),
    ):
        tell(f"searching: {name}")
        first = np.zeros(9) if make is _squares else draw()
        x = _search(setup.shortened(PERIOD), limits, make, first, draw, evaluations // 2, seed)
        if x is not None:
            found.append((name, make(x)))
    tell("checking the designs at full length")
    results = []
    for name, signal in found:
        try:
            scaled = paper if signal is paper else within_limits(setup, signal, limits, seed)
        except ValueError:  # kept them over the first seconds only
            continue
        run = setup.run(scaled, seed)
        precision = predicted(setup, run)
        results.append(Design(setup, limits, scaled, name, run, precision, precision, 1.0))
    best = min(results, key=lambda d: d.precision.log_volume)
    return replace(best, paper=results[0].precision, paper_scale=paper.factor)


def _search(setup, limits, make, first, draw, evaluations, seed) -> NDArray[np.float64] | None:
    """Random starts, then COBYLA from the best: derivative-free, as the encoders make the criterion rough."""
    best: tuple[float, NDArray[np.float64] | None] = (math.inf, None)

    def cost(x: NDArray[np.float64]) -> float:
        nonlocal best
        value = _cost(setup, limits, make(x), seed)
        if value < best[0]:
            best = value, x.copy()
        return value if math.isfinite(value) else 1e3

    draws = max(evaluations // 5, 2)
    for x in [first, *(draw() for _ in range(draws - 1))]:
        cost(x)
    if best[1] is not None:
        minimize(cost, best[1], method="COBYLA", options={"maxiter": evaluations - draws, "rhobeg": _STEP})
    return best[1]


def _cost(setup: Setup, limits: Limits, signal: Signal, seed: int) -> float:
    """log_volume of the signal scaled to the limits in a few steps; what it then exceeds is paid for."""
    tried = [t for t in sized(setup, signal, limits, seed, rounds=_SCALINGS) if t.run.fell is None]
    if not tried:
        return math.inf
    best = min(tried, key=lambda t: abs(math.log(max(t.excess, 1e-3))))
    # the information grows with the square of the size, so with 9 parameters its log det falls by 18 ln(size)
    return predicted(setup, best.run).log_volume + 18.0 * math.log(max(best.excess, 0.5))


def _squares(x: NDArray[np.float64]) -> Signal:
    """Nine numbers around the paper's d(t): log factors on three amplitudes and periods, phases in cycles."""
    amplitudes = np.array([1.0, 0.5, 0.25]) * np.exp(x[:3])
    cycles = np.clip(np.rint(PERIOD * np.array([0.5, 2.0, 3.0]) * np.exp(-x[3:6])), 1, PERIOD * _FASTEST)
    waves = zip(amplitudes, PERIOD / cycles, x[6:] % 1.0, strict=True)
    return Sum(tuple(SquareWave(float(a), float(p), None, float(phase)) for a, p, phase in waves))


def _random_squares(rng: np.random.Generator) -> NDArray[np.float64]:
    return np.concatenate([rng.normal(0.0, 0.5, 6), rng.uniform(0.0, 1.0, 3)])


def _sines(x: NDArray[np.float64]) -> Signal:
    """Log amplitudes of the lines, then their phases in cycles."""
    n = len(_LINES)
    return Sines(*(tuple(map(float, v)) for v in (np.exp(x[:n]), _LINES, x[n:])))


def _random_sines(rng: np.random.Generator) -> NDArray[np.float64]:
    """Amplitudes that fall with frequency, each somewhat off, and random phases."""
    return np.concatenate([-0.5 * np.log(_LINES) + rng.normal(0.0, 0.6, len(_LINES)), rng.uniform(size=len(_LINES))])
