"""Covariances and gains of many filters side by side, compiled.

Arrays end with a lane for each filter. A covariance is packed, C (n(n+1)/2, L): element (i, j ≤ i) of every filter in
row `packed(i, j)`. For the usual sizes of a state the matrix products are written out, element by element, so that a
loop over the lanes is one run of SIMD instructions; larger states take loops over the elements.
"""

from __future__ import annotations

import math
from typing import Any

from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.dynamics import mass_matrix

from .rounding import cell

_WRITTEN_OUT = (4, 5, 6)  # sizes of a state: model (5), and effects with one or two memories


@compiled(forceinline=True)
def packed(i, j):
    """Row of a packed covariance that holds element (i, j), in either order."""
    a, b = (i, j) if i >= j else (j, i)
    return a * (a + 1) // 2 + b


def _row(i: int, j: int) -> int:
    return max(i, j) * (max(i, j) + 1) // 2 + min(i, j)


def _generated(name: str, lines: list[str]) -> Any:
    source = "\n".join([lines[0], *("    " + line for line in lines[1:])])
    names: dict[str, Any] = {"__name__": __name__}
    exec(compile(source, __file__, "exec"), names)
    return compiled(names[name], nogil=True)


def _product(n: int, own: bool) -> Any:
    """C ← Φ C Φᵀ for states of size n: Φ (n, n, 1) of all filters, or `own` ones (n, n, L)."""
    name = f"product_{n}_{'own' if own else 'shared'}"
    transitions = [f"f{i}{j} = Phi[{i}, {j}, {'g' if own else 0}]" for i in range(n) for j in range(n)]
    loop = [f"c{i}{j} = C[{_row(i, j)}, g]" for i in range(n) for j in range(i + 1)]
    loop += transitions if own else []
    for i in range(n):
        for j in range(n):
            loop.append(f"w{i}{j} = " + " + ".join(f"f{i}{m} * c{max(m, j)}{min(m, j)}" for m in range(n)))
    for i in range(n):
        for j in range(i + 1):
            loop.append(f"C[{_row(i, j)}, g] = " + " + ".join(f"w{i}{m} * f{j}{m}" for m in range(n)))
    head = [f"def {name}(C, Phi):", *([] if own else transitions), "for g in range(C.shape[1]):"]
    return _generated(name, head + ["    " + line for line in loop])


def _reduction(n: int) -> Any:
    """C ← C − K (C h)ᵀ for states of size n, K (n, L) and C h (n, L)."""
    name = f"reduction_{n}"
    loop = [f"C[{_row(i, j)}, g] -= K[{i}, g] * CH[{j}, g]" for i in range(n) for j in range(i + 1)]
    return _generated(name, [f"def {name}(C, K, CH):", "for g in range(C.shape[1]):", *("    " + x for x in loop)])


_shared_4, _shared_5, _shared_6 = (_product(n, False) for n in _WRITTEN_OUT)
_own_4, _own_5, _own_6 = (_product(n, True) for n in _WRITTEN_OUT)
_reduction_4, _reduction_5, _reduction_6 = (_reduction(n) for n in _WRITTEN_OUT)


@compiled(nogil=True)
def propagate_leaders(C, Phi, work):
    """C ← Φ C Φᵀ in every lane. Phi (n, n, 1) for all filters, or (n, n, L). work (n, n, L)."""
    n = Phi.shape[0]
    own = Phi.shape[2] > 1
    if n == 4:
        _own_4(C, Phi) if own else _shared_4(C, Phi)
    elif n == 5:
        _own_5(C, Phi) if own else _shared_5(C, Phi)
    elif n == 6:
        _own_6(C, Phi) if own else _shared_6(C, Phi)
    else:
        _product_of_any(C, Phi, work)


@compiled(nogil=True)
def _product_of_any(C, Phi, work):
    n, L = Phi.shape[0], C.shape[1]
    step = 1 if Phi.shape[2] > 1 else 0
    for i in range(n):
        for j in range(n):
            for g in range(L):
                work[i, j, g] = 0.0
            for m in range(n):
                row = packed(m, j)
                for g in range(L):
                    work[i, j, g] += Phi[i, m, step * g] * C[row, g]
    for i in range(n):
        for j in range(i + 1):
            row = packed(i, j)
            for g in range(L):
                C[row, g] = 0.0
            for m in range(n):
                for g in range(L):
                    C[row, g] += work[i, m, g] * Phi[j, m, step * g]


