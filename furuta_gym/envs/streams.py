"""Random numbers inside the compiled code: one 64-bit stream for each env, so that a batch equals single envs.

SplitMix64 (Steele, Lea and Flood 2014): the state advances by a constant and is hashed to 64 random bits. A stream
starts from 64 bits of the env's own `np_random` and then goes on through all its episodes.
"""

import math

import numpy as np

from ..plant.compiled import compiled
from ..plant.elementary import sincos

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX1, _MIX2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


def start_stream(rng: np.random.Generator) -> np.uint64:
    """First state of a stream, from the generator that a seed made."""
    return rng.integers(2**64 - 1, dtype=np.uint64, endpoint=True)


@compiled(forceinline=True)
def uniform(streams, k):
    """Next number of stream k, uniform in [0, 1)."""
    state = streams[k] + _GOLDEN
    streams[k] = state
    z = (state ^ (state >> _S30)) * _MIX1
    z = (z ^ (z >> _S27)) * _MIX2
    z = z ^ (z >> _S31)
    return np.float64(z >> _S11) * 2.0**-53


@compiled(forceinline=True)
def normal_pair(streams, k):
    """Two independent standard normal numbers of stream k (Box and Muller 1958)."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(streams, k)))
    s, c = sincos(2.0 * math.pi * uniform(streams, k))
    return radius * c, radius * s
