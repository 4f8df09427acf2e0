"""How long the what-if view takes from a slider to a picture, without the browser.

    python -m experiments.studio.speed [LOG]

The footer of the page shows the whole way, the browser included.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from importlib.resources import files
from pathlib import Path

from furuta_gym import Plant
from identification import PredictionWindow, read_log

from . import charts

MOVES = 60


def measure(path: Path, plant: Plant, effects: int = 3) -> dict[str, float]:
    """Milliseconds of MOVES slider movements on the first window of a log, with some effects acting."""
    log = read_log(path)
    window = PredictionWindow.of(log, plant)
    for name in ("arm_spring", "arm_stribeck", "actuator_lag")[:effects]:
        plant = plant.with_effects(plant.default_effect(name))
    window.predict(plant)
    times, drawn = [], []
    for i in range(MOVES):
        theta = plant.theta.copy()
        theta[5] *= 1.0 + 0.001 * i
        began = time.perf_counter()
        found = window.predict(plant.replace(theta=theta))
        computed = time.perf_counter()
        json.dumps(charts.simulated(window.log.t, found.angles))
        times.append(1e3 * (computed - began))
        drawn.append(1e3 * (time.perf_counter() - computed))
    return {
        "samples": float(len(window.log)),
        "seconds": window.log.duration,
        "compute": statistics.median(times),
        "compute_95": statistics.quantiles(times, n=20)[-1],
        "to_json": statistics.median(drawn),
    }


def main() -> None:
    """Print the times."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(str(files("experiments.demo") / "logs" / "wide.csv"))
    for effects in (0, 1, 3):
        found = measure(path, Plant.resolve("table3"), effects)
        print(
            f"{path.name}, {found['samples']:.0f} samples in {found['seconds']:.3g} s, {effects} effects: "
            f"compute {found['compute']:.0f} ms (95 % below {found['compute_95']:.0f} ms), "
            f"picture as JSON {found['to_json']:.1f} ms"
        )


if __name__ == "__main__":
    main()
