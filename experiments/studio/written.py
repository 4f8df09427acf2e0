"""Files that replace what a user may have written into them: each says what went, or what was kept."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from experiments.replaced import kept_mapping, limits_lost
from furuta_gym.plant import Plant
from identification import LogError, RigMapping, load_mapping, save_mapping

from .session import Session


def write_plant(plant: Plant, path: Path) -> str:
    """Write a plant file. Gives what to say of the limits that were in the file before; "" for none."""
    lost = limits_lost(path, plant)
    plant.save(path)
    return f"{lost}." if lost else ""


def write_mapping(session: Session, path: Path) -> str:
    """Write how the logs are read. What was left out by the file before is kept, unless the command line said that no
    file of its own holds. Gives what to say of that, and of what it said otherwise; "" for nothing."""
    proposal = session.proposal
    assert proposal is not None
    shown = proposal.mapping  # all that the page shows is said, and holds
    kept = RigMapping() if session.stated is not None else kept_mapping(path, replace(proposal, given=shown))
    mapping = kept.over(shown)
    try:
        there = load_mapping(path)
    except LogError:  # none that can be read
        there = RigMapping()
    new = mapping.to_dict()
    otherwise = there.without(*(name for name, value in there.to_dict().items() if new.get(name) == value))
    reasons = {item.name: item.reason for item in proposal.items}
    reasons |= dict.fromkeys(kept.to_dict(), "kept from the file that was here")
    save_mapping(path, mapping, reasons, "How the logs of this rig are read.")
    said = [] if kept.empty else [f"{path}: kept from the file that was replaced: {kept.options()}."]
    if not otherwise.empty:
        said.append(f"{path}: the file that was replaced said otherwise: {otherwise.options()}.")
    return " ".join(said)
