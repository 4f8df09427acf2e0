"""An identified plant as a MuJoCo model (MJCF)."""

import math
import os
from pathlib import Path

import numpy as np

from furuta_gym.files import write_whole
from furuta_gym.plant import TABLE_3, Plant
from furuta_gym.plant.rigid_body import nearest_rigid_body, physical_consistency

GRAVITY = 9.81
STEP = 0.0005  # s of the simulation
ARM = 0.1  # of the arm's length, where its own weight sits at most; a weight nearer the axis has less inertia
CARRIED = ("arm_spring", "actuator_lag", "input_saturation", "input_offset", "base_tilt")
"""The effects that MJCF has words for."""

_MODEL = """\
<!--
  A Furuta pendulum as furuta-gym identified it. theta = {theta} ({unit}).
{moved}
  Torques are in the command's unit ({unit}), and so are mass and inertia: {unit_note}
  Lengths are in m. Positions: q1 the arm, q2 the pendulum, zero upright; ctrl is the command.

  Model (5) has J1 in M11 and J2 in M22 alone, which is what `armature` means; the pendulum is a point mass besides.
  Carried exactly: M, C, g, viscous friction{carried}.
  Carried closely: Coulomb friction. `frictionloss` is a dry friction that sticks; the plant's is
  Fc tanh(r v) with r = {sharpness} s/rad, which is the same at speeds well above 1/r and creeps below.
  Not carried: encoders, {slew}{short}{limits}and the sampling of the command; hold ctrl for one sample time of the rig.
-->
<mujoco model="furuta">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{step}" gravity="{gravity}" integrator="RK4">
    <flag contact="disable"/>
  </option>
  <default>
    <joint solreffriction="0.002 1" solimpfriction="0.99 0.99 0.001"/>
  </default>
  <worldbody>
    <light pos="0 0 {far:.6g}"/>
    <body name="arm">
      <joint name="q1" type="hinge" axis="0 0 1" armature="{J1!r}" damping="{Fv1!r}" frictionloss="{Fc1!r}"{spring}/>
      <inertial pos="{arm_at!r} 0 0" mass="{arm_mass!r}" diaginertia="{tiny!r} {tiny!r} {tiny!r}"/>
      <geom type="capsule" fromto="0 0 0 {L1!r} 0 0" size="{thick:.6g}" rgba="0.24 0.26 0.30 1" mass="0"/>
      <body name="pendulum" pos="{L1!r} 0 0">
        <joint name="q2" type="hinge" axis="-1 0 0" armature="{J2!r}" damping="{Fv2!r}" frictionloss="{Fc2!r}"/>
        <inertial pos="0 0 {l2!r}" mass="{m2!r}" diaginertia="{tiny!r} {tiny!r} {tiny!r}"/>
        <geom type="capsule" fromto="0 0 0 0 0 {rod:.6g}" size="{thin:.6g}" rgba="0.84 0.35 0.19 1" mass="0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    {actuator}
  </actuator>
  <sensor>
    <jointpos joint="q1"/>
    <jointpos joint="q2"/>
  </sensor>
</mujoco>
"""


