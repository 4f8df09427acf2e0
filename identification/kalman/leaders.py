"""Covariances and gains of many filters side by side, compiled.

Arrays end with a lane for each filter. A covariance is packed, C (n(n+1)/2, L): element (i, j ≤ i) of every filter in
row `packed(i, j)`. For the usual sizes of a state a whole step is written out, element by element, as one loop over the
lanes that is one run of SIMD instructions; larger states, and readings of other than two angles, take loops over the
elements.
"""

from __future__ import annotations

from typing import Any

from furuta_gym.plant.compiled import compiled, lanes_of
from furuta_gym.plant.dynamics import mass_matrix
from furuta_gym.plant.elementary import log

from .arguments import LeaderReadings
from .rounding import cell

_WRITTEN_OUT = (4, 5, 6, 7)  # sizes of a state: model (5), and effects with up to three memories


@compiled(forceinline=True)
def packed(i, j):
    """Row of a packed covariance that holds element (i, j), in either order."""
    a, b = (i, j) if i >= j else (j, i)
    return a * (a + 1) // 2 + b


@compiled(forceinline=True)
def shaken(q2, th1, th2, th3, th4, n1, n2):
    """Intensities (11, 12, 22) of the accelerations that white torques of intensities n1, n2 cause."""
    m11, m12, m22 = mass_matrix(q2, th1, th2, th3, th4)
    det = m11 * m22 - m12 * m12
    a, b, d = m22 / det, -m12 / det, m11 / det
    return n1 * a * a + n2 * b * b, n1 * a * b + n2 * b * d, n1 * b * b + n2 * d * d


def _row(i: int, j: int) -> int:
    return max(i, j) * (max(i, j) + 1) // 2 + min(i, j)


def _triangle(n: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(n) for j in range(i + 1)]


def _c(i: int, j: int) -> str:
    return f"c{max(i, j)}{min(i, j)}"


def _predicted(n: int) -> list[str]:
    """C ← Φ C Φᵀ + what white torques leave after T seconds, in lane g."""
    lines = [f"{_c(i, j)} = C{_row(i, j)}[g]" for i, j in _triangle(n)]
    lines += [f"f{i}{j} = Phi{i * n + j}[g]" for i in range(n) for j in range(n)]
    for i in range(n):
        for j in range(n):
            lines.append(f"w{i}{j} = " + " + ".join(f"f{i}{m} * {_c(m, j)}" for m in range(n)))
    for i, j in _triangle(n):
        lines.append(f"{_c(i, j)} = " + " + ".join(f"w{i}{m} * f{j}{m}" for m in range(n)))
    lines.append("v0, v1, v2 = shaken(q2[g], theta0[g], theta1[g], theta2[g], theta3[g], noise0[g], noise1[g])")
    for i, j in _triangle(4):
        lines.append(f"{_c(i, j)} += v{i % 2 + j % 2} * {('t3', 't2', 'T')[i // 2 + j // 2]}")
    return lines


def _read(n: int, a: int) -> list[str]:
    """Reading a, which is of angle a; the second one less what the first says of it. C ← what is left."""
    beyond = ("d0[g]", "d1[g] - told * e0")[a]
    lines = [f"v = noise{2 + a}[g] + {_c(a, a)}", f"e{a}, s, half{a}, factor{a} = cell({beyond}, v, step{a})"]
    lines += [f"h{i} = {_c(i, a)}" for i in range(n)]
    if a == 0:
        lines += ["both = h1", "told = both / s", "own_e0[g] = e0", "prior0[g] = v", "S0[g] = s", "S1[g] = both"]
    else:
        lines += ["own_e1[g] = e1 + told * e0", "prior1[g] = v + told * both", "S2[g] = s + told * both"]
    for i in range(n):
        lines += [f"k{i} = h{i} / s", f"K{a * n + i}[g] = k{i}"]
    for i, j in _triangle(n):
        lines.append((_c(i, j) if a == 0 else f"C{_row(i, j)}[g]") + f" = {_c(i, j)} - k{i} * h{j}")
    return lines


