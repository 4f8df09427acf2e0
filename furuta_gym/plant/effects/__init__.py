"""The library of effects that model (5) leaves out, and the values that put them into a plant."""

from .declaration import EffectType, Parameter
from .effect import Effect, where_to_look
from .library import EFFECTS

__all__ = ["EFFECTS", "Effect", "EffectType", "Parameter", "where_to_look"]
