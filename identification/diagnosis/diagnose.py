"""Logs in, Diagnosis out: is an effect missing from the model, which, how large, and how sure are we."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from furuta_gym.plant import EFFECTS, EffectType, Plant

from ..estimation.estimate import Estimate
from ..estimation.identifiability import NotIdentifiable
from ..estimation.identify import identify
from ..kalman.record import stretches
from ..logs.log import Log
from .locate.locate import locate, long_enough
from .locate.location import Where
from .naming.forward import START_NOISE, Naming, name_effects, unsettled
from .naming.scores import Fit, fit
from .naming.search import THRESHOLD, Suspect

SCHEMA = "furuta-diagnosis/1"
SHARPNESS = 100.0  # s/rad; what model (5) is taken to have, so that another r is itself a finding
CONSTANT = 1e-3  # level of the test that parameters are the same all along a log
_LEAST_SHARE = 0.3  # of θ4 in θ2; a uniform rod has 0.75
ABSORBED = {
    "back_emf": "adds to θ6",
    "amplifier_gain": "scales every θ",
    "arm_encoder_offset": "changes nothing in model (5)",
}
"""What no log can tell from the parameters of model (5), and what becomes of it: never named, always reported."""

_ABSORBED = 0.995  # share of an effect's answer that θ imitates, from which it cannot be seen in principle


@dataclass(frozen=True)
class Diagnosis:
    """verdict: named, ambiguous, none, unknown or insufficient_excitation; `summary` says it in a sentence.

    before, after: estimates without and with the effects found (after is before where none was). left_over: rms of the
    torque [{u}] that the final model does not explain, over a tenth of a second, and `command_rms` to compare it with.
    carried: False once data that no fit saw have shown no gain from the effects; `plant` is then without them.
    still_off: error over the noise floor that the effects leave on such data, where that is much; 1 otherwise.
    """

    verdict: str
    summary: str
    before: Estimate | None = field(repr=False)
    after: Estimate | None = field(repr=False)
    naming: Naming | None = field(repr=False)
    rest: Where | None = field(repr=False)
    left_over: float
    command_rms: float
    runtime_s: float
    carried: bool = True
    still_off: float = 1.0

    @property
    def leftover(self) -> bool:
        """Whether the final model leaves structure that no effect found explains."""
        refused = self.naming is not None and self.naming.refused is not None
        return refused or self.still_off > 1.0 or (self.rest is not None and structured(self.rest))

    @property
    def plant(self) -> Plant | None:
        best = self.after if self.carried else self.before
        return best.plant if best else None

    @property
    def timed(self) -> bool:
        """Whether an effect found follows the clock of its log, and so cannot be looked for in another."""
        return bool(self._timed)

    @property
    def repeating(self) -> bool:
        """Whether every such effect repeats, so that a later part of the same log can speak about it."""
        return self.timed and all(any(p.grid == "frequencies" for p in effect.parameters) for effect in self._timed)

    @property
    def _timed(self) -> list[EffectType]:
        found = [EFFECTS[suspect.name] for suspect in self.found]
        return [effect for effect in found if any("t" in a for a in effect.arguments.values())]

    @property
    def found(self) -> tuple[Suspect, ...]:
        return self.naming.accepted if self.naming else ()

    def vetoed(self) -> Diagnosis:
        """The same once held-out data have shown no gain from the effects: what is missing is something else."""
        names = " and ".join(suspect.name for suspect in self.found)
        one = len(self.found) == 1
        brings, is_not = ("brings", "it is not the name") if one else ("bring", "they are not the names")
        summary = f"{names} would explain these logs, but {brings} nothing on data that no fit saw: {is_not}"
        return replace(self, verdict="unknown", summary=summary, carried=False)

    def falling_short(self, ratio: float) -> Diagnosis:
        """The same once data that no fit saw are still predicted with `ratio` times the error that noise leaves."""
        summary = f"{self.summary}; data that no fit saw are still {ratio:.1f} times as far off as noise alone would be"
        return replace(self, summary=summary, still_off=ratio)

    def to_dict(self) -> dict[str, Any]:
        """As diagnosis.json has it, except what only held-out logs can tell (the gap)."""
        naming = self.naming
        effects = [self._effect(i, suspect) for i, suspect in enumerate(naming.accepted)] if naming else []
        first = naming.rankings[0] if naming and naming.rankings else ()
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "summary": self.summary,
            "effects": effects,
            "ranking": [{"name": s.name, "log_likelihood_gain": s.gain, "score": s.score} for s in first],
            "not_visible": sorted(n for n, share in naming.absorbed.items() if share > _ABSORBED) if naming else [],
            "absorbed": dict(ABSORBED),
            "leftover": self.leftover,
            "rest": self.rest.to_dict() if self.rest else None,
            "left_over_torque": self.left_over,
            "command_rms": self.command_rms,
            "runtime_s": self.runtime_s,
        }

    def _effect(self, i: int, suspect: Suspect) -> dict[str, Any]:
        assert self.naming is not None
        assert self.after is not None
        found = self.after.plant.effect(suspect.name)
        assert found is not None
        return found.to_dict(self.after.plant.unit) | {
            "equation": EFFECTS[suspect.name].equation,
            "place": EFFECTS[suspect.name].place,
            "log_likelihood_gain": suspect.gain,
            "confused_with": list(self.naming.equals[i]),
        }

    def __str__(self) -> str:
        lines = [f"{self.verdict.upper()}: {self.summary}"]
        if self.naming:
            for step, ranking in enumerate(self.naming.rankings, 1):
                shown = ", ".join(f"{s.name} {s.net:+.0f}" for s in ranking[:4])
                lines.append(f"  step {step}, nats gained net of the price: {shown or 'no suspect'}")
            for suspect, equals in zip(self.naming.accepted, self.naming.equals, strict=True):
                found = self.after.plant.effect(suspect.name) if self.after else None
                lines.append(f"  + {found}   [{EFFECTS[suspect.name].equation}]")
                lines.append(f"    on the rig: {EFFECTS[suspect.name].symptom}")
                if equals:
                    lines.append(f"    cannot be told on these logs from: {', '.join(equals)}")
        if self.leftover and self.rest:
            lines.append(f"  left over: {self.rest.sentence}")
            if self.found:
                lines.append("  the standard deviations above hold where nothing is left: here they are too small")
        lines.append(
            f"  torque that passes for noise: {self.left_over:.2g} against a command of {self.command_rms:.2g} rms"
        )
        taken = "; ".join(f"{name.replace('_', ' ')} ({how})" for name, how in ABSORBED.items())
        lines.append(f"  no log can tell from θ: {taken}")
        return "\n".join(lines)


def diagnose(
    logs: Sequence[Log],
    start: Plant | str | None = None,
    most: int = 3,
    only: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Search the library for what model (5) misses in these logs of one rig.

    start: a plant to start from, without its effects (default: the logs alone). most: effects at most. only: restrict
    the library. progress is told each step. Raises ValueError for bad arguments.
    """
    began = time.monotonic()
    tell = progress or (lambda text: None)
    if strange := set(only or ()) - set(EFFECTS):
        raise ValueError(f"unknown effects {sorted(strange)}; the library has: {', '.join(EFFECTS)}")
    if most < 1:
        raise ValueError(f"most must be at least 1, got {most}")
    if start is not None:  # effects are for the search to find, and to be judged
        start = Plant.resolve(start).replace(effects=())
    rms = float(np.sqrt(np.mean(np.concatenate([log.u for log in logs]) ** 2)))
    tell("identifying model (5)")
    try:
        before = identify(logs, start)
    except NotIdentifiable as error:
        text = f"{error} — nothing can be said about missing effects"
        return Diagnosis(
            "insufficient_excitation", text, None, None, None, None, math.nan, rms, time.monotonic() - began
        )
    long_enough(logs)  # or nothing could be said after the search
    anchor = _anchor(before.plant)
    records = [stretch.record for stretch in stretches(logs)]
    nominal = fit(anchor, START_NOISE, records, anchor=anchor)
    naming, after, rest = _searched(nominal, anchor, before, logs, most, only, tell)
    verdict, summary = _verdict(naming, rest)
    if verdict == "unknown":
        tell("searching again from more starts, before nothing is said to explain these logs")
        again = _searched(nominal, anchor, before, logs, most, only, tell, thorough=True)
        if again[0].final.value < naming.final.value - THRESHOLD:
            naming, after, rest = again
            verdict, summary = _verdict(naming, rest)
    if any(suspect.name == "friction_sharpness" for suspect in naming.accepted):
        # before it was found, r was what model (5) has; the first estimate had it free already
        before = identify(logs, naming.nominal.plant, noise=naming.nominal.noise, sharpness=SHARPNESS)
    left = math.sqrt(naming.final.noise.torque[0] / 0.1)
    return Diagnosis(verdict, summary, before, after, naming, rest, left, rms, time.monotonic() - began)


