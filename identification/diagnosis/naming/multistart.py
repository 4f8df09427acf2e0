"""Multi-start: coarse fits from several starts, a few iterations at a time; those that cannot catch up are pruned.

A fit of an effect descends from the θ of the model without it, which the missing effect has dragged away; some get
stuck there. So the best suspect starts again from other sizes, and the others from the best fit's θ, until the best
stays the best.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from furuta_gym.plant import EFFECTS, THETA_NAMES, Effect, Plant

from ...estimation.grids import at_grid_points, clock_of
from ...estimation.pool import mapped, shared_pool
from ...kalman.coordinates import Zeros
from ...kalman.noise_model import Noise
from ..policy import DecisionPolicy
from .fits import Fit, FitRequest, Fitter, added, without_further
from .related import angles_of, in_place_of_friction, nearest, related
from .suspects import alike


class Setting(Protocol):
    """What stays the same in a search: the anchor of the weak prior, the thresholds, and what fits."""

    @property
    def anchor(self) -> Plant: ...

    @property
    def policy(self) -> DecisionPolicy: ...

    @property
    def fitter(self) -> Fitter: ...


@dataclass(frozen=True, eq=False)
class EffectStart:
    """Where one fit starts: the effects it stands for, a plant with them, its noise, and the zeros of the
    encoders in each log."""

    effects: tuple[str, ...]
    plant: Plant
    noise: Noise
    zeros: Zeros = field(default_factory=dict)

    @property
    def effect(self) -> str:
        """The effect, where there is one only."""
        (name,) = self.effects
        return name


def multi_start(
    starts: Sequence[EffectStart],
    current: Fit,
    setting: Setting,
    ahead: float = math.inf,
    halve: bool | None = None,
) -> dict[EffectStart, Fit]:
    """Coarse fits from several starts, a few iterations at a time; a start that cannot catch up is pruned.

    ahead: value [nats] of a fit that is there already. halve: keep half of the starts after each round (default: only
    without `ahead`).
    """
    policy = setting.policy
    halve = math.isinf(ahead) if halve is None else halve
    fits: dict[EffectStart, Fit] = {}
    running: list[tuple[EffectStart, EffectStart | Fit]] = [(start, start) for start in starts]
    for turn in range(policy.rounds):
        if not running:
            break
        results = mapped(shared_pool(), lambda entry: one_round(entry[1], current, setting), running)
        pace = {}
        for (start, _), result in zip(running, results, strict=True):
            came = fits[start].value - result.value if start in fits else math.inf
            pace[start] = min(came, result.promised)
            fits[start] = result
        best = min(ahead, *(f.value for f in fits.values()))
        order = sorted((start for start, _ in running), key=lambda start: fits[start].value)
        on = [start for start in order if not fits[start].optimum.converged and pace[start] > policy.stands]
        if halve:
            on = on[: max(2, len(fits) >> (turn + 1))]
        running = [(start, fits[start]) for start in on if catches_up(fits[start], pace[start], best, policy)]
    return fits


def catches_up(fitted: Fit, pace: float, best: float, policy: DecisionPolicy) -> bool:
    """Whether a fit may reach the best value [nats] in a few more rounds, at a pace [nats a round]."""
    return fitted.value - policy.catches_up * pace < best + policy.reach


def one_round(at: EffectStart | Fit, current: Fit, setting: Setting) -> Fit:
    """A few iterations from a start, or on from a fit, on the records of `current`."""
    return setting.fitter(
        FitRequest(
            at.plant,
            at.noise,
            current.records,
            anchor=setting.anchor,
            policy=setting.policy,
            iterations=setting.policy.round_iterations,
            effort="coarse",
            zeros=at.zeros,
        )
    )


def best_of(found: Mapping[EffectStart, Fit], so_far: Mapping[str, Fit] | None = None) -> dict[str, Fit]:
    """The best fit of each effect, from fits by their starts and from those known so far."""
    best = dict(so_far or {})
    for start, fitted in found.items():
        if start.effect not in best or fitted.value < best[start.effect].value:
            best[start.effect] = fitted
    return best


def from_other_sizes(
    names: Sequence[str], suggested: Mapping[str, Effect], fits: Mapping[str, Fit], current: Fit, setting: Setting
) -> dict[str, Fit]:
    """Fits, better where some effects started from other sizes. A score is taken where θ and the noise have absorbed
    most of an effect: it suggests too small a size, at times of the wrong sign, and the descent from there may not
    find the way."""
    policy, starts = setting.policy, []
    for name in names:
        larger, mirrored = resized(suggested[name], policy.larger), resized(suggested[name], -1.0)
        if larger is not None:
            fresh = _afresh(current, larger, setting)
            starts += [with_effect(current, larger, setting), fresh]
            if current.plant.effects:  # what was found before has taken this one's part as well
                smaller = [resized(e, policy.smaller) or e for e in current.plant.effects]
                starts.append(replace(fresh, plant=fresh.plant.with_effects(*smaller)))
        if mirrored is not None:
            starts.append(with_effect(current, mirrored, setting))
    ahead = min(f.value for f in fits.values())
    return best_of(multi_start(starts, current, setting, ahead, halve=True), fits)


def resized(effect: Effect, factor: float) -> Effect | None:
    """The effect with `factor` times its size, None where its bounds forbid that or no size can be scaled."""
    values = dict(effect.parameters)
    for p in effect.type.parameters:
        if p.role == "size" and not p.integer:
            # where no effect is an infinite value (a stiffness, a limit), a smaller value is more of it
            values[p.name] = values[p.name] * factor if math.isfinite(p.neutral) else values[p.name] / factor
            if not p.lower <= values[p.name] <= p.upper:
                return None
    return Effect(effect.name, values) if values != dict(effect.parameters) else None


def from_best(
    best: str, rivals: Mapping[str, Effect], fits: Mapping[str, Fit], current: Fit, setting: Setting
) -> dict[str, Fit]:
    """Fits, better where rivals started from the best one's θ, which is near the truth if its name is nearly right:
    there the others soon find their own optimum. One of them may be the best then. rivals: where each starts; those
    whose law is related to the best one's, or that are it where no Coulomb friction is left, start from what does
    nearly the same, too."""
    noise = between(fits[best], current)
    plant = without_further(fits[best], current)
    zeros = fits[best].zeros
    clock = clock_of(current.records)
    starts = []
    for name, effect in rivals.items():
        if related(best, name):
            near = nearest(added(fits[best], current), effect, angles_of(current.records, zeros))
            starts.append(EffectStart((name,), plant.with_effects(near), fits[best].noise, zeros))
        if (same := in_place_of_friction(fits[best].plant, best, name, setting.policy)) is not None:
            starts.append(EffectStart((name,), same, fits[best].noise, zeros))
        tried = [
            effect,
            *(at_grid_points(effect, plant, (), clock) if _degenerate(name, fits, setting.policy) else ()),
        ]
        starts += [EffectStart((name,), plant.with_effects(e), noise, zeros) for e in tried]
    return best_of(multi_start(starts, current, setting, ahead=fits[best].value), fits)


def _degenerate(name: str, fits: Mapping[str, Fit], policy: DecisionPolicy) -> bool:
    """Whether a fit has become that of a special case, as a cable that comes taut where the arm never is: a spring.
    No descent comes back from there."""
    special = [fits[n].value for n in EFFECTS[name].includes if n in fits]
    return name in fits and any(fits[name].value > value - policy.special for value in special)


def best_and_look_alike(fits: Mapping[str, Fit]) -> list[str]:
    """The best effect and the best one that it is mistaken for."""
    best = min(fits, key=lambda name: fits[name].value)
    return [best, *look_alikes(best, fits)[:1]]


def rivals_of(best: str, fits: Mapping[str, Fit], policy: DecisionPolicy) -> list[str]:
    """What might be mistaken for the best: its look-alikes, and the next in order."""
    same = look_alikes(best, fits)
    others = [n for n in sorted(fits, key=lambda n: fits[n].value) if n not in same]
    return [*same, *others[: 1 + policy.rivals]]


def look_alikes(name: str, fits: Mapping[str, Fit]) -> list[str]:
    """Declared look-alikes among fitted effects, the best first."""
    return sorted((n for n in fits if alike(n, name)), key=lambda n: fits[n].value)


def between(best: Fit, current: Fit) -> Noise:
    """Noise for a rival at the best fit's θ: half way, in the logarithm, back to what the model without it needs."""
    own, other = best.noise.packed(), current.noise.packed()
    return Noise.unpacked(np.sqrt(own * np.maximum(other, own)))


