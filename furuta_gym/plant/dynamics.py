"""Model (5) with the errata's corrections: the one copy of the physics.

`integration` carries it in time, with the active effects.
"""

from .compiled import compiled
from .elementary import sincos, tanh


@compiled(forceinline=True)
def mass_matrix(q2, th1, th2, th3, th4):
    """(M11, M12, M22) of Eq. (7)."""
    s, c = sincos(q2)
    return th1 + th2 * s * s, th3 * c, th4


@compiled(forceinline=True)
def bias_torque(q2, v1, v2, th2, th3, th5):
    """C(q, q̇) q̇ + g(q), Eqs. (8) and (9); C11 holds q̇2 where the paper prints q̇1 (only so energy is kept)."""
    s, c = sincos(q2)
    half_th2_sin2q2 = th2 * s * c
    return 2.0 * half_th2_sin2q2 * v1 * v2 - th3 * s * v2 * v2, -half_th2_sin2q2 * v1 * v1 - th5 * s


@compiled(forceinline=True)
def friction_torque(v1, v2, th6, th7, th8, th9, r1, r2):
    """F_v q̇ + F_c tanh(r q̇), Eqs. (10) to (12)."""
    return th6 * v1 + th8 * tanh(r1 * v1), th7 * v2 + th9 * tanh(r2 * v2)


@compiled(forceinline=True)
def acceleration(q2, v1, v2, f1, f2, th1, th2, th3, th4, th5, th6, th7, th8, th9, r1, r2):
    """q̈ = M⁻¹ (f − C q̇ − F_v q̇ − F_c tanh(r q̇) − g), Eq. (5); f = (f1, f2) are the torques on the two rows."""
    m11, m12, m22 = mass_matrix(q2, th1, th2, th3, th4)
    c1, c2 = bias_torque(q2, v1, v2, th2, th3, th5)
    d1, d2 = friction_torque(v1, v2, th6, th7, th8, th9, r1, r2)
    b1 = f1 - c1 - d1
    b2 = f2 - c2 - d2
    det = 1.0 / (m11 * m22 - m12 * m12)
    return det * (m22 * b1 - m12 * b2), det * (m11 * b2 - m12 * b1)


@compiled(forceinline=True)
def energy(q2, v1, v2, th1, th2, th3, th4, th5):
    """½ q̇ᵀ M q̇ + θ5 cos q2: kept when friction, command and effects are off."""
    m11, m12, m22 = mass_matrix(q2, th1, th2, th3, th4)
    _, c = sincos(q2)
    return 0.5 * m11 * v1 * v1 + m12 * v1 * v2 + 0.5 * m22 * v2 * v2 + th5 * c
