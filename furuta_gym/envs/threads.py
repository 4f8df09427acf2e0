"""Blocks of a batch spread over the cores by Python threads that take them from a common board.

A step of a large batch lasts a fifth of a millisecond, about as long as it takes to wake a sleeping thread. So a helper
that has run out of blocks looks at the board for some 0.2 ms before it goes to sleep: in a tight loop it is there when
the next step begins, and beside a learner, whose own work takes longer, it sleeps. Numba's parallel loops would do
as well on an idle machine, but their OpenMP threads spin for as long as they wait and take the cores from the learner.
"""

import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from numba import types

from ..plant.compiled import compiled, instruction

NEXT, FINISHED, N_BOARD = range(3)  # of a board, int64: the next block to take, and how many are done
PATIENCE = 300_000  # looks at the board, two thirds of a nanosecond each


def _place(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
    return builder.gep(data, [arguments[1]])


@instruction
def _read(typing_context: Any, board: Any, place: Any) -> Any:
    """board[place] as it is now: other threads write to it."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load_atomic(_place(context, builder, signature, arguments), "acquire", 8)

    return types.int64(board, types.int64), code


@instruction
def _write(typing_context: Any, board: Any, place: Any, value: Any) -> Any:
    """board[place] = value, and all that was written before it is seen by who reads it."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store_atomic(arguments[2], _place(context, builder, signature, arguments), "release", 8)
        return context.get_dummy_value()

    return types.void(board, types.int64, types.int64), code


@instruction
def _count(typing_context: Any, board: Any, place: Any) -> Any:
    """board[place] += 1 in one indivisible step; returns what was there before."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        one = context.get_constant(types.int64, 1)
        return builder.atomic_rmw("add", _place(context, builder, signature, arguments), one, "seq_cst")

    return types.int64(board, types.int64), code


@compiled
def post(board):
    """Lay out the blocks of a new step. What the step reads must be in place before."""
    _write(board, FINISHED, 0)
    _write(board, NEXT, 0)


@compiled
def take(board, n, patience):
    """The next of n blocks; n if there is none, after looking `patience` times more."""
    for _ in range(patience + 1):
        if _read(board, NEXT) < n:
            return min(_count(board, NEXT), n)
    return n


@compiled
def finish(board):
    """Say that a block is done."""
    _count(board, FINISHED)


@compiled(nogil=True)
def all_done(board, n):
    """Whether all n blocks are done, at the latest after looking for a while."""
    looks = 0
    while looks < PATIENCE and _read(board, FINISHED) < n:
        looks += 1
    return looks < PATIENCE


class _Helper:
    """A thread that does what it is given, and sleeps in between."""

    def __init__(self) -> None:
        self._job: Callable[[], None] | None = None
        self._bell = threading.Lock()
        self._bell.acquire()
        threading.Thread(target=self._serve, name="furuta-gym", daemon=True).start()

    def give(self, job: Callable[[], None]) -> None:
        self._job = job
        with suppress(RuntimeError):  # it rings already
            self._bell.release()

    def _serve(self) -> None:
        while True:
            self._bell.acquire()
            job, self._job = self._job, None
            if job is not None:
                job()
            job = None  # it holds the arrays of its batch


_helpers: list[_Helper] = []


def _forget_helpers() -> None:
    _helpers.clear()  # threads do not survive a fork


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_helpers)


def share(work: Callable[[int], None], board: Any, n: int, threads: int) -> None:
    """Have the n blocks of a board done, by this thread and `threads` − 1 others.

    work(patience) takes blocks while there are any, and looks `patience` times for more; it must let go of Python's
    lock. A thread that the machine lets wait holds up no more than the block that it has taken.
    """
    post(board)
    for _ in range(threads - 1 - len(_helpers)):
        _helpers.append(_Helper())
    try:
        for helper in _helpers[: threads - 1]:
            helper.give(lambda: work(PATIENCE))
        work(0)
    except BaseException:
        while take(board, n, 0) < n:  # what nobody has taken counts as done
            finish(board)
        raise
    finally:  # also where Ctrl-C came between two blocks: the next step must not count the blocks of this one
        while not all_done(board, n):
            time.sleep(0.0)
