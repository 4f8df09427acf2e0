"""Which effect is missing: joint refits of the suspects, compared by likelihood with what each costs.

Every suspect is fitted together with θ and the noise intensities (frozen noise hides most of the evidence, and θ fitted
without the effect carries part of it). Suspects that the data cannot tell apart are kept as a set of equals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import EFFECTS, Effect, Plant

from ..prediction_error import THREADS, quietest
from .candidates import Fit, Score, fit, scores

Array = NDArray[np.float64]

THRESHOLD = 10.0  # nats, net of the price of the parameters: what an effect must gain to be believed
EQUALS = 5.0  # nats: suspects this close to the best cannot be told from it
_SHORTLIST, _NEAR = 6, 0.15  # effects, and the share of the best score that they must have
_FAINT = (0.5, 1.5)  # of the price, what a score must reach: the first effect's, later ones'
_QUIETER = 100.0
_POWERS = {"frequencies": 1.5, "times": 1.0}
_OWN_SHARE = 0.2  # of the largest gain before, what a further effect must explain
_DRAGGED = 0.3  # log of a factor
START_NOISE = np.array([1e-3, 1e-5, 0.5, 0.5])
_HEAT, _ROUNDS = 4, 8  # iterations in a round of the race, and rounds at most
_CATCHES_UP = 3.0  # rounds at its last pace within which a suspect must reach the best to go on
_FINALISTS, _REACH = 4, 25.0  # suspects that are finished at most, and how near [nats] to the best they must be
_CHASERS = 2  # of those that are no look-alikes
_RESTART = 10.0  # factor on the noise


@dataclass(frozen=True)
class Suspect:
    """A refitted effect. `gain` [nats]: log-likelihood over the model without it; `net`: minus its price."""

    name: str
    gain: float
    net: float
    fit: Fit = field(repr=False)
    score: float = 0.0


@dataclass(frozen=True)
class Naming:
    """Outcome of the search: the model without and with the effects found, and every suspect of each step."""

    nominal: Fit = field(repr=False)
    final: Fit = field(repr=False)
    accepted: tuple[Suspect, ...]
    equals: tuple[tuple[str, ...], ...]  # beside each accepted effect, what cannot be told from it
    rankings: tuple[tuple[Suspect, ...], ...]
    absorbed: dict[str, float]  # share of each effect's answer that θ can imitate on these logs
    refused: Suspect | None = None  # what would explain some more, but too little to be told from a wrong form


def name_effects(
    nominal: Fit,
    anchor: Plant,
    most: int = 3,
    only: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
    left: Callable[[Plant], float] = lambda plant: 0.0,
) -> Naming:
    """Forward search with backward checks.

    anchor: plant for the weak prior (see `anchored`). most: effects at most. only: restrict the library.
    progress(text) is told each step. left(plant): evidence [nats] of torques that a plant does not explain; a further
    effect that leaves more than it explains is not what is missing, only something that takes its shape.
    """
    tell = progress or (lambda text: None)
    current, accepted, equals, rankings = nominal, [], [], []
    absorbed: dict[str, float] = {}
    refused: Suspect | None = None
    for step in range(most):
        tell(f"scoring the library (step {step + 1})")
        names, table = _suspects(current, only, len(accepted))
        if step == 0:
            absorbed = {name: s.absorbed for name, s in table.items()}
        current, ranking = _refits(current, names, table, anchor, tell)
        rankings.append(tuple(ranking))
        if step == 0:
            nominal = current
        if not ranking or ranking[0].net < THRESHOLD:
            break
        best = ranking[0]
        if accepted and (_mends(best, accepted) or best.net < left(best.fit.plant)):
            refused = best
            break
        accepted.append(best)
        equals.append(tuple(s.name for s in ranking[1:] if best.net - s.net < EQUALS))
        current = best.fit
    if len(accepted) > 1:
        current, accepted, equals = _backward(current, accepted, equals, anchor, tell)
    return Naming(nominal, current, tuple(accepted), tuple(equals), tuple(rankings), absorbed, refused)


def _mends(suspect: Suspect, accepted: Sequence[Suspect]) -> bool:
    """Whether a further effect may only mend the form of one found before: it explains far less. No rig has an effect
    in the library's very words, and what the words miss of a large effect looks like a small one of another name."""
    return suspect.gain < _OWN_SHARE * max(a.gain for a in accepted)


