"""The demo's own section of the report: what the controllers did on the rig."""

from __future__ import annotations

from experiments.report.contents import Section, Table, Text

from .policies import DURATION, RUNS, SIDES, Trial


def rig_section(trial: Trial) -> Section:
    """Policies and LQRs made without and with the effect, on the rig that hides it."""
    rows = []
    for p in trial.played:
        held, *figures = (p.figures[name] for name in ("success", "rms_q1", "rms_q2", "energy"))
        rows.append((f"{p.name}, {p.side} the effect", f"{100 * held.value:.0f} %", *map(str, figures)))
    table = Table(
        ("controller, made", "held", "rms q1 [rad]", "rms q2 [rad]", "∫u² dt [V²·s]"),
        rows,
        f"{RUNS} runs of {DURATION:g} s from the same starts near upright; 95 % intervals.",
    )
    learned = " and ".join(f"{trial.training[side]['wall_s']:.0f} s" for side in SIDES)
    said = tuple(
        Text(f"The {name} made with the effect, against the one made without it: {trial.verdict(name)}.", "strong")
        for name in trial.names
    )
    caveat = Text(
        f"Each policy learned once, in {learned}. Another seed gives another policy: only a large difference between "
        "the policies says something about the plants.",
        "note",
    )
    return Section("rig", "On the rig itself", (*said, table, caveat))
