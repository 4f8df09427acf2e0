"""The grammar of ranged randomisation, one for Python, the command line and the plant file.

NAME=RANGE NAME=RANGE …

RANGE   uniform:LOW,HIGH | loguniform:LOW,HIGH | normal:MEAN,STD | NUMBER,  or chance:P:RANGE: in the other episodes the
        size of an effect is neutral, and anything else has its own value
NAME    an effect with one parameter beside those that have a usual value (input_delay, arm_backlash),
        EFFECT.PARAMETER (arm_spring.k), or one of `RIG`
        EFFECT=chance:P lets an effect act with probability P, at a size of its own or as its ranges draw it
        EFFECT.PARAMETER of a whole number, as arm_ripple.n, draws whole numbers
        theta=posterior draws θ from the plant's covariance; theta=physical:S draws masses, lengths, inertias,
        frictions and gain within ± S of themselves, so that every rig drawn could be built
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..arguments import ArgumentError
from ..plant.effects import EFFECTS, Effect, where_to_look
from ..plant.effects.effect import as_written
from ..plant.plant import Plant

UNIFORM, NORMAL, LOG_UNIFORM, PHYSICAL = range(4)
_KINDS = {"uniform": UNIFORM, "normal": NORMAL, "loguniform": LOG_UNIFORM}
_FORMS = "uniform:LOW,HIGH, loguniform:LOW,HIGH, normal:MEAN,STD, a number, or one of these after chance:P:"
_WIDEST_SHARE = 0.5  # of theta=physical:S; beyond it a rig is another rig


class Entry(NamedTuple):
    """What may be drawn beside the plant: number of values, bounds, unit, meaning."""

    values: int
    low: float
    high: float
    unit: str
    meaning: str


# In the order of the rows NOISE1 … of `kernels`.
RIG: dict[str, Entry] = {
    "noise_std": Entry(2, 0.0, 0.5, "rad", "white noise of the two angles"),
    "encoder_offset": Entry(2, -math.pi, math.pi, "rad", "what the two encoders read at zero"),
    "u_max": Entry(1, 1e-6, 1e6, "command", "largest command, up to the plant's supply; the action's scale stays"),
    "jitter": Entry(1, 0.0, 0.3, "share of the sample time", "spread of the sample time"),
    "push": Entry(
        1,
        0.0,
        100.0,
        "rad/s",
        "change of q̇2 by a tap on the pendulum during the episode; q̇1 changes as θ of the start has it",
    ),
    "push_rate": Entry(1, 0.0, 10.0, "1/s", "mean number of taps a second (0.5 unless given)"),
}


@dataclass(frozen=True)
class Range:
    """A distribution: kind with its two numbers, the probability that it is drawn from at all, and if it is rounded."""

    kind: int
    a: float
    b: float
    chance: float = 1.0
    whole: bool = False

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value; a normal one ends at four standard deviations."""
        return (self.a - 4 * self.b, self.a + 4 * self.b) if self.kind == NORMAL else (self.a, self.b)


@dataclass(frozen=True)
class Draws:
    """What `randomize` asks for.

    posterior: θ, r and carried effects from the covariance. physical: share of theta=physical, 0 for none. ranges:
    of rig entries and of "effect.parameter". chances: of effects to act in an episode; {} for those that always do.
    """

    posterior: bool
    physical: float
    ranges: Mapping[str, Range]
    chances: Mapping[str, float]

    @property
    def names(self) -> set[str]:
        """Names of everything that is drawn: effects, entries of the rig, and "theta"."""
        found = {name.partition(".")[0] for name in self.ranges} | set(self.chances)
        found -= {name for name, p in self.chances.items() if p == 0}
        return found | ({"theta"} if self.posterior or self.physical else set())