def _written_out(n: int) -> Any:
    """`step_leaders` for states of size n whose first two are read as they are."""
    rows = {"C": n * (n + 1) // 2, "Phi": n * n, "q2": 1, "theta": 4, "noise": 4, "d": 2}
    rows |= {"K": 2 * n, "own_e": 2, "S": 3, "prior": 2, "cost": 1}
    one = [(name, i, f"{name}{i}" if count > 1 else name) for name, count in rows.items() for i in range(count)]
    body = _predicted(n) + _read(n, 0) + _read(n, 1)
    body.append("cost[g] = (0.5 * half0 + log(factor0)) + (0.5 * half1 + log(factor1))")
    loop = [f"def lanes_{n}({', '.join(x for *_, x in one)}, T, step0, step1, L):"]
    loop += ["    t2, t3 = T * T / 2.0, T * T * T / 3.0", "    for g in range(L):"] + [
        f"        {line}" for line in body
    ]
    calls = ", ".join(f"lanes_of({name}, {i})" for name, i, _ in one)
    step = f"def step_{n}({', '.join(rows)}, T, quantum):\n"
    step += f"    lanes_{n}({calls}, T, quantum[0], quantum[1], C.shape[1])"
    names: dict[str, Any] = {"__name__": __name__, "lanes_of": lanes_of, "cell": cell, "log": log, "shaken": shaken}
    exec(compile("\n".join(loop), __file__, "exec"), names)
    names[f"lanes_{n}"] = compiled(names[f"lanes_{n}"], apart=True, nogil=True)
    exec(compile(step, __file__, "exec"), names)
    return compiled(names[f"step_{n}"], nogil=True)


_step_4, _step_5, _step_6, _step_7 = (_written_out(n) for n in _WRITTEN_OUT)


@compiled(nogil=True)
def step_leaders(C, Phi, q2, theta, T, H, direct, noise, d, quantum, told: LeaderReadings, work):
    """T seconds on to the next pair of readings, in every lane: C ← what is known of the states after both.

    Phi (n, n, L): how the states are carried there, q2 (L,): the pendulums then, theta (≥ 4, L), noise (4, L):
    intensities of the white torques and variances of the readings before rounding. H (2, n, L) is how the states are
    read, direct: whether that is angles 0 and 1 as they are. d (2, L): readings beyond the filters' predictions. told:
    LeaderReadings, filled. work (n, n, L).
    """
    n = Phi.shape[0]
    if direct and n == 4:
        _step_4(C, Phi, q2, theta, noise, d, told.K, told.e, told.S, told.prior, told.cost, T, quantum)
    elif direct and n == 5:
        _step_5(C, Phi, q2, theta, noise, d, told.K, told.e, told.S, told.prior, told.cost, T, quantum)
    elif direct and n == 6:
        _step_6(C, Phi, q2, theta, noise, d, told.K, told.e, told.S, told.prior, told.cost, T, quantum)
    elif direct and n == 7:
        _step_7(C, Phi, q2, theta, noise, d, told.K, told.e, told.S, told.prior, told.cost, T, quantum)
    else:
        _propagate(C, Phi, work)
        _add_noise(C, q2, theta, noise, T)
        _read_any(C, H, noise[2:], d, quantum, told)


@compiled(nogil=True)
def _propagate(C, Phi, work):
    """C ← Φ C Φᵀ."""
    n, L = Phi.shape[0], C.shape[1]
    for i in range(n):
        for j in range(n):
            for g in range(L):
                work[i, j, g] = 0.0
            for m in range(n):
                row = packed(m, j)
                for g in range(L):
                    work[i, j, g] += Phi[i, m, g] * C[row, g]
    for i in range(n):
        for j in range(i + 1):
            row = packed(i, j)
            for g in range(L):
                C[row, g] = 0.0
            for m in range(n):
                for g in range(L):
                    C[row, g] += work[i, m, g] * Phi[j, m, g]


@compiled(nogil=True)
def _add_noise(C, q2, theta, noise, T):
    """C += covariance that white torques leave in the states after T seconds."""
    t2, t3 = T * T / 2.0, T * T * T / 3.0
    for g in range(C.shape[1]):
        v11, v12, v22 = shaken(q2[g], theta[0, g], theta[1, g], theta[2, g], theta[3, g], noise[0, g], noise[1, g])
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
def _read_any(C, H, noise, d, quantum, told: LeaderReadings):
    """A pair of readings, one after the other; noise (2, L): variances of the readings before rounding."""
    K, e, S, prior, cost, CH, work = told
    n, L = CH.shape
    q, factor, of_first, left = work[0], work[1], work[2], work[3]
    _seen(C, H, 0, CH, prior, noise)
    for g in range(L):
        S[1, g] = 0.0
    for i in range(n):
        for g in range(L):
            S[1, g] += H[1, i, g] * CH[i, g]
    step = quantum[0]
    for g in range(L):
        e[0, g], S[0, g], q[g], factor[g] = cell(d[0, g], prior[0, g], step)
        left[g] = S[0, g]
    for g in range(L):
        cost[g] = 0.5 * q[g] + log(factor[g])
    _reduce(C, CH, left, K[0])
    # the second innovation less what the first one says of it
    _seen(C, H, 1, CH, prior, noise)
    step = quantum[1]
    for g in range(L):
        of_first[g] = S[1, g] / S[0, g]
        second, left[g], q[g], factor[g] = cell(d[1, g] - of_first[g] * e[0, g], prior[1, g], step)
        e[1, g] = second + of_first[g] * e[0, g]
        prior[1, g] += of_first[g] * S[1, g]
        S[2, g] = left[g] + of_first[g] * S[1, g]
    for g in range(L):
        cost[g] += 0.5 * q[g] + log(factor[g])
    _reduce(C, CH, left, K[1])


@compiled(nogil=True)
def _seen(C, H, a, CH, prior, noise):
    """C h (n, L) and the variance of reading a before rounding, prior[a]."""
    n, L = CH.shape
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
def _reduce(C, CH, left, K):
    """K = C h / s and C ← C − K (C h)ᵀ, s = left (L,) being the reading's variance."""
    n, L = CH.shape
    for i in range(n):
        for g in range(L):
            K[i, g] = CH[i, g] / left[g]
    for i in range(n):
        for j in range(i + 1):
            row = packed(i, j)
            for g in range(L):
                C[row, g] -= K[i, g] * CH[j, g]
