"""The two bodies in motion: mass matrix and the forces that inertia and weight exert, from the energies.

Two sources, one interface. Either Lagrange's equations from M(q2) and its derivative, with no Coriolis matrix
written down (T = ½ q̇ᵀ M q̇ gives h = Ṁ q̇ − ½ ∂(q̇ᵀ M q̇)/∂q + ∂V/∂q), or MuJoCo's rigid bodies, called through
the C library's address.
"""

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .compiled import compiled
from .fields import Q1, Q2, V1, V2


def _caller(n: int) -> Any:
    """An intrinsic that calls a C function of `n` pointers, given by its address."""

    def codegen(context, builder, signature, args):
        word = args[0].type
        kind = ir.FunctionType(ir.VoidType(), [word] * n).as_pointer()
        builder.call(builder.inttoptr(args[0], kind), list(args[1:]))
        return context.get_dummy_value()

    return codegen


@intrinsic
def _call2(typing_context, address, a, b):
    return types.void(types.intp, types.intp, types.intp), _caller(2)


@intrinsic
def _call4(typing_context, address, a, b, c, d):
    return types.void(types.intp, types.intp, types.intp, types.intp, types.intp), _caller(4)


@compiled
def _smooth_step(t, start, width):
    """(value, rate, second rate) of a fifth-degree step from 0 to 1 between `start` and `start + width`."""
    if t <= start:
        return 0.0, 0.0, 0.0
    if t >= start + width:
        return 1.0, 0.0, 0.0
    z = (t - start) / width
    value = z * z * z * (10.0 - 15.0 * z + 6.0 * z * z)
    rate = 30.0 * z * z * (1.0 - z) * (1.0 - z) / width
    return value, rate, 60.0 * z * (1.0 - z) * (1.0 - 2.0 * z) / (width * width)


@compiled
def payload(t, p):
    """(mass, place, speed, acceleration) of the mass on the pendulum, along the pendulum."""
    m = p.pay_m if t >= p.pay_t else 0.0
    if p.pay_ramp > 0.0:
        m = p.pay_m * _smooth_step(t, p.pay_t, p.pay_ramp)[0]
    s, ds, dds = p.pay_s, 0.0, 0.0
    if p.move != 0.0:
        for start in (p.move_t1, p.move_t2, p.move_t3):
            a, b, c = _smooth_step(t, start, p.move_time)
            s, ds, dds = s + p.move * a, ds + p.move * b, dds + p.move * c
    return m, s, ds, dds


@compiled
def _lagrange(t, x, p):
    q1, q2, v1, v2 = x[Q1], x[Q2], x[V1], x[V2]
    sine, cosine = math.sin(q2), math.cos(q2)
    th1, th2, th3, th4, th5, g1 = p.th1, p.th2, p.th3, p.th4, p.th5, p.g1
    moving1, moving2 = 0.0, 0.0
    if p.pay_m != 0.0:
        m, s, ds, dds = payload(t, p)
        th1, th2, th3, th4 = th1 + m * p.pay_arm**2, th2 + m * s * s, th3 + m * p.pay_arm * s, th4 + m * s * s
        th5, g1 = th5 + m * p.gravity * s, g1 + m * p.gravity * p.pay_arm
        # a mass that moves along the rod: m s̈ e + 2 m ṡ ė, e the rod's direction, projected on ∂position/∂q
        moving1 = m * (p.pay_arm * (dds * sine + 2.0 * ds * cosine * v2) + 2.0 * s * ds * sine * sine * v1)
        moving2 = 2.0 * m * s * ds * v2
    m11, m12, m22 = th1 + th2 * sine * sine, th3 * cosine, th4
    d11, d12 = 2.0 * th2 * sine * cosine, -th3 * sine  # ∂M/∂q2
    h1 = (d11 * v1 + d12 * v2) * v2 + moving1
    h2 = d12 * v1 * v2 - 0.5 * (d11 * v1 * v1 + 2.0 * d12 * v1 * v2) + moving2
    # V = th5 (n · (sin q2 t̂ + cos q2 ẑ)) + g1 (n · r̂), r̂ = (cos q1, sin q1, 0), t̂ = ∂r̂/∂q1
    if p.nx != 0.0 or p.ny != 0.0:
        along_r = p.nx * math.cos(q1) + p.ny * math.sin(q1)
        along_t = -p.nx * math.sin(q1) + p.ny * math.cos(q1)
        h1 += -th5 * sine * along_r + g1 * along_t
        h2 += th5 * cosine * along_t
    h2 -= th5 * p.nz * sine
    return m11, m12, m22, h1, h2


@compiled
def _mujoco(x, p, link):
    position, velocity, bias, unit, column = link
    position[0], position[1], velocity[0], velocity[1] = x[Q1], x[Q2], x[V1], x[V2]
    _call2(p.mj_forward, p.mj_model, p.mj_data)  # pyrefly: ignore[missing-argument]
    unit[0], unit[1] = 1.0, 0.0
    _call4(p.mj_mulm, p.mj_model, p.mj_data, column.ctypes.data, unit.ctypes.data)  # pyrefly: ignore[missing-argument]
    m11, m12 = column[0], column[1]
    unit[0], unit[1] = 0.0, 1.0
    _call4(p.mj_mulm, p.mj_model, p.mj_data, column.ctypes.data, unit.ctypes.data)  # pyrefly: ignore[missing-argument]
    return m11, m12, column[1], bias[0], bias[1]


@compiled
def mass_and_bias(t, x, p, link):
    """(M11, M12, M22, h1, h2) of M q̈ + h = Q."""
    if p.mujoco != 0:
        return _mujoco(x, p, link)
    return _lagrange(t, x, p)


@compiled
def energy(t, x, p):
    """Kinetic plus potential energy of arm and pendulum (Lagrange's bodies), payload at rest on the rod."""
    sine, cosine = math.sin(x[Q2]), math.cos(x[Q2])
    th1, th2, th3, th4, th5, g1 = p.th1, p.th2, p.th3, p.th4, p.th5, p.g1
    if p.pay_m != 0.0:
        m, s, _, _ = payload(t, p)
        th1, th2, th3, th4 = th1 + m * p.pay_arm**2, th2 + m * s * s, th3 + m * p.pay_arm * s, th4 + m * s * s
        th5, g1 = th5 + m * p.gravity * s, g1 + m * p.gravity * p.pay_arm
    v1, v2 = x[V1], x[V2]
    kinetic = 0.5 * (th1 + th2 * sine * sine) * v1 * v1 + th3 * cosine * v1 * v2 + 0.5 * th4 * v2 * v2
    along_r = p.nx * math.cos(x[Q1]) + p.ny * math.sin(x[Q1])
    along_t = -p.nx * math.sin(x[Q1]) + p.ny * math.cos(x[Q1])
    return kinetic + th5 * (sine * along_t + cosine * p.nz) + g1 * along_r
