"""What is left of a friction's sharpness where a filter does not know the velocity well.

tanh(r q̇) is sharper than what a filter knows of q̇ where noise is large, and its slope at the mean then says nothing.
So the mean over the velocity's uncertainty σ is taken: with tanh(r v) ≈ erf(√π r v / 2),

    E tanh(r (v + σ ξ)) ≈ tanh(ρ v),   ρ = r / √(1 + (π/2) r² σ²),

which is statistical linearisation (Gelb 1974, section 6.2) of the friction: ρ takes the place of r, sample by sample.
"""

import math

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.layout import ParameterLayout

_SPEED = {"r1": 2, "r2": 3}  # the state in which the velocity of its friction is


@compiled(forceinline=True)
def effective_sharpness(r, variance):
    """ρ [s/rad]: the sharpness left of r where the velocity is known to this variance [rad²/s²]."""
    return r / math.sqrt(1.0 + 0.5 * math.pi * r * r * variance)


@compiled
def sharpest(p, sharp):
    """(r1, r2) [s/rad]: the sharpest frictions of a plant, and 1 at least. p: its parameters, sharp: see `Model`."""
    r1, r2 = 1.0, 1.0
    for m in range(sharp.shape[0]):
        if sharp[m, 1] == 2:
            r1 = max(r1, p[sharp[m, 0]])
        else:
            r2 = max(r2, p[sharp[m, 0]])
    return r1, r2


def sharpness_rows(layout: ParameterLayout) -> NDArray[np.int64]:
    """(m, 2): rows of P that hold a friction's sharpness, and the state that its velocity is."""
    names = ("r1", "r2", "friction_sharpness.r1", "friction_sharpness.r2")
    return np.array([(row, _SPEED[name[-2:]]) for name in names for row in layout.rows(name)], dtype=np.int64)
