"""How long would a nonlinear MPC of the swing-up have to compute? `python -m experiments.studies.mpc_time`.

At moments along the plan of `plan_swing_up`, the rest of the swing-up is planned anew from the plan's own state with
errors of an estimate, starting IPOPT from the plan before: what an MPC solves at every sample. Prints the times.
"""

from __future__ import annotations

import time
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from controllers.swing_up.planning import Collocation, Plan, require_casadi
from experiments.cli.errors import explained
from furuta_gym.plant import Plant
from furuta_gym.plant.parameters import pendulum_frequency

SOLVES = 20
STEP = 0.02  # s between two solves; a tenth of the fastest motion of such rigs


def solve_times(plant: Plant, intervals: int, solves: int = SOLVES, seed: int = 0) -> tuple[list[float], int]:
    """Wall time [s] of each warm solve that gave a plan, and how many gave none. Raises DesignError without CasADi."""
    problem = Collocation(require_casadi(), plant, intervals, 0.0)
    whole = problem.solve(swings=1.0)
    if whole is None:
        raise ValueError("no plan to start from; choose a larger u_max")
    rng = np.random.default_rng(seed)
    spread = np.array([0.002, 0.002, 0.05, 0.05])  # rad, rad/s: what an estimate is off by
    taken, failed, near = [], 0, whole
    for k in range(1, solves + 1):
        at = (k * STEP) % (0.7 * whole.duration)
        if at < STEP:
            near = whole
        start = np.array([np.interp(at, whole.t, row) for row in whole.state[:4]])
        start += spread * rng.standard_normal(4)
        began = time.perf_counter()
        plan = problem.solve(start, near=rest_of(near, STEP))
        if plan is None:
            failed += 1
        else:
            taken.append(time.perf_counter() - began)
        near = plan or whole
    return taken, failed


def rest_of(plan: Plan, since: float) -> Plan:
    """The plan from `since` [s] on, at as many times: the first guess of the next solve."""
    t = np.linspace(min(since, 0.9 * plan.duration), plan.duration, plan.t.size)
    fine = np.linspace(t[0], t[-1], plan.torque.size)
    state = np.stack([np.interp(t, plan.t, row) for row in plan.state])
    return Plan(t - t[0], state, plan.torque_at(fine))


def main(
    plant: Annotated[str, typer.Option(help="table3, qube, large, or a plant file.")] = "qube",
    u_max: Annotated[float, typer.Option(help="Largest command.")] = 6.0,
) -> None:
    """Times of warm solves for plans of three finenesses."""
    with explained():
        rig = Plant.resolve(plant).replace(u_max=u_max, effects=())
        table = Table(
            title=f"{SOLVES} warm solves each; a sample of {plant} is {1e3 * (rig.sample_time or 0.002):g} ms"
        )
        for title in ("intervals", "median [ms]", "longest [ms]", "without a plan"):
            table.add_column(title, justify="right")
        for intervals in (10, 20, 40):
            taken, failed = solve_times(rig, intervals)
            row = [f"{1e3 * f(taken):.0f}" if taken else "–" for f in (np.median, np.max)]
            table.add_row(str(intervals), *row, f"{failed} of {SOLVES}")
        Console(width=100).print(table)
        Console().print(f"The pendulum's period at rest is {2 * np.pi / pendulum_frequency(rig.theta):.2f} s.")


if __name__ == "__main__":
    typer.run(main)
