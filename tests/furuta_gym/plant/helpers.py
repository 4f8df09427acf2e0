"""Ways from a Plant to a trajectory and to its oracle."""

import numpy as np

from furuta_gym.plant import EFFECTS, Effect, Plant
from furuta_gym.plant.advance import advance
from furuta_gym.plant.dynamics import energy
from furuta_gym.plant.effects.dispatch import read_sensors
from furuta_gym.plant.linearization import state_derivative
from tests.oracles.reference import Reference, static_command


def oracle(plant: Plant) -> Reference:
    """The plain-Python reference of the same plant."""
    effects = {effect.name: dict(effect.parameters) for effect in plant.effects}
    return Reference(tuple(plant.theta), plant.friction_sharpness, effects)


def memory_row(plant: Plant, name: str) -> int:
    """First row of an effect's memory in the state."""
    row = 4
    for effect in plant.effects:
        if effect.name == name:
            return row
        row += len(effect.type.memory)
    raise KeyError(name)


def run(plant: Plant, x0, t_u, u, stop, h_max=1e-3, w=(0.0, 0.0), settled=True) -> np.ndarray:
    """States (len(t_u) + 1, rows) at the sample times t_u and at `stop`, by the compiled core.

    settled: an actuator with lag starts on the first command, as the oracle does; otherwise at zero.
    """
    p, codes, rows = plant.packed()
    X = np.zeros((rows, 1))
    X[: len(x0), 0] = x0
    if settled and plant.effect("actuator_lag"):
        effects = {effect.name: dict(effect.parameters) for effect in plant.effects}
        X[memory_row(plant, "actuator_lag")] = static_command(float(u[0]), effects)
    t_u, U = np.asarray(t_u, dtype=float), np.array(u, dtype=float)[:, None]
    W, states = np.array(w, dtype=float)[:, None], [X[:, 0].copy()]
    for j, (a, b) in enumerate(zip(t_u, [*t_u[1:], stop], strict=True)):
        advance(X, a, b, t_u, U, j, W, p[:, None], codes, h_max)
        states.append(X[:, 0].copy())
    return np.array(states)


def reference_run(plant: Plant, x0, t_u, u, stop, w=(0.0, 0.0), **solver) -> np.ndarray:
    """The oracle's states at the same times as `run`."""
    return oracle(plant).run(x0, [*t_u, stop], t_u, u, w, **solver)


def readings(plant: Plant, q1: float, q2: float) -> tuple[float, float]:
    """Ideal encoders' readings by the compiled sensor maps."""
    p, codes, rows = plant.packed()
    X = np.zeros((rows, 1))
    X[:2, 0] = q1, q2
    Y = X[:2].copy()
    read_sensors(X, p[:, None], codes, Y)
    return float(Y[0, 0]), float(Y[1, 0])


def mechanical_energy(plant: Plant, x) -> float:
    """½ q̇ᵀ M q̇ + θ5 cos q2 by the compiled core."""
    return energy(x[1], x[2], x[3], *plant.theta[:5])


def derivative(plant: Plant, x, tau: float, t: float = 0.0) -> np.ndarray:
    """dx/dt (4 + memory,) at one point by the compiled core."""
    return state_derivative(plant, np.asarray(x, dtype=float), tau, t)


def square_waves(t) -> np.ndarray:
    """A command that changes sign, size and pace, within ±1.5."""
    t = np.asarray(t)
    return np.sign(np.sin(2 * np.pi * 3 * t + 0.3)) + 0.5 * np.sign(np.sin(2 * np.pi * 7.7 * t + 1.0))


def neutral(name: str, **shapes: float) -> Effect:
    """The effect at neutral size, shape parameters as given or at their defaults."""
    return Effect(name, EFFECTS[name].neutral() | shapes)