def mjcf(plant: Plant) -> str:
    """The MJCF text of a physically consistent plant.

    Lengths and masses follow from θ by Table 2: L1 = g θ3/θ5, l2 = g θ2/θ5, m2 = θ2/l2², J1 = θ1 − θ3²/θ2,
    J2 = θ4 − θ2. Where an estimate is no rigid body's by no more than its error bars, the nearest one is taken. A
    common factor of all θ (volts instead of N·m) scales masses and torques alike and leaves every acceleration as it
    is. Raises ValueError for a θ that no rigid body has, and for effects that MJCF cannot carry.
    """
    check = physical_consistency(plant.theta, plant.covariance)
    if not check.consistent:
        way = "Identify the plant with `furuta identify … --physical`, best from logs that also hang"
        if np.array_equal(plant.theta, TABLE_3.theta):
            way = (
                "The set table3 holds the paper's numbers as printed. Export qube, large or an identified plant instead"
            )
        raise ValueError(
            f"no rigid body has these parameters: {'; '.join(check.failures)}. In a rigid body no mass, inertia or "
            f"friction is negative, and MuJoCo needs one. {way}, or simulate this plant with FurutaID-v0"
        )
    strange = [effect.name for effect in plant.effects if effect.name not in CARRIED]
    if strange:
        raise ValueError(
            f"MJCF cannot carry {', '.join(strange)} (it can: {', '.join(CARRIED)}); export the plant without, or "
            "simulate it with FurutaID-v0"
        )
    saturation, offset = plant.effect("input_saturation"), plant.effect("input_offset")
    if saturation is not None and offset is not None:
        raise ValueError(
            "MJCF limits a command before it adds an offset to it, and this plant's input_saturation limits the sum; "
            "export the plant without one of them, or simulate it with FurutaID-v0"
        )
    if saturation is not None and saturation.parameters["knee"] > 0:
        raise ValueError(
            f"MJCF has no round knee, and this input_saturation has {saturation.parameters['knee']:.2g}; fit it again "
            "with fixed={'input_saturation.knee': 0}, or simulate it with FurutaID-v0"
        )
    theta = nearest_rigid_body(plant.theta, plant.covariance)
    th1, th2, th3, th4, th5, Fv1, Fv2, Fc1, Fc2 = (float(v) for v in theta)
    moved = "" if np.array_equal(theta, plant.theta) else "  Moved within its error bars to the nearest rigid body.\n"
    L1, l2 = GRAVITY * th3 / th5, GRAVITY * th2 / th5
    J1, J2 = max(th1 - th3 * th3 / th2, 0.0), max(th4 - th2, 0.0)
    spring, lag, tilt = (plant.effect(name) for name in ("arm_spring", "actuator_lag", "base_tilt"))
    lean = tilt.parameters if tilt else {"αx": 0.0, "αy": 0.0, "G1": 0.0}
    arm_at, arm_mass = _weight_of_the_arm(lean["G1"] - th5 * th3 / th2, L1, J1) if tilt else (0.0, 0.0)
    if tilt and lean["G1"] != th5 * th3 / th2 and not arm_mass:
        raise ValueError("this plant's arm has no inertia of its own that could carry the weight G1 of base_tilt")
    limit = min(plant.supply, saturation.parameters["m"]) if saturation else plant.supply
    motor = f'name="u" joint="q1" ctrlrange="{-limit!r} {limit!r}"'
    if offset:
        motor += f' biastype="affine" biasprm="{offset.parameters["b"]!r} 0 0"'
    T = lag.parameters["T"] if lag else 0.0
    short, carried = "", [effect.name for effect in plant.effects]
    if lag and T < 0.5 * STEP:  # RK4 diverges where the step is 2.8 times as long, and no rig shows so short a lag
        short = f"the actuator's lag of {T:g} s, too short for this time step, " if T > 0 else ""
        carried.remove(lag.name)
        T = 0.0
    tiny = max(1e-9 * th4, 2e-15)  # MuJoCo wants moving bodies to have some mass and inertia of their own
    # where a rig is switched off; as a range of the joint it would be a stop that the arm does not have
    told = [
        (name, unit) for name, unit in (("arm_travel", "rad"), ("arm_speed", "rad/s")) if name in (plant.limits or {})
    ]
    return _MODEL.format(
        theta=", ".join(f"{v:.6g}" for v in theta),
        unit=plant.unit,
        unit_note="kg and kg m^2." if plant.unit == "N·m" else "a common factor that no acceleration feels.",
        carried="".join(f", {name}" for name in carried),
        step=STEP,
        short=short,
        sharpness=" and ".join(f"{r:g}" for r in dict.fromkeys(plant.sharpness)),
        gravity=f"{GRAVITY * lean['αx']!r} {GRAVITY * lean['αy']!r} {-GRAVITY!r}",
        slew="" if plant.limit("slew", math.inf) == math.inf else "the largest slew of the command, ",
        limits="".join(f"the rig's {name} of {plant.limit(name, 0.0):g} {unit}, " for name, unit in told),
        far=4 * (abs(L1) + l2),
        moved=moved,
        J1=J1 - arm_mass * arm_at**2,
        arm_at=arm_at,
        arm_mass=max(arm_mass, tiny),
        J2=J2,
        Fv1=Fv1,
        Fv2=Fv2,
        Fc1=Fc1,
        Fc2=Fc2,
        spring=f' stiffness="{spring.parameters["k"]!r}" springref="{spring.parameters["q1n"]!r}"' if spring else "",
        tiny=tiny,
        L1=L1,
        l2=l2,
        m2=th2 / l2**2,
        thick=0.06 * abs(L1),
        thin=0.04 * abs(L1),
        rod=1.5 * GRAVITY * th4 / th5,  # of a uniform rod, to look at
        actuator=f'<general {motor} dyntype="filter" dynprm="{T!r}"/>' if T > 0 else f"<general {motor}/>",
    )


def _weight_of_the_arm(moment: float, length: float, inertia: float) -> tuple[float, float]:
    """Where on the arm [m], and how heavy, a weight of a moment is that a tilted base shows; behind the axis for a
    moment below 0. It takes no more than half of the arm's own inertia, which the armature has without it."""
    if moment == 0.0:
        return 0.0, 0.0
    at = math.copysign(min(ARM * abs(length), 0.5 * inertia * GRAVITY / abs(moment)), moment)
    return at, moment / (GRAVITY * at) if at else 0.0


def export_mjcf(plant: Plant, path: str | os.PathLike[str]) -> Path:
    """Write a physically consistent plant as MuJoCo XML to `path` and return the path.

    Raises ValueError for what `mjcf` refuses.
    """
    return write_whole(path, mjcf(plant))
