"""What a file that is to be replaced says and the new one would not: the rig's limits, and how its logs are read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from furuta_gym.plant import Plant
from identification.logs.checks import LogError
from identification.logs.proposal import Confidence, Proposal
from identification.logs.rig_file import load_mapping
from identification.logs.rig_mapping import RigMapping
from identification.logs.said import SECONDS


def limits_lost(path: Path, plant: Plant) -> str:
    """What to say where the plant file that is replaced holds limits of the rig, and the new one would not; else ""."""
    try:
        limits = Plant.load(path).limits if path.exists() and not plant.limits else None
    except (ValueError, OSError):  # what is replaced is no plant file
        limits = None
    if not limits:
        return ""
    told = ", ".join(f"{name} {value:g}" for name, value in limits.items())
    return (
        f"{path}: the file that is replaced had the rig's limits ({told}); the new one has none, so controllers and "
        "designs keep to u_max alone. Copy them into it"
    )


def kept_mapping(target: Path, proposal: Proposal) -> RigMapping:
    """What a file that is to be replaced says of these columns that no motion tells and nobody says otherwise now: unit
    and scale of the command, the seconds of a counter's count, and what is left out."""
    try:
        there = load_mapping(target)
    except (LogError, OSError):
        return RigMapping()
    given, unit = proposal.given, proposal.item("input_unit") if proposal.item("u").value else None
    kept: dict[str, Any] = {"skip": there.skip, "cut": there.cut}
    if there.time_unit not in SECONDS:
        kept["time_unit"] = there.time_unit
    said = given.input_unit is not None or given.input_scale is not None
    scaled = any(item.name == "input_scale" for item in proposal.items)  # as the file states
    same = unit is not None and proposal.item("u").value == (there.u or "u") and not said and not scaled
    if same and (unit.confidence is not Confidence.sure or unit.value == there.input_unit):  # type: ignore[union-attr]
        kept |= {"input_unit": there.input_unit, "input_scale": there.input_scale}
    return RigMapping(**{name: value for name, value in kept.items() if getattr(given, name) is None})
