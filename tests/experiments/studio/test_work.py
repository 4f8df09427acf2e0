"""Computations off the event loop, without a page."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.studio import work

THREADS, MB = 5, 50
PROGRAM = """
import asyncio, os, sys
from threading import Barrier
from experiments.studio import work
from experiments.studio.footprint import memory

threads, mb, kept = map(int, sys.argv[1:])
together = Barrier(threads)  # each in a thread of its own, all at once

def compute():
    bytes(30_000_000)  # lets glibc keep as much
    pieces = [bytearray(2000) for _ in range(500 * mb)]
    together.wait(30)
    return pieces[-kept:] if kept else None

async def scenario():
    before = memory(os.getpid())[0]
    found = await asyncio.gather(*(work.off_loop(compute) for _ in range(threads)))
    took = memory(os.getpid())[1] - before
    await asyncio.sleep(1.5 * work.AFTERWARDS)
    print(took, memory(os.getpid())[0] - before)

work.keep_little()
asyncio.run(scenario())
"""


@pytest.mark.skipif(work._malloc_trim is None, reason="the C library is not glibc")
@pytest.mark.parametrize("kept", [0, 1])
def test_threads_give_back_the_memory_of_computations(kept: int) -> None:
    """kept: pieces that stay, at the end of the memory of each thread."""
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])}
    command = [sys.executable, "-c", PROGRAM, *map(str, (THREADS, MB, kept))]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=True)
    took, held = map(float, done.stdout.split())
    assert took > 0.7 * THREADS * MB
    assert held < 0.15 * THREADS * MB
