"""Torques on arm and pendulum, and the rate of the whole state.

An axis with hard friction is in one of three modes: −1 and +1 (slipping that way, friction −mode × level) or
0 (stuck: its acceleration is exactly zero, and the torque that holds it is found from the equations of motion).
"""

import math

from .body import mass_and_bias
from .compiled import compiled
from .fields import (
    BRISTLE,
    CABLE,
    FLEXIBLE,
    LAG_A,
    LAG_B,
    PLAY,
    Q1,
    Q2,
    QM,
    RIGID,
    SAWTOOTH,
    SINE,
    SINE_WITH_OVERTONE,
    SMOOTH_TANH,
    TABLE,
    TWIST,
    V1,
    V2,
    VM,
)


@compiled
def _warmed(t, rate, tau):
    """Relative change after t seconds: linear, or exponential with the same initial rate."""
    return rate * t if math.isinf(tau) else rate * tau * (1.0 - math.exp(-t / tau))


@compiled
def _stribeck(v, size, speed, tail):
    """How much larger friction is than in fast motion: Gauss's curve, or size/(1 + (v/speed)²), with its long tail
    (Hess and Soom 1990)."""
    x = (v / speed) ** 2
    return size / (1.0 + x) if tail > 0.0 else size * math.exp(-x)


@compiled
def arm_level(t, q, v, p):
    """Coulomb level of the arm axis, the part that does not depend on the direction."""
    level = 0.0 if p.bristle > 0.0 else p.fc1
    level += _stribeck(v, p.strib1, p.strib1_v, p.strib1_tail) if p.strib1 != 0.0 else 0.0
    if p.warm_c != 0.0:
        level += p.fc1 * _warmed(t, p.warm_c, p.warm_c_tau)
    if p.place_sin != 0.0 or p.place_cos != 0.0:
        level += p.place_sin * math.sin(q) + p.place_cos * math.cos(q)
        level += p.place_2nd * math.hypot(p.place_sin, p.place_cos) * math.sin(2.0 * q)
    return level


@compiled
def pendulum_level(v, p):
    """Coulomb level of the pendulum axis, the part that does not depend on the direction."""
    if p.strib2 == 0.0:
        return p.fc2
    return p.fc2 + _stribeck(v, p.strib2, p.strib2_v, p.strib2_tail)


@compiled
def _turn(rv, shape):
    """A smooth sign function of slope 1."""
    return math.tanh(rv) if shape == SMOOTH_TANH else rv / math.sqrt(1.0 + rv * rv)


@compiled
def _dry(level, asymmetry, v, r, shape, asymmetry_shape, hard, mode):
    """Dry friction's torque; `asymmetry` is added to the level of positive speeds and taken from negative ones."""
    if hard:
        return -mode * level - asymmetry * abs(mode)
    rv = r * v
    weight = abs(math.tanh(rv)) if asymmetry_shape == SMOOTH_TANH else rv * rv / (1.0 + rv * rv)
    return -level * _turn(rv, shape) - asymmetry * weight


@compiled
def _drag(c, e, v):
    return -c * abs(v) ** (e - 1.0) * v if c != 0.0 else 0.0


@compiled
def _beat(t, p):
    phase = 2.0 * math.pi * p.beat_f * t + p.beat_phase
    if p.beat_shape == SINE:
        return p.beat * math.sin(phase)
    if p.beat_shape == SINE_WITH_OVERTONE:
        return p.beat * (math.sin(phase) + 0.15 * math.sin(2.0 * phase + 1.0))
    turns = phase / (2.0 * math.pi)
    turns -= math.floor(turns)
    if p.beat_shape == SAWTOOTH:
        return p.beat * (2.0 * turns - 1.0)
    return p.beat if turns < 0.5 else -p.beat


@compiled
def _saturating_rate(v, z, limit, exponent):
    """Rate of a deflection that follows v while it unloads and stops growing at ±limit."""
    return v if v * z <= 0.0 else v * (1.0 - min(1.0, abs(z / limit)) ** exponent)


@compiled
def _join(x, p):
    """(torque from the second body to the arm, rate of the twist)."""
    w = x[VM] - x[V1]
    if p.join == FLEXIBLE:
        return p.join_k * (x[QM] - x[Q1]) + p.join_c * w, 0.0
    if p.join == PLAY:
        s = x[QM] - x[Q1]
        if s > p.join_gap:
            return max(0.0, p.join_k * (s - p.join_gap) + p.join_c * w), 0.0
        if s < -p.join_gap:
            return min(0.0, p.join_k * (s + p.join_gap) + p.join_c * w), 0.0
        return 0.0, 0.0
    # slips faster and faster with the torque: join_slip [rad/s] at the torque join_limit, by its third power
    rate = w - p.join_slip * (p.join_k * x[TWIST] / p.join_limit) ** 3
    return p.join_k * x[TWIST] + p.join_c * rate, rate


@compiled
def _looked_up(q, p):
    """The table at q: cubics with the given slopes at its points, straight on beyond the first and the last."""
    place = (q - p.table_from) / p.table_step
    if place <= 0.0:
        return p.table[0] + (q - p.table_from) * p.slopes[0]
    if place >= TABLE - 1.0:
        return p.table[TABLE - 1] + (place - (TABLE - 1.0)) * p.table_step * p.slopes[TABLE - 1]
    i = int(place)
    s = place - i
    height = p.table[i] + (3.0 - 2.0 * s) * s * s * (p.table[i + 1] - p.table[i])
    return height + s * (1.0 - s) * ((1.0 - s) * p.slopes[i] - s * p.slopes[i + 1]) * p.table_step


