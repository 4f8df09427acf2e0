"""The threads that filters run on side by side: the compiled filters release the interpreter's lock."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

_In = TypeVar("_In")
_Out = TypeVar("_Out")


@lru_cache
def shared_pool() -> Executor:
    """The pool of whoever brings none, made once: a thread for every core this process may use, at least two.

    Never hand it to work that runs in it: a task that waits for others of its own pool may wait for ever.
    """
    # not every system tells a process its own cores
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return ThreadPoolExecutor(max_workers=max(2, cores), thread_name_prefix="furuta")


def mapped(pool: Executor | None, work: Callable[[_In], _Out], items: Iterable[_In]) -> Iterable[_Out]:
    """work(item) of every item, in order: in the pool, or without one in the caller's own thread."""
    return map(work, items) if pool is None else pool.map(work, items)
