"""How long the studio takes to start, and the memory that it needs with four logs of 20 s at 1 kHz open (Linux).

python -m experiments.studio.footprint
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from urllib.request import ProxyHandler, build_opener

import typer

from controllers import usual_controller
from furuta_gym import Plant, simulate
from identification import Log, write_log

from .drive import browser, served

LONGEST_START = 3.0
"""Seconds from the command to the page."""
LARGEST = 400.0
"""MB of memory with the logs open."""
LOGS, SECONDS, SAMPLE_TIME = 4, 20.0, 1e-3


@dataclass(frozen=True)
class Footprint:
    """start [s]: from the command to the whole page. memory, peak [MB]: of the process with the logs open."""

    start: float
    memory: float
    peak: float


def write_logs(folder: Path, seconds: float = SECONDS) -> list[Path]:
    """LOGS logs at 1 kHz, each of another excitation."""
    plant = Plant.resolve("table3")
    paths = []
    for i in range(LOGS):
        controller = usual_controller(plant, SAMPLE_TIME)
        run = simulate(plant, controller, seconds, excitation=lambda t, i=i: 0.3 * _square(t, 1.0 + 0.3 * i), seed=i)
        paths.append(folder / f"log{i + 1}.csv")
        write_log(paths[-1], Log.from_run(run, plant.unit, 4096))
    return paths


def _square(t, period: float):
    return 2.0 * ((t // (0.5 * period)) % 2) - 1.0


def memory(process: int) -> tuple[float, float]:
    """Memory that a process has and had at most [MB]."""
    text = Path(f"/proc/{process}/status").read_text()
    found = {line.split(":")[0]: line.split()[1] for line in text.splitlines() if line.startswith("Vm")}
    return float(found["VmRSS"]) / 1024, float(found["VmHWM"]) / 1024


def start_time() -> float:
    """Seconds from the command to the page, as the server gives it out."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, served(Path(folder)) as studio:
        build_opener(ProxyHandler({})).open(studio.address, timeout=30).read()
        return time.perf_counter() - began


def measure(logs: list[Path]) -> Footprint:
    """Start, then open the logs in Chromium and look at the memory of the server."""
    start = min(start_time() for _ in range(3))
    with tempfile.TemporaryDirectory() as folder, served(Path(folder), *logs) as studio, browser() as window:
        page = window.new_page()
        page.goto(studio.address)
        page.get_by_text(logs[-1].name, exact=True).first.wait_for(timeout=120_000)
        page.get_by_role("button", name="Use these logs").wait_for(timeout=120_000)
        page.wait_for_timeout(3000)
        now, peak = memory(studio.process.pid)
    return Footprint(start, now, peak)


def main() -> None:
    """Print the figures."""
    with tempfile.TemporaryDirectory() as folder:
        found = measure(write_logs(Path(folder)))
    print(
        f"start {found.start:.1f} s (best of 3; limit {LONGEST_START:g} s); {LOGS} logs of {SECONDS:g} s at "
        f"{1 / SAMPLE_TIME:g} Hz open: {found.memory:.0f} MB, {found.peak:.0f} MB at most (limit {LARGEST:g} MB)"
    )


if __name__ == "__main__":
    typer.run(main)
