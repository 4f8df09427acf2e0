"""What a torque or an error of a reading that a plant lacks goes with: where it enters, and what it depends on.

Their values are the words that files and tables have for them.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple, Self


class Channel(StrEnum):
    """Where something enters that a plant lacks."""

    ARM = "arm"
    PENDULUM = "pendulum"
    INPUT = "input"
    SENSOR = "sensor"
    PARAMETERS = "parameters"


class Variable(StrEnum):
    """What it depends on. argument: the name that kernels have for it (`HOOKS`), unit: its unit, in which {u} stands
    for the command's; both are empty where it is no single quantity."""

    argument: str
    unit: str

    def __new__(cls, words: str, argument: str = "", unit: str = "") -> Self:
        made = str.__new__(cls, words)
        made._value_ = words
        made.argument, made.unit = argument, unit
        return made

    CONSTANT = "constant"
    ARM_ANGLE = "arm angle", "q1", "rad"
    ARM_SPEED = "arm speed", "v1", "rad/s"
    PENDULUM_ANGLE = "pendulum angle", "q2", "rad"
    PENDULUM_SPEED = "pendulum speed", "v2", "rad/s"
    COMMAND = "command", "u", "{u}"
    TIME = "time", "t", "s"
    ARM_ANGLE_AND_DIRECTION = "arm angle and direction"
    MEMORY = "memory of the motion"
    FREQUENCY = "frequency"
    COMMAND_CHANGE = "change of the command"
    FRICTION_IN_TIME = "time (friction)"
    GAIN_IN_TIME = "time (gain)"
    MASSES_IN_TIME = "time (masses)"
    ARM_ZERO_IN_TIME = "time (zero of the arm)"
    PENDULUM_ZERO_IN_TIME = "time (zero of the pendulum)"
    # of another law of one effect: see `diagnosis.locate.laws`
    STANDSTILL = "near standstill"
    SMOOTH_ARM_ANGLE = "smooth in the arm angle"
    OWN_TRAVEL = "memory at its own travel"
    OWN_RIPPLE = "its own ripple"
    OWN_FRICTION = "its own friction"
    OWN_FREQUENCY = "its own frequency"
    OWN_TURN = "its own turn"


class Dependence(NamedTuple):
    """Where a function enters, and what it is a function of."""

    channel: Channel
    variable: Variable


ANGLES = {"arm": Variable.ARM_ANGLE, "pendulum": Variable.PENDULUM_ANGLE}
SPEEDS = {"arm": Variable.ARM_SPEED, "pendulum": Variable.PENDULUM_SPEED}
ZEROS = {"arm": Variable.ARM_ZERO_IN_TIME, "pendulum": Variable.PENDULUM_ZERO_IN_TIME}
"""Of each joint: its angle, its speed, and the zero of its encoder in time."""
