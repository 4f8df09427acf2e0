"""Record the logs of the regression net on the virtual bench: `python -m tests.golden.make_logs`.

The logs are committed; run this only to change which ones there are, and renew the expected results afterwards
(`python -m tests.golden.results --renew`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.bench import HiddenEffect, Rig, record

LOGS = Path(__file__).parent / "logs"
DURATION, SAMPLE_TIME = 8.0, 4e-3  # s


@dataclass(frozen=True)
class Recipe:
    """One case: the rig, the experiment that is fitted and the one that is held out ("" for none)."""

    rig: Rig
    experiment: str = "paper"
    held_out: str = ""
    seed: int = 1
    broken: str = ""  # what is done to the readings afterwards


def _rig(kind: str, *effects: HiddenEffect, individual: int = 3, **more) -> Rig:
    return Rig(kind, effects, individual=individual, scatter=0.08, sample_time=SAMPLE_TIME, **more)


def _one(kind: str, name: str, strength: float = 1.0, form: str = "", **more) -> Rig:
    return _rig(kind, HiddenEffect(name, strength, form), **more)


RECIPES: dict[str, Recipe] = {
    "none-servo": Recipe(_rig("servo")),
    "none-table3": Recipe(_rig("table3", torque_noise=(2e-6, 1e-8)), "wide", "paper"),
    "none-workshop-hanging": Recipe(_rig("workshop"), "hanging-chirp"),
    "spring-table3": Recipe(_one("table3", "arm_spring"), "paper", "wide"),
    "spring-servo": Recipe(_one("servo", "arm_spring", 2.0, "bench")),
    "lag-servo": Recipe(_one("servo", "actuator_lag", 2.0), "paper", "steps"),
    "delay-workshop": Recipe(_one("workshop", "input_delay", 2.0)),
    "lag-faint-desk": Recipe(_one("desk", "actuator_lag", 0.1), "dither"),
    "delay-faint-servo": Recipe(_one("servo", "input_delay", 0.1), "dither", "paper"),
    "offset-table3": Recipe(_one("table3", "input_offset", 0.2)),
    "dead-zone-table3": Recipe(_one("table3", "input_dead_zone", 2.0), "paper", "wide"),
    "stribeck-desk": Recipe(_one("desk", "arm_stribeck", 2.0, "bench")),
    "drag-servo-hanging": Recipe(_one("servo", "pendulum_quadratic_drag", 2.0), "hanging-chirp", "free-decay"),
    "presliding-servo": Recipe(_one("servo", "arm_presliding", 1.0)),
    "tilt-desk": Recipe(_one("desk", "base_tilt", 1.0), "wide", "paper"),
    "two-spring-lag-servo": Recipe(
        _rig("servo", HiddenEffect("arm_spring", 2.0), HiddenEffect("actuator_lag", 2.0)), "paper", "steps"
    ),
    "two-offset-dead-zone-table3": Recipe(
        _rig("table3", HiddenEffect("input_dead_zone", 1.5), HiddenEffect("pendulum_encoder_offset", 1.0)), "paper"
    ),
    "outside-slipping-payload": Recipe(_one("servo", "slipping_payload", 2.0), "paper", "steps"),
    "outside-slipping-coupling": Recipe(_one("desk", "slipping_coupling", 2.0)),
    "outside-lost-counts": Recipe(_one("workshop", "lost_counts", 2.0), "paper", "wide"),
    "still-pendulum": Recipe(_rig("servo"), broken="pendulum"),
    "still-rig": Recipe(_rig("desk"), broken="both"),
}


def write(name: str, recipe: Recipe) -> None:
    """The logs of one case."""
    from identification.logs.formats import write_table

    runs = {"fit": (recipe.experiment, recipe.seed), "held_out": (recipe.held_out, recipe.seed + 1)}
    for role, (experiment, seed) in runs.items():
        if not experiment:
            continue
        run = record(recipe.rig, experiment, seed, DURATION)
        q1, q2 = run.q1.copy(), run.q2.copy()
        quantum = 2 * np.pi / np.array(recipe.rig.counts)
        if recipe.broken:  # an encoder that is not connected; an arm that is blocked
            q2[:] = 0.0
        if recipe.broken == "both":
            q1 = np.round(q1 / quantum[0]) % 2 * quantum[0]
        columns = {"t": run.t, "q1": q1, "q2": q2, "u": run.u}
        about = {
            "input_unit": recipe.rig.kind.unit,
            "pendulum_zero": "upright",
            "encoder_counts": " ".join(str(c) for c in recipe.rig.counts),
        }
        write_table(LOGS / f"{name}.{role}.parquet", columns, about)


def main() -> None:
    LOGS.mkdir(exist_ok=True)
    for name, recipe in RECIPES.items():
        write(name, recipe)


if __name__ == "__main__":
    main()
