"""The same pendulum as MuJoCo builds it from bodies and joints: no equation of motion is written here.

The pendulum's rotational inertia is J2 about the joint's axis and J2/2 about the two others: a disc that shares
the joint's axis. That is the limiting rigid body for which M11 holds θ2 = m2 l2² exactly as Table 2 defines it;
the part J2/2 that turns with the arm is taken from J1, so J1 > J2/2 is needed. `rod=True` builds the thin rod
instead (J2 across, nothing along), whose M11 is θ1 + (m2 l2² + J2) sin² q2: θ2 = θ4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_TEMPLATE = """
<mujoco>
  <option timestep="{step:.17g}" gravity="0 0 {down:.17g}" integrator="RK4">
    <flag contact="disable" constraint="disable"/>
  </option>
  <worldbody>
    <body name="arm">
      <joint name="q1" type="hinge" axis="0 0 1" damping="{damping1:.17g}"/>
      <inertial pos="0 0 0" mass="1" diaginertia="{arm:.17g} {arm:.17g} {arm:.17g}"/>
      <body name="pendulum" pos="{L1:.17g} 0 0">
        <joint name="q2" type="hinge" axis="-1 0 0" damping="{damping2:.17g}"/>
        <inertial pos="0 0 {l2:.17g}" mass="{m2:.17g}" diaginertia="{about:.17g} {across:.17g} {along:.17g}"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@dataclass(frozen=True)
class RigidSet:
    """A physically consistent pendulum in SI units; damping in N·m·s/rad at the two joints."""

    J1: float
    m2: float
    L1: float
    l2: float
    J2: float
    g: float = 9.81
    damping: tuple[float, float] = (0.0, 0.0)
    rod: bool = False

    @classmethod
    def from_theta(cls, theta, g: float = 9.81) -> RigidSet:
        """Masses and lengths behind a consistent θ (Table 2): L1 = g θ3/θ5, l2 = g θ2/θ5, m2 = θ2/l2²."""
        theta = [float(value) for value in theta]
        L1, l2 = g * theta[2] / theta[4], g * theta[1] / theta[4]
        m2 = theta[1] / l2**2
        return cls(theta[0] - m2 * L1**2, m2, L1, l2, theta[3] - theta[1], g, (theta[5], theta[6]))

    @property
    def theta(self) -> np.ndarray:
        """θ1…θ9 by Table 2 (without Coulomb friction); for the rod θ2 = θ4."""
        second = self.m2 * self.l2**2 + (self.J2 if self.rod else 0.0)
        return np.array(
            [
                self.m2 * self.L1**2 + self.J1,
                second,
                self.m2 * self.L1 * self.l2,
                self.m2 * self.l2**2 + self.J2,
                self.m2 * self.l2 * self.g,
                *self.damping,
                0.0,
                0.0,
            ]
        )

    def xml(self, step: float = 1e-4) -> str:
        """MJCF text of the pendulum, RK4 with the given step [s]."""
        turning_with_arm = 0.0 if self.rod else self.J2 / 2
        if turning_with_arm >= self.J1:
            raise ValueError(f"J1 = {self.J1:g} must exceed J2/2 = {turning_with_arm:g} for this body")
        tiny = 1e-6 * self.J2  # MuJoCo wants three positive moments that keep the triangle inequality
        across, along = (self.J2, tiny) if self.rod else (self.J2 / 2 + tiny, self.J2 / 2 + tiny)
        arm = self.J1 - (tiny if self.rod else along)
        across += tiny if self.rod else 0.0  # keeps θ2 = across − along + m2 l2² exact
        return _TEMPLATE.format(
            step=step,
            down=-self.g,
            damping1=self.damping[0],
            damping2=self.damping[1],
            arm=arm,
            L1=self.L1,
            l2=self.l2,
            m2=self.m2,
            about=self.J2,
            across=across,
            along=along,
        )

    def run(self, x0, times, step: float = 1e-4) -> np.ndarray:
        """States (n, 4) = (q1, q2, v1, v2) of the motion from x0 without input; times are multiples of the step."""
        import mujoco

        model = mujoco.MjModel.from_xml_string(self.xml(step))
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = x0[:2], x0[2:]
        states = []
        for t in times:
            for _ in range(round((t - data.time) / step)):
                mujoco.mj_step(model, data)
            states.append([*data.qpos, *data.qvel])
        return np.array(states)
