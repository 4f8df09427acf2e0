"""Marks: one outcome for every answer, by rules that are fixed here and tested on answers made by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from furuta_gym.plant.covariance import NORMAL_95

from .trial import NOTHING

RIGHT = ("right", "pair")
"""Outcomes that count as named right: alone, or within a set of two equals."""

_SHARPNESS = "friction_sharpness"
SAME_LAW = {("arm_spring", "bench"): "arm_cable"}
"""(hidden effect, form) whose law is exactly that of another library effect: either name is right. A spring k e (1 +
0.15 e²) is a cable with k3 = 0.15 k that is softest where it has no torque."""
_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Outcome:
    """What an answer is worth.

    result, where something is to be named ("library", "strong", "two", "composite", "hard"): right (alone), pair (in a
    set of two), inside (in a larger set), extra (right, and a false one beside it), half (some of several), wrong,
    missed (none), unknown, insufficient, error. Where nothing is (NOTHING): right (none), false_alarm, unknown,
    insufficient, error. "outside": right (unknown, or leftover structure reported), wrong, missed, insufficient, error.
    named: the names given first, in order. found: hidden effects that a set of at most two equals names. false: sets
    that hold nothing hidden. inside: every hidden name is in a stated set. covered: parameter → its 95 %
    interval holds the truth, for table forms that were named right. leftover: the answer says that structure is left.
    code: digest of the code that answered (`code.answering_code`), "" where nobody kept it.
    """

    id: str
    kind: str
    subject: str
    rig: str
    form: str
    ratio: float | None
    result: str
    named: tuple[str, ...]
    found: int
    false: int
    inside: bool
    covered: Mapping[str, bool]
    leftover: bool
    reported_absorbed: bool
    closed_fraction: float | None
    after_over_floor: float | None
    runtime_s: float | None
    code: str = ""

    @property
    def right(self) -> bool:
        """Named right (alone or in a pair), or rightly not named."""
        return self.result in RIGHT


def score(sealed: Mapping[str, Any], answer: Mapping[str, Any]) -> Outcome:
    """Mark one answer (diagnosis.json as a dictionary, or {"error": …}) by the sealed truth of its trial."""
    trial = sealed["trial"]
    hidden = [h["name"] for h in trial["hidden"]]
    sets = [_one_name(s, trial["hidden"]) for s in stated_sets(answer)]
    result = _result(trial["kind"], hidden, trial["friction"] == "hard", sets, answer)
    true = _true_sets(hidden, trial["friction"] == "hard", sets)
    matched = [s for s in _matched(hidden, true) if s is not None]
    ratios = [r for r in sealed["ratios"] if r is not None] or [sealed.get("hard_ratio")]
    return Outcome(
        id=trial["id"],
        kind=trial["kind"],
        subject=sealed["subject"],
        rig=trial["rig"],
        form="+".join(h["form"] for h in trial["hidden"]),
        ratio=min(ratios) if None not in ratios else None,
        result=result,
        named=tuple(s[0] for s in stated_sets(answer)),
        found=sum(len(s) <= 2 for s in matched),
        false=len(true) - len(matched),
        inside=bool(hidden) and set(hidden) <= {name for s in sets for name in s},
        covered=_covered(sealed["truth"], answer)
        if trial["kind"] in ("library", "strong", "two", "composite") and result in RIGHT
        else {},
        leftover=bool(answer.get("leftover")),
        reported_absorbed=any(name in answer.get("absorbed", ()) for name in hidden),
        closed_fraction=_gap_number(answer, "closed_fraction"),
        after_over_floor=_after_over_floor(answer),
        runtime_s=answer.get("runtime_s"),
        code=str(answer.get("code", "")),
    )


def stated_sets(answer: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """The sets of equals that the answer names, the first name of each first; none unless it names something."""
    if answer.get("verdict") not in ("named", "ambiguous"):
        return []
    return [(e["name"], *(n for n in e.get("confused_with", ()) if n != e["name"])) for e in answer["effects"]]


def _one_name(equals: tuple[str, ...], hidden: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """A set of equals in which another name of a hidden law is the hidden effect's."""
    other = {SAME_LAW[h["name"], h["form"]]: h["name"] for h in hidden if (h["name"], h["form"]) in SAME_LAW}
    return tuple(dict.fromkeys(other.get(name, name) for name in equals))


