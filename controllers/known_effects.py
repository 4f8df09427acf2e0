"""What a controller undoes of the effects that its plant carries: reading errors and the static command path.

Both are inverted numerically from the plant's own compiled equations, so an effect that is added to the library
is undone here without a word. Delay and lag are no static maps; the design model takes them in (see `design`).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.effects.dispatch import add_torques, map_command
from furuta_gym.plant.integration import rates
from furuta_gym.plant.layout import N_BASE
from furuta_gym.sensors import Sensors, angles_read

from .base import DesignError
from .design import choose_sensors

_SLOPE = 1e-6  # rad and rad/s
_TABLE = 513  # points at which the command map is looked at
_STRAIGHT = 3e-4  # of the supply: how far the torque on the table's lines may be from those points; no rig shows it


class KnownEffects:
    """Maps between readings and angles, and between wanted torque and command, for one plant.

    sensors: default is what the plant file says. offset (2,) [rad]: what they read at zero; `angles` takes it off too.
    torque_limits: the torques that ±`plant.supply` gives, the largest command that reaches the motor. `command_map` is
    the table (torque, command) when there is one.
    friction_speed [rad/s]: friction that `arm_torque` knows changes sign over this speed, slower than the plant's
    own 1/r, as estimated velocities are noisy.
    """

    def __init__(self, plant: Plant, sensors: Sensors | None = None, friction_speed: float = 0.1) -> None:
        # what depends on the time since a log's start cannot be known on the next run
        lasting = plant.keeping(lambda effect: not effect.type.memory and not effect.type.follows_clock)
        # friction_speed takes the place of the effect that is a sharpness
        self.plant = lasting.keeping(lambda effect: not effect.type.sharpens).replace(
            friction_sharpness=1.0 / friction_speed
        )
        known = self.plant.effects
        self.offset = np.array(choose_sensors(plant, sensors).offset)
        p, self._codes, self._rows = self.plant.packed()
        self._p = p[:, None]
        self._on_arm = self._codes[[e.type.place == "arm" for e in known]]
        plain = [e.type.place == "arm" and not e.type.dry for e in known]
        self._without_dry = self._codes[plain]
        self._touching = self._codes[["torque" in e.type.kernels and "arm" in e.type.place for e in known]]
        hooks = {hook for e in known for hook in e.type.kernels}
        self.reads_wrong = "sensor" in hooks
        self.command_map: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self.torque_limits = (-plant.supply, plant.supply)
        if "command" in hooks:
            self.command_map = self._tabulate(plant.supply)
            self.torque_limits = float(self.command_map[0][0]), float(self.command_map[0][-1])

    def limits_about(self, torque: float, name: str) -> tuple[float, float]:
        """`torque_limits` less the torque that holds the arm at zero. Raises DesignError, with the name of the
        controller, where that is more than the motor gives."""
        low, high = self.torque_limits
        if not low < torque < high:
            raise DesignError(
                f"{name}: holding the arm at zero takes {torque:.4g} {self.plant.unit}, more than the motor gives "
                f"({low:.4g} to {high:.4g}); check the plant's effects and u_max"
            )
        return low - torque, high - torque

    def _tabulate(self, u_max: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        u = np.linspace(-u_max, u_max, _TABLE)
        middle = _TABLE // 2
        tau = self._torques(u)
        tau[middle:] = np.maximum.accumulate(tau[middle:])
        tau[middle::-1] = np.minimum.accumulate(tau[middle::-1])
        if not tau[-1] > tau[0]:
            raise DesignError("no command within ±u_max moves this plant; check the size of its dead zone")
        # no more command than it takes to reach the limits, and a little slope to make dead zones invertible
        first, last = np.flatnonzero(tau <= tau[0])[-1], np.flatnonzero(tau >= tau[-1])[0]
        u, tau = u[first : last + 1], tau[first : last + 1]
        tau += 1e-6 * u
        corners = _corners(u, tau, _STRAIGHT * u_max)  # few, for a microcontroller's memory
        return tau[corners], u[corners]

    def _torques(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        tau = u.copy()
        map_command(np.repeat(self._p, u.size, axis=1), self._codes, tau)
        return tau

    def angles(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angles (2,) or (2, L) whose readings are y."""
        if not self.reads_wrong and not self.offset.any():
            return y
        wanted = y.reshape(2, -1) - self.offset[:, None]
        return angles_read(wanted, np.repeat(self._p, wanted.shape[1], axis=1), self._codes).reshape(y.shape)

    def command(self, torque: Any) -> Any:
        """The command whose static map gives the wanted motor torque."""
        return torque if self.command_map is None else np.interp(torque, *self.command_map)

    def torque_for(self, acceleration: Any, x: NDArray[np.float64]) -> Any:
        """Motor torque that gives the arm the acceleration [rad/s²], (L,) or float, in states x (4,) or (4, L).

        The plant's own equations are affine in the torque, so two evaluations tell (collocated linearization).
        """
        lanes = x.size // 4
        X = np.zeros((self._rows, lanes))
        X[:4] = x.reshape(4, lanes)
        P, zero, W = np.repeat(self._p, lanes, axis=1), np.zeros(lanes), np.zeros((2, lanes))
        K = np.empty((2, *X.shape))
        work = np.empty((N_BASE, lanes)), np.empty((2, lanes))
        rates(zero, X, zero, W, P, self._codes, *work, K[0])
        rates(zero, X, zero + 1.0, W, P, self._codes, *work, K[1])
        torque = (acceleration - K[0, 2]) / (K[1, 2] - K[0, 2])
        return torque if x.ndim == 2 else float(torque[0])

    @property
    def cancels_effects(self) -> bool:
        """Whether `arm_torque` holds more than Coulomb friction."""
        return bool(self._on_arm.size)

    def effect_slopes(self) -> NDArray[np.float64]:
        """(4,): change of the torque that the arm's effects exert near upright with q1, q2, q̇1 and q̇2. Without dry
        friction, which linear designs leave out too."""
        steps = np.concatenate([np.eye(4), -np.eye(4)], axis=1) * _SLOPE
        torque = self._torque(self._without_dry, steps)
        return (torque[:4] - torque[4:]) / (2.0 * _SLOPE)

    def torque_on_arm(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Torque (L,) of Coulomb friction and of all effects without memory on the arm, a tilt among them, in states x
        (4, L)."""
        return self._coulomb(x) + self._torque(self._touching, x)

    def _coulomb(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return -self.plant.theta[7] * np.tanh(self.plant.sharpness[0] * x[2])

    def _torque(self, codes: NDArray[np.int64], x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Torque (L,) of some effects on the arm in states x (4, L)."""
        lanes = x.shape[1]
        F = np.zeros((2, lanes))
        if codes.size:
            X = np.zeros((self._rows, lanes))
            X[:4] = x
            P, zero = np.repeat(self._p, lanes, axis=1), np.zeros(lanes)
            add_torques(zero, X, zero, P, codes, P[:N_BASE].copy(), F)
        return F[0]

    def arm_torque(self, x: NDArray[np.float64]) -> Any:
        """Torque, (L,) or float, that Coulomb friction and the arm's effects exert in states x (4,) or (4, L)."""
        X = np.ascontiguousarray(x.reshape(4, -1))
        torque = self._coulomb(X) + self._torque(self._on_arm, X)
        return torque if x.ndim == 2 else float(torque[0])


def _corners(x: NDArray[np.float64], y: NDArray[np.float64], tolerance: float) -> NDArray[np.int64]:
    """Indices of the points whose joining lines pass every point (x, y), x rising, within `tolerance` of y
    (Douglas & Peucker 1973)."""
    kept, spans = {0, x.size - 1}, [(0, x.size - 1)]
    while spans:
        a, b = spans.pop()
        inside = slice(a + 1, b)
        missed = np.abs(np.interp(x[inside], x[[a, b]], y[[a, b]]) - y[inside])
        if missed.size and missed.max() > tolerance:
            middle = a + 1 + int(missed.argmax())
            kept.add(middle)
            spans += [(a, middle), (middle, b)]
    return np.array(sorted(kept))