def _suspects(current: Fit, only: Sequence[str] | None, found: int) -> tuple[list[str], dict[str, Score]]:
    """Effects worth a refit, and the scores of all. Where the noise has been fitted to hide what is missing, scores at
    less noise choose."""
    table = scores(current, only)
    names = shortlist(table, current.samples, _FAINT[min(found, 1)])
    hiding = np.any(current.noise[:2] > 10.0 * quietest(current.plant, current.records))
    convincing = any(table[n].gain > price(n, current.samples) + THRESHOLD for n in names)
    if hiding and not convincing:
        quiet = scores(current, only, quieter=_QUIETER)
        more = [n for n in shortlist(quiet, current.samples, 1.0) if n not in names]
        table |= {n: replace(quiet[n], gain=table[n].gain) for n in more}
        names += more
    return names, table


def shortlist(table: dict[str, Score], samples: int, least: float) -> list[str]:
    """Effects whose score comes near the best one's, and what the best few are mistaken for (equal to first order,
    apart in a refit), if the score is `least` times what the effect's parameters cost."""
    promising = {n: s for n, s in table.items() if s.start is not None and s.gain > least * price(n, samples)}
    ranked = sorted(promising, key=lambda name: -promising[name].gain)
    names = [n for n in ranked[:_SHORTLIST] if promising[n].gain > _NEAR * promising[ranked[0]].gain]
    for name in names[:3]:
        names += [n for n in EFFECTS[name].mistaken_for if n in promising and n not in names]
    return names


def price(name: str, samples: int) -> float:
    """What an effect's parameters cost [nats]: half ln N each (the Bayesian information criterion), but 3/2 ln N for a
    frequency and ln N for an instant, which N samples determine so well that more of them can be told apart (Djurić
    1998, "Asymptotic MAP criteria for model selection")."""
    powers = [_POWERS.get(p.grid, 0.5) if isinstance(p.grid, str) else 0.5 for p in EFFECTS[name].parameters]
    return sum(powers) * math.log(samples)


def _refits(
    current: Fit, names: Sequence[str], table: dict[str, Score], anchor: Plant, tell
) -> tuple[Fit, list[Suspect]]:
    """Suspects refitted; the model without any is refitted from the best one's θ, so that neither stopped early."""
    if not names:
        return current, []
    tell(f"racing {', '.join(names)}")
    fits = _race({name: _with_effect(current, table[name].start, anchor) for name in names}, current, anchor)
    led: set[str] = set()
    while (leader := min(fits, key=lambda name: fits[name].value)) not in led:
        led.add(leader)
        _chase(leader, fits, current, anchor, tell)
    best = min(f.value for f in fits.values())
    for name in sorted(fits, key=lambda name: fits[name].value)[:_FINALISTS]:
        if fits[name].value < best + _REACH:
            tell(f"finishing {name}")
            fits[name] = fit(fits[name].plant, fits[name].noise, current.records, anchor=anchor)
    tell("refitting the model without it")
    best = min(fits.values(), key=lambda f: f.value)
    again = fit(_without(best, current), current.noise, current.records, anchor=anchor)
    if again.value < current.value:
        current = again
    suspects = []
    for name, fitted in fits.items():
        gain = current.value - fitted.value
        suspects.append(Suspect(name, gain, gain - price(name, fitted.samples), fitted, table[name].gain))
    return current, sorted(suspects, key=lambda s: -s.net)


def _chase(leader: str, fits: dict[str, Fit], current: Fit, anchor: Plant, tell) -> None:
    """Race on from the leader's θ, which is near the truth if its name is nearly right: there the others soon find
    their best. Keeps in `fits` what is better; one of them may lead then, and the leader be among those that follow."""
    rivals = {
        name: (
            _without(fits[leader], current).with_effects(fits[name].plant.effects[-1]),
            _between(fits[leader], current),
        )
        for name in _rivals(leader, fits)
        if name != leader
    }
    tell(f"chasing {leader} with {', '.join(rivals) or 'none'}")
    for name, chaser in _race(rivals, current, anchor, ahead=fits[leader].value).items():
        if chaser.value < fits[name].value:
            fits[name] = chaser


