"""What a diagnosis says, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

from furuta_gym.plant import EFFECTS
from furuta_gym.plant.effects.words import number

from ..discrepancy.dependence import Channel, Variable
from ..validation.gap import HORIZON
from ..validation.one_rig import OneByOne
from .locate.location import Where
from .naming.found import Naming

_PLACES: dict[Channel | None, str] = {
    Channel.ARM: "a torque on the arm",
    Channel.PENDULUM: "a torque on the pendulum",
    Channel.INPUT: "a torque that comes with the command",
    Channel.SENSOR: "an error of a reading",
}
ENDED_EARLY = "The time that was given ended the search, so more effects may be missing."
UNCHANGING = "The parameters are not the same all along the logs: structure remains that changes with time."


def effects(names: Sequence[str]) -> str:
    """Effects in words with their identifiers."""
    return " and ".join(_told(name) for name in names)


def _told(name: str, alike: Sequence[str] = ()) -> str:
    """An effect in words with its identifier, and what would predict the same in its place."""
    same = f"; {' or '.join(alike)} would predict the same" if alike else ""
    return f"{EFFECTS[name].title} ({name}{same})"


def misses(naming: Naming) -> str:
    """What the model misses, of which effects the law is another, and what was taken back."""
    named = " and ".join(_told(effect.name, effect.same) for effect in naming.own)
    ambiguous = any(effect.apart for effect in naming.own)
    either = ", or one of its equals, which explain these logs as well" if ambiguous else ""
    text = f"The model misses {named}{either}."
    for name in naming.names:
        if (of := naming.follows(name)) is not None:
            text += (
                f" The pendulum hung at rest when its counter was set. So from {of} follows {_told(name)}, "
                "and it is part of the plant for that."
            )
        elif (of := naming.describes(name)) is not None:
            text += (
                f" The law of {of} is not quite the library's: {_told(name)} describes the difference, "
                "and is part of the plant for that. Whether it acts on its own, these logs do not show."
            )
    if naming.taken_back:
        back = capital(effects([suspect.name for suspect in naming.taken_back]))
        text += f" {back} would explain more of these logs, but predictions of held-out data do not improve with it."
    for suspect in naming.perhaps_absent:
        what = capital(_told(suspect.name))
        text += f" {what} would make these logs likelier, but its size may as well be zero. So it is no name."
    return text


def nothing(rest: Where) -> str:
    """That no effect is missing, and how little is left."""
    text = "No effect of the library improves on model (5) by more than chance would."
    if rest.found:
        text += f" What is left changes a prediction by {rest.counts.max():.2g} counts, which is negligible."
    return text


def only_sharpness(ratio: float) -> str:
    """That friction is softer or sharper than the paper has it, which shows in no prediction."""
    return (
        "No effect of the library is needed. Friction sets in at another sharpness than the paper's, which shows in no "
        f"prediction: without it the error on held-out data is {ratio:.2f} times the noise floor. r is "
        "fitted like the other parameters."
    )


def usual_sharpness(r: float, paper: float, ratio: float | None) -> str:
    """That friction is softer or sharper than the paper has it, and model (5) with r fitted is enough. ratio: of the
    error on held-out data to the noise floor, None where that is said elsewhere."""
    error = "" if ratio is None else f" With it the error on held-out data is {ratio:.2f} times the noise floor."
    return (
        f"No effect of the library is needed. Friction sets in at r = {number(r)} s/rad; the paper has {paper:g}, "
        f"and r is fitted like the other parameters.{error}"
    )


def of_no_size(names: Sequence[str], ratio: float) -> str:
    """That what was found may as well be zero, and the error is at the noise floor without it."""
    size, without = ("its size", "it") if len(names) == 1 else ("their sizes", "them")
    return (
        f"No effect of the library is needed. The searched logs are likelier with {' and '.join(names)}, but {size} "
        f"may as well be zero. Without {without} the error on held-out data is {ratio:.2f} times the noise floor."
    )


def left(rest: Where) -> str:
    """A torque or reading error that remains, with its size."""
    what = capital(_PLACES.get(rest.channel, "something"))
    counts = f"{rest.counts.max():.2g}"
    how = "is constant" if rest.variable is Variable.CONSTANT else f"depends on {rest.variable}"
    return (
        f"{what} remains. It {how}, and no effect of the library explains it. It changes a "
        f"prediction {HORIZON:g} s ahead by {counts} count{'' if counts == '1' else 's'} ({rest.evidence:.0f} nats)."
    )


def zero(counts: float) -> str:
    """That the pendulum's zero in the first log is off by some counts."""
    return (
        f"The pendulum's zero in the first log is off by {abs(counts):.1f} counts; a small constant torque on the "
        "pendulum would look the same."
    )


