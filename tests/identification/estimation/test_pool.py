"""Filters side by side: the numbers are those of one thread, and no work waits inside its own pool."""

from __future__ import annotations

import os
import threading
from concurrent.futures import Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from furuta_gym.plant import TABLE_3
from identification.estimation.identify import identify
from identification.estimation.pool import mapped, one_blas_thread, shared_pool, threads
from identification.estimation.prediction_error import PredictionError
from identification.kalman.coordinates import noise_coordinates, plant_coordinates
from identification.kalman.noise_model import Noise
from identification.kalman.record import Record
from tests.factories import loop_log


class Counting(Executor):
    """Runs each task at once, and counts them; refuses a task that is started inside another."""

    def __init__(self) -> None:
        self.tasks, self.inside = 0, False

    def submit(self, fn, /, *args, **kwargs) -> Future:
        assert not self.inside, "parallel work was started inside a task of the same pool"
        self.tasks, self.inside = self.tasks + 1, True
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        finally:
            self.inside = False
        return future


def test_the_numbers_do_not_depend_on_the_pool() -> None:
    records = [Record.from_log(loop_log(duration=2.0, seed=seed)[0]) for seed in (0, 1)]
    coordinates = plant_coordinates(TABLE_3) + noise_coordinates()
    for used in (records[:1], records):
        with ThreadPoolExecutor(3) as three:
            alone, beside = (
                PredictionError(TABLE_3, used, coordinates, Noise((1e-3, 1e-5)), pool=pool) for pool in (None, three)
            )
            z = alone.start()
            assert alone.value(z) == beside.value(z)
            one, other = alone.expand(z, exact=True), beside.expand(z, exact=True)
        np.testing.assert_array_equal(one.gradient, other.gradient)
        np.testing.assert_array_equal(one.information, other.information)


def test_an_identification_uses_the_pool_it_is_given_and_never_inside_its_tasks() -> None:
    log = loop_log(duration=3.0)[0]
    pool = Counting()
    own, shared = identify(log, iterations=3, pool=pool), identify(log, iterations=3)
    assert pool.tasks > 10
    np.testing.assert_array_equal(own.values, shared.values)


def test_the_shared_pool_is_one_and_of_the_machines_size() -> None:
    assert shared_pool() is shared_pool()
    assert len(set(mapped(shared_pool(), abs, range(-5, 5)))) == 6
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    assert shared_pool()._max_workers == max(2, cores)  # type: ignore[attr-defined]


def test_a_task_of_the_shared_pool_may_hand_out_work() -> None:
    """More tasks than threads, each of which waits for others: they run where they were started."""

    def outer(i: int) -> tuple[list[int], set[str]]:
        inner = list(mapped(shared_pool(), lambda j: (i * j, threading.current_thread().name), range(4)))
        return [value for value, _ in inner], {name for _, name in inner} - {threading.current_thread().name}

    found = list(mapped(shared_pool(), outer, range(16)))
    assert [values for values, _ in found] == [[i * j for j in range(4)] for i in range(16)]
    assert not any(elsewhere for _, elsewhere in found)


def test_linear_algebra_has_one_thread_until_the_last_has_ended() -> None:
    """Two calls that overlap: the first to end gives no threads to the other, and the last gives back what was."""

    def threads() -> list[int]:
        return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]

    begun, first_ended = threading.Event(), threading.Event()

    @one_blas_thread
    def short() -> None:
        begun.wait(10.0)

    @one_blas_thread
    def long() -> list[int]:
        begun.set()
        first_ended.wait(10.0)
        return threads()

    with threadpool_limits(limits=2, user_api="blas"):
        before = threads()
        with ThreadPoolExecutor(2) as pool:
            first, last = pool.submit(short), pool.submit(long)
            first.result()
            first_ended.set()
            assert set(last.result()) == {1}
        assert threads() == before


def test_noise_of_another_kind_is_refused() -> None:
    with pytest.raises(ValueError, match=r"must be a Noise.*ndarray"):
        identify(loop_log(duration=3.0)[0], TABLE_3, noise=np.ones(4))  # type: ignore[arg-type]


def test_noise_needs_the_plant_that_it_belongs_to() -> None:
    """Else it would be used for nothing, but no restart would be tried."""
    log = loop_log(duration=3.0)[0]
    noise = Noise((1e-6, 1e-8))
    with pytest.raises(ValueError, match=r"there is no start.*Expected both: identify\(logs, estimate\.plant, noise="):
        identify(log, noise=noise)
    assert identify(log, TABLE_3, noise=noise, iterations=1, model_error=False).samples == len(log)


@pytest.mark.parametrize(
    ("here", "told", "used"), [(16, "", 16), (1, "", 2), (16, "3", 3), (16, "1", 2), (16, "many", 16)]
)
def test_a_worker_among_others_takes_no_more_threads_than_it_is_told(
    here: int, told: str, used: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", told)
    monkeypatch.setattr("identification.estimation.pool.cores", lambda: here)
    assert threads.__wrapped__() == used
