"""What a plant file leaves open, and what it says that nobody reads: each a sentence for its user."""

import difflib
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from .parameters import THETA_NAMES
from .plant_file import CovarianceEntry, EffectEntry, PlantFile, SensorsEntry

_SHARPNESS = ("r", "r1", "r2")


def remarks(data: Mapping[str, Any], unit: str, u_max: float, parameters: Collection[str]) -> Iterator[str]:
    """The ends of sentences that begin with the file's name.

    data: a file that is a plant. unit, u_max: what the plant has. parameters: of its effects, as EFFECT.PARAMETER.
    """
    if "unit" not in data:
        yield 'has no "unit"; its command is taken to be in V. Write "unit": "V" or "unit": "N·m" into it.'
    if "u_max" not in data:
        yield (
            f'has no "u_max"; its largest command is taken to be {u_max:g} {unit}. Write "u_max" with the rig\'s own '
            "into it."
        )
    yield from _unknown(data, PlantFile.__struct_fields__)
    for effect in data.get("effects") or ():
        yield from _unknown(effect, EffectEntry.__struct_fields__, f" in effects[{effect['name']}]")
    covariance = data.get("covariance")
    if isinstance(covariance, Mapping):
        yield from _unknown(covariance, CovarianceEntry.__struct_fields__, " in its covariance")
        yield from _of_nothing(covariance["names"], parameters)
    for key, meant in _slips(data.get("sensors") or {}, SensorsEntry.__struct_fields__):
        yield f"has the key {key!r} in its sensors, which is not known and is left out; did you mean {meant!r}?"


def _unknown(data: Mapping[str, Any], known: Sequence[str], where: str = "") -> Iterator[str]:
    for key in sorted(set(data) - set(known)):
        yield f"has the key {key!r:.80}{where}, which is not known and is left out{_perhaps(key, known)}"


def _slips(data: Mapping[str, Any], known: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Keys that are nearly a known one which is missing, where others are notes of the user's own."""
    free = [name for name in known if name not in data]
    for key in sorted(set(data) - set(known)):
        for near in difflib.get_close_matches(key, free, n=1):
            yield key, near


def _of_nothing(names: Sequence[str], parameters: Collection[str]) -> Iterator[str]:
    known = (*THETA_NAMES, *_SHARPNESS, *parameters)
    for name in names:
        if name not in known:
            yield (
                f"has a covariance of {name!r:.80}, which is no parameter of this plant: its uncertainty is left out"
                + _perhaps(name, [k for k in known if k not in names])
            )


def _perhaps(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {near[0]!r}?" if near else "."
