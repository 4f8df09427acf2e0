"""How far does an arm go after the envelope has switched off, if the pendulum's encoder froze while it balanced?

`python -m experiments.studies.coasting --delay 0.024 --arm-travel 1.5 --arm-speed 8 --supply 5` balances the plant
`qube` with `lqg`, freezes the reading of the pendulum at some instants, and prints how far the arm turned after the
command became 0, in rad and in v·θ1/θ6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import typer

from controllers import make_controller
from controllers.envelope import Guarded
from experiments.cli.errors import explained
from furuta_gym.plant import QUBE, Effect, Plant
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import LivePlant

START = (0.1, 0.05, 0.0, 0.0)
COASTS = 30.0  # s after the encoder froze
SAMPLE_TIME = 0.004  # s


@dataclass(frozen=True)
class Coasting:
    """frozen [s]: when the encoder froze. off: the envelope's reason. further [rad]: how far the arm turned after
    that, and factor: the same in v·θ1/θ6, of its speed v when the command became 0."""

    frozen: float
    off: str
    further: float
    factor: float


def coasted(plant: Plant, frozen: float, controller: str = "lqg") -> Coasting:
    """One run whose pendulum's encoder freezes at an instant [s]."""
    guarded = Guarded(make_controller(controller, plant, SAMPLE_TIME))
    rig = LivePlant(plant, SAMPLE_TIME, Sensors.of_file(plant.sensors), x0=START)
    held, begun, further = None, None, 0.0
    while rig.t < frozen + COASTS:
        q1, q2 = rig.read()
        if rig.t >= frozen:
            held = q2 if held is None else held
        rig.step(guarded((q1, q2 if held is None else held)))
        if guarded.off != "on":
            begun = rig.state.copy() if begun is None else begun
            further = max(further, abs(float(rig.state[0] - begun[0])))
    if begun is None:
        return Coasting(frozen, "on", 0.0, 0.0)
    speed = abs(float(begun[2]))
    return Coasting(frozen, guarded.off, further, further / (speed * plant.theta[0] / plant.theta[5]))


def said(runs: Sequence[Coasting]) -> str:
    """The runs in a line."""
    off = [run for run in runs if run.off != "on"]
    if not off:
        return f"{len(runs)} runs: the envelope never switched off"
    further, factor = (np.array([getattr(run, name) for run in off]) for name in ("further", "factor"))
    return (
        f"{len(off)} of {len(runs)} runs were switched off ({', '.join(sorted({run.off for run in off}))}); the arm "
        f"went {further.min():.1f} to {further.max():.1f} rad further, {factor.min():.2f} to {factor.max():.2f} times "
        "v·θ1/θ6"
    )


def main(
    delay: Annotated[float, typer.Option(help="Of the command, in s.")] = 0.024,
    arm_travel: Annotated[float, typer.Option(help="Limit of the arm, in rad.")] = 1.5,
    arm_speed: Annotated[float, typer.Option(help="Limit of its speed, in rad/s.")] = 8.0,
    supply: Annotated[float, typer.Option(help="Largest command, in V.")] = 5.0,
    runs: Annotated[int, typer.Option(min=1, help="Instants at which the encoder freezes.")] = 20,
) -> None:
    """Print how far the arm coasts."""
    with explained():
        limits = {"arm_travel": arm_travel, "arm_speed": arm_speed, "slew": 500.0, "supply": supply}
        plant = QUBE.replace(limits=limits, sensors={"encoder_counts": 2048})
        plant = plant.with_effects(Effect("input_delay", {"d": delay})) if delay else plant
        instants = np.random.default_rng(0).uniform(3.0, 9.0, runs)
        typer.echo(said([coasted(plant, float(t)) for t in instants]))


if __name__ == "__main__":
    typer.run(main)
