"""The torque of effects as a function of the motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Effect, EffectType, Plant
from furuta_gym.plant.dynamics import mass_matrix
from furuta_gym.plant.linearization import state_derivative

from ..discrepancy.basis import Signals
from ..kalman.record import stretches
from ..logs.log import Log
from ..validation.gap import filtered

_MOST = 1500  # points of the motion at which the torque is computed
_HOOKS = {"torque", "theta", "command"}


def is_function_of_motion(effect: EffectType) -> bool:
    """Whether an effect's torque is one: it keeps no memory, acts on no reading and does not delay the command."""
    return set(effect.kernels) <= _HOOKS and not effect.memory


def motion_of(plant: Plant, logs: Sequence[Log]) -> Signals:
    """Up to 1500 points of the filtered motion along the longest stretch of the logs without a gap.

    Raises ValueError where the plant's filter loses the log.
    """
    longest = max((stretch.piece for stretch in stretches(logs)), key=len)
    signals = Signals.of(filtered(plant, longest))
    every = slice(None, None, -(-len(signals.t) // _MOST))
    return Signals(*(getattr(signals, f)[every] for f in ("t", "q", "v", "a", "u", "expected")))


def added_torque(plant: Plant, names: Sequence[str], signals: Signals) -> NDArray[np.float64]:
    """Torque (N, 2) [{u}] that the plant's effects `names` add to the arm's and the pendulum's row at points of a
    motion. Each must be a function of the motion (see `is_function_of_motion`)."""
    effects = [effect for effect in plant.effects if effect.name in names]
    without = plant.without(*names).replace(covariance=None)
    command = _commanded(effects, signals)
    rows = []
    for t, q, v, u, tau in zip(signals.t, signals.q, signals.v, signals.u, command, strict=True):
        x = np.array([*q, *v])
        apart = state_derivative(plant, x, tau, t)[2:4] - state_derivative(without, x, u, t)[2:4]
        m11, m12, m22 = mass_matrix(q[1], *without.theta[:4])
        rows.append((m11 * apart[0] + m12 * apart[1], m12 * apart[0] + m22 * apart[1]))
    return np.array(rows)


def _commanded(effects: Sequence[Effect], signals: Signals) -> NDArray[np.float64]:
    """The command (N,) after the static maps of some effects."""
    command = signals.u.copy()
    for effect in effects:
        if kernel := effect.type.kernels.get("command"):
            given = [effect.parameters[a] for a in effect.type.arguments["command"][1:]]
            command = np.array([kernel(u, *given) for u in command])
    return command
