"""The library: every effect that has a name, and what a plant can carry beside them."""

from .arm import ARM_EFFECTS
from .cable import CABLE_EFFECTS
from .command import COMMAND_EFFECTS
from .declaration import EffectType
from .learned import LEARNED_EFFECTS
from .pendulum import PENDULUM_EFFECTS
from .sensor import SENSOR_EFFECTS

EFFECTS: dict[str, EffectType] = {
    effect.name: effect
    for effect in (*COMMAND_EFFECTS, *ARM_EFFECTS, *CABLE_EFFECTS, *PENDULUM_EFFECTS, *SENSOR_EFFECTS)
}
"""The effects that a search proposes."""

CARRIED: dict[str, EffectType] = EFFECTS | {effect.name: effect for effect in LEARNED_EFFECTS}
"""All that a plant can carry, in a fixed order."""

NUMBERS: dict[str, int] = {name: number for number, name in enumerate(CARRIED)}
"""Places in that order, which number the compiled code's branches."""