def _race(
    entries: dict[str, tuple[Plant, Array]], current: Fit, anchor: Plant, ahead: float = math.inf
) -> dict[str, Fit]:
    """Coarse fits from plants and noise, a few iterations at a time; who cannot catch up any more stops.

    `ahead`: value of a fit that runs before them. Without one, the field is halved after each round.
    """
    fits: dict[str, Fit] = {}
    for turn in range(_ROUNDS):
        if not entries:
            break
        results = THREADS.map(lambda entry: _round(current, entry, anchor), entries.values())
        pace = {}
        for name, result in zip(list(entries), results, strict=True):
            pace[name] = fits[name].value - result.value if name in fits else math.inf
            fits[name] = result
        best = min(ahead, *(f.value for f in fits.values()))
        on = [name for name in sorted(entries, key=lambda name: fits[name].value) if not fits[name].optimum.converged]
        if math.isinf(ahead):
            on = on[: max(2, len(fits) >> (turn + 1))]
        entries = {
            name: (fits[name].plant, fits[name].noise)
            for name in on
            if fits[name].value - _CATCHES_UP * pace[name] < best + _REACH
        }
    return fits


def _round(current: Fit, entry: tuple[Plant, Array], anchor: Plant) -> Fit:
    plant, noise = entry
    return fit(plant, noise, current.records, anchor=anchor, iterations=_HEAT, coarse=True)


def _rivals(leader: str, fits: dict[str, Fit]) -> list[str]:
    """What might be mistaken for the leader: its look-alikes, and the next in the race."""
    alike = {n for n in fits if n in EFFECTS[leader].mistaken_for or leader in EFFECTS[n].mistaken_for}
    return [*alike, *[n for n in sorted(fits, key=lambda n: fits[n].value) if n not in alike][: 1 + _CHASERS]]


def _between(leader: Fit, current: Fit) -> Array:
    """Noise for a rival at the leader's θ: half way, in the logarithm, back to what the model without it needs."""
    return np.sqrt(leader.noise * np.maximum(current.noise, leader.noise))


def _with_effect(current: Fit, start: Effect | None, anchor: Plant) -> tuple[Plant, Array]:
    """Plant and noise to start from, with an effect added. Where the missing effect has dragged the scale of the
    pendulum's row away, the way back leads along a narrow valley: starting at the anchor's θ is shorter."""
    assert start is not None
    plant, noise = current.plant, current.noise
    dragged = np.abs(np.log(np.maximum(plant.theta[2:5], 1e-12) / anchor.theta[2:5])).max()
    if dragged > _DRAGGED:
        plant, noise = plant.replace(theta=anchor.theta), noise * np.array([_RESTART, _RESTART, 1.0, 1.0])
    return plant.with_effects(start), noise


def _without(fitted: Fit, current: Fit):
    """The plant of `fitted` with only the effects of `current`."""
    keep = {e.name for e in current.plant.effects}
    return fitted.plant.replace(effects=tuple(e for e in fitted.plant.effects if e.name in keep))


def _backward(current: Fit, accepted, equals, anchor: Plant, tell):
    """Drop any accepted effect that the others have made superfluous."""
    for suspect in list(accepted[:-1]):
        tell(f"checking that {suspect.name} is still needed")
        reduced_plant = current.plant.replace(effects=tuple(e for e in current.plant.effects if e.name != suspect.name))
        reduced = fit(reduced_plant, current.noise, current.records, anchor=anchor)
        if reduced.value - current.value - price(suspect.name, current.samples) < THRESHOLD:
            at = [s.name for s in accepted].index(suspect.name)
            accepted, equals = accepted[:at] + accepted[at + 1 :], equals[:at] + equals[at + 1 :]
            current = reduced
    return current, accepted, equals
