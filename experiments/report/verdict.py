"""The first screen of a diagnosis: one verdict in physical words, which no later section contradicts."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import EFFECTS, Effect
from identification.diagnosis.gap_change import GapChange
from identification.diagnosis.locate.location import Where
from identification.diagnosis.outcome import Diagnosis, SecondWitness
from identification.diagnosis.sentences import ENDED_EARLY, different_plants
from identification.discrepancy.dependence import Channel, Variable
from identification.validation.gap import printed_fits

from .contents import Fact, Verdict
from .words import BADGE, joined

_PLACES: dict[Channel | None, str] = {
    Channel.ARM: "a torque on the arm",
    Channel.PENDULUM: "a torque on the pendulum",
    Channel.INPUT: "something between the command and the motor",
    Channel.SENSOR: "an error of a reading",
    Channel.PARAMETERS: "a change of the parameters",
}
_AGAINST: dict[Variable | None, str] = {
    Variable.CONSTANT: "is constant",
    Variable.FREQUENCY: "repeats in time",
    Variable.COMMAND: "depends on the command",
    Variable.COMMAND_CHANGE: "follows the changes of the command",
    Variable.MEMORY: "depends on the motion before",
    Variable.FRICTION_IN_TIME: "is friction that changes in time",
    Variable.GAIN_IN_TIME: "is a gain of the command that changes in time",
    Variable.MASSES_IN_TIME: "is a mass that changes in time",
    Variable.ARM_ZERO_IN_TIME: "is a zero of the arm that moves",
    Variable.PENDULUM_ZERO_IN_TIME: "is a zero of the pendulum that moves",
}


def verdict(diagnosis: Diagnosis, next_step: str) -> Verdict:
    """The verdict of a diagnosis as the page shows it first."""
    d = diagnosis
    label = BADGE[d.verdict]
    if d.different is not None:
        label += "; other logs need other parameters"
    elif d.verdict in ("named", "ambiguous") and d.leftover:
        label += "; unexplained structure"
    headline = " ".join(part for part in (_found(d), _improvement(d)) if part)
    if d.uncertain:
        label += "; parameters uncertain"
    gap = judged_on(d)
    far = gap is not None and gap.after_over_floor > d.policy.far
    good = d.verdict in ("named", "none") and not d.leftover and not far and not d.ended_early
    return Verdict(label, good, headline, tuple(_doubts(d)), tuple(_facts(d)), next_step)


def sentences(diagnosis: Diagnosis) -> list[str]:
    """What each named effect does to the rig, with its size."""
    after, named = diagnosis.after, {s.name for s in diagnosis.named}
    if after is None:
        return []
    return [f"{e.sentence(after.plant.unit)}." for e in effects(diagnosis) if e.name in named]


def effects(diagnosis: Diagnosis) -> list[Effect]:
    """The effects found, as the plant has them."""
    plant = diagnosis.after.plant if diagnosis.after else None
    return [e for s in diagnosis.found if plant is not None and (e := plant.effect(s.name)) is not None]


def equals(diagnosis: Diagnosis) -> list[str]:
    """Names of what these logs cannot tell from the effects found."""
    return list(dict.fromkeys(name for effect in diagnosis.found for name in effect.equals))


def judged_on(diagnosis: Diagnosis) -> GapChange | None:
    """The gap that judged the effects: on the logs' own last part where an effect follows the clock of its log."""
    gap = diagnosis.gap
    return gap.own_tail if gap is not None and gap.tail is None and diagnosis.timed else gap


def data(gap: GapChange) -> str:
    """What the data are called that no fit saw."""
    return "held-out data" if gap.tail is None else f"the last {100 * gap.tail:.0f} % of the logs, held out of the fit,"


def place(where: Where) -> str:
    """What the model misses and what it depends on, in words."""
    what = _PLACES.get(where.channel, "something")
    return f"{what} that {_AGAINST.get(where.variable, f'depends on the {where.variable}')}"


def times(ratio: float) -> str:
    """An error over the noise floor, as it is printed everywhere."""
    return f"{ratio:.1f}" if ratio < 100 else f"{ratio:.0f}"


def fit(percent: NDArray[np.float64]) -> str:
    """The fit of both angles."""
    return " and ".join(printed_fits(percent)).replace("-", "−") + "\u00a0%"


def _found(d: Diagnosis) -> str:
    if d.verdict in ("named", "ambiguous"):
        return " ".join(sentences(d))
    if d.verdict == "none":
        return "Nothing is missing from the model that these logs can show."
    if d.verdict == "insufficient_excitation":
        return "These logs move the rig too little to determine the model, so nothing can be said of missing effects."
    start = "Something is missing from the model, and the library has no name for it"
    if d.found or d.rest is None or not d.rest.matters:
        return f"{start}."
    return f"{start}: {place(d.rest)}."