def refused(name: str, gain: float) -> str:
    """That some structure remains, which another effect takes up a little of."""
    return (
        f"Some structure remains: {effects([name])} explains a little more ({gain:.0f} nats). That is too little to "
        "separate it from another law of what was found."
    )


def nearest(names: Sequence[str]) -> str:
    """What comes nearest where more is left than explained."""
    comes, explains, leaves = (
        ("comes", "explains", "it leaves") if len(names) == 1 else ("come", "explain", "they leave")
    )
    return f"{capital(effects(names))} {comes} nearest, but {explains} less than {leaves}."


def vetoed(names: Sequence[str]) -> str:
    """That held-out data show no gain."""
    explains, it = ("explains", "It") if len(names) == 1 else ("explain", "They")
    return (
        f"{capital(effects(names))} {explains} the fitted logs, but predictions of held-out data do not improve. No "
        f"name is given. {it} may follow another law than the library's, or imitate something else. Check that all "
        "logs are of one rig, with nothing changed in between."
    )


def still_off(ratio: float) -> str:
    """How far off held-out data are predicted with everything found."""
    return f"The error on held-out data is still {ratio:.1f} times the noise floor."


def astray(ratio: float, together: float | None, far: float) -> str:
    """How far off held-out data are predicted, and with the parameters fitted to them as well."""
    told = f"The error on held-out data is {ratio:.1f} times the noise floor"
    if together is None:
        return f"{told}, though nothing stands out of the noise on the searched logs."
    if together > far:
        return (
            f"{told}, and {together:.1f} times with the parameters fitted to all logs together: something is missing "
            "that shows there. Diagnose all logs together."
        )
    return (
        f"{told}, and {together:.1f} times with the parameters fitted to all logs together: the searched logs alone "
        "say too little about them."
    )


def different_plants(found: OneByOne, adequate: float) -> str:
    """That no plant explains all logs to `adequate` times the noise floor, or only one with an effect that plants of
    their own need not have."""
    ratios = ", ".join(f"{ratio:.2f} ({name})" for name, ratio in zip(found.sources, found.ratios, strict=True))
    differ = f" {capital(found.what_differs)}." if found.what_differs else ""
    effects = ", with the same effects" if found.estimates and found.estimates[0].plant.effects else ""
    common = (
        "No plant explains all logs, but each is explained by one of its own"
        if found.together > adequate
        else "One plant with an effect explains all logs, but a plant of its own for each is likelier"
    )
    return (
        f"{common}{effects}: the errors are {ratios} times the noise floor. So the rig changed between them, they are "
        f"of different rigs, or the model lacks what other parameters imitate in each.{differ} All else here is of "
        f"{found.sources[0]} alone: diagnose "
        "the others by themselves."
    )


def another_clock(names: Sequence[str], before: float, after: float) -> str:
    """That held-out data are predicted worse with what follows the clock of the searched logs."""
    follows, it = ("follows", "it") if len(names) == 1 else ("follow", "them")
    return (
        f"Held-out data are predicted worse with what was found: {after:.1f} times the noise floor, {before:.1f} "
        f"before. {capital(effects(names))} {follows} the clock of the searched logs, so other logs may lack {it}."
    )


def elsewhere(angles: tuple[float, float]) -> str:
    """That the arm leaves the angles of the searched logs on held-out ones."""
    low, high = angles
    return (
        f"On the held-out logs the arm leaves the angles of the searched ones ({low:.2g} to {high:.2g} rad). What "
        "depends on its angle is an extrapolation there. Diagnose all logs together."
    )


def unexplained(torque: float, command: float, unit: str) -> str:
    """The rms torque that the plant takes for noise, beside the command."""
    share = f" ({100 * torque / command:.2g} % of the command)" if command > 0 else ""
    return f"unexplained torque: {torque:.2g} {unit} rms{share}"


def capital(text: str) -> str:
    """With a capital letter."""
    return text[:1].upper() + text[1:]