@compiled
def _arm_torques(t, x, p):
    """What acts on the arm itself and is not friction."""
    q1 = x[Q1]
    total = 0.0
    if p.spring != 0.0:
        e = q1 - p.spring_q
        total -= p.spring * e * (1.0 + p.spring_cubic * e * e)
    if p.stiffer != 0.0:
        total -= p.stiffer * ((q1 - p.stiffer_q) ** 3 - (p.stiffer_from - p.stiffer_q) ** 3)
    if p.below != 0.0 or p.above != 0.0:
        total += p.taut_rest - (p.above if q1 > p.taut_q else p.below) * (q1 - p.taut_q)
    if p.table_step > 0.0:
        total -= _looked_up(q1, p)
    if p.ripple != 0.0:
        angle = p.ripple_n * q1 + p.ripple_phase
        total -= p.ripple * (math.sin(angle) + p.ripple_2nd * math.sin(2.0 * angle))
    if p.beat != 0.0:
        total += _beat(t, p)
    if p.cable != 0.0:
        total -= p.cable * x[CABLE]
    return total


@compiled
def derivative(t, x, tau, n1, n2, s1, s2, params, link, dx):
    """Fill dx = dx/dt; return the torques (λ1, λ2) that hold the stuck axes (0 where an axis is not stuck).

    tau: command after delay and static maps; n1, n2: disturbance torques; s1, s2: modes of the two axes.
    """
    p = params[0]
    hard = p.hard != 0
    q1, v1, v2 = x[Q1], x[V1], x[V2]
    dx[:] = 0.0
    drive = tau
    if p.lag_a > 0.0:
        dx[LAG_A] = (drive - x[LAG_A]) / p.lag_a
        drive = x[LAG_A]
    if p.lag_b > 0.0:
        dx[LAG_B] = (drive - x[LAG_B]) / p.lag_b
        drive = x[LAG_B]
    if p.fade != 0.0:
        drive *= 1.0 + p.fade * t / (1.0 + t / p.fade_tau)

    at_motor = p.friction_at_motor != 0
    qf, vf = (x[QM], x[VM]) if at_motor else (q1, v1)
    friction = _dry(arm_level(t, qf, vf, p), p.asym1, vf, p.r1, p.turn1, p.asym_turn, hard, s1)
    viscous = p.fv1 + p.back_emf
    if p.warm_v != 0.0:
        viscous += p.fv1 * _warmed(t, p.warm_v, p.warm_v_tau)
    friction += _drag(p.drag1, p.drag1_e, vf) - viscous * vf
    if p.bristle > 0.0:
        friction -= p.bristle * x[BRISTLE]
        limit = p.fc1 / p.bristle
        if p.bristle_e == 1.0:
            dx[BRISTLE] = vf - abs(vf) * x[BRISTLE] / limit
        else:
            dx[BRISTLE] = _saturating_rate(vf, x[BRISTLE], limit, p.bristle_e)

    f1 = n1 + _arm_torques(t, x, p)
    hold1 = hard and s1 == 0
    lam1, lam2 = 0.0, 0.0
    if p.join == RIGID:
        f1 += drive + friction
    else:
        through, dx[TWIST] = _join(x, p)
        f1 += through
        motor = -through
        if p.join == FLEXIBLE:
            f1 += drive
        else:
            motor += drive
        if at_motor:
            motor += friction
        else:
            f1 += friction
        if hold1 and at_motor:
            lam1, motor = -motor, 0.0
        dx[QM] = x[VM]
        dx[VM] = motor / p.motor_j
    f2 = n2 + _dry(pendulum_level(v2, p), p.asym2, v2, p.r2, p.turn2, p.asym_turn, hard, s2)
    lever = p.drag2_sweep * math.cos(x[Q2]) if p.drag2_sweep != 0.0 else 0.0
    air = _drag(p.drag2, p.drag2_e, v2 + lever * v1)
    f1 += lever * air
    f2 += air - p.fv2 * v2

    m11, m12, m22, h1, h2 = mass_and_bias(t, x, p, link)
    f1 -= h1
    f2 -= h2
    hold_arm, hold_pendulum = hold1 and not at_motor, hard and s2 == 0
    if hold_arm and hold_pendulum:
        a1, a2 = 0.0, 0.0
        lam1, lam2 = -f1, -f2
    elif hold_arm:
        a1, a2 = 0.0, f2 / m22
        lam1 = m12 * a2 - f1
    elif hold_pendulum:
        a1, a2 = f1 / m11, 0.0
        lam2 = m12 * a1 - f2
    else:
        det = m11 * m22 - m12 * m12
        a1, a2 = (m22 * f1 - m12 * f2) / det, (m11 * f2 - m12 * f1) / det
    dx[Q1], dx[Q2], dx[V1], dx[V2] = v1, v2, a1, a2
    if p.cable != 0.0:
        dx[CABLE] = _saturating_rate(v1, x[CABLE], p.cable_q, p.cable_e)
    return lam1, lam2
