"""The physics: model (5) of the paper with the errata's corrections, and the library of what it leaves out."""

from .covariance import Covariance
from .effects import EFFECTS, Effect, EffectType, Parameter
from .parameters import THETA_MEANING, THETA_NAMES
from .plant import PLANTS, Plant
from .rigid_body import RigidBody, physical_consistency
from .sampling import sampled_plants
from .sets import LARGE_RIG, PAPER_GAIN, QUBE, TABLE_3

__all__ = [
    "EFFECTS",
    "LARGE_RIG",
    "PAPER_GAIN",
    "PLANTS",
    "QUBE",
    "TABLE_3",
    "THETA_MEANING",
    "THETA_NAMES",
    "Covariance",
    "Effect",
    "EffectType",
    "Parameter",
    "Plant",
    "RigidBody",
    "physical_consistency",
    "sampled_plants",
]
