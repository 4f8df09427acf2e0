"""The library: every effect there is, in a fixed order whose positions number the compiled code's branches."""

from .arm import ARM_EFFECTS
from .cable import CABLE_EFFECTS
from .command import COMMAND_EFFECTS
from .declaration import EffectType
from .pendulum import PENDULUM_EFFECTS
from .sensor import SENSOR_EFFECTS

EFFECTS: dict[str, EffectType] = {
    effect.name: effect
    for effect in (*COMMAND_EFFECTS, *ARM_EFFECTS, *CABLE_EFFECTS, *PENDULUM_EFFECTS, *SENSOR_EFFECTS)
}
NUMBERS: dict[str, int] = {name: number for number, name in enumerate(EFFECTS)}
