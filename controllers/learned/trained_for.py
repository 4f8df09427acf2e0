"""What of a rig no episode of a policy's training had: its effects, and limits that are narrower than there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from furuta_gym.envs.ranges import as_mapping
from furuta_gym.plant import Plant
from furuta_gym.plant.plant_file import ARM_TRAVEL

_SAME = 1e-6  # share by which a limit may be narrower


def never_met(record: Mapping[str, Any], plant: Plant) -> list[str]:
    """In words, what `plant` has and the training of a policy had not; [] where its record names no plant.

    record: of the training, see `policy_file.read_record`."""
    rig, env = record.get("plant") or {}, record.get("env") or {}
    if not rig.get("theta"):
        return []
    drawn = _drawn(env, rig)
    had = drawn | {str(effect.get("name")) for effect in rig.get("effects") or []}
    found = [effect.name for effect in plant.effects if effect.name not in had]
    limits = rig.get("limits") or {}
    kept = {
        "arm_travel": env.get("arm_limit") or limits.get("arm_travel") or ARM_TRAVEL,
        "arm_speed": limits.get("arm_speed") or math.inf,
        "slew": limits.get("slew") or math.inf,
        "supply": 0.0 if "u_max" in drawn else min(limits.get("supply") or math.inf, rig.get("u_max") or math.inf),
    }
    for name, trained in kept.items():
        own = plant.supply if name == "supply" else plant.limit(name, math.inf)
        if own < (1.0 - _SAME) * float(trained):
            said = f"{float(trained):g}" if math.isfinite(float(trained)) else "no limit"
            if name == "supply" and "supply" not in (plant.limits or {}):
                name = "u_max"
            found.append(f"{name} of {own:g} ({said} there)")
    return found


def _drawn(env: Mapping[str, Any], rig: Mapping[str, Any]) -> set[str]:
    """Names of what the episodes drew. `randomize` True means what the plant file says."""
    given = env.get("randomize")
    ranges = as_mapping((rig.get("randomize") if given is True else given) or {})
    return {name.partition(".")[0] for name in (*ranges, *(env.get("effect_probabilities") or {}))}
