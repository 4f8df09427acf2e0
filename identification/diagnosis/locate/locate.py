"""Find where a plant and logs disagree: unknown torques on both rows, smoothed, and what they go with.

The decision is made on the innovations, where the noise model holds: families of torques (functions of each angle,
speed, the command and its past, time) compete in generalised least squares beside free values of θ. The smoothed
torques, their maps and their predictability are for the eye.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import THETA_NAMES, Plant
from furuta_gym.plant.effects.words import number

from ...discrepancy.correction import combined
from ...discrepancy.dependence import ANGLES, ZEROS, Channel, Variable
from ...discrepancy.prediction_change import prediction_change
from ...discrepancy.response import answers
from ...estimation.pool import one_blas_thread
from ...kalman.likelihood import whiten
from ...kalman.noise import likeliest
from ...kalman.path import follow, refilter, smooth
from ...kalman.whiteness import Whitened, innovations
from ...logs.log import Log, as_logs
from ..policy import DecisionPolicy
from .constancy import Constancy, constancy
from .evidence import HORIZON, Look, evidence_of, parameters_of, suspicions_of
from .laws import own_variables
from .location import MissingTorque, Suspicion, Where
from .seen import Seen
from .structure import largest_line, predictable
from .torque_maps import VARIABLES, torque_map

_BLOCK = 0.25  # s

Array = NDArray[np.float64]


def locate(plant: Plant | str, logs: Log | Sequence[Log], policy: DecisionPolicy | None = None) -> Where:
    """Where the plant fails on these logs, usually those it was fitted to.

    plant: a `Plant`, a plant file or a known set. policy: holds the evidence from which something is said to be left
    (default: `DecisionPolicy()`). Raises TypeError for what is no `Log`, and ValueError if a log is too
    short, its command is in another unit than the plant's, or the filter loses it.
    """
    policy = policy or DecisionPolicy()
    plant, logs = Plant.resolve(plant), as_logs(logs)
    for log in logs:
        log.check_unit(plant.unit)
    return located(Seen.of(plant, logs, policy), policy)


@dataclass(frozen=True)
class Left:
    """What no torque of the plant explains: the families that would, best first; evidence [nats] of the best one, and
    what it changes of predictions of both angles, in counts (2,)."""

    suspicions: tuple[Suspicion, ...]
    evidence: float
    counts: Array

    def negligible(self, policy: DecisionPolicy) -> bool:
        """Whether it changes no prediction by a count that matters."""
        return bool(self.counts.max() < policy.negligible)


@one_blas_thread
def left_of(seen: Seen, policy: DecisionPolicy) -> Left:
    """What is left of logs; the part of `located` that a search asks for again and again."""
    suspicions = suspicions_of(seen.looks, seen.columns, policy)
    best = suspicions[0]
    evidence = evidence_of(seen.looks, seen.columns, {best.dependence})
    return Left(tuple(suspicions), evidence.nats, evidence.change / _count(seen.looks))


@one_blas_thread
def located(seen: Seen, policy: DecisionPolicy) -> Where:
    """`locate` for what has been seen already."""
    plant, logs, looks = seen.plant, seen.logs, seen.looks
    left = left_of(seen, policy)
    best, counts = left.suspicions[0], left.counts
    found = left.evidence > policy.left
    torques = tuple(_missing(look, logs[look.log].source) for look in looks)
    spans = tuple(_spans(torque, policy.stands_out) if found else () for torque in torques)
    longest = max(range(len(looks)), key=lambda i: len(torques[i].t))
    r2, line, frequencies = _structure(looks[longest], torques[longest])
    steady = _constancy(looks[longest])
    drift = _drift(looks[longest], steady) / _count(looks)
    return Where(
        found=found,
        sentence=_sentence(best, spans, torques, frequencies, left.evidence, counts, plant.unit)
        if found
        else _nothing(left.evidence),
        evidence=left.evidence,
        counts=counts,
        negligible=left.negligible(policy),
        channel=_channel(best) if found else None,
        variable=best.variable if found else None,
        intervals_s=spans,
        suspicions=left.suspicions,
        predictable=r2,
        line=line,
        frequencies=frequencies,
        constancy=steady,
        drift_counts=drift,
        changing=bool(steady.joint_p < policy.constant and drift.max() >= policy.negligible),
        innovations=tuple(innovations(Whitened.of(look.flexible.plain.path)) for look in looks),
        torques=torques,
        maps=tuple(
            torque_map([look.flexible.uncorrected for look in looks], row, name)
            for row in range(2)
            for name in VARIABLES
            if not (row == 1 and name is Variable.COMMAND)
        ),
        unit=plant.unit,
    )


def _count(looks: Sequence[Look]) -> Array:
    """One count of each encoder (2,) [rad]; of readings that are not rounded, the step that would give their noise."""
    records = [look.plain.record for look in looks]
    quantum, variance = (np.max([getattr(r, name) for r in records], axis=0) for name in ("quantum", "variance"))
    return np.where(quantum > 0, quantum, np.sqrt(12.0 * variance))


def of_effects(where: Where, names: Sequence[str]) -> Where:
    """The same of a plant that lacks effects which were named, as their fit sees more than one free function does:
    where none is believed, the likeliest of those that go with their own variables stands for it."""
    own = {variable for name in names for variable in own_variables(name)}
    near = next((s for s in where.suspicions if s.dependence in own), None)
    if where.found or near is None:
        return where
    channel, variable = _channel(near), near.variable
    return replace(
        where,
        channel=channel,
        variable=variable,
        sentence="No free function of the motion, the command or time shows the missing torque for certain "
        f"({where.evidence:.1f} nats). By the law of what was named it goes with the {variable} ({channel}).",
    )


def _channel(best: Suspicion) -> Channel:
    """As diagnosis.json has it; a constant torque on the pendulum, which nothing drives, is a wrong zero."""
    wrong_zero = best.dependence == (Channel.PENDULUM, Variable.CONSTANT)
    return Channel.SENSOR if wrong_zero else best.channel


def _missing(look: Look, source: str) -> MissingTorque:
    """Unknown torques as random walks beside the log's own noise, their intensities most likely, smoothed."""
    path = look.flexible.path
    size = np.maximum(
        np.var(look.flexible.torque, axis=0), path.noise.torque
    )  # a first guess, over a tenth of a second
    walk = follow(path.plant, path.record, path.noise, 10.0 * size)
    if walk is not None:
        noise, intensity = likeliest(walk, hold_noise=True)
        walk = follow(path.plant, path.record, noise, intensity)
    if walk is None:
        torque = look.flexible.torque
        std = np.tile(np.std(torque, axis=0), (len(torque), 1))
        return MissingTorque(look.log, source, path.record.t + look.start, torque, std)
    smoothed = smooth(refilter(walk, walk.noise, walk.walk))
    n = walk.states
    mean, std = smoothed.mean[:, n : n + 2], np.sqrt(smoothed.variance[:, n : n + 2])
    return MissingTorque(look.log, source, path.record.t + look.start, mean, std)


