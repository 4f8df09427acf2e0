"""Where joblib runs the trials of a study: this process, processes of this machine, or a dask cluster."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from typing import Any

from joblib import parallel_config

from furuta_gym.processes import worker_options

BACKENDS = ("loky", "dask")
_REPLACED = "A worker stopped while some jobs were given to the executor"
"""loky replaces a worker whose memory grew, and says so as a warning; nothing is lost."""


@contextmanager
def workers(backend: str, jobs: int) -> Iterator[None]:
    """joblib's `Parallel` inside goes to `jobs` workers with one thread each: the trials are many, so threads inside
    one would only get in the way.

    backend: loky (processes of this machine; one job is this process itself) or dask (the cluster at
    DASK_SCHEDULER_ADDRESS, else processes of this machine). Raises ValueError for another.
    """
    if backend not in BACKENDS:
        raise ValueError(f"backend {backend!r} given, expected one of: {', '.join(BACKENDS)}")
    with ExitStack() as stack:
        stack.enter_context(warnings.catch_warnings())
        warnings.filterwarnings("ignore", message=_REPLACED)
        if backend == "dask":
            stack.enter_context(_dask(jobs))
            stack.enter_context(parallel_config("dask", n_jobs=-1))
        elif jobs > 1:
            stack.enter_context(parallel_config("loky", n_jobs=jobs, inner_max_num_threads=1, **worker_options()))
        else:
            stack.enter_context(parallel_config("sequential", n_jobs=1))
        yield


@contextmanager
def _dask(jobs: int) -> Iterator[None]:
    if find_spec("dask") is None or find_spec("distributed") is None:
        raise ValueError("--backend dask needs two packages: pip install dask distributed")
    from dask import config
    from distributed import Client, LocalCluster

    threads = {f"distributed.nanny.pre-spawn-environ.{name}_NUM_THREADS": 1 for name in ("OMP", "MKL", "NUMBA")}
    with config.set(threads), ExitStack() as stack:
        address = config.get("scheduler-address", None)
        if address is None:
            made: Any = LocalCluster(n_workers=jobs, threads_per_worker=1, dashboard_address=":0")
            address = stack.enter_context(made)
        stack.enter_context(Client(address))
        yield
