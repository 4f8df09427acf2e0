"""What a training took, over all its sittings."""

import time
from typing import Annotated

from msgspec import Meta, Struct

Seconds = Annotated[float, Meta(ge=0)]


class Spent(Struct, frozen=True):
    """Wall and CPU time [s]."""

    wall_s: Seconds = 0.0
    cpu_s: Seconds = 0.0


class Clock:
    """Runs from when it is made."""

    def __init__(self) -> None:
        self._wall, self._cpu = time.perf_counter(), time.process_time()

    def after(self, before: Spent) -> dict[str, float]:
        """Both times so far and those spent before, by name."""
        wall, cpu = time.perf_counter() - self._wall, time.process_time() - self._cpu
        return {"wall_s": round(before.wall_s + wall, 2), "cpu_s": round(before.cpu_s + cpu, 2)}
