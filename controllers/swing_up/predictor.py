"""The state at the moment a command takes hold: an observer on the plant's own equations, run on over the delay."""

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.advance import advance
from furuta_gym.plant.dynamics import mass_matrix
from furuta_gym.plant.effects.dispatch import command_delays
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import LONGEST_STEP, integration_step

from ..design import DesignModel, riccati, torque_noise_intensity
from ..known_effects import KnownEffects
from ..linear.lqg import measurement_noise

_FASTEST = 300.0  # rad/s; no rig is faster, and a wrong reading must not leave a speed that takes long to forget
_SHARPEST = 30.0  # s/rad; estimated speeds are not sure enough for friction that turns over faster
_JUMP = 1.0  # rad; a reading so far from what was expected is taken as a new start


def steady(plant: Plant) -> Plant:
    """The plant without the effects that follow the time since a log's start, which the next run cannot know."""
    return plant.keeping(lambda effect: not effect.type.follows_clock)


def _smooth(plant: Plant) -> Plant:
    """The plant with friction no sharper than `_SHARPEST`, also where an effect gives it another sharpness."""
    effect = plant.sharpening
    other = tuple(effect.parameters.values()) if effect else (0.0, 0.0)  # 0 keeps the plant's own
    r1, r2 = (min(new or own, _SHARPEST) for new, own in zip(other, plant.sharpness, strict=True))
    return plant.keeping(lambda effect: not effect.type.sharpens).replace(friction_sharpness=(r1, r2))


class Predictor:
    """Follows L rigs from their readings and the commands sent; predicts them over the delay of the command.

    Between samples the plant's equations run with the effects it carries, memory and delay included. A reading then
    corrects angle and speed of its own axis, by the steady Kalman gain of an angle whose acceleration is unknown.
    `delay` [s] is the plant's. States are (4 + memory, L): q1, q2, q̇1, q̇2 [rad, rad/s], then the effects' memory.
    """

    def __init__(self, plant: Plant, sample_time: float, sensors: Sensors) -> None:
        self.plant = _smooth(steady(plant))
        self.sample_time = sample_time
        self.known = KnownEffects(plant, sensors)
        p, self._codes, self._rows = self.plant.packed()
        self._p = p[:, None]
        late = np.zeros(1)
        command_delays(self._p, self._codes, late)
        self.delay = float(late[0])
        self._past = int(np.ceil(self.delay / sample_time - 1e-9)) + 2
        self._h = integration_step(self.plant, LONGEST_STEP, sample_time)
        self._gains = _gains(plant, sample_time, sensors)
        self.restart()

    def restart(self, state: NDArray[np.float64] | None = None) -> None:
        """Forget the past. state (4, L): what is known before the first reading."""
        self._X: NDArray[np.float64] | None = None
        self._given = state

    def _begin(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        lanes = q.shape[1]
        X = np.zeros((self._rows, lanes))
        X[:2] = q
        if self._given is not None:
            X[:4] = self._given
        self._P = np.repeat(self._p, lanes, axis=1)
        self._U = np.zeros((self._past, lanes))
        self._W = np.zeros((2, lanes))
        self._sent = self.sample_time * np.arange(1 - self._past, 1)  # s, of the rows of U, at the newest command
        self._sent[0] = -np.inf
        return X

    def update(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """The state now, (4 + memory, L), from readings (2, L)."""
        q = self.known.angles(y)
        if self._X is None:
            self._X = self._begin(q)
            return self._X
        X, error = self._X, q - self._X[:2]
        lost = ~(np.abs(error).max(axis=0) < _JUMP)
        X[:2] += self._gains[:, :1] * error
        X[2:4] += self._gains[:, 1:] * error
        np.clip(X[2:4], -_FASTEST, _FASTEST, out=X[2:4])
        if lost.any():
            X[:, lost] = 0.0
            X[:2, lost] = q[:, lost]
        return X

    def ahead(self, beyond: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The states (4 + memory, L) when a command given now takes hold, and `beyond` [s] later if none is given."""
        assert self._X is not None
        first = self._X.copy()
        sent, last = self._sent - self.sample_time, self._past - 1
        if self.delay > 0:
            advance(first, 0.0, self.delay, sent, self._U, last, self._W, self._P, self._codes, self._h)
        later = first
        if beyond > 0:
            later, end = first.copy(), self.delay + beyond
            advance(later, self.delay, end, sent, self._U, last, self._W, self._P, self._codes, self._h)
        return first, later

    def send(self, command: NDArray[np.float64]) -> None:
        """Take in the commands (L,) that are really sent now, and go on to the next sample."""
        assert self._X is not None
        self._U[:-1] = self._U[1:]
        self._U[-1] = command
        last = self._past - 1
        advance(self._X, 0.0, self.sample_time, self._sent, self._U, last, self._W, self._P, self._codes, self._h)


def without_delay(plant: Plant) -> Plant:
    """The plant as it acts on a command that has arrived: what is controlled from predicted states."""
    return plant.without("input_delay")


def lagged_torque_row(plant: Plant) -> int | None:
    """The row of the state that holds the lagged motor torque; None without `actuator_lag`."""
    codes = plant.packed().codes
    rows = [int(codes[i, 2]) for i, e in enumerate(plant.effects) if e.name == "actuator_lag"]
    return rows[0] if rows else None


def feedback_state(X: NDArray[np.float64], model: DesignModel, row: int | None) -> NDArray[np.float64]:
    """The rows of X that a gain of `design_model` without delay multiplies: angles, speeds, lagged torque."""
    return X[:4] if model.size == 4 or row is None else np.vstack([X[:4], X[row] - model.torque])


def _gains(plant: Plant, sample_time: float, sensors: Sensors) -> NDArray[np.float64]:
    """[angle, speed] gains of each axis (2, 2): steady Kalman filters of an angle under white acceleration."""
    import control

    m11, m12, m22 = mass_matrix(0.0, *plant.theta[:4])
    inverse = np.linalg.inv(np.array([[m11, m12], [m12, m22]]))
    intensity = np.diag(inverse @ np.diag(torque_noise_intensity(plant)) @ inverse.T)
    T, R = sample_time, measurement_noise(sensors)
    A, C = np.array([[1.0, T], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    gains = []
    for axis in range(2):
        Q = intensity[axis] * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]])
        _, P, _ = riccati(control.dlqe, A, np.eye(2), C, Q, R[axis : axis + 1, axis : axis + 1])
        gains.append(P[:, 0] / (P[0, 0] + R[axis, axis]))
    return np.array(gains)
