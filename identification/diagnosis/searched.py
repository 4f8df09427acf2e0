"""The search of logs for names, from model (5) to what is left; its outcome is not verified yet."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from furuta_gym.plant import Plant

from ..estimation.estimate import Estimate
from ..estimation.identifiability import NotIdentifiable
from ..estimation.identify import identify
from ..estimation.memories import MEMORIES, Remembering, remembering
from ..estimation.prediction_error import quietest
from ..estimation.start import Start, candidates
from ..estimation.zeros import moved
from ..kalman.noise_model import unexplained_torque
from ..kalman.record import stretches
from ..logs.log import Log
from . import sentences
from .diagnosis_file import Verdict
from .equals import interchangeable
from .held_out import HeldOut
from .leftovers import Leftovers
from .locate.locate import locate
from .locate.location import Where
from .locate.seen import long_enough
from .naming.afresh import afresh, cost
from .naming.certain import without_absent
from .naming.fits import Fit, FitRequest, Fitter
from .naming.forward import START_NOISE, name_effects, unsettled
from .naming.found import Naming
from .naming.search import NOTHING_YET, Search
from .naming.suspects import price_in
from .naming.upheld import preferred, upheld
from .origin import with_origin
from .outcome import Diagnosis
from .policy import DecisionPolicy

_Answer = tuple[Naming, Estimate, Where]


def searched(
    held: HeldOut,
    start: Plant | None,
    most: int,
    only: Sequence[str] | None,
    progress: Callable[[str], None],
    fitter: Fitter,
    until: float = math.inf,
) -> Diagnosis:
    """The search of the logs, its outcome not verified yet. Arguments as in `diagnose`; until: see `Search`."""
    logs, policy = held.logs, held.policy
    rms = float(np.sqrt(np.mean(np.concatenate([log.u for log in logs]) ** 2)))
    progress("identifying model (5)")
    try:
        before = identify(logs, start)
    except NotIdentifiable as error:
        text = f"{error}. Nothing can be said about missing effects."
        return Diagnosis("insufficient_excitation", text, None, None, None, None, math.nan, rms, 0.0, policy)
    long_enough(logs, policy)  # or nothing could be said after the search
    starts = _own_starts(logs, before.plant)
    unexplained = unexplained_torque(before.noise.torque[0]) if before.noise else 0.0
    memories = _memories(logs, before.plant)
    dragged = unexplained > policy.strong * rms or any(m.left < policy.remembered for m in memories)
    anchor = _anchor(_middle(starts) if starts and (dragged or _adrift(before)) else before.plant, policy)
    records = [stretch.record for stretch in stretches(logs)]
    nominal = fitter(FitRequest(anchor, START_NOISE, records, anchor=anchor, policy=policy))
    search = Search(anchor, only, policy, progress, fitter, until=until)
    naming, after, rest = _settled(
        lambda joined: _named(search, nominal, before, held, most, joined),
        lambda known: afresh(nominal, starts, search, known, [s for m in memories for s in m.starts]),
        search,
        dragged,
    )
    verdict, summary = _verdict(naming, rest, policy)
    if not naming.found:
        before = after
    if abs(zero := _zero_in_counts(naming.final)) > policy.zero_told:
        summary += f" {sentences.zero(zero)}"
    before = _without_sharpness(before, naming, logs, policy)
    left = unexplained_torque(naming.final.noise.torque[0])
    return Diagnosis(verdict, summary, before, after, naming, rest, left, rms, 0.0, policy)


def _named(
    search: Search, nominal: Fit, before: Estimate, held: HeldOut, most: int, joined: Mapping[str, Fit]
) -> _Answer:
    """The search for names, the estimate with what was found, and what that leaves. joined: see `name_effects`."""
    logs, policy = held.logs, search.policy
    rest = Leftovers(logs, policy)
    naming = name_effects(nominal, search, most, rest, held, joined)
    naming = replace(naming, ended_early=True) if naming.found and search.late else preferred(naming, search, held)
    naming = upheld(naming, search, held)
    naming, after, remains = _estimated(naming, before, logs, search)
    needed: set[str] = set()
    while (fewer := without_absent(naming, after.plant, search, held, needed)) is not None:
        left = _estimated(fewer, before, logs, search)
        if left[2].matters and not remains.matters:
            needed.add(fewer.perhaps_absent[-1].name)
        else:
            naming, after, remains = left
    naming = unsettled(naming, remains, policy)
    found = tuple(replace(effect, same=interchangeable(effect, logs, policy)) for effect in naming.found)
    return replace(naming, found=found), after, remains


def _estimated(naming: Naming, before: Estimate, logs: Sequence[Log], search: Search) -> _Answer:
    """The names, the estimate with them, and what that leaves."""
    after = before
    if naming.found:
        search.progress("estimating all parameters together")
        after = with_origin(_all_together(logs, naming.final, search.policy), before.plant)
    search.progress("looking at what is left")
    return naming, after, locate(after.plant, moved(logs, after.zeros), search.policy)


def _all_together(logs: Sequence[Log], final: Fit, policy: DecisionPolicy) -> Estimate:
    """All parameters from where the search ended. Its prior on θ may have held that in a valley far from the rig, and
    torque noise explained the rest: where much of it is left, a fit from other starts is compared."""
    fitted = identify(logs, final.plant, noise=final.noise, zeros=final.zeros)
    if fitted.problem is None or fitted.noise is None:
        return fitted
    least = quietest(fitted.plant, fitted.problem.records)
    if not np.any(np.array(fitted.noise.torque) > policy.hiding_noise * least):
        return fitted
    afresh = identify(logs, final.plant, zeros=final.zeros, polished=False, model_error=False)
    if not afresh.log_likelihood > fitted.log_likelihood or afresh.problem is None or afresh.optimum is None:
        return fitted
    noise = afresh.problem.noise_at(afresh.optimum.z)
    return identify(logs, afresh.plant, noise=noise, zeros=afresh.zeros)


def _zero_in_counts(fitted: Fit) -> float:
    """How far the pendulum's zero in the first log is off."""
    first = min(record.log for record in fitted.records)
    record = next(r for r in fitted.records if r.log == first)
    count = float(max(record.quantum[1], np.sqrt(12.0 * record.variance[1])))
    return fitted.zeros.get(first, (0.0, 0.0))[1] / count