def _result(kind: str, hidden: list[str], hard: bool, sets: list[tuple[str, ...]], answer: Mapping[str, Any]) -> str:
    verdict = answer.get("verdict")
    if "error" in answer or verdict is None:
        return "error"
    if verdict == "insufficient_excitation":
        return "insufficient"
    if kind == "outside":
        laws = [e for e in answer.get("other_laws", ()) if not e.get("follows")]
        if verdict == "unknown" or (sets and (answer.get("leftover") or laws)):
            return "right"
        return "wrong" if sets else "missed"
    if verdict == "unknown":
        return "unknown"
    if kind in NOTHING:
        return "false_alarm" if sets else "right"
    if kind == "hard":
        return _compared([_SHARPNESS], sets)
    return _compared(hidden, _true_sets(hidden, hard, sets))


def _true_sets(hidden: list[str], hard: bool, sets: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """The sets that are marked: on a rig with hard friction, which is a very large r, its sharpness is true as well."""
    if hard and _SHARPNESS not in hidden:
        return [s for s in sets if s[0] != _SHARPNESS]
    return sets


def _compared(hidden: list[str], sets: list[tuple[str, ...]]) -> str:
    """How well sets of equals name what is hidden: one set for each name, in any order."""
    if not sets:
        return "missed"
    matched = _matched(hidden, sets)
    found = [s for s in matched if s is not None]
    if not found:
        return "wrong"
    if len(found) < len(hidden):
        return "half"
    if len(sets) > len(hidden):
        return "extra"
    largest = max(map(len, found))
    return "right" if largest == 1 else "pair" if largest == 2 else "inside"


def _matched(hidden: list[str], sets: list[tuple[str, ...]]) -> list[tuple[str, ...] | None]:
    """A set for each hidden name, each set used once, as many as can be; None where there is none."""
    if not hidden:
        return []
    name, rest = hidden[0], hidden[1:]
    ways = [[None, *_matched(rest, sets)]]
    for i, s in enumerate(sets):
        if name in s:
            ways.append([s, *_matched(rest, sets[:i] + sets[i + 1 :])])
    return min(ways, key=lambda way: (way.count(None), max((len(s) for s in way if s), default=0)))


def _covered(truth: Mapping[str, Any], answer: Mapping[str, Any]) -> dict[str, bool]:
    """ "effect.parameter" → whether the stated 95 % interval holds the truth; for table forms whose name comes first.
    Where none is stated, and for what turns: value ± 1.96 std."""
    given = {e["name"]: e["parameters"] for e in answer["effects"]}
    found = {}
    for effect in truth["effects"]:
        name = effect["name"]
        if effect["form"] != "table" or name not in given:
            continue
        true = {key: p["value"] for key, p in effect["parameters"].items()}
        for key, p in _same_branch(given[name], true).items():
            if p.get("std") and key in true:  # fixed parameters and whole numbers have no std
                apart = NORMAL_95 * p["std"]
                low, high = p.get("interval") or (p["value"] - apart, p["value"] + apart)
                found[f"{name}.{key}"] = low <= true[key] <= high
    return found


def _same_branch(given: Mapping[str, Any], true: Mapping[str, float]) -> dict[str, Any]:
    """The given sine with the sign and the turn of the true one: A sin(x + φ) = −A sin(x + φ + π)."""
    if "φ" not in given:
        return dict(given)
    a, phase = given["A"], given["φ"]
    flipped = a["value"] * true["A"] < 0.0
    away = phase["value"] + (math.pi if flipped else 0.0) - true["φ"]
    near = true["φ"] + away - _TURN * round(away / _TURN)
    turned = {"A": a | {"value": -a["value"] if flipped else a["value"]}, "φ": phase | {"value": near}}
    return {**given, **{key: p | {"interval": None} for key, p in turned.items()}}


def _gap_number(answer: Mapping[str, Any], key: str) -> float | None:
    value = (answer.get("gap") or {}).get(key)
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None


def _after_over_floor(answer: Mapping[str, Any]) -> float | None:
    """Root mean square over the axes of held-out error after, over the noise floor."""
    gap = answer.get("gap") or {}
    after, floor = gap.get("after") or {}, gap.get("noise_floor") or {}
    try:
        ratios = [after[key] / floor[key] for key in ("rms_q1", "rms_q2")]
    except (KeyError, ZeroDivisionError):
        return None
    return math.sqrt(sum(r * r for r in ratios) / 2.0)
