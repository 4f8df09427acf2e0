"""The threads that filters run on side by side: the compiled filters release the interpreter's lock."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import lru_cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

from furuta_gym.cores import cores

_In = TypeVar("_In")
_Out = TypeVar("_Out")
_Arguments = ParamSpec("_Arguments")


_thread = threading.local()


def _enter() -> None:
    _thread.shared = True


@lru_cache
def threads() -> int:
    """How many threads run side by side: one for every core this process may use, at least two. No more than numba is
    told, as a worker among others is."""
    told = os.environ.get("NUMBA_NUM_THREADS", "")
    return max(2, min(cores(), int(told) if told.isdigit() else sys.maxsize))


@lru_cache
def shared_pool() -> Executor:
    """The pool of whoever brings none, made once."""
    return ThreadPoolExecutor(max_workers=threads(), thread_name_prefix="furuta", initializer=_enter)


def in_shared_pool() -> bool:
    """Whether the caller runs in a thread of the shared pool, where `mapped` does one item after the other."""
    return getattr(_thread, "shared", False)


def mapped(pool: Executor | None, work: Callable[[_In], _Out], items: Iterable[_In]) -> Iterable[_Out]:
    """work(item) of every item, in order: in the pool, or in the caller's own thread if there is none, or if that is a
    thread of the shared pool, where a task that waits for others might wait for ever."""
    return map(work, items) if pool is None or in_shared_pool() else pool.map(work, items)


class _OneBlasThread:
    """Linear algebra on one thread, as long as any thread of the program is inside; then as it was before the first."""

    def __init__(self) -> None:
        self._lock, self._inside, self._limit = threading.Lock(), 0, None

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                self._limit = _libraries(len(sys.modules)).limit(limits=1, user_api="blas")
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0 and self._limit is not None:
                self._limit.restore_original_limits()


_one_thread = _OneBlasThread()


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """The libraries of linear algebra; looked for again once modules were imported, which may have loaded another."""
    return ThreadpoolController()


def one_blas_thread(work: Callable[_Arguments, _Out]) -> Callable[_Arguments, _Out]:
    """work, with linear algebra on one thread each: matrices here are small, and threads of BLAS that wait for one
    another take several times the processor's time."""

    @wraps(work)
    def limited(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Out:
        with _one_thread:
            return work(*args, **kwargs)

    return limited
