"""Compiled calls spread over the cores by Python threads.

The kernels release Python's lock, so plain threads suffice. Numba's own parallel loops would do as well on an idle
machine, but their OpenMP threads spin while they wait, which takes the cores from a learner or from other processes.
"""

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

_pool: ThreadPoolExecutor | None = None


def _forget_pool() -> None:
    global _pool
    _pool = None  # threads do not survive a fork


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_pool)


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def share(call: Callable[[int, int], None], n: int, threads: int) -> None:
    """Call `call(first, last)` over the range n in equal parts, one to each thread, the first one to this thread."""
    global _pool
    threads = min(threads, n)
    if threads == 1:
        call(0, n)
        return
    if _pool is None:
        _pool = ThreadPoolExecutor(max(cores() - 1, 1), thread_name_prefix="furuta-gym")
    ends = [n * i // threads for i in range(threads + 1)]
    others = [_pool.submit(call, first, last) for first, last in itertools.pairwise(ends[1:])]
    call(0, ends[1])
    for other in others:
        other.result()
