"""Does a fit that starts far off end where it should? `python -m experiments.studies.identification_benchmark.starts`.

Every θ of the start is wrong by its own factor, log-uniform between 1/3 and 3. A fit has arrived if its log-likelihood
is within half a nat of the best that any start reached on the same log, the true θ among them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.stats import binomtest

from experiments.cli.errors import explained
from experiments.cli.output import write_json
from experiments.studies.identification_benchmark.cases import Case, sample
from experiments.workers import workers
from furuta_gym.plant import Plant
from identification.estimation.identify import identify

FACTOR = 3.0
SAME = 0.5  # nats
SCHEMA = "furuta-starts/1"


@dataclass(frozen=True)
class Fits:
    """One log, and the log-likelihoods [nats] reached from the truth, from the log alone and from wrong starts."""

    case: str
    seed: int
    truth: float
    alone: float
    wrong: tuple[float, ...]

    @property
    def arrived(self) -> list[bool]:
        """Of each wrong start."""
        return [value > max(self.truth, self.alone, *self.wrong) - SAME for value in self.wrong]


def wrong_theta(theta: NDArray[np.float64], rng: np.random.Generator, factor: float = FACTOR) -> NDArray[np.float64]:
    """θ (9,), each wrong by its own factor, such that M stays positive definite (others are no start at all)."""
    while True:
        wrong = theta * np.exp(rng.uniform(-np.log(factor), np.log(factor), 9))
        if wrong[0] * wrong[3] > wrong[2] ** 2:
            return wrong


def fits(case: Case, seed: int, starts: int) -> Fits:
    """Simulate a log and fit it from the truth, from itself, and from `starts` wrong θ."""
    log, rng = sample(case, seed).log, np.random.default_rng([seed, starts])

    def reached(start: Plant | None) -> float:
        return identify(log, start=start).log_likelihood

    wrong = [reached(case.plant.replace(theta=wrong_theta(case.plant.theta, rng))) for _ in range(starts)]
    return Fits(case.name, seed, reached(case.plant), reached(None), tuple(wrong))


def table(found: Sequence[Fits]) -> str:
    """Share of arrivals by case and over all, with exact 95 % intervals, in Markdown."""
    lines = ["| logs | fits from wrong starts | arrived | from the log alone |", "|---|---|---|---|"]
    names = list(dict.fromkeys(f.case for f in found))
    for name, part in [(n, [f for f in found if f.case == n]) for n in names] + [("all", list(found))]:
        arrived = [a for f in part for a in f.arrived]
        interval = binomtest(sum(arrived), len(arrived)).proportion_ci()
        own = sum(f.alone > max(f.truth, f.alone, *f.wrong) - SAME for f in part)
        share = f"{sum(arrived)} of {len(arrived)} (95 %: {100 * interval.low:.1f} … {100 * interval.high:.1f} %)"
        lines.append(f"| {name} | {len(part)} logs × {len(part[0].wrong)} | {share} | {own} of {len(part)} |")
    return "\n".join(lines)


def main(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for starts.json.")] = Path("out"),
    logs: Annotated[int, typer.Option(help="Logs of each rig.", min=1)] = 10,
    starts: Annotated[int, typer.Option(help="Wrong starts for each log.", min=1)] = 10,
    first_seed: Annotated[int, typer.Option(help="The first seed.", min=0)] = 5000,
    backend: Annotated[str, typer.Option(help="loky, or dask.")] = "loky",
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 1,
) -> None:
    """Fit simulated logs of three rigs from starts up to a factor 3 wrong in every θ."""
    with explained():
        cases = [Case(rig, 0.002, 4096) for rig in ("table3", "qube", "large")]
        todo = [(case, first_seed + k, starts) for case in cases for k in range(logs)]
        with workers(backend, jobs):
            found: list[Fits] = Parallel()(delayed(fits)(*job) for job in todo)  # type: ignore[assignment]
        write_json(output / "starts.json", {"schema": SCHEMA, "fits": [asdict(f) for f in found]})
        typer.echo(table(found))


if __name__ == "__main__":
    typer.run(main)
