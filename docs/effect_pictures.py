"""Draws the pictures of the page on effects; `python docs/generate.py --pictures` calls it."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def draw_effects(folder: Path) -> None:
    """A picture for each effect: the two angles without and with it."""
    import matplotlib

    matplotlib.use("agg")
    import numpy as np
    from matplotlib.figure import Figure

    from controllers import make_controller
    from furuta_gym import EFFECTS, Effect, Plant, simulate
    from identification.design.signals import excitation

    plant = Plant.resolve("qube")
    d = excitation("paper", duration=4.0)

    def run(one: Plant) -> Any:
        controller = make_controller("lqr", plant)
        return simulate(one, controller, 4.0, excitation=d, x0=(0.3, 0.05, 0.0, 0.0), q2_limit=1.5)

    folder.mkdir(parents=True, exist_ok=True)
    without = run(plant)
    for name in EFFECTS:
        at_two = {p.name: 2.0 for p in EFFECTS[name].parameters if p.instant}
        usual = dict(plant.default_effect(name).parameters)
        with_it = run(plant.with_effects(Effect(name, usual | at_two)))
        n = min(len(without.t), len(with_it.t))  # a run ends where the pendulum falls
        difference = np.degrees(with_it.measured[:n] - without.measured[:n])
        if not np.abs(difference).max() > 0.0:
            raise ValueError(f"{name} changes nothing in {n} samples: its picture would show no effect")
        figure = Figure(figsize=(7.2, 2.4), layout="constrained")
        axes = figure.subplots(2, 2, sharex=True, height_ratios=(1.5, 1.0))
        for column, title in enumerate(("arm q1 [°]", "pendulum q2 [°]")):
            top, bottom = axes[:, column]
            for record, color, width in ((without, "#9aa0a6", 2.2), (with_it, "#2f6f9f", 1.0)):
                top.plot(record.t, np.degrees(record.measured[:, column]), color=color, linewidth=width)
            bottom.plot(without.t[:n], difference[:, column], color="#d9822b", linewidth=1.0)
            top.set_title(title, fontsize=8, loc="left")
            bottom.set_title("difference [°]", fontsize=8, loc="left")
            top.tick_params(labelsize=7)
            bottom.tick_params(labelsize=7)
        axes[1, 0].set_xlabel("t [s]", fontsize=7)
        axes[1, 1].set_xlabel("t [s]", fontsize=7)
        figure.savefig(folder / f"{name}.png", dpi=75)