def _improvement(d: Diagnosis) -> str:
    """What adding the effects does to the error on data that no fit saw."""
    gap, titles = judged_on(d), joined([EFFECTS[s.name].title for s in d.named], "and")
    one = len(d.named) == 1
    it = "it" if one else "them"
    if gap is None and d.found and d.gap is not None:
        before, after = times(d.gap.over_floor(d.gap.before)), times(d.gap.after_over_floor)
        return (
            f"Another log cannot judge what follows the clock of its own. The error on {data(d.gap)} is {before} times "
            f"the noise floor without {it} and {after} times with {it}."
        )
    if gap is None:
        return "It could not be tested on held-out data." if d.found else ""
    before, after = times(gap.over_floor(gap.before)), times(gap.after_over_floor)
    if not gap.changed:
        return f"The error on {data(gap)} is {after} times the noise floor."
    if d.verdict == "unknown" and not d.confirmed:
        explain = f"{titles[:1].upper()}{titles[1:]} would explain the fitted logs"
        ratios = f"{before} times the noise floor without {it}, {after} with {it}"
        return f"{explain}, but the error on {data(gap)} does not improve ({ratios})."
    nearest = f"Nearest {'comes' if one else 'come'} {titles}"
    if not gap.closed.interval[0] > 0:  # NaN where the error was at the floor before
        start = f"{nearest}. " if d.verdict == "unknown" else ""
        return (
            f"{start}The error on {data(gap)} is {before} times the noise floor without {it} and {after} times with "
            f"{it}. The gain shows only one sample ahead ({gap.likelier:+.0f} nats)."
        )
    fall = f"the error on {data(gap)} falls from {before} to {after} times the noise floor"
    if d.verdict == "unknown":
        return f"{nearest}: with {it}, {fall}, but more is left than {it} explain{'s' if one else ''}."
    return f"After adding {it}, {fall}."


def _doubts(d: Diagnosis) -> list[str]:
    doubts = []
    if d.verdict == "insufficient_excitation":
        doubts.append(f"{d.summary[:1].upper()}{d.summary[1:]}")
    if alike := equals(d) if d.verdict == "ambiguous" else []:
        others = joined([EFFECTS[name].title for name in alike], "or")
        doubts.append(f"These logs cannot tell this from {others}.")
    if d.different is not None:
        doubts.append(different_plants(d.different, d.policy.adequate).replace("theta", "θ"))
    doubts += [f"{str(change)[:1].upper()}{str(change)[1:]}." for change in d.gain_changes]
    if d.together is not None:
        fitted = f"With the parameters fitted to all logs together it is {times(d.together)} times"
        too_little = "the searched logs alone say too little about the parameters"
        why = too_little if d.uncertain else "what is missing shows there"
        doubts.append(f"{fitted}: {why}.")
    if d.second is not None and (said := _of_second(d.second)):
        doubts.append(said)
    if d.ended_early:
        doubts.append(ENDED_EARLY)
    remains = []
    if d.verdict in ("named", "ambiguous"):
        if d.rest is not None and d.rest.matters:
            remains.append(f"on the searched logs there is still {place(d.rest)}")
        elif d.rest is not None and d.rest.structured:
            remains.append("the parameters are not the same all along the searched logs")
        elif d.naming is not None and d.naming.refused is not None:
            remains.append(f"{EFFECTS[d.naming.refused.name].title} would explain a little more, too little to be sure")
        if d.still_off > 1.0:
            remains.append(f"the error on held-out data is still {times(d.still_off)} times the noise floor")
    if remains:
        doubts.append(
            f"Unexplained structure remains: {'; '.join(remains)}. The error bars allow for it as far as the logs show "
            "it, and may be too small."
        )
    return doubts


def _of_second(second: SecondWitness) -> str:
    about = ", ".join(name.replace("theta", "θ") for name in second.disagreeing)
    said = f"A second fit, by multiple shooting, disagrees about {about}" if about else ""
    if second.better:
        said = f"{said}. It" if said else "A second fit, by multiple shooting,"
        return (
            f"{said} predicts held-out data better for certain, so its plant is the one that was written. "
            "The numbers here are those of the first fit."
        )
    return f"{said}: the first may have taken a missing torque for noise." if said else ""


def _facts(d: Diagnosis) -> list[Fact]:
    gap = judged_on(d)
    if gap is None:
        return [Fact("Error on held-out data", "not known", d.gap_remark)] if d.gap_remark else []
    before, after = (times(gap.over_floor(g)) for g in (gap.before, gap.after))
    ahead = f"{gap.before.horizon:g} s ahead"
    where = "held-out data" if gap.tail is None else f"last {100 * gap.tail:.0f} %"
    fits = [fit(g.fit_percent) for _, g in gap.sides]
    right = f"of q1 and q2; a right plant: {fit(gap.before.fit_at(gap.floor))}"
    facts = [
        Fact(
            f"Error on {where}",
            " → ".join([before, after][-len(gap.sides) :]) + " × noise floor",
            f"{ahead}; 1 is perfect",
        ),
        Fact(f"Fit {ahead}", fits[-1], right + (f"; before: {fits[0]}" if gap.changed else "")),
    ]
    if gap.changed and math.isfinite(gap.closed.value):
        facts.insert(1, Fact("Closed share", f"{100 * gap.closed.value:.1f} %", gap.closed.spoken))
    if d.after is not None and math.isfinite(d.left_over):
        share = 100 * d.left_over / d.command_rms if d.command_rms > 0 else math.nan
        meaning = f"rms; {share:.1f} % of the command" if math.isfinite(share) else "rms"
        facts.append(Fact("Unexplained torque", f"{d.left_over:.2g} {d.after.plant.unit}", meaning))
    return facts
