"""Which effect is missing: joint refits of the suspects, compared by likelihood with what each costs.

Every suspect is fitted together with θ and the noise intensities (frozen noise hides most of the evidence, and θ fitted
without the effect carries part of it). Suspects that the data cannot tell apart are kept as a set of equals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from furuta_gym.plant import EFFECTS, Effect, Plant

from .candidates import Fit, Score, fit, scores

THRESHOLD = 10.0  # nats, net of the price of the parameters: what an effect must gain to be believed
EQUALS = 5.0  # nats: suspects this close to the best cannot be told from it
_SHORTLIST = 8
_DRAGGED = 0.3  # log of a factor
START_NOISE = np.array([1e-3, 1e-5, 0.5, 0.5])
_HEAT, _FINALISTS = 8, 4  # iterations that every suspect gets, and how many of them are then finished


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


def name_effects(
    nominal: Fit, anchor: Plant, most: int = 3, only: Sequence[str] | None = None, progress=None
) -> Naming:
    """Forward search with backward checks.

    anchor: plant for the weak prior (see `anchored`). most: effects at most. only: restrict the library.
    progress(text) is told each step.
    """
    tell = progress or (lambda text: None)
    current, accepted, equals, rankings = nominal, [], [], []
    absorbed: dict[str, float] = {}
    for step in range(most):
        tell(f"scoring the library (step {step + 1})")
        table = scores(current, only, quieter=100.0)
        if step == 0:
            absorbed = {name: s.absorbed for name, s in table.items()}
        current, ranking = _refits(current, table, anchor, tell)
        rankings.append(tuple(ranking))
        if step == 0:
            nominal = current
        if not ranking or ranking[0].net < THRESHOLD:
            break
        best = ranking[0]
        accepted.append(best)
        equals.append(tuple(s.name for s in ranking[1:] if best.net - s.net < EQUALS))
        current = best.fit
    if len(accepted) > 1:
        current, accepted, equals = _backward(current, accepted, equals, anchor, tell)
    return Naming(nominal, current, tuple(accepted), tuple(equals), tuple(rankings), absorbed)


def shortlist(table: dict[str, Score]) -> list[str]:
    """The best by score and everything that the best few are mistaken for (equal to first order, apart in a refit)."""
    ranked = sorted((s for s in table.values() if s.start is not None and s.gain > 1.0), key=lambda s: -s.gain)
    names = [s.effect for s in ranked[:_SHORTLIST]]
    for name in names[:3]:
        names += [n for n in EFFECTS[name].mistaken_for if n in table and table[n].start is not None and n not in names]
    return names


def _refits(current: Fit, table: dict[str, Score], anchor: Plant, tell) -> tuple[Fit, list[Suspect]]:
    """Every suspect refitted; the model without it is refitted from the best one's θ, so that neither stopped early."""
    fits: dict[str, Fit] = {}
    for name in shortlist(table):
        tell(f"refitting with {name}")
        fits[name] = _with_effect(current, table[name].start, anchor, iterations=_HEAT)
    # a race: most suspects fall behind within a few iterations, and only the leaders are worth finishing
    leaders = sorted(fits, key=lambda name: fits[name].value)[:_FINALISTS]
    for name in leaders:
        if not fits[name].optimum.converged:
            tell(f"finishing {name}")
            fits[name] = fit(fits[name].plant, fits[name].noise, current.records, anchor=anchor)
    if fits:
        best = min(fits.values(), key=lambda f: f.value)
        again = fit(_without(best, current), current.noise, current.records, anchor=anchor)
        if again.value < current.value:
            current = again
    suspects = []
    for name, fitted in fits.items():
        gain = current.value - fitted.value
        extra = len(EFFECTS[name].parameters)
        price = 0.5 * extra * math.log(fitted.samples)
        suspects.append(Suspect(name, gain, gain - price, fitted, table[name].gain))
    return current, sorted(suspects, key=lambda s: -s.net)


def _with_effect(current: Fit, start: Effect | None, anchor: Plant, iterations: int) -> Fit:
    """`current` with an effect added. Where the missing effect has dragged the scale of the pendulum's row away, the
    way back leads along a narrow valley: starting at the anchor's θ is shorter."""
    assert start is not None
    plant, noise = current.plant, current.noise
    dragged = np.abs(np.log(np.maximum(plant.theta[2:5], 1e-12) / anchor.theta[2:5])).max()
    if dragged > _DRAGGED:
        plant, noise = plant.replace(theta=anchor.theta), np.maximum(noise, START_NOISE)
    return fit(plant.with_effects(start), noise, current.records, anchor=anchor, iterations=iterations)


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
        price = 0.5 * len(EFFECTS[suspect.name].parameters) * math.log(current.samples)
        if reduced.value - current.value - price < THRESHOLD:
            at = [s.name for s in accepted].index(suspect.name)
            accepted, equals = accepted[:at] + accepted[at + 1 :], equals[:at] + equals[at + 1 :]
            current = reduced
    return current, accepted, equals


def noise_ratio(naming: Naming) -> np.ndarray:
    """How much the torque noise fell (2,) when the effects were added: the clearest sign that this was it."""
    return naming.nominal.noise[:2] / np.maximum(naming.final.noise[:2], 1e-300)
