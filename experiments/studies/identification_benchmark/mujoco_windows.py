"""A peer: MuJoCo's own least squares on MuJoCo's own rollouts over short windows of the log.

`mujoco.sysid` is made of these two, `mujoco.minimize.least_squares` and `mujoco.rollout`; of MuJoCo 4.0's wheel without
the extra `sysid` only they can be used (`mujoco.sysid` imports colorama and tabulate, and is an empty name without
them). As there, initial states are given and not estimated: smoothed readings and their derivatives. Windows are short,
because a free run of the upright pendulum diverges. Friction is MuJoCo's: viscous damping and a frictionloss.
"""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from furuta_gym.plant import Plant
from identification.estimation.start import candidates
from identification.estimation.uncertainty import inverse_information
from identification.logs.log import Log

WINDOW = 0.3  # s
_SMOOTHING = 0.03  # s, of the readings that give initial states
_KEPT = 0.01  # s between the readings that are compared
_LONGEST_STEP = 2e-3  # s
_ITERATIONS = 25
_GRAVITY = 9.81
_NEUTRAL = np.array([1, 0.1, 0.1, 1, 1, 0, 0, 0, 0.0])

_XML = """
<mujoco>
  <compiler inertiafromgeom="false"/>
  <option gravity="0 0 -9.81" timestep="{step:.17g}" integrator="implicitfast"><flag contact="disable"/></option>
  <worldbody>
    <body name="arm">
      <joint name="arm" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <body name="pendulum" pos="1 0 0">
        <joint name="pendulum" axis="-1 0 0"/>
        <inertial pos="0 0 1" mass="1" diaginertia="1 1 1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="arm"/></actuator>
</mujoco>
"""

_STEP = 1e-4  # of a logarithm

Array = NDArray[np.float64]


def fit(log: Log) -> tuple[Array, Array]:
    """θ̂ (9,) and standard deviations (9,) of a rigid rig (θ4 > θ2, θ1 > θ3²/θ2 + θ4 − θ2) from one log.

    Raises ValueError where MuJoCo cannot take the motion on.
    """
    from mujoco import minimize

    problem = _Windows(log)
    start = candidates([log], Plant(_NEUTRAL, unit=log.input_unit, u_max=1.0))[0].plant
    x0 = _to_x(start.theta)
    width = np.array([3.0] * 5 + [7.0] * 4)  # of the search, in ln
    x, _ = minimize.least_squares(
        x0, problem.residuals, [(x0 - width)[:, None], (x0 + width)[:, None]], verbose=0, max_iter=_ITERATIONS
    )
    x = np.ravel(x)
    ahead, behind = (problem.residuals(x[:, None] + sign * _STEP * np.eye(9)) for sign in (1.0, -1.0))
    jacobian, residual = (ahead - behind) / (2.0 * _STEP), problem.residuals(x[:, None]).ravel()
    if not (np.isfinite(jacobian).all() and np.isfinite(residual).all()):
        raise ValueError("MuJoCo's least squares ended where the rollouts are not finite")
    variance = residual @ residual / (residual.size - x.size)
    covariance = variance * inverse_information(jacobian.T @ jacobian)
    slope = np.stack([(_to_theta(x + h) - _to_theta(x - h)) / 2e-6 for h in 1e-6 * np.eye(9)], axis=1)
    return _to_theta(x), np.sqrt(np.diag(slope @ covariance @ slope.T))


def _to_x(theta: Array) -> Array:
    """Logarithms of arm inertia, l, m, L1, J2, then of damping and frictionloss of both joints."""
    th1, th2, th3, th4, th5 = theta[:5]
    m, length, l1, j2 = th5**2 / (_GRAVITY**2 * th2), th2 * _GRAVITY / th5, th3 * _GRAVITY / th5, th4 - th2
    arm = max(th1 - m * l1**2 - j2, 0.05 * th1)
    least = np.array([0.05 * th1, 0.02 * th4, 1e-3 * th5, 1e-4 * th5])
    return np.log(np.array([arm, length, m, l1, j2, *np.maximum(theta[5:], least)]))


def _to_theta(x: Array) -> Array:
    arm, length, m, l1, j2 = np.exp(x[:5])
    ml = m * length
    rigid = [arm + m * l1**2 + j2, ml * length, l1 * ml, ml * length + j2, ml * _GRAVITY]
    return np.array([*rigid, *np.exp(x[5:])])


class _Windows:
    """The log cut into windows, and the residuals of MuJoCo's rollouts over them in units of the reading noise."""

    def __init__(self, log: Log) -> None:
        T = log.sample_time
        self.steps = max(1, math.ceil(T / _LONGEST_STEP - 1e-6))
        n = round(WINDOW / T)
        width = 2 * max(round(0.5 * _SMOOTHING / T), 2) + 1
        q, v = (np.asarray(savgol_filter(log.angles, width, 3, deriv=d, delta=T, axis=0)) for d in (0, 1))
        first = np.arange(width, len(log) - n - width, n)
        state = np.column_stack([np.zeros(len(first)), q[first], v[first]])
        control = np.stack([np.repeat(log.u[k : k + n], self.steps) for k in first])[:, :, None]
        self.every = max(1, round(_KEPT / T))
        at = np.arange(self.every, n + 1, self.every)
        self.measured = np.stack([log.angles[k + at] for k in first])
        self.at = at * self.steps - 1
        self.noise = np.maximum(log.noise_std, 1e-6)
        self.state, self.control = state, control
        mujoco: Any = import_module("mujoco")  # an extra, and its stubs leave most of it out
        self.spec = mujoco.MjSpec.from_string(_XML.format(step=T / self.steps))
        self.data = mujoco.MjData(self.spec.compile())

    def _model(self, x: Array):
        """The MuJoCo model of coordinates x (9,)."""
        arm, length, m, l1, j2, *friction = np.exp(x)
        body, pendulum = self.spec.body("arm"), self.spec.body("pendulum")
        body.inertia = [arm] * 3
        pendulum.pos = [l1, 0.0, 0.0]
        pendulum.ipos = [0.0, 0.0, length]
        pendulum.mass = m
        pendulum.inertia = [j2] * 3
        for i, name in enumerate(("arm", "pendulum")):
            joint = self.spec.joint(name)
            joint.damping = [friction[i], 0.0, 0.0]
            joint.frictionloss = friction[2 + i]
        return self.spec.compile()

    def residuals(self, x: Array) -> Array:
        """(m, k) residuals of k points x (9, k)."""
        from mujoco import rollout

        found = []
        for column in x.T:
            state, _ = rollout.rollout(self._model(column), self.data, self.state, self.control)
            angles = np.asarray(state)[:, self.at, 1:3]
            found.append(((angles - self.measured) / self.noise).ravel())
        return np.stack(found, axis=1)
