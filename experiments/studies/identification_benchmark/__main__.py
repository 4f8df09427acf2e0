"""Command line of the study: `python -m experiments.studies.identification_benchmark -o docs`."""

from __future__ import annotations

import platform
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import typer

from experiments.cli.errors import explained
from experiments.cli.output import counted, write_json
from experiments.studies.identification_benchmark.cases import cases
from experiments.studies.identification_benchmark.study import Trial, run
from experiments.studies.identification_benchmark.summary import (
    cells,
    limit_table,
    method_table,
    plot,
    pooled_table,
    to_json,
    verdict,
)
from furuta_gym.files import write_whole


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]


def main(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for JSON, tables and the plot.")] = Path("out"),
    rigs: Annotated[str, typer.Option(help="table3, qube, large.")] = "table3,qube,large",
    times: Annotated[str, typer.Option(help="Sample times [ms].")] = "1,2,5",
    counts: Annotated[str, typer.Option(help="Encoder counts.")] = "2048,4096",
    experiments: Annotated[str, typer.Option(help="paper, hanging.")] = "paper",
    methods: Annotated[str, typer.Option(help="See `methods.METHODS`.")] = "prediction-error",
    seeds: Annotated[int, typer.Option(help="Logs a cell.", min=1)] = 50,
    first_seed: Annotated[int, typer.Option(help="The first seed.", min=0)] = 1000,
    duration: Annotated[float, typer.Option(help="Of each log [s].")] = 10.0,
    backend: Annotated[
        str, typer.Option(help="loky, or dask (DASK_SCHEDULER_ADDRESS, or a cluster made here).")
    ] = "loky",
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 1,
    name: Annotated[str, typer.Option(help="Stem of the files.")] = "identification_benchmark",
) -> None:
    """Bias, RMSE over the Cramér–Rao bound, coverage and time of the identification methods."""
    with explained():
        times_ms, encoders = [float(x) for x in _words(times)], [int(x) for x in _words(counts)]
        of = _words(rigs), [t / 1e3 for t in times_ms], encoders, _words(experiments)
        todo, tried = list(cases(*of, duration)), _words(methods)
        settings: dict[str, Any] = {"rigs": of[0], "times_ms": times_ms, "counts": encoders, "experiments": of[3]}
        settings |= {"methods": tried, "duration_s": duration}
        found: list[Trial] = []
        output.mkdir(parents=True, exist_ok=True)
        with counted("fitting") as tell:
            for trial in run(todo, range(first_seed, first_seed + seeds), tried, backend, jobs):
                found.append(trial)
                tell(len(found), len(todo) * seeds)
                if len(found) % len(todo) == 0:  # every cell has this seed: what is there is a whole, smaller study
                    _write(output, name, found, settings | {"seeds": len(found) // len(todo), "first_seed": first_seed})
        records = cells(found)
        typer.echo(_tables(records))


def _write(output: Path, name: str, trials: list[Trial], settings: dict) -> None:
    versions = {p: version(p) for p in ("furuta-gym", "numpy", "scipy", "numba")} | {
        "python": platform.python_version()
    }
    records = cells(trials)
    write_json(output / f"{name}.json", to_json(records, settings | {"versions": versions}))
    write_whole(output / f"{name}_tables.md", _tables(records) + "\n")
    if "prediction-error" in settings["methods"]:
        plot(records, output / f"{name}.png")


def _tables(records: list[dict[str, Any]]) -> str:
    tables = [limit_table(records), pooled_table(records), method_table(records), "Missing the bar:", verdict(records)]
    return "\n\n".join(tables)


if __name__ == "__main__":
    typer.run(main)
