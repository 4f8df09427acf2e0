"""MuJoCo's rigid bodies for the sets that are rigid bodies, called by address from the compiled integrator."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from .sets import GRAVITY, Bodies

_XML = """
<mujoco model="furuta">
  <compiler angle="radian" inertiafromgeom="false"/>
  <option gravity="{gx:.17g} {gy:.17g} {gz:.17g}">
    <flag contact="disable" constraint="disable"/>
  </option>
  <worldbody>
    <body name="arm">
      <joint name="arm" type="hinge" axis="0 0 1"/>
      <inertial pos="{arm_com:.17g} 0 0" mass="{arm_mass:.17g}"
                diaginertia="{arm_inertia:.17g} {arm_inertia:.17g} {arm_inertia:.17g}"/>
      <body name="pendulum" pos="{arm_length:.17g} 0 0">
        <joint name="pendulum" type="hinge" axis="-1 0 0"/>
        <inertial pos="0 0 {pendulum_com:.17g}" mass="{pendulum_mass:.17g}"
                  diaginertia="{joint:.17g} {across:.17g} {along:.17g}"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def arm_about_com(bodies: Bodies, motor_inertia: float = 0.0) -> float:
    """Inertia of the arm alone about its centre of mass, in units of the command; not above 0: no rigid body is so."""
    scale = 1.0 / bodies.torque_per_command
    return bodies.arm_inertia * scale - motor_inertia - bodies.arm_mass * scale * bodies.arm_com**2


def model_xml(bodies: Bodies, motor_inertia: float = 0.0, up: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> str:
    """MJCF in units of the command; `motor_inertia` (same units) is left to the caller; `up`: against gravity."""
    scale = 1.0 / bodies.torque_per_command
    about_com = arm_about_com(bodies, motor_inertia)
    if about_com <= 0.0:
        raise ValueError(
            f"the arm has no inertia left about its centre of mass ({about_com:.3g}): give it a smaller arm_com, "
            "or a smaller motor."
        )
    return _XML.format(
        gx=-GRAVITY * up[0],
        gy=-GRAVITY * up[1],
        gz=-GRAVITY * up[2],
        arm_com=bodies.arm_com,
        arm_mass=bodies.arm_mass * scale,
        arm_inertia=about_com,
        arm_length=bodies.arm_length,
        pendulum_com=bodies.pendulum_com,
        pendulum_mass=bodies.pendulum_mass * scale,
        joint=bodies.pendulum_inertia[0] * scale,
        across=bodies.pendulum_inertia[1] * scale,
        along=bodies.pendulum_inertia[2] * scale,
    )


@lru_cache
def _functions() -> tuple[Any, int, int]:
    """(module, address of mj_forward, address of mj_mulM). ImportError if MuJoCo cannot be used this way."""
    module = import_module("mujoco")
    found = sorted(Path(module.__file__).parent.glob("*mujoco*.so*"))  # type: ignore[arg-type]
    found += sorted(Path(module.__file__).parent.glob("*mujoco*.d*"))  # type: ignore[arg-type]
    if not found or not hasattr(module.MjData, "_address"):
        raise ImportError("this build of the mujoco package does not show its library")
    library = ctypes.CDLL(str(found[0]))
    forward, multiply = (
        ctypes.cast(getattr(library, name), ctypes.c_void_p).value for name in ("mj_forward", "mj_mulM")
    )
    return module, int(forward or 0), int(multiply or 0)


def available() -> bool:
    """True if the mujoco package is installed and can be called by address."""
    try:
        _functions()
    except (ImportError, OSError, AttributeError):
        return False
    return True


@dataclass(frozen=True)
class MujocoBody:
    """A model with its data; `link` holds views into the data, so keep this object as long as they are used."""

    model: Any
    data: Any
    link: tuple[np.ndarray, ...]
    addresses: dict[str, int]


def make(bodies: Bodies, motor_inertia: float, up: tuple[float, float, float]) -> MujocoBody:
    """A MuJoCo model of `bodies`, ready for the kernels."""
    module, forward, multiply = _functions()
    model = module.MjModel.from_xml_string(model_xml(bodies, motor_inertia, up))
    data = module.MjData(model)
    link = (data.qpos, data.qvel, data.qfrc_bias, np.zeros(2), np.zeros(2))
    addresses = {
        "mujoco": 1,
        "mj_forward": forward,
        "mj_mulm": multiply,
        "mj_model": model._address,
        "mj_data": data._address,
    }
    return MujocoBody(model, data, link, addresses)
