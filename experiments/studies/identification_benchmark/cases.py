"""The cells of the study: a rig, how it is sampled, an experiment; and one log of it with its bound."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from controllers import make_controller
from furuta_gym.plant import PLANTS, Plant
from furuta_gym.sensors import Sensors
from identification.design.d_optimal import predicted
from identification.design.setup import Setup
from identification.design.signals import Multisine, Signal, paper_signal
from identification.logs.log import Log

EXPERIMENTS = ("paper", "hanging")
_CONTROLLERS = {"table3": "paper-lqr", "qube": "lqr", "large": "lqr"}
_AMPLITUDE = {"table3": 1.0, "qube": 1.0, "large": 0.5}  # of d(t), {u}; the large rig swings out of reach at 1 N·m
_HANGING = {"table3": 1.0, "qube": 1.0, "large": 0.8}  # of the multisine, {u}


@dataclass(frozen=True)
class Case:
    """rig: a known set. T [s]; counts per revolution; experiment: "paper" (closed loop, d(t) of (24)) or "hanging"
    (open loop, sines); duration [s]."""

    rig: str
    T: float
    counts: int
    experiment: str = "paper"
    duration: float = 10.0

    @property
    def plant(self) -> Plant:
        return PLANTS[self.rig]

    @property
    def name(self) -> str:
        return f"{self.rig}, {1e3 * self.T:g} ms, {self.counts} counts, {self.experiment}"

    def setup(self) -> Setup:
        """The experiment with its controller; torque noise of a twentieth of the Coulomb friction over 10 ms."""
        hangs = self.experiment == "hanging"
        policy = None if hangs else make_controller(_CONTROLLERS[self.rig], self.plant, self.T)
        found = Setup.of(self.plant, policy, self.duration, self.T)
        return replace(found, sensors=Sensors(self.counts))

    def signal(self) -> Signal:
        if self.experiment == "hanging":
            return Multisine.band(_HANGING[self.rig], 0.3, 4.0, 5.0)
        return paper_signal(scale=_AMPLITUDE[self.rig])


@dataclass(frozen=True)
class Sample:
    """One log, the true θ (9,), and the Cramér–Rao bound (9,) on its standard deviations."""

    log: Log
    truth: NDArray[np.float64]
    bound: NDArray[np.float64]


def sample(case: Case, seed: int) -> Sample:
    """Simulate one log. Raises RuntimeError if the pendulum falls: the study would then compare nothing.

    The bound is the inverse Fisher information of this log's innovations at the truth, r and noise free as in the fit.
    """
    setup = case.setup()
    run = setup.run(case.signal(), seed)
    if run.fell is not None:
        raise RuntimeError(f"{case.name}: the pendulum falls after {run.fell:.2f} s")
    log = Log.from_run(run, case.plant.unit, case.counts, f"{case.name}, seed {seed}")
    return Sample(log, case.plant.theta, predicted(setup, run).std)


def cases(
    rigs: Sequence[str], times: Sequence[float], counts: Sequence[int], experiments: Sequence[str], duration: float
) -> Iterable[Case]:
    """All combinations, checked. Raises ValueError for an unknown rig or experiment."""
    for word, given, known in (("rig", rigs, tuple(_CONTROLLERS)), ("experiment", experiments, EXPERIMENTS)):
        if strange := set(given) - set(known):
            raise ValueError(f"unknown {word} {', '.join(sorted(strange))}; expected some of {', '.join(known)}")
    for rig, T, count, experiment in itertools.product(rigs, times, counts, experiments):
        yield Case(rig, T, count, experiment, duration)