def _spans(torque: MissingTorque, stands_out: float) -> tuple[tuple[float, float], ...]:
    """Stretches of time in which either torque stands out of its band; gaps up to half a second are bridged."""
    t = torque.t
    z = np.max(np.abs(torque.mean) / np.maximum(torque.std, 1e-300), axis=1)
    blocks = ((t - t[0]) / _BLOCK).astype(int)
    out = np.array([np.mean(z[blocks == b] ** 2) > stands_out**2 for b in range(blocks[-1] + 1)])
    spans: list[list[float]] = []
    for b in np.flatnonzero(out):
        start, stop = float(t[0] + b * _BLOCK), float(min(t[0] + (b + 1) * _BLOCK, t[-1]))
        if spans and start - spans[-1][1] <= 0.5:
            spans[-1][1] = stop
        else:
            spans.append([start, stop])
    if sum(b - a for a, b in spans) > 0.7 * (t[-1] - t[0]):
        return ((float(t[0]), float(t[-1])),)
    return tuple((a, b) for a, b in spans)


def _structure(look: Look, torque: MissingTorque) -> tuple[Array, Array, Array]:
    """R², Fisher's g and frequency of both rows' torques."""
    s = look.signals
    T = float(np.median(np.diff(s.t)))
    back = lambda lag: s.u[np.maximum(np.arange(len(s.u)) - max(1, round(lag / T)), 0)]  # noqa: E731
    q2 = s.q[:, 1]
    inputs = np.column_stack([s.q[:, 0], np.sin(q2), np.cos(q2), s.v, s.u, back(0.01), back(0.03)])
    r2 = np.array([predictable(torque.mean[:, a], inputs) for a in range(2)])
    lines = [largest_line(torque.mean[:, a], T) for a in range(2)]
    return r2, np.array([g for g, _ in lines]), np.array([f for _, f in lines])


