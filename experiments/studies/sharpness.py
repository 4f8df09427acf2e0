"""Does the interval of r hold the truth? On fast swings of the plain laboratory, which integrates in steps of 0.1 ms.

`python -m experiments.studies.sharpness --rigs 40` identifies model (5) from a sweep of each rig, which has the
size of a QUBE and another θ. It prints how often 95 % intervals hold the true r = 100 s/rad, and each of θ1 … θ9.
"""

from __future__ import annotations

import warnings
from typing import Annotated

import numpy as np
import typer
from joblib import Parallel, delayed

from experiments.bench import plain_lab
from experiments.cli.errors import explained
from experiments.trials.report import percent
from experiments.trials.summary import rate
from experiments.workers import workers
from furuta_gym.plant import QUBE
from furuta_gym.plant.covariance import NORMAL_95
from identification.estimation.identify import identify
from identification.logs.log import Log

DURATION, SAMPLE_TIME = 10.0, 2e-3  # s
COUNTS = 2048  # a turn
SCATTER = 0.1  # standard deviation of ln θ over the rigs


def swept(seed: int) -> tuple[Log, plain_lab.PlainRig]:
    """A log of a hanging pendulum under a sweep, and its rig."""
    theta = QUBE.theta * np.exp(np.random.default_rng(seed).normal(0.0, SCATTER, 9))
    rig = plain_lab.PlainRig(tuple(theta.tolist()), QUBE.u_max, COUNTS)
    read = plain_lab.a_log(rig, "sweep", seed, DURATION, SAMPLE_TIME)
    counts = rig.counts, rig.counts
    return Log(t=read["t"], q1=read["q1"], q2=read["q2"], u=read["u"], encoder_counts=counts, input_unit="V"), rig


def errors(seed: int) -> dict[str, float]:
    """(estimate − truth) / standard deviation of r and each θ, as far as they are identified, of one rig.

    Empty where `identify` refuses the log, as of a pendulum that turns over again and again."""
    log, rig = swept(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # advice for a person
        try:
            estimate = identify(log, u_max=rig.u_max)
        except ValueError:
            return {}
    truth = {f"theta{i + 1}": value for i, value in enumerate(rig.theta)} | {"r": plain_lab.SHARPNESS}
    left_out = {*estimate.at_bound, *estimate.identifiability.weak, *estimate.identifiability.unidentified}
    stated = zip(estimate.names, estimate.values, estimate.std, strict=True)
    return {name: (value - truth[name]) / std for name, value, std in stated if name in truth and name not in left_out}


def main(
    rigs: Annotated[int, typer.Option(help="How many rigs", min=1)] = 40,
    seed: Annotated[int, typer.Option(help="Of the first rig")] = 0,
    jobs: Annotated[int, typer.Option(help="Processes at once", min=1)] = 2,
) -> None:
    """Coverage of the intervals of r and θ on sweeps of the plain laboratory."""
    with explained(), workers("loky", jobs):
        found = Parallel()(delayed(errors)(s) for s in range(seed, seed + rigs))
    print(f"{sum(not one for one in found)} of {rigs} logs refused")
    for name in ("r", *(f"theta{i}" for i in range(1, 10))):
        held = rate(abs(one[name]) < NORMAL_95 for one in found if name in one)
        print(f"{name}: {percent(held)} of the intervals hold the truth")


if __name__ == "__main__":
    typer.run(main)