def _settled(
    named: Callable[[Mapping[str, Fit]], _Answer],
    other: Callable[[Fit | None], Mapping[str, Fit]],
    search: Search,
    dragged: bool,
) -> _Answer:
    """named(joined): the names. other(known): the best fits of one effect from the logs' own starts. They join the
    search at once where model (5) is `dragged` away by what is missing. Else the search is made again with them, if
    names leave structure and one of them beats the best single effect so far."""
    if dragged:
        search.progress("fitting every effect from other starts, as much is missing")
        return named(other(None))
    naming, after, rest = named(NOTHING_YET)
    if not rest.matters and _verdict(naming, rest, search.policy)[0] != "unknown":
        return naming, after, rest
    if search.late:
        return replace(naming, ended_early=True), after, rest
    search.progress("fitting every effect from other starts, as structure is left")
    best = naming.alone or naming.nominal
    fresh = other(best)
    first = min(fresh, key=lambda name: cost(fresh[name]), default=None)
    if first is None or cost(fresh[first]) > cost(best) - search.policy.believed:
        return naming, after, rest
    search.progress(f"searching again with {first}")
    again = named(fresh)
    if cost(again[0].final) < cost(naming.final) - search.policy.believed:
        return again
    return replace(naming, ended_early=again[0].ended_early), after, rest


def _own_starts(logs: Sequence[Log], plant: Plant) -> list[Start]:
    """Start values from the logs alone; none where the command does not drive the arm."""
    try:
        return candidates([stretch.piece for stretch in stretches(logs)], plant.replace(effects=()))
    except ValueError:
        return []


def _memories(logs: Sequence[Log], plant: Plant) -> list[Remembering]:
    """Start values from the logs alone with each kind of friction that remembers."""
    pieces = [stretch.piece for stretch in stretches(logs)]
    return [remembering(pieces, plant.replace(effects=()), name) for name in MEMORIES]


def _middle(starts: Sequence[Start]) -> Plant:
    """Of the start values that share the first one's ratios of the pendulum's row, the one of middle scale."""
    ratio = starts[0].plant.theta[4] / starts[0].plant.theta[3]
    alike = [s.plant for s in starts if math.isclose(s.plant.theta[4] / s.plant.theta[3], ratio, rel_tol=1e-6)]
    return sorted(alike, key=lambda plant: plant.theta[3])[len(alike) // 2]


def _adrift(before: Estimate) -> bool:
    """Whether model (5) leaves the scale of the pendulum's row undetermined. Its fit then ends anywhere, often at a
    thousandth of the scale, and a prior around that would hold every right name away from its parameters."""
    return "theta4" in before.identifiability.unidentified


def _without_sharpness(before: Estimate, naming: Naming, logs: Sequence[Log], policy: DecisionPolicy) -> Estimate:
    """The estimate without effects. Where a sharpness was found, r is what model (5) has; `before` has it free."""
    if any(effect.type.sharpens for effect in naming.found):
        plain = identify(logs, naming.nominal.plant, noise=naming.nominal.noise, sharpness=policy.sharpness)
        return with_origin(plain, before.plant)
    return before


def _anchor(plant: Plant, policy: DecisionPolicy) -> Plant:
    """The identified plant as a start: friction and θ2 off their bounds, r as model (5) has it. A missing effect may
    have driven θ2 to nothing, from where no descent on its logarithm comes back; no pendulum has so little of θ4."""
    theta = plant.theta.copy()
    theta[1] = max(theta[1], policy.least_theta2 * theta[3])
    floor = [0.02 * theta[0], 0.02 * theta[3], 0.005 * plant.u_max, 5e-4 * abs(theta[4])]
    theta[5:] = np.maximum(theta[5:], floor)
    return plant.without_fit().replace(theta=theta, friction_sharpness=policy.sharpness, effects=())


def _verdict(naming: Naming, rest: Where, policy: DecisionPolicy) -> tuple[Verdict, str]:
    """The verdict, and what it says in sentences."""
    names = [effect.name for effect in naming.own]
    remains = []
    if rest.matters:
        remains = [sentences.left(rest)]
    elif rest.structured:
        remains = [sentences.UNCHANGING]
    elif naming.refused is not None:
        remains = [sentences.refused(naming.refused.name, naming.refused.gain)]
    if not names:
        return ("unknown", remains[0]) if remains else ("none", sentences.nothing(rest))
    cost = sum(price_in(naming.final, name) for name in naming.names)
    if rest.matters and rest.evidence > naming.nominal.value - naming.final.value - cost:
        return "unknown", f"{remains[0]} {sentences.nearest(names)}"
    verdict = "ambiguous" if any(effect.apart for effect in naming.own) else "named"
    return verdict, " ".join([sentences.misses(naming), *remains])
