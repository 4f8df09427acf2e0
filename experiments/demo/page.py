"""The demo's own section of the report: what the controllers did on the rig."""

from __future__ import annotations

from experiments.report.contents import Section, Table, Text

from .policies import DURATION, RUNS, SIDES, Trial


def rig_section(trial: Trial) -> Section:
    """Policies and LQRs made without and with the effect, on the rig that hides it."""
    caption = f"{RUNS} runs of {DURATION:g} s from the same starts near upright; 95 % intervals."
    table = Table(trial.head, trial.rows, caption)
    learned = " and ".join(f"{trial.training[side]['wall_s']:.0f} s" for side in SIDES)
    verdicts = {name: trial.verdict(name).replace(" -", " −").replace(" %", "\u00a0%") for name in trial.names}
    said = tuple(
        Text(f"The {name} made with the effect, against the one made without it: {verdict}.", "strong")
        for name, verdict in verdicts.items()
    )
    caveat = Text(
        f"Each policy learned once, in {learned}. Another seed gives another policy: only a large difference between "
        "the policies says something about the plants.",
        "note",
    )
    return Section("rig", "On the rig itself", (*said, table, caveat))
