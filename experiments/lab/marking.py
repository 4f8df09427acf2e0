"""A student's diagnosis.json against what the rig hides, by the rules of the blind trials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.trials.scoring import Outcome, score
from furuta_gym.files import read_json
from furuta_gym.plant import EFFECTS
from identification.logs.formats import file_hash

VERDICTS = ("named", "ambiguous", "none", "unknown", "insufficient_excitation")
NOTHING = ("none", "torque_noise", "absorbed")
"""Kinds of rig on which nothing is to be named."""

_WORDS = {
    "right": "Right: what is hidden is named, and nothing else.",
    "pair": "Right: what is hidden is one of two effects that are named as equals.",
    "inside": "Partly right: what is hidden is one of several effects that are named as equals.",
    "extra": "Partly right: what is hidden is named, and something that is not there beside it.",
    "half": "Partly right: one of two hidden effects is named.",
    "wrong": "Wrong: another effect is named than the hidden one.",
    "missed": "Wrong: an effect is hidden, and none is named.",
    "unknown": "Not named: the diagnosis says that something is missing, and gives it no name.",
    "insufficient": "Not named: the diagnosis says that the motion does not suffice.",
    "false_alarm": "Wrong: nothing is hidden, and an effect is named.",
}
_ERRORS = ("after", "noise_floor")
"""Parts of a gap that a mark looks at."""

_NONE_THERE = "Right: nothing is hidden, and no effect is named."
_OUTSIDE = "Right: what is hidden is outside the library, and the diagnosis reports unexplained structure."
_OUTSIDE_NAMED = (
    "Partly right: what is hidden is outside the library, and the diagnosis reports unexplained structure. What it "
    "names is not there, and stands for what is hidden."
)


@dataclass(frozen=True)
class Comparison:
    """One parameter of a hidden effect: hidden and found value, its standard deviation (None: not estimated), unit,
    and whether the 95 % interval holds the hidden value (None where the rig's law is not the library's)."""

    parameter: str
    hidden: float
    found: float
    std: float | None
    unit: str
    inside: bool | None


def read_diagnosis(file: Path) -> dict[str, Any]:
    """A diagnosis.json, with what marking needs in its place. Raises ValueError and OSError."""
    try:
        answer = read_json(file.read_bytes())
    except ValueError as error:
        raise ValueError(f"{file} is not JSON ({error}); expected a diagnosis.json of `furuta diagnose`") from None
    if not (isinstance(answer, dict) and answer.get("schema") == "furuta-diagnosis/1"):
        raise ValueError(f'{file}: expected a diagnosis.json of `furuta diagnose` ("schema": "furuta-diagnosis/1")')
    if answer.get("verdict") not in VERDICTS:
        raise ValueError(f"{file}: verdict {answer.get('verdict')!r} given, expected one of {', '.join(VERDICTS)}")
    effects = answer.get("effects")
    if isinstance(effects, list) and (strange := [name for e in effects if (name := _name(e)) not in (None, *EFFECTS)]):
        raise ValueError(f"{file}: the library has no effect {', '.join(map(str, strange))}; `furuta effects` lists it")
    if not (isinstance(effects, list) and all(map(_is_effect, effects))):
        raise ValueError(
            f"{file}: every entry of effects needs a name, confused_with and parameters with a value, and A beside φ"
        )
    if not isinstance(answer.get("absorbed", {}), dict | list):
        raise ValueError(f"{file}: absorbed {answer['absorbed']!r} given, expected effects by name")
    gap = answer.get("gap")
    if not _is_gap(gap):
        raise ValueError(f"{file}: gap must be null, or hold after and noise_floor with numbers or null in them")
    return answer | {"gap": None if gap is None else gap | {name: _measured(gap.get(name)) for name in _ERRORS}}


def foreign_logs(sealed: Path, answer: Mapping[str, Any]) -> list[str]:
    """Names of the logs of a diagnosis that are no files beside a sealed file; none where no log lies there. A log that
    was opened and saved by another program is no longer the file that was handed out."""
    own = {file_hash(log) for log in sealed.parent.rglob("*.csv")}
    logs = answer.get("logs")
    given = [log for log in logs if isinstance(log, dict)] if isinstance(logs, list) else []
    return [str(log.get("source")) for log in given if own and log.get("sha256") not in own]


def _name(entry: Any) -> str | None:
    """The name of an entry of `effects`, None where it has none."""
    name = entry.get("name") if isinstance(entry, dict) else None
    return name if isinstance(name, str) else None


def _is_effect(entry: Any) -> bool:
    if not (isinstance(entry, dict) and isinstance(entry.get("name"), str)):
        return False
    others, parameters = entry.get("confused_with", []), entry.get("parameters")
    if not (isinstance(others, list) and all(isinstance(name, str) for name in others)):
        return False
    return (
        isinstance(parameters, dict)
        and all(
            isinstance(p, dict)
            and _number(p.get("value"))
            and (p.get("std") is None or _number(p["std"]))
            and _is_interval(p.get("interval"))
            for p in parameters.values()
        )
        and ("φ" not in parameters or "A" in parameters)
    )


def _is_gap(given: Any) -> bool:
    if not isinstance(given, dict):
        return given is None
    parts = [given[name] for name in _ERRORS if given.get(name) is not None]
    return all(isinstance(part, dict) and all(v is None or _number(v) for v in part.values()) for part in parts)


def _measured(errors: Mapping[str, Any] | None) -> dict[str, Any]:
    """The errors without those that are null: they were not measured."""
    return {name: value for name, value in (errors or {}).items() if value is not None}


def _is_interval(given: Any) -> bool:
    return given is None or (isinstance(given, list) and len(given) == 2 and all(_number(x) for x in given))


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def marked(sealed: Mapping[str, Any], answer: Mapping[str, Any]) -> tuple[Outcome, str, list[Comparison]]:
    """The mark of the trials, the same in a sentence, and the parameters of effects that were hidden and named."""
    outcome = score(sealed, answer)
    return outcome, sentence(outcome, bool(outcome.named)), _compared(sealed["truth"], answer, outcome.covered)


def sentence(outcome: Outcome, named: bool = False) -> str:
    """What an outcome means for the student. named: whether the diagnosis names an effect."""
    if outcome.result == "right" and outcome.kind in NOTHING:
        return _NONE_THERE
    if outcome.result == "right" and outcome.kind == "outside":
        return _OUTSIDE_NAMED if named else _OUTSIDE
    return _WORDS[outcome.result]


def _compared(truth: Mapping[str, Any], answer: Mapping[str, Any], covered: Mapping[str, bool]) -> list[Comparison]:
    given = {entry["name"]: entry["parameters"] for entry in answer["effects"]}
    return [
        Comparison(
            parameter=f"{effect['name']}.{key}",
            hidden=p["value"],
            found=given[effect["name"]][key]["value"],
            std=given[effect["name"]][key].get("std"),
            unit=p["unit"],
            inside=covered.get(f"{effect['name']}.{key}"),
        )
        for effect in truth["effects"]
        for key, p in effect["parameters"].items()
        if key in given.get(effect["name"], {})
    ]