def _searched(
    nominal: Fit,
    anchor: Plant,
    before: Estimate,
    logs: Sequence[Log],
    most: int,
    only: Sequence[str] | None,
    tell: Callable[[str], None],
    thorough: bool = False,
) -> tuple[Naming, Estimate, Where]:
    """The search for names, the estimate with what was found, and what that leaves."""
    naming = name_effects(nominal, anchor, most, only, tell, lambda plant: locate(plant, logs).evidence, thorough)
    after = before
    if naming.accepted:
        tell("estimating all parameters together")
        after = identify(logs, naming.final.plant, noise=naming.final.noise)
    tell("looking at what is left")
    rest = locate(after.plant, logs)
    return unsettled(naming, rest), after, rest


def _anchor(plant: Plant) -> Plant:
    """The identified plant as a start: friction and θ2 off their bounds, r as model (5) has it. A missing effect may
    have driven θ2 to nothing, from where no descent on its logarithm comes back; no pendulum has so little of θ4."""
    theta = plant.theta.copy()
    theta[1] = max(theta[1], _LEAST_SHARE * theta[3])
    floor = [0.02 * theta[0], 0.02 * theta[3], 0.005 * plant.u_max, 5e-4 * abs(theta[4])]
    theta[5:] = np.maximum(theta[5:], floor)
    return plant.replace(
        theta=theta, friction_sharpness=SHARPNESS, covariance=None, checks={}, provenance={}, effects=()
    )


