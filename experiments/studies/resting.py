"""Is a right plant at the noise floor where a joint rests? On logs of the plain laboratory, which only rounds.

`python -m experiments.studies.resting --logs 24` draws rigs with much friction, half under pulses with pauses and half
under a weak multisine. It prints the error of the true plant over the noise floor, and how often something is said to
be left, by the share of the windows in which an angle rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import numpy as np
import typer
from joblib import Parallel, delayed

from experiments.bench import plain_lab
from experiments.cli.errors import explained
from experiments.workers import workers
from furuta_gym.plant import Plant
from identification.diagnosis.locate.locate import locate
from identification.logs.log import Log
from identification.validation.gap import validate

STICKIER = 5.0  # times the friction of a rig that was drawn, at most
WEAKER = 0.25  # of its command, at least
COUNTS = (512, 1024, 2048, 4096)
SAMPLE_TIMES = (2e-3, 4e-3)  # s
EDGES = (0.0, 0.1, 0.5, 0.9, 1.0)


@dataclass(frozen=True)
class Judged:
    """Of one log: the larger share of windows in which an angle rests, the right plant's error over the noise floor,
    and whether something that matters is said to be left."""

    resting: float
    ratio: float
    left: bool


def sticky(seed: int) -> tuple[Plant, Log]:
    """A right plant and a log of its rig."""
    rng = np.random.default_rng([seed, 43])
    rig = plain_lab.a_rig(10_000 + seed)
    theta = np.array(rig.theta)
    theta[6:] *= np.exp(rng.uniform(0.0, np.log(STICKIER), 3))
    rig = replace(rig, theta=tuple(theta.tolist()), counts=int(rng.choice(COUNTS)))
    experiment = "pulses"
    if rng.random() < 0.5:
        experiment = "hanging"
        rig = replace(rig, u_max=rig.u_max * float(np.exp(rng.uniform(np.log(WEAKER), 0.0))))
    read = plain_lab.a_log(rig, experiment, seed, T=float(rng.choice(SAMPLE_TIMES)))
    log = Log(read["t"], read["q1"], read["q2"], read["u"], encoder_counts=(rig.counts, rig.counts))
    return Plant(theta=theta, u_max=rig.u_max), log


def judged(seed: int) -> Judged:
    """The log of a seed under its own plant."""
    plant, log = sticky(seed)
    gap = validate(plant, log)
    return Judged(float(gap.resting.max()), gap.ratio_to_floor, locate(plant, log).matters)


def table(found: Sequence[Judged]) -> str:
    """Logs by the share of windows in which an angle rests, as Markdown."""
    rows = ["| an angle rests in | logs | error over the floor | something left |", "|---|---|---|---|"]
    for low, high in pairwise(EDGES):
        own = [one for one in found if low <= one.resting < high or one.resting == high == 1.0]
        ratios = [one.ratio for one in own]
        between = f"{min(ratios):.2f} … {max(ratios):.2f}" if own else "–"
        span = f"{100 * low:g} … {100 * high:g} % of the windows"
        rows.append(f"| {span} | {len(own)} | {between} | {sum(one.left for one in own)} |")
    return "\n".join(rows)


def main(
    logs: Annotated[int, typer.Option(help="How many logs", min=1)] = 24,
    seed: Annotated[int, typer.Option(help="Of the first log")] = 0,
    jobs: Annotated[int, typer.Option(help="Processes at once", min=1)] = 2,
) -> None:
    """Right plants on logs in which a joint rests."""
    with explained(), workers("loky", jobs):
        found = Parallel()(delayed(judged)(s) for s in range(seed, seed + logs))
    print(table(found))


if __name__ == "__main__":
    typer.run(main)
