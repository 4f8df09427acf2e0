"""The compiled draws of a plant's and a rig's numbers at a reset, from the tables of a `Randomization`."""

import math

import numpy as np

from ..plant.compiled import compiled
from . import ranges as rg
from .streams import normal_pair, uniform

_TRIES = 10_000  # draws until a possible plant; construction has shown that one in 1000 is
_AGAIN = 100  # draws of a normal number until it lies inside its bounds

# Rows of Randomization.table, one column for each row of P.
NOMINAL, LOWER, UPPER, OFF, FROM, TO, INVERSE = range(7)

# Columns of Randomization.ranges, one row for each number that is drawn. TARGET is the row of P, or −1 − the row of the
# rig's. WHOLE is 1 where it is rounded, TIED where
# it is drawn whenever the row before it is. Of theta=physical only KIND and A, the share, mean something.
TARGET, KIND, A, B, CHANCE, DEFAULT, LEAST, MOST, WHOLE, TIED, N_COLUMNS = range(11)


@compiled(forceinline=True)
def _possible(P, k, table):
    """M > 0 for every q2 (see `parameters.theta_vector`) and every row inside its bounds."""
    for row in range(P.shape[0]):
        if not (table[LOWER, row] <= P[row, k] <= table[UPPER, row]):
            return False
    th1, th2, th3, th4 = P[0, k], P[1, k], P[2, k], P[3, k]
    return th1 > 0.0 and th4 > 0.0 and th1 + th2 > 0.0 and th1 * th4 > th3 * th3


@compiled
def draw_parameters(P, k, streams, i, table, root, switches):
    """Fill column k of P (n, L) with a plant drawn from stream i."""
    tries = _TRIES if root.shape[1] > 0 else 0
    for attempt in range(tries + 1):
        for row in range(P.shape[0]):
            P[row, k] = table[NOMINAL, row]
        if attempt == tries:
            break
        for j in range(root.shape[1]):
            z, _ = normal_pair(streams, i)
            for row in range(P.shape[0]):
                if root[row, j] != 0.0:  # also keeps 0 · z from turning an infinite parameter into NaN
                    P[row, k] += root[row, j] * z
        if _possible(P, k, table):
            break
    for s in range(switches.shape[0]):
        first, count = int(switches[s, 0]), int(switches[s, 1])
        on = uniform(streams, i) < switches[s, 2]
        for row in range(first, first + count):
            share = 1.0 - uniform(streams, i)
            low, high = table[FROM, row], table[TO, row]
            if not on:
                P[row, k] = table[OFF, row]
            elif table[INVERSE, row] > 0.0:
                P[row, k] = high / share
            elif not math.isnan(high):
                P[row, k] = low + share * (high - low)


@compiled
def draw_ranges(P, rig, k, streams, ranges):
    """Draw what `ranges` names into column k of P (n, L) and of the rig's rows (8, L), from stream k."""
    on = False
    for i in range(ranges.shape[0]):
        kind = int(ranges[i, KIND])
        a, b = ranges[i, A], ranges[i, B]
        if kind == rg.PHYSICAL:
            _draw_similar(P, k, streams, a)
            continue
        toss = uniform(streams, k) < ranges[i, CHANCE]
        if ranges[i, TIED] == 0.0:
            on = toss
        share, (z, _) = uniform(streams, k), normal_pair(streams, k)
        if kind == rg.NORMAL:
            value = a + b * z
            for _ in range(_AGAIN):
                if ranges[i, LEAST] <= value <= ranges[i, MOST]:
                    break
                z, _ = normal_pair(streams, k)
                value = a + b * z
        elif kind == rg.LOG_UNIFORM:
            value = a * (b / a) ** share
        else:
            value = a + share * (b - a)
        value = min(max(value, ranges[i, LEAST]), ranges[i, MOST])
        if ranges[i, WHOLE] > 0.0:
            value = np.floor(value + 0.5)
        target = int(ranges[i, TARGET])
        if target >= 0:
            P[target, k] = value if on and not math.isnan(P[target, k]) else ranges[i, DEFAULT]
        elif on:
            rig[-1 - target, k] = value


@compiled
def _draw_similar(P, k, streams, share):
    """θ of a rig whose m2, l2, L1, J1, J2, frictions and gain differ by up to `share` of themselves.

    By Table 2 θ1 = J1 + m2 L1², θ2 = m2 l2², θ3 = m2 L1 l2, θ4 = θ2 + J2, θ5 = m2 l2 g, each times the gain. J2 goes
    with m2 l2² and a factor of its own. The part of θ1 that goes with m2 L1² is θ3²/θ2. Where that leaves no J1 ≥ 0 or
    no J2 ≥ 0, it is θ3²/θ4, and all of θ4 goes with m2 l2². A θ2 < 0 goes with θ1. So M stays positive definite in
    every draw: θ1 θ4 − θ3² and θ1 + θ2 remain above zero.
    """
    mass, length, arm, inertia, shape, gain = 1.0, 1.0, 1.0, 1.0, 1.0, 1.0
    mass += share * (2.0 * uniform(streams, k) - 1.0)
    length += share * (2.0 * uniform(streams, k) - 1.0)
    arm += share * (2.0 * uniform(streams, k) - 1.0)
    inertia += share * (2.0 * uniform(streams, k) - 1.0)
    shape += share * (2.0 * uniform(streams, k) - 1.0)
    gain += share * (2.0 * uniform(streams, k) - 1.0)
    vary(P, k, mass, length, arm, inertia, shape, gain)
    for row in range(5, 9):
        P[row, k] *= gain * (1.0 + share * (2.0 * uniform(streams, k) - 1.0))


@compiled
def vary(P, k, mass, length, arm, inertia, shape, gain):
    """θ1 … θ5 of column k for a rig that differs by these factors; see `_draw_similar`."""
    th1, th2, th3, th4 = P[0, k], P[1, k], P[2, k], P[3, k]
    carried, rod = th3 * th3 / th4, 0.0
    if th2 > 0.0 and carried <= th3 * th3 / th2 <= th1:
        carried, rod = th3 * th3 / th2, max(th4 - th2, 0.0)
    P[0, k] = gain * (inertia * (th1 - carried) + mass * arm * arm * carried)
    P[1, k] = gain * mass * length * length * th2 if th2 >= 0.0 else P[0, k] * th2 / th1
    P[2, k] = gain * mass * arm * length * th3
    P[3, k] = gain * mass * length * length * (th4 - rod + shape * rod)
    P[4, k] *= gain * mass * length
