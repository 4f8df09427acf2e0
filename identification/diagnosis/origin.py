"""Where the plants of a diagnosis come from, as their files say it."""

from __future__ import annotations

from dataclasses import replace

from furuta_gym.plant import Plant

from ..estimation.estimate import Estimate


def with_origin(fitted: Estimate, before: Plant) -> Estimate:
    """An estimate that a diagnosis made: it says that it started from the search, and has its limits from where the
    plant `before` has them. By itself it would say that a user gave the plant that it started from."""
    known = {"u_max": before.provenance["u_max"]} if "u_max" in before.provenance else {}
    origin = dict(fitted.plant.provenance) | {"start": "the search for missing effects"} | known
    return replace(fitted, plant=fitted.plant.replace(provenance=origin))
