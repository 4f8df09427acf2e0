"""The leaderboard as tables and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from controllers.comparison.conditions import Condition
from controllers.learned.policy_file import read_record
from furuta_gym.plant import Plant

from .blocks import Block
from .contestants import Contestant, policy_file
from .summary import Cell, cell


def cells_of(
    contestants: Sequence[Contestant], conditions: Sequence[Condition], blocks: Sequence[Block], duration: float
) -> list[Cell]:
    """A cell for each contestant and condition that was played; a design that does not apply has none."""
    found = []
    for c in contestants:
        for row in conditions:
            own = [b for b in blocks if (b.contestant, b.condition) == (c.name, row.name) and not b.refused]
            if own:
                found.append(cell(own, duration))
    return found


def spent_on(contestants: Sequence[Contestant], seeds: int, work: Path) -> dict[str, dict[str, Any]]:
    """Steps and CPU time [s] of each training, by contestant; what its record says."""
    found: dict[str, dict[str, Any]] = {}
    for c in contestants:
        records = [read_record(policy_file(work, c, seed)) for seed in range(seeds)] if c.learned else []
        records = [record for record in records if record]
        if records:
            cpu = [float(record["spent"]["cpu_s"]) for record in records]
            found[c.name] = {"steps": records[0]["steps"], "cpu_s": cpu, "seeds": len(records)}
    return found


def tables(
    contestants: Sequence[Contestant],
    conditions: Sequence[Condition],
    cells: Sequence[Cell],
    spent: Mapping[str, Mapping[str, Any]],
    plant: Plant,
) -> str:
    """Markdown: success everywhere, then how, on the rig as it is; best mean success first.

    Only those are ranked that played every rig, with the same number of trainings: a mean over other rigs is another.
    """
    at = {(c.contestant, c.condition): c for c in cells}
    names = [row.name for row in conditions]
    played = {c.name: [at[c.name, name] for name in names if (c.name, name) in at] for c in contestants}
    whole = [c for c in contestants if _is_whole(played[c.name], len(names))]
    mean = {c.name: float(np.mean([x.success.value for x in played[c.name]])) for c in whole}
    ranked = sorted(whole, key=lambda c: -mean[c.name])
    heads = [f"{c.words} ({played[c.name][0].seeds} seeds)" if c.learned else c.words for c in ranked]
    trained = " or ".join(map(str, sorted({played[c.name][0].seeds for c in ranked if c.learned})))
    lines = ["Success in %, with its 95 % interval" + (f" of these {trained} trainings." if trained else "."), ""]
    lines += [f"| rig | {' | '.join(heads)} |", "|---" * (len(ranked) + 1) + "|"]
    for name in names:
        lines.append(f"| {name} | {' | '.join(_rate(at[c.name, name]) for c in ranked)} |")
    lines.append(f"| mean | {' | '.join(f'{100 * mean[c.name]:.1f}' for c in ranked)} |")
    u = plant.unit
    lines += ["", "On the rig as it is:", ""]
    head = f"up after [s] (worst 5 %) | roughness [{u}/s] | effort [{u}² s] | largest arm angle [rad]"
    lines += [f"| controller | {head} | env steps | CPU of a training [s] |", "|---" * 7 + "|"]
    for c in ranked:
        x = at[c.name, names[0]]
        if np.isnan(x.settling.value):
            continue
        cost = spent.get(c.name)
        training = f"{cost['steps']:,} | {np.mean(cost['cpu_s']):.0f}" if cost else "– | –"
        figures = f"{x.settling.value:.2f} ({x.worst_settling:.2f}) | {_number(x.roughness)} | {_number(x.energy)}"
        lines.append(f"| {c.words} | {figures} | {x.largest_q1:.1f} | {training} |")
    if left := [c.words for c in contestants if c not in ranked and not played[c.name]]:
        lines += ["", f"Not run, or not possible on this rig: {'; '.join(left)}."]
    if left := [c.words for c in contestants if c not in ranked and played[c.name]]:
        lines += ["", f"Not ranked, as trials are missing: {'; '.join(left)}."]
    return "\n".join(lines) + "\n"


def _is_whole(played: Sequence[Cell], rigs: int) -> bool:
    return len(played) == rigs and len({cell.seeds for cell in played}) == 1


def _rate(x: Cell) -> str:
    return f"{100 * x.success.value:.3g} ({100 * x.success.low:.3g}–{100 * x.success.high:.3g})"


def _number(x: Any) -> str:
    return f"{x.value:.3g} ({x.low:.3g}–{x.high:.3g})"


def draw(contestants: Sequence[Contestant], conditions: Sequence[Condition], cells: Sequence[Cell], path: Path) -> None:
    """Success in % of all as a map: contestants down, rigs across; below each figure those of the single seeds."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    at = {(c.contestant, c.condition): c for c in cells}
    rows = [c for c in contestants if any((c.name, row.name) in at for row in conditions)]
    figure = Figure(figsize=(2.6 + 1.0 * len(conditions), 1.4 + 0.5 * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    value = [[at[c.name, r.name].success.value if (c.name, r.name) in at else np.nan for r in conditions] for c in rows]
    axis.imshow(value, cmap="RdYlGn", vmin=0.0, vmax=1.0, aspect="auto")
    for i, c in enumerate(rows):
        for j, row in enumerate(conditions):
            x = at.get((c.name, row.name))
            text = "–" if x is None else f"{100 * x.success.value:.0f}"
            if x is not None and x.seeds > 1:
                text += f"\n{100 * min(x.each):.0f} … {100 * max(x.each):.0f}"
            colour = "white" if x is not None and not 0.15 < x.success.value < 0.85 else "black"
            axis.text(j, i, text, ha="center", va="center", fontsize=7, color=colour)
    names = [row.name.replace(", ", ",\n") for row in conditions]
    axis.set_xticks(range(len(conditions)), names, fontsize=8, rotation=30, ha="right")
    axis.set_yticks(range(len(rows)), [c.words for c in rows], fontsize=8)
    axis.set_title("swing-ups that succeed [%]; below, the worst and the best training seed", fontsize=9)
    figure.savefig(path, dpi=110)