def as_mapping(given: Any) -> dict[str, str]:
    """`randomize` as {name: range}: from "a=… b=…", from a list of such words, or from a mapping. Raises ValueError."""
    if isinstance(given, Mapping):
        return {str(name): str(value) for name, value in given.items()}
    words = given.split() if isinstance(given, str) else given
    if not isinstance(words, Iterable):
        raise ValueError(f'randomize must be True, False, "NAME=RANGE …" or a mapping, got {given!r}')
    found: dict[str, str] = {}
    for word in words:
        name, equals, value = str(word).partition("=")
        if not (name and equals and value):
            raise ArgumentError("randomize", str(word), "expected NAME=RANGE such as input_delay=uniform:0,0.03")
        if name in found:
            raise ArgumentError("randomize", str(word), f"{name} is given twice; give one range for each")
        found[name] = value
    return found


def draws(given: Any, plant: Plant) -> Draws:
    """What to draw on `plant`. True means what the plant file's "randomize" says, else the covariance.

    Raises ArgumentError on unknown names and impossible ranges.
    """
    if isinstance(given, bool | np.bool_) and given and plant.randomize:
        try:
            return draws(plant.randomize, plant)
        except ArgumentError as error:
            raise error.renamed('"randomize" of the plant file,') from None
    if isinstance(given, bool | np.bool_):
        return Draws(bool(given), 0.0, {}, {})
    posterior, physical = False, 0.0
    ranges: dict[str, Range] = {}
    chances: dict[str, float] = {}
    for name, text in as_mapping(given).items():
        if name == "theta":
            posterior, physical = _theta(text)
        elif name in RIG:
            ranges[name] = _inside(name, text, RIG[name].low, RIG[name].high, RIG[name].unit)
        else:
            _effect(name, text, ranges, chances)
    if "push_rate" in ranges and "push" not in ranges:
        raise ArgumentError("randomize", "push_rate", "it says how often; give push=RANGE [rad/s] too")
    return Draws(posterior, physical, ranges, chances)


def _effect(name: str, text: str, ranges: dict[str, Range], chances: dict[str, float]) -> None:
    effect, dot, wanted = name.partition(".")
    if effect not in EFFECTS:
        fault = f"nothing is called {name}; expected theta, {', '.join(RIG)}, an effect, or EFFECT.PARAMETER"
        raise ArgumentError("randomize", f"{name}={text}", fault + where_to_look([effect], ["theta", *RIG, *EFFECTS]))
    parameters = {p.name: p for p in EFFECTS[effect].parameters}
    head, _, rest = text.partition(":")
    if head == "chance" and ":" not in rest and not dot:
        chances[effect] = _number(name, text, rest)
        if not 0.0 <= chances[effect] <= 1.0:
            raise _wrong(name, text, "a chance must lie in [0, 1]")
        return
    asked = [p.name for p in EFFECTS[effect].parameters if not (p.optional or p.spread)]  # the others have a default
    if not dot and len(asked) > 1:
        ways = ", ".join(f"{effect}.{p}" for p in parameters)
        raise _wrong(name, text, f"{effect} has several parameters; give {ways}, or {effect}=chance:P")
    wanted = as_written(wanted or asked[0])
    if wanted not in parameters:
        raise _wrong(name, text, f"{effect} has no parameter {wanted!r}; it has {', '.join(parameters)}")
    p = parameters[wanted]
    made = _inside(name, text, p.lower, p.upper, p.unit)
    if p.integer and made.kind != NORMAL and not (made.a.is_integer() and made.b.is_integer()):
        raise _wrong(name, text, f"{wanted} of {effect} is a whole number; give whole LOW and HIGH")
    ranges[f"{effect}.{wanted}"] = replace(made, whole=p.integer)


def _theta(text: str) -> tuple[bool, float]:
    if text == "posterior":
        return True, 0.0
    head, _, rest = text.partition(":")
    share = _number("theta", text, rest) if head == "physical" else math.nan
    if not 0.0 < share <= _WIDEST_SHARE:
        raise _wrong("theta", text, f"expected posterior, or physical:S with S in (0, {_WIDEST_SHARE:g}]")
    return False, share


