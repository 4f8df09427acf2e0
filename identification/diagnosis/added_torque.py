"""The torque of effects as a function of the motion."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import EFFECTS, Effect, EffectType, Plant
from furuta_gym.plant.dynamics import mass_matrix
from furuta_gym.plant.linearization import state_derivative

from ..discrepancy.basis import Signals
from ..logs.log import Log
from ..validation.gap import filtered

_MOST = 1500  # points of the motion at which the torque is computed
_HOOKS = {"torque", "theta", "command"}


def is_function_of_motion(effect: EffectType) -> bool:
    """Whether an effect's torque is one: it keeps no memory, acts on no reading and does not delay the command."""
    return set(effect.kernels) <= _HOOKS and not effect.memory


def motion_of(plant: Plant, logs: Sequence[Log]) -> Signals:
    """Up to 1500 points of the filtered motion along the longest of the logs.

    Raises ValueError where the plant's filter loses the log.
    """
    signals = Signals.of(filtered(plant, max(logs, key=len)))
    every = slice(None, None, -(-len(signals.t) // _MOST))
    return Signals(*(getattr(signals, f)[every] for f in ("t", "q", "v", "a", "u", "expected")))


def added_torque(plant: Plant, names: Sequence[str], signals: Signals) -> NDArray[np.float64]:
    """Torque (N, 2) [{u}] that the plant's effects `names` add to the arm's and the pendulum's row at points of a
    motion. Each must be a function of the motion (see `is_function_of_motion`)."""
    effects = [effect for effect in plant.effects if effect.name in names]
    without = plant.replace(effects=tuple(e for e in plant.effects if e not in effects), covariance=None)
    command = _commanded(effects, signals)
    rows = []
    for t, q, v, u, tau in zip(signals.t, signals.q, signals.v, signals.u, command, strict=True):
        x = np.array([*q, *v])
        apart = state_derivative(plant, x, tau, t)[2:4] - state_derivative(without, x, u, t)[2:4]
        m11, m12, m22 = mass_matrix(q[1], *without.theta[:4])
        rows.append((m11 * apart[0] + m12 * apart[1], m12 * apart[0] + m22 * apart[1]))
    return np.array(rows)


def law_change(before: Plant, after: Plant, name: str, other: str, logs: Sequence[Log]) -> float:
    """How much the torque that a motion asks for changes from one plant to another that has the effect `name` besides,
    as a share of the torque of its effect `other`: deviation over deviation along the longest log, on the rows on which
    `name` acts.

    θ counts with the effects, as it takes back most of what an effect that only mends another's form adds. Constant
    parts do not count: a tilted base holds the pendulum with a torque beside which the form of its pull on the arm
    would be nothing. Infinite where one of the two is no function of the motion, or where the filter loses the log."""
    if not all(is_function_of_motion(EFFECTS[n]) for n in (name, other)):
        return math.inf
    try:
        signals = motion_of(after, logs)
    except ValueError:
        return math.inf
    rows = [row for row, joint in enumerate(("arm", "pendulum")) if joint in EFFECTS[name].place] or [0, 1]
    change = (_asked_for(after, signals) - _asked_for(before, signals))[:, rows]
    size = float(np.sum(np.var(added_torque(after, [other], signals)[:, rows], axis=0)))
    return math.sqrt(float(np.sum(np.var(change, axis=0))) / size) if size > 0.0 else math.inf


def _asked_for(plant: Plant, signals: Signals) -> NDArray[np.float64]:
    """Torque (N, 2) besides the plant's own that the accelerations of a motion need."""
    command = _commanded(plant.effects, signals)
    rows = []
    for t, q, v, a, tau in zip(signals.t, signals.q, signals.v, signals.a, command, strict=True):
        left = a - state_derivative(plant, np.array([*q, *v]), tau, t)[2:4]
        m11, m12, m22 = mass_matrix(q[1], *plant.theta[:4])
        rows.append((m11 * left[0] + m12 * left[1], m12 * left[0] + m22 * left[1]))
    return np.array(rows)


def _commanded(effects: Sequence[Effect], signals: Signals) -> NDArray[np.float64]:
    """The command (N,) after the static maps of some effects."""
    command = signals.u.copy()
    for effect in effects:
        if kernel := effect.type.kernels.get("command"):
            given = [effect.parameters[a] for a in effect.type.arguments["command"][1:]]
            command = np.array([kernel(u, *given) for u in command])
    return command
