"""Parameter sets of the bench: rigs as a workshop would describe them, by masses, lengths and inertias.

Written for the bench alone. Everything the kernels see is in units of the command ("V" sets: mechanical constants
divided by the torque per volt), as the paper does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

GRAVITY = 9.81


@dataclass(frozen=True)
class Bodies:
    """Two rigid bodies. SI units; `torque_per_command` [N·m per unit of the command]."""

    arm_mass: float
    arm_length: float  # axis to pendulum joint
    arm_com: float  # axis to the arm's centre of mass
    arm_inertia: float  # about the axis, motor included
    pendulum_mass: float
    pendulum_com: float  # joint to centre of mass
    # about the pendulum's centre of mass: parallel to the joint's axis, across axis and rod, along the rod
    pendulum_inertia: tuple[float, float, float]
    torque_per_command: float = 1.0

    def inertial(self) -> tuple[float, float, float, float, float]:
        """θ1 … θ5 in units of the command.

        Table 2 with the pendulum's full inertia tensor: the moments about the other two axes, which the paper
        leaves out, belong to θ2 (their difference) and θ1. For a thin rod θ2 = θ4.
        """
        ml = self.pendulum_mass * self.pendulum_com
        about_joint = ml * self.pendulum_com
        joint, across, along = self.pendulum_inertia
        si = (
            self.pendulum_mass * self.arm_length**2 + self.arm_inertia + along,
            about_joint + across - along,
            self.arm_length * ml,
            about_joint + joint,
            ml * GRAVITY,
        )
        return tuple(value / self.torque_per_command for value in si)  # type: ignore[return-value]

    def weight_moment(self) -> float:
        """Weight moment of arm and carried pendulum about the axis, in units of the command (G1)."""
        moment = self.arm_mass * self.arm_com + self.pendulum_mass * self.arm_length
        return moment * GRAVITY / self.torque_per_command


@dataclass(frozen=True)
class ParameterSet:
    """A kind of rig.

    inertia: θ1 … θ5 of Table 2; viscous, coulomb: (arm, pendulum); sharpness: r [s/rad] of tanh(r q̇);
    weight_moment: G1. `bodies` is None where θ belongs to no rigid body (the paper's Table 3).
    drive: amplitude of the excitation that suits this rig, 1 for the paper's, in units of the command.
    plain: factor on the strengths of effects, which makes strength 1 about equally plain on all sets.
    """

    name: str
    unit: str
    inertia: tuple[float, float, float, float, float]
    viscous: tuple[float, float]
    coulomb: tuple[float, float]
    weight_moment: float
    u_max: float
    encoder_counts: tuple[int, int]
    sample_time: float
    drive: float
    bodies: Bodies | None = None
    sharpness: float = 100.0
    plain: float = 1.0
    feedback: tuple[float, float, float, float] | None = None

    @property
    def theta(self) -> np.ndarray:
        """(9,) θ1 … θ9 of Table 2."""
        return np.array([*self.inertia, *self.viscous, *self.coulomb])

    @property
    def fall_time(self) -> float:
        """√(θ4/θ5) [s]: the time constant with which the pendulum falls."""
        return float(np.sqrt(self.inertia[3] / self.inertia[4]))

    @property
    def arm_length(self) -> float:
        """L1 = g θ3/θ5 [m]."""
        return GRAVITY * self.inertia[2] / self.inertia[4]

    @property
    def pendulum_com(self) -> float:
        """L1 θ2/θ3 [m]: l2 as θ alone tells it (the centre of mass if Table 2 holds as printed)."""
        return self.arm_length * self.inertia[1] / self.inertia[2]

    @property
    def pendulum_mass(self) -> float:
        """m2 = θ2/l2², in units of the command."""
        return self.inertia[1] / self.pendulum_com**2

    @property
    def swing_length(self) -> float:
        """g θ4/θ5 [m]: length of the point pendulum that swings alike."""
        return GRAVITY * self.inertia[3] / self.inertia[4]

    @property
    def swing_mass(self) -> float:
        """Mass of that point pendulum with the same θ4 and θ5, in units of the command."""
        return self.inertia[3] / self.swing_length**2

    def individual(self, number: int, scatter: float = 0.08) -> ParameterSet:
        """One rig of this kind: constants scattered by a relative standard deviation, cut at two of them."""
        if scatter == 0.0:
            return self
        rng = np.random.default_rng([number, 0x5E7])

        def near(*values: float) -> tuple[float, ...]:
            return tuple(v * (1.0 + scatter * float(np.clip(rng.standard_normal(), -2.0, 2.0))) for v in values)

        viscous, coulomb = near(*self.viscous), near(*self.coulomb)
        if self.bodies is None:
            mass, length = near(1.0, 1.0)  # a heavier, longer pendulum on the same arm keeps M > 0
            th1, th2, th3, th4, th5 = self.inertia
            inertia = (th1, th2 * mass * length**2, th3 * mass * length, th4 * mass * length**2, th5 * mass * length)
            return replace(self, inertia=inertia, viscous=viscous, coulomb=coulomb)  # type: ignore[arg-type]
        b = self.bodies
        arm_inertia, m2, l2 = near(b.arm_inertia, b.pendulum_mass, b.pendulum_com)
        factor = (m2 / b.pendulum_mass) * (l2 / b.pendulum_com) ** 2
        joint, across, along = b.pendulum_inertia
        bodies = replace(
            b,
            arm_inertia=arm_inertia,
            pendulum_mass=m2,
            pendulum_com=l2,
            pendulum_inertia=(factor * joint, factor * across, factor * along),
        )
        return _rigid(self, bodies, viscous=viscous, coulomb=coulomb)


def _rigid(base: ParameterSet, bodies: Bodies, **changes) -> ParameterSet:
    return replace(base, bodies=bodies, inertia=bodies.inertial(), weight_moment=bodies.weight_moment(), **changes)


_PAPER = ParameterSet(
    name="table3",
    unit="V",
    inertia=(0.19717, 0.03909, 0.01746, 0.01187, 0.40808),
    viscous=(0.0108, 0.00267),
    coulomb=(0.11456, 0.00732),
    weight_moment=1.0,
    u_max=10.0,
    encoder_counts=(4096, 4096),
    sample_time=0.002,
    drive=1.0,
    feedback=tuple(0.8 * k for k in (-9.1265, -5.2953, -41.5431, -5.6176)),  # type: ignore[arg-type]
)

_SERVO = _rigid(
    ParameterSet(
        name="servo",
        unit="V",
        inertia=(0.0,) * 5,  # type: ignore[arg-type]
        viscous=(0.06, 0.004),
        coulomb=(0.12, 0.015),
        weight_moment=0.0,
        u_max=10.0,
        encoder_counts=(2048, 2048),
        sample_time=0.002,
        drive=1.0,
        plain=1.6,
    ),
    Bodies(
        arm_mass=0.095,
        arm_length=0.085,
        arm_com=0.020,
        arm_inertia=1.2e-4,
        pendulum_mass=0.024,
        pendulum_com=0.0645,
        pendulum_inertia=(3.33e-5, 3.33e-5, 2.0e-7),
        torque_per_command=0.042 / 8.4,  # torque constant over winding resistance
    ),
)

_WORKSHOP = _rigid(
    ParameterSet(
        name="workshop",
        unit="N·m",
        inertia=(0.0,) * 5,  # type: ignore[arg-type]
        viscous=(0.015, 0.002),
        coulomb=(0.08, 0.008),
        weight_moment=0.0,
        u_max=8.0,
        encoder_counts=(8192, 4096),
        sample_time=0.004,
        drive=0.8,
        plain=0.35,
    ),
    Bodies(
        arm_mass=0.4,
        arm_length=0.35,
        arm_com=0.12,
        arm_inertia=0.035,
        pendulum_mass=0.25,
        pendulum_com=0.28,
        pendulum_inertia=(0.006, 0.0045, 0.0016),
    ),
)

_DESK = _rigid(
    ParameterSet(
        name="desk",
        unit="N·m",
        inertia=(0.0,) * 5,  # type: ignore[arg-type]
        viscous=(0.002, 0.0003),
        coulomb=(0.012, 0.0008),
        weight_moment=0.0,
        u_max=1.0,
        encoder_counts=(4096, 4096),
        sample_time=0.001,
        drive=0.1,
        plain=0.8,
    ),
    Bodies(
        arm_mass=0.15,
        arm_length=0.20,
        arm_com=0.08,
        arm_inertia=0.004,
        pendulum_mass=0.10,
        pendulum_com=0.15,
        pendulum_inertia=(7.5e-4, 7.5e-4, 5.0e-6),
    ),
)

SETS: dict[str, ParameterSet] = {s.name: s for s in (_PAPER, _SERVO, _WORKSHOP, _DESK)}
"""The paper's Table 3 (no rigid body has this θ), a small servo in volts, two rigs in N·m."""


def parameter_set(which: str | ParameterSet) -> ParameterSet:
    """A set by name; ValueError names those there are."""
    if isinstance(which, ParameterSet):
        return which
    if which not in SETS:
        raise ValueError(f"unknown parameter set {which!r}. Expected one of: {', '.join(SETS)}.")
    return SETS[which]
