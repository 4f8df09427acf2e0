"""The Furuta pendulum by Euler and Lagrange, derived with SymPy from energies alone.

Two independent starts lead to the equations of motion M q̈ + h + g = u, h = C q̇:

* `from_theta`: kinetic energy ½ q̇ᵀ M q̇ and potential energy written in θ1…θ5 (equations (7) and (9));
* `from_geometry`: a rigid arm and a rigid pendulum, located by rotations, with masses and inertia tensors.

Angles follow the paper: q2 = 0 is upright, and positive q2 leans towards positive q1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import sympy as sp

time = sp.Symbol("t")
q1, q2, v1, v2, a1, a2 = sp.symbols("q1 q2 v1 v2 a1 a2", real=True)
theta = sp.symbols("theta1:10", positive=True)
J1, m2, L1, l2, gravity = sp.symbols("J1 m2 L1 l2 g", positive=True)
# Principal moments of the pendulum about its centre of mass: about the joint's axis (radial), about the
# tangent that is normal to both joint and rod, and along the rod.
J_joint, J_tangent, J_rod = sp.symbols("J_joint J_tangent J_rod", nonnegative=True)

_path1, _path2 = sp.Function("q1")(time), sp.Function("q2")(time)


@dataclass(frozen=True)
class Motion:
    """M (2x2), h = C q̇ (2x1), g (2x1) and the energies they came from, in the symbols q, v and θ or geometry."""

    M: sp.Matrix
    h: sp.Matrix
    g: sp.Matrix
    kinetic: sp.Expr
    potential: sp.Expr


def _at_instant(expression: sp.Expr) -> sp.Expr:
    """Replace the functions of time and their derivatives by the symbols q, v, a."""
    for order, symbols in ((2, (a1, a2)), (1, (v1, v2)), (0, (q1, q2))):
        for path, symbol in zip((_path1, _path2), symbols, strict=True):
            expression = expression.subs(sp.diff(path, time, order) if order else path, symbol)
    return expression


def _on_path(expression: sp.Expr) -> sp.Expr:
    """Replace the symbols q, v by functions of time and their derivatives."""
    return expression.subs(
        {q1: _path1, q2: _path2, v1: sp.diff(_path1, time), v2: sp.diff(_path2, time)}, simultaneous=True
    )


def euler_lagrange(kinetic: sp.Expr, potential: sp.Expr) -> Motion:
    """d/dt ∂L/∂q̇ − ∂L/∂q, split into the part in q̈ (M), the part in q̇ (h) and the rest (g)."""
    lagrangian = kinetic - potential
    rows = []
    for q, v in ((q1, v1), (q2, v2)):
        momentum = sp.diff(lagrangian, v)
        rows.append(_at_instant(sp.diff(_on_path(momentum), time)) - sp.diff(lagrangian, q))
    full = sp.Matrix(rows).applyfunc(sp.expand)
    mass = full.jacobian([a1, a2]).applyfunc(sp.simplify)
    at_rest = full.subs({a1: 0, a2: 0, v1: 0, v2: 0})
    velocity_terms = (full.subs({a1: 0, a2: 0}) - at_rest).applyfunc(sp.simplify)
    return Motion(mass, velocity_terms, at_rest.applyfunc(sp.simplify), kinetic, potential)


@cache
def from_theta() -> Motion:
    """Model (5) without friction, from its energies in θ1…θ5."""
    t1, t2, t3, t4, t5 = theta[:5]
    inertia = sp.Matrix([[t1 + t2 * sp.sin(q2) ** 2, t3 * sp.cos(q2)], [t3 * sp.cos(q2), t4]])
    rates = sp.Matrix([v1, v2])
    kinetic = (rates.T * inertia * rates)[0] / 2
    return euler_lagrange(sp.expand(kinetic), t5 * sp.cos(q2))


@cache
def from_geometry() -> Motion:
    """Arm (inertia J1 about the vertical axis) and rigid pendulum at its end, in masses, lengths and inertias.

    The pendulum's rotational energy comes from the rotation matrix R(t) through ω̂ = Rᵀ Ṙ (body frame),
    not from a hand-made angular velocity.
    """
    turn = sp.Matrix([[sp.cos(_path1), -sp.sin(_path1), 0], [sp.sin(_path1), sp.cos(_path1), 0], [0, 0, 1]])
    # Rotation about the arm by −q2, so that the pendulum's tip leans towards +tangent for q2 > 0.
    lean = sp.Matrix([[1, 0, 0], [0, sp.cos(_path2), sp.sin(_path2)], [0, -sp.sin(_path2), sp.cos(_path2)]])
    rotation = turn * lean
    centre = turn * sp.Matrix([L1, 0, 0]) + rotation * sp.Matrix([0, 0, l2])
    velocity = sp.diff(centre, time)
    spin = (rotation.T * sp.diff(rotation, time)).applyfunc(sp.simplify)
    omega = sp.Matrix([spin[2, 1], spin[0, 2], spin[1, 0]])
    tensor = sp.diag(J_joint, J_tangent, J_rod)
    arm = J1 * sp.diff(_path1, time) ** 2 / 2
    translation = m2 * (velocity.T * velocity)[0] / 2
    rotational = (omega.T * tensor * omega)[0] / 2
    kinetic = sp.simplify(_at_instant(arm + translation + rotational))
    potential = _at_instant(m2 * gravity * centre[2])
    return euler_lagrange(kinetic, potential)


def theta_of_geometry() -> tuple[sp.Expr, ...]:
    """θ1…θ5 of a general rigid pendulum, read off `from_geometry` (Table 2 is the case J_tangent = J_rod = 0)."""
    motion = from_geometry()
    upright = motion.M.subs(q2, 0).applyfunc(sp.simplify)
    level = motion.M.subs(q2, sp.pi / 2).applyfunc(sp.simplify)
    weight = sp.simplify(-motion.g[1] / sp.sin(q2))
    return (upright[0, 0], sp.simplify(level[0, 0] - upright[0, 0]), upright[0, 1], upright[1, 1], weight)


def christoffel(mass: sp.Matrix) -> sp.Matrix:
    """C_ij = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_jk/∂q_i) q̇_k: the one C for which Ṁ − 2C is skew."""
    q, v = (q1, q2), (v1, v2)
    return sp.Matrix(
        2,
        2,
        lambda i, j: sp.simplify(
            sum(
                (sp.diff(mass[i, j], q[k]) + sp.diff(mass[i, k], q[j]) - sp.diff(mass[j, k], q[i])) * v[k] / 2
                for k in range(2)
            )
        ),
    )


def coriolis(printed: bool = False) -> sp.Matrix:
    """Equation (8): as the paper prints it (C11 with q̇1), or with the erratum's C11 (q̇2)."""
    swing = sp.Rational(1, 2) * theta[1] * sp.sin(2 * q2)
    first = v1 if printed else v2
    return sp.Matrix([[swing * first, -theta[2] * v2 * sp.sin(q2) + swing * v1], [-swing * v1, 0]])


def mass_rate(mass: sp.Matrix) -> sp.Matrix:
    """Ṁ along the motion."""
    return sp.diff(mass, q1) * v1 + sp.diff(mass, q2) * v2


@cache
def numeric() -> dict[str, Callable]:
    """NumPy functions of (q1, q2, v1, v2, θ): M, h, g, C (Christoffel), C_printed and energy."""
    motion = from_theta()
    arguments = (q1, q2, v1, v2, theta)
    expressions = {
        "M": motion.M,
        "h": motion.h,
        "g": motion.g,
        "C": christoffel(motion.M),
        "C_printed": coriolis(printed=True),
        "energy": motion.kinetic + motion.potential,
    }
    return {name: sp.lambdify(arguments, value, "numpy") for name, value in expressions.items()}
