"""Run the trials, in this process or many, and keep them as records."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed

from experiments.studies.identification_benchmark.cases import Case, sample
from experiments.studies.identification_benchmark.methods import METHODS
from experiments.workers import workers
from identification.logs.log import Log

FAILURES = (ValueError, FloatingPointError, np.linalg.LinAlgError)  # of a method on a log, not of the study


@dataclass(frozen=True)
class Trial:
    """One log and what each method made of it: errors and standard deviations (9,), NaN where it failed; seconds."""

    case: Case
    seed: int
    bound: np.ndarray
    error: dict[str, np.ndarray]
    std: dict[str, np.ndarray]
    seconds: dict[str, float]
    failure: dict[str, str]


def run_trial(case: Case, seed: int, methods: Sequence[str]) -> Trial:
    """Simulate one log, give it to each method."""
    drawn = sample(case, seed)
    error, std, seconds, failure = {}, {}, {}, {}
    for name in methods:
        begun = time.perf_counter()
        theta, spread, failed = _answer(name, drawn.log)
        seconds[name] = time.perf_counter() - begun
        error[name], std[name] = theta - drawn.truth, spread
        if failed:
            failure[name] = failed
    return Trial(case, seed, drawn.bound, error, std, seconds, failure)


def _answer(name: str, log: Log) -> tuple[np.ndarray, np.ndarray, str]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of bias and the like: here they are measured
            return *METHODS[name](log), ""
    except FAILURES as error:
        return np.full(9, np.nan), np.full(9, np.nan), str(error)


def run(
    cases: Sequence[Case], seeds: Sequence[int], methods: Sequence[str], backend: str = "loky", jobs: int = 1
) -> Iterator[Trial]:
    """All trials as they are done, seeds in the outer loop, so that a run cut short has all cells."""
    if strange := set(methods) - set(METHODS):
        raise ValueError(f"unknown method {', '.join(sorted(strange))}; there are {', '.join(METHODS)}")
    todo = [(case, seed) for seed in seeds for case in cases]
    with workers(backend, jobs):
        yield from Parallel(return_as="generator")(delayed(run_trial)(*job, methods) for job in todo)  # type: ignore[misc]