def structured(rest: Where) -> bool:
    """Whether what a plant leaves of its logs is more than noise: torques that go with the motion, the command or
    time, or parameters that are not the same all along."""
    return rest.found or rest.constancy.joint_p < CONSTANT


def _verdict(naming: Naming, rest: Where) -> tuple[str, str]:
    """The verdict and its sentence."""
    explained = sum(suspect.net for suspect in naming.accepted)
    names = " and ".join(suspect.name for suspect in naming.accepted)
    remains = ""
    if rest.found:
        remains = f"what remains {_against(rest)}, which no effect of the library explains"
    elif structured(rest):
        remains = "what remains changes along the log: the parameters are not the same all the time"
    elif naming.refused is not None:
        remains = (
            f"{naming.refused.name} would take up a little more ({naming.refused.gain:.0f} nats), too little to be "
            "told from another form of what was found"
        )
    if not naming.accepted:
        if remains:
            return "unknown", remains
        return "none", "no effect of the library improves on model (5) by more than chance would"
    if rest.evidence > explained:
        return "unknown", f"{remains}; {names} comes nearest, but explains less than it leaves"
    equals = any(naming.equals)
    sentence = f"the model misses {names}" + (" or a look-alike that these logs cannot tell from it" if equals else "")
    return "ambiguous" if equals else "named", sentence + (f"; {remains}" if remains else "")


def _against(rest: Where) -> str:
    place = {"arm": "on the arm", "pendulum": "on the pendulum", "input": "at the command", "sensor": "in a reading"}
    return f"{place.get(rest.channel or '', 'somewhere')} goes with {rest.variable} ({rest.evidence:.0f} nats)"
