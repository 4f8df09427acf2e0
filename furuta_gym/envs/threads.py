"""Compiled calls spread over the cores by Python threads.

The kernels release Python's lock, so plain threads suffice. Numba's own parallel loops would do as well on an idle
machine, but their OpenMP threads spin while they wait, which takes the cores from a learner or from other processes.
"""

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
    """Do `call(first, last)` over the range n, by this thread and up to `threads` − 1 others.

    Each takes the next item when it is done with one, so a thread that the machine lets wait holds nobody up.
    """
    global _pool
    if min(threads, n) == 1:
        call(0, n)
        return
    if _pool is None:
        _pool = ThreadPoolExecutor(max(cores() - 1, 1), thread_name_prefix="furuta-gym")
    todo = iter(range(n))

    def work() -> None:
        for item in todo:
            call(item, item + 1)

    others = [_pool.submit(work) for _ in range(min(threads, n) - 1)]
    try:
        work()
    finally:
        for other in others:
            if not other.cancel():
                other.result()
