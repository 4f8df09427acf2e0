"""The catalogue of everything that a rig of the bench can hide."""

from __future__ import annotations

from . import library, outside
from .declaration import BenchEffect


def catalogue() -> dict[str, BenchEffect]:
    """Every effect by name, in a fixed order."""
    return {e.name: e for e in (*library.EFFECTS, *outside.EFFECTS)}


def find(name: str) -> BenchEffect:
    """An effect by name; ValueError names those there are."""
    known = catalogue()
    if name not in known:
        raise ValueError(f"unknown effect {name!r}. The bench can hide: {', '.join(known)}.")
    return known[name]