def with_effect(current: Fit, start: Effect, setting: Setting) -> EffectStart:
    """Where to start with an effect added.

    Where the first missing effect has dragged the scale of the pendulum's row away, the way back leads along a narrow
    valley: starting at the anchor's θ is shorter. Once an effect has been found, the anchor, which has none, is the
    one that is far away."""
    scale = np.maximum(np.abs([current.plant.theta[2:5], setting.anchor.theta[2:5]]), 1e-12)
    if np.abs(np.diff(np.log(scale), axis=0)).max() > setting.policy.dragged and not current.plant.effects:
        return _afresh(current, start, setting)
    plant = _with_friction(current.plant, start).with_effects(start)
    return EffectStart((start.name,), plant, current.noise, current.zeros)


def _with_friction(plant: Plant, effect: Effect) -> Plant:
    """The plant with at least the friction to which the default of an abrupt parameter is relative. Where friction
    ended near zero, such an effect would have nothing to act on, and be too stiff to be integrated."""
    theta = plant.theta.copy()
    for p in effect.type.parameters:
        if p.abrupt and p.relative_to in THETA_NAMES:
            i = THETA_NAMES.index(p.relative_to)
            theta[i] = max(theta[i], plant.noticeable(p.relative_to))
    return plant.replace(theta=theta)


def _afresh(current: Fit, start: Effect, setting: Setting) -> EffectStart:
    """From the anchor's θ, with noise enough to find the way."""
    plant = _with_friction(current.plant.replace(theta=setting.anchor.theta), start).with_effects(start)
    return EffectStart((start.name,), plant, current.noise.louder(setting.policy.restart_noise), current.zeros)