@compiled(nogil=True)
def add_noise_to_leaders(C, q2, theta, noise, T):
    """C += covariance that white torques of intensities noise[:2] (2, L) leave in the states after T seconds, the
    pendulums being at q2 (L,); theta (≥ 4, L)."""
    t2, t3 = T * T / 2.0, T * T * T / 3.0
    for g in range(C.shape[1]):
        m11, m12, m22 = mass_matrix(q2[g], theta[0, g], theta[1, g], theta[2, g], theta[3, g])
        det = m11 * m22 - m12 * m12
        a, b, d = m22 / det, -m12 / det, m11 / det
        v11 = noise[0, g] * a * a + noise[1, g] * b * b
        v12 = noise[0, g] * a * b + noise[1, g] * b * d
        v22 = noise[0, g] * b * b + noise[1, g] * d * d
        C[0, g] += v11 * t3
        C[1, g] += v12 * t3
        C[2, g] += v22 * t3
        C[3, g] += v11 * t2
        C[4, g] += v12 * t2
        C[5, g] += v11 * T
        C[6, g] += v12 * t2
        C[7, g] += v22 * t2
        C[8, g] += v12 * T
        C[9, g] += v22 * T


@compiled(nogil=True)
def read_leaders(C, H, direct, noise, d, quantum, told):
    """A pair of readings d (2, L) beyond the filters' predictions, one after the other; C ← what is left.

    H (2, n, L) is how the states are read; direct: whether they are angles 0 and 1 as they are. noise (2, L):
    variances of the readings before rounding. told: LeaderReadings, filled.
    """
    K, e, S, prior, cost, CH, work = told
    L = C.shape[1]
    q, factor, of_first, left = work[0], work[1], work[2], work[3]
    _seen(C, H, direct, 0, CH, prior, noise)
    _also_seen(H, direct, CH, S)
    step = quantum[0]
    for g in range(L):
        e[0, g], S[0, g], q[g], factor[g] = cell(d[0, g], prior[0, g], step)
        left[g] = S[0, g]
    for g in range(L):
        cost[g] = 0.5 * q[g] + math.log(factor[g])
    _reduce(C, CH, left, K[0])
    # the second innovation less what the first one says of it
    _seen(C, H, direct, 1, CH, prior, noise)
    step = quantum[1]
    for g in range(L):
        of_first[g] = S[1, g] / S[0, g]
        second, left[g], q[g], factor[g] = cell(d[1, g] - of_first[g] * e[0, g], prior[1, g], step)
        e[1, g] = second + of_first[g] * e[0, g]
        prior[1, g] += of_first[g] * S[1, g]
        S[2, g] = left[g] + of_first[g] * S[1, g]
    for g in range(L):
        cost[g] += 0.5 * q[g] + math.log(factor[g])
    _reduce(C, CH, left, K[1])


@compiled(nogil=True)
def _seen(C, H, direct, a, CH, prior, noise):
    """C h (n, L) and the variance of reading a before rounding, prior[a]."""
    n, L = CH.shape
    if direct:
        for i in range(n):
            row = packed(i, a)
            for g in range(L):
                CH[i, g] = C[row, g]
        for g in range(L):
            prior[a, g] = noise[a, g] + CH[a, g]
        return
    for g in range(L):
        prior[a, g] = noise[a, g]
    for i in range(n):
        for g in range(L):
            CH[i, g] = 0.0
        for m in range(n):
            row = packed(i, m)
            for g in range(L):
                CH[i, g] += C[row, g] * H[a, m, g]
        for g in range(L):
            prior[a, g] += H[a, i, g] * CH[i, g]


@compiled(nogil=True)
def _also_seen(H, direct, CH, S):
    """S[1]: the covariance of both readings, from C h of the first."""
    n, L = CH.shape
    for g in range(L):
        S[1, g] = CH[1, g] if direct else 0.0
    if not direct:
        for i in range(n):
            for g in range(L):
                S[1, g] += H[1, i, g] * CH[i, g]


@compiled(nogil=True)
def _reduce(C, CH, left, K):
    """K = C h / s and C ← C − K (C h)ᵀ, s = left (L,) being the reading's variance."""
    n, L = CH.shape
    for i in range(n):
        for g in range(L):
            K[i, g] = CH[i, g] / left[g]
    if n == 4:
        _reduction_4(C, K, CH)
    elif n == 5:
        _reduction_5(C, K, CH)
    elif n == 6:
        _reduction_6(C, K, CH)
    else:
        for i in range(n):
            for j in range(i + 1):
                row = packed(i, j)
                for g in range(L):
                    C[row, g] -= K[i, g] * CH[j, g]