def _constancy(look: Look) -> Constancy:
    D = answers(look.plain, parameters_of(look)).reshape(-1, 2, 9)
    w = whiten(look.plain.e, look.plain.S)
    free = [i for i in range(9) if np.any(D[:, :, i])]
    used = look.plain.read
    return constancy(D[used][:, :, free], w[used], [THETA_NAMES[i] for i in free])


def _drift(look: Look, found: Constancy) -> Array:
    """What parameters that lie off their mean in equal stretches of time change of predictions (2,) [rad]."""
    family, path = parameters_of(look), look.plain
    coefficients = np.zeros((len(found.moved), family.size))
    coefficients[:, [THETA_NAMES.index(name) for name in found.names]] = found.moved
    torque, misreading = np.zeros((2, len(path.read), 2))
    used = np.flatnonzero(path.read)
    first = 0
    for block, c in zip(np.array_split(used, len(found.moved)), coefficients, strict=True):
        samples = slice(first, int(block[-1]) + 1)
        torque[samples], misreading[samples] = (x[samples] for x in combined([family], c))
        first = samples.stop
    return np.sqrt(prediction_change(path, torque, misreading, HORIZON))


def _nothing(evidence: float) -> str:
    return (
        "Nothing is left: no torque that is a function of the motion, the command or time makes these logs likelier "
        f"(evidence {evidence:.1f} nats)."
    )


def _sentence(best: Suspicion, spans, torques, line: Array, evidence: float, counts: Array, unit: str) -> str:
    row, misread = int(best.channel is Channel.PENDULUM), best.channel is Channel.SENSOR
    read = next((ANGLES[joint] for joint, zero in ZEROS.items() if zero is best.variable), best.variable)
    places = {Channel.INPUT: "between the command and the motor", Channel.SENSOR: f"in the reading of the {read}"}
    place = places.get(best.channel, f"in a torque on the {best.channel}'s row")
    zero = "is constant, as a wrong zero of its encoder or a tilted base gives"
    against = {
        Variable.CONSTANT: zero if row == 1 else "is constant, as an offset of the command or a spring gives",
        Variable.FREQUENCY: f"repeats at {line[row]:.3g} Hz",
        Variable.COMMAND: "depends on the command itself",
        Variable.COMMAND_CHANGE: "follows the command's changes, as a delay or a lag would",
        Variable.MEMORY: "remembers the way the joint has turned",
        Variable.FRICTION_IN_TIME: "is friction that changes in time",
        Variable.GAIN_IN_TIME: "is a gain of the command that changes in time",
        Variable.MASSES_IN_TIME: "is an inertia or a weight that changes in time",
        **dict.fromkeys(ZEROS.values(), "is a zero that moves in time, as lost counts or a slipping coupling give"),
    }.get(best.variable, f"depends on the {best.variable}")
    rms = np.sqrt(np.mean(np.concatenate([t.mean for t in torques]) ** 2, axis=0))
    lasting = [sum(b - a for a, b in s) > 0.7 * (t.t[-1] - t.t[0]) for s, t in zip(spans, torques, strict=True)]
    several = len({torque.log for torque in torques}) > 1
    times = [(t.source, f"{a:.2f} to {b:.2f} s") for s, t in zip(spans, torques, strict=True) for a, b in s][:3]
    first = [f"{span} of {source}" if several else span for source, span in times]
    when = "all along" if all(lasting) or not first else "most at " + ", ".join(first)
    # an error of a reading is no torque: what the smoother makes of it says nothing of its size
    size = "it changes" if misread else f"smoothed, it is {rms[row]:.2g} {unit} rms, which changes"
    return (
        f"The model fails {place}: what is missing {against} ({100 * best.share:.0f} % of what any function could "
        f"explain), {when}; {size} a prediction "
        f"{HORIZON:g} s ahead by {number(float(counts.max()), 2)} counts of the encoder "
        f"(evidence {evidence:.0f} nats)."
    )