def _range(name: str, text: str) -> Range:
    head, colon, rest = text.partition(":")
    if head == "chance" and colon:
        share, _, inner = rest.partition(":")
        p = _number(name, text, share)
        if not 0.0 <= p <= 1.0:
            raise _wrong(name, text, "a chance must lie in [0, 1]")
        made = _range(name, inner)
        return Range(made.kind, made.a, made.b, p * made.chance)
    if not colon:
        value = _number(name, text, text)
        return Range(UNIFORM, value, value)
    parts = rest.split(",")
    if head not in _KINDS or len(parts) != 2:
        raise _wrong(name, text, f"expected {_FORMS}")
    a, b = (_number(name, text, part) for part in parts)
    kind = _KINDS[head]
    if (kind == NORMAL and b < 0) or (kind != NORMAL and b < a) or (kind == LOG_UNIFORM and a <= 0):
        raise _wrong(name, text, "expected LOW ≤ HIGH, 0 < LOW for loguniform, 0 ≤ STD for normal")
    return Range(kind, a, b)


def _number(name: str, text: str, part: str) -> float:
    try:
        value = float(part)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise _wrong(name, text, f"expected {_FORMS}")
    return value


def _wrong(name: str, text: str, fault: str) -> ArgumentError:
    return ArgumentError("randomize", f"{name}={text}", fault)


def _inside(name: str, text: str, low: float, high: float, unit: str) -> Range:
    """A normal range is drawn anew outside its bounds; any other must lie inside."""
    made = _range(name, text)
    least, most = (made.a, made.a) if made.kind == NORMAL else made.bounds
    if not low <= least <= most <= high:
        raise _wrong(name, text, f"its values must lie in [{low:g}, {high:g}] {unit}")
    return made


def never_drawn(wanted: Draws, plant: Plant, probabilities: Mapping[str, float]) -> list[str]:
    """Effects and entries of the rig that no episode has: neither carried by the plant nor drawn."""
    had = wanted.names | {e.name for e in plant.effects} | {n for n, p in probabilities.items() if p > 0}
    return [name for name in (*EFFECTS, "theta", *RIG) if name not in had and name != "push_rate"]


def within_an_episode(wanted: Draws, plant: Plant, episode: float) -> Draws:
    """The draws with the time of a change, as `payload_step` has one, drawn over an episode [s].

    Only where the plant does not carry the effect and nothing says when: its usual time may be after the end."""
    carried = {effect.name for effect in plant.effects}
    added = {
        f"{name}.{p.name}": Range(UNIFORM, p.lower, max(p.lower, episode))
        for name in EFFECTS
        if name in wanted.names - carried
        for p in EFFECTS[name].parameters
        if p.instant
    }
    return replace(wanted, ranges={**added, **wanted.ranges})


def with_drawn_effects(plant: Plant, wanted: Draws) -> Plant:
    """The plant with the effects added that ranges draw and no chance switches on; what no range draws is neutral, or a
    shape worth noticing. Raises ArgumentError for an effect of which no size is drawn."""
    found = {effect.name for effect in plant.effects} | set(wanted.chances)
    added = []
    for drawn in wanted.ranges:
        name, dot, _ = drawn.partition(".")
        if not dot or name in found:
            continue
        found.add(name)
        default = plant.default_effect(name).parameters
        sizes = {p.name: p.neutral for p in EFFECTS[name].parameters if p.role == "size"}
        ways = [f"{name}.{size}" for size in sizes]
        if not set(ways) & set(wanted.ranges):
            fault = (
                f"the plant has no {name}, and its size is not drawn; give {' or '.join(ways)} too, or {name}=chance:P"
            )
            raise ArgumentError("randomize", drawn, fault)
        added.append(Effect(name, {**default, **sizes}))
    return plant.with_effects(*added)
