"""The library: every effect that has a name, and what a plant can carry beside them."""

from .arm import ARM_EFFECTS
from .cable import CABLE_EFFECTS
from .command import COMMAND_EFFECTS
from .declaration import EffectType
from .learned import LEARNED_EFFECTS
from .pendulum import PENDULUM_EFFECTS
from .sensor import SENSOR_EFFECTS

_ALONE = ("delay", "filter")  # hooks whose result takes the place of the one before


def numbered(effects: dict[str, EffectType]) -> dict[str, int]:
    """Each effect's number, which the compiled code's branches have: its place.

    Raises ValueError for a second effect with a `delay` or a `filter` kernel: only one of them could act."""
    for hook in _ALONE:
        if len(having := [name for name, effect in effects.items() if hook in effect.kernels]) > 1:
            raise ValueError(
                f"the library can have one effect with a {hook} kernel, got {', '.join(having)}; put the {hook} of "
                "both into one effect with more parameters"
            )
    return {name: number for number, name in enumerate(effects)}


EFFECTS: dict[str, EffectType] = {
    effect.name: effect
    for effect in (*COMMAND_EFFECTS, *ARM_EFFECTS, *CABLE_EFFECTS, *PENDULUM_EFFECTS, *SENSOR_EFFECTS)
}
"""The effects that a search proposes."""

CARRIED: dict[str, EffectType] = EFFECTS | {effect.name: effect for effect in LEARNED_EFFECTS}
"""All that a plant can carry, in a fixed order."""

NUMBERS: dict[str, int] = numbered(CARRIED)
"""Places in that order, which number the compiled code's branches."""

FILTERS = frozenset(NUMBERS[effect.name] for effect in CARRIED.values() if "filter" in effect.kernels)
"""Numbers of those that filter the command: one, or none."""
