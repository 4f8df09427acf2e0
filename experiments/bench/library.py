"""The nameable effects: one declaration each, with its size at strength 1 and its two forms.

Sizes scale with the rig: torques with its Coulomb friction, commands with its usual excitation, times with its
time constants, so that strength 1 is about equally plain on every parameter set (see `size.py`).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import PchipInterpolator

from .declaration import BenchEffect
from .kernels import fields as at

WARM_UP = 12.0  # s, time constant of the exponential form of the drifts
_FALLS = 1.0 / 24.0  # 1/s, at most: within the 20 s of a run friction falls to a sixth, never below zero
_FADES = 1.0 / 40.0  # 1/s, at most: within the 20 s of a run a motor loses half of its gain


def _library(name, says, other, units, sizes, build) -> BenchEffect:
    return BenchEffect(name, "library", says, units, sizes, build, other)


# ---- command ---------------------------------------------------------------------------------------------------


def _delay(d, p, bench):
    d.command.delay = p["d"]
    d.command.delay_flutter = 0.15 if bench else 0.0


def _lag(d, p, bench):
    d.put(lag_a=0.8 * p["T"] if bench else p["T"], lag_b=0.2 * p["T"] if bench else 0.0)


def _dead_zone(d, p, bench):
    d.command.dead_zone, d.command.dead_zone_round = p["w"], bench


def _saturation(d, p, bench):
    d.command.limit, d.command.limit_round = p["m"], bench


def _offset(d, p, bench):
    d.command.offset, d.command.offset_wander = p["b"], 0.1 if bench else 0.0


def _gain_asymmetry(d, p, bench):
    d.command.asymmetry = p["a"]
    d.command.asymmetry_width = 0.1 * d.kind.drive if bench else 0.0


def _cubic(d, p, bench):
    d.command.cubic, d.command.cubic_levels_off = p["a"], bench


def _fade(d, p, bench):
    d.put(fade=p["a"], fade_tau=WARM_UP if bench else math.inf)


_COMMAND = (
    _library(
        "input_delay", "τ(t) = u(t − d)", "the delay flutters by 15 %", {"d": "s"},
        lambda s, k, v: {"d": 0.03 * k * s.fall_time}, _delay,
    ),
    _library(
        "actuator_lag", "T τ̇ + τ = u", "two lags in series, 0.8 T and 0.2 T", {"T": "s"},
        lambda s, k, v: {"T": 0.03 * k * s.fall_time}, _lag,
    ),
    _library(
        "input_dead_zone", "τ = u − clip(u, −w, w)", "τ = u − w tanh(u/w)", {"w": "{u}"},
        lambda s, k, v: {"w": 0.8 * k * s.coulomb[0]}, _dead_zone,
    ),
    _library(
        "input_saturation", "τ = clip(u, −m, m)", "a round knee: u (1 + (u/m)⁴)^(−1/4)", {"m": "{u}"},
        lambda s, k, v: {"m": 1.6 * s.drive * s.plain / k}, _saturation,
    ),
    _library(
        "input_offset", "τ = u + b", "the offset wanders by 10 % over a minute", {"b": "{u}"},
        lambda s, k, v: {"b": 0.4 * k * v.sign() * s.coulomb[0]}, _offset,
    ),
    _library(
        "input_gain_asymmetry", "τ = u (1 + a sign u)", "the gain changes over a small range of u", {"a": "1"},
        lambda s, k, v: {"a": 0.05 * k * v.sign()}, _gain_asymmetry,
    ),
    _library(
        "input_cubic_gain", "τ = u + a u³", "levels off at large commands", {"a": "1/{u}²"},
        lambda s, k, v: {"a": 0.045 * k * v.sign() / s.drive**2}, _cubic,
    ),
    _library(
        "input_gain_drift", "arm: a t τ", "levels off as t/(1 + t/12 s)", {"a": "1/s"},
        lambda s, k, v: {"a": -min(0.005 * k, _FADES)}, _fade,
    ),
)  # fmt: skip


# ---- friction of the arm ---------------------------------------------------------------------------------------


def _stribeck1(d, p, bench):
    d.put(strib1=p["ΔF"], strib1_v=p["vs"], strib1_tail=1.0 if bench else 0.0)


def _asymmetry1(d, p, bench):
    d.put(asym1=p["a"], asym_turn=at.SMOOTH_ALGEBRAIC if bench else at.SMOOTH_TANH)


def _drag1(d, p, bench):
    d.put(drag1=p["c"], drag1_e=1.8 if bench else 2.0)


def _place(d, p, bench):
    d.put(place_sin=p["a"], place_cos=p["b"], place_2nd=0.2 if bench else 0.0)


def _presliding(d, p, bench):
    d.put(bristle=p["σ0"], bristle_e=2.0 if bench else 1.0)


def _warm_coulomb(d, p, bench):
    d.put(warm_c=p["a"], warm_c_tau=WARM_UP if bench else math.inf)


def _warm_viscous(d, p, bench):
    d.put(warm_v=p["a"], warm_v_tau=WARM_UP if bench else math.inf)


def _place_sizes(s, k, v):
    angle = v.near(0.54, 0.0, 2.0 * math.pi)
    size = 0.8 * k * s.coulomb[0]
    return {"a": size * math.cos(angle), "b": size * math.sin(angle)}


_ARM_FRICTION = (
    _library(
        "arm_stribeck", "arm: −ΔF exp(−(q̇1/vs)²) tanh(r q̇1)", "ΔF/(1 + (q̇1/vs)²)", {"ΔF": "{u}", "vs": "rad/s"},
        lambda s, k, v: {"ΔF": 0.9 * k * s.coulomb[0], "vs": v.near(0.3, 0.2, 0.5)}, _stribeck1,
    ),
    _library(
        "arm_coulomb_asymmetry", "arm: −a |tanh(r q̇1)|", "turns over as (r q̇1)²/(1 + (r q̇1)²)", {"a": "{u}"},
        lambda s, k, v: {"a": 0.35 * k * v.sign() * s.coulomb[0]}, _asymmetry1,
    ),
    _library(
        "arm_quadratic_drag", "arm: −c q̇1 |q̇1|", "power 1.8", {"c": "{u}·s²/rad²"},
        lambda s, k, v: {"c": 1.2 * k * s.coulomb[0]}, _drag1,
    ),
    _library(
        "arm_position_friction", "arm: −(a sin q1 + b cos q1) tanh(r q̇1)", "with a second harmonic",
        {"a": "{u}", "b": "{u}"}, _place_sizes, _place,
    ),
    _library(
        "arm_presliding", "arm: Coulomb torque replaced by a bristle (Dahl)", "exponent 2", {"σ0": "{u}/rad"},
        lambda s, k, v: {"σ0": 100.0 * s.coulomb[0] / k}, _presliding,
    ),
    _library(
        "arm_friction_drift", "arm: −θ8 a t tanh(r q̇1)", "exponential warm-up", {"a": "1/s"},
        lambda s, k, v: {"a": -min(0.03 * k, _FALLS)}, _warm_coulomb,
    ),
    _library(
        "arm_viscous_drift", "arm: −θ6 a t q̇1", "exponential warm-up", {"a": "1/s"},
        lambda s, k, v: {"a": 0.05 * k * s.coulomb[0] / s.viscous[0]}, _warm_viscous,
    ),
)  # fmt: skip


# ---- other torques on the arm ----------------------------------------------------------------------------------


def _spring(d, p, bench):
    d.put(spring=p["k"], spring_q=p["q1n"], spring_cubic=0.15 if bench else 0.0)


def _cable(d, p, bench):
    if not bench:
        d.put(spring=p["k"], spring_q=p["q1n"])
        d.put(stiffer=p["k3"], stiffer_q=p["q1s"], stiffer_from=p["q1n"])
        return
    points = np.linspace(-3.0, 3.0, at.TABLE)
    e = points - p["q1s"]
    _measured(d, points, p["k"] * points + p["k3"] * np.sign(e) * np.abs(e) ** 2.5, p["q1n"])


def _taut(d, p, bench):
    def pull(q):
        return p["k1"] * np.minimum(q - p["qt"], 0.0) + p["k2"] * np.maximum(q - p["qt"], 0.0)

    if not bench:
        d.put(below=p["k1"], above=p["k2"], taut_q=p["qt"], taut_rest=float(pull(p["q1n"])))
        return
    points = p["qt"] + np.linspace(-2.75, 3.25, at.TABLE)  # qt lies between two of them
    _measured(d, points, pull(points), p["q1n"])


def _measured(d, points, torques, rest):
    """A table read smoothly and without overshoot: a cable's torque has no corners and does not turn back."""
    curve = PchipInterpolator(points, torques)
    d.put(table=torques - curve(rest), slopes=curve.derivative()(points))
    d.put(table_from=points[0], table_step=points[1] - points[0])


def _hysteresis(d, p, bench):
    d.put(cable=p["κ"], cable_q=p["d"], cable_e=2.0 if bench else math.inf)


def _cable_sizes(s, k, v):
    side, size = v.sign(), k * s.coulomb[0]
    return {
        "k": size,
        "q1n": v.near(0.3, -0.5, 0.5),
        "k3": size,
        "q1s": -side * v.near(0.4, 0.2, 0.7),
    }


def _taut_sizes(s, k, v):
    soft, stiff = 0.3 * k * s.coulomb[0], 6.0 * k * s.coulomb[0]
    below, above = (soft, stiff) if v.sign() > 0.0 else (stiff, soft)
    return {"k1": below, "k2": above, "q1n": v.near(0.1, -0.3, 0.3), "qt": v.near(0.05, -0.15, 0.15)}


def _ripple(d, p, bench):
    d.put(ripple=p["A"], ripple_n=p["n"], ripple_phase=p["φ"], ripple_2nd=0.15 if bench else 0.0)


def _beat(d, p, bench):
    shape = at.SINE_WITH_OVERTONE if bench else at.SINE
    d.put(beat=p["A"], beat_f=p["f"], beat_phase=p["φ"], beat_shape=shape)


def _backlash_sizes(s, k, v):
    th1, _, th3, th4 = s.inertia[:4]
    most = 0.7 * (1.0 - th3**2 / (th1 * th4))  # what is left turns the arm
    return {"b": 0.012 * k, "ρ": min(v.near(0.1, 0.05, 0.45), most)}


def _backlash(d, p, bench):
    heavier, rate, damping = (1.2, 300.0, 0.4) if bench else (1.0, 200.0, 0.7)
    share = heavier * p["ρ"]
    th1, _, th3, th4 = d.kind.inertia[:4]
    j, both = share * th1, th1 - th3**2 / th4
    reduced = j * (both - j) / both  # of motor and arm against each other
    d.join(at.PLAY, share, motor_j=j, join_k=reduced * rate**2, join_c=2 * damping * reduced * rate, join_gap=p["b"])


_ARM_TORQUES = (
    _library(
        "arm_spring", "arm: −k (q1 − q1n)", "stiffens: k e (1 + 0.15 e²)", {"k": "{u}/rad", "q1n": "rad"},
        lambda s, k, v: {"k": 2.0 * k * s.coulomb[0], "q1n": v.near(0.3, -0.5, 0.5)}, _spring,
    ),
    _library(
        "arm_cable", "arm: −k (q1 − q1n) − k3 ((q1 − q1s)³ − (q1n − q1s)³)",
        "a smooth curve through a table, stiffens by the power 2.5",
        {"k": "{u}/rad", "q1n": "rad", "k3": "{u}/rad³", "q1s": "rad"}, _cable_sizes, _cable,
    ),
    _library(
        "arm_taut_cable", "arm: −(g(q1) − g(q1n)), g(q) = k1 (q − qt) for q < qt, k2 (q − qt) beyond",
        "a smooth curve through a table, comes taut over a radian",
        {"k1": "{u}/rad", "k2": "{u}/rad", "q1n": "rad", "qt": "rad"}, _taut_sizes, _taut,
    ),
    _library(
        "arm_hysteresis", "arm: −κ z, z ← clip(z + Δq1, ±d)", "yields gradually (Bouc–Wen, exponent 2)",
        {"κ": "{u}/rad", "d": "rad"},
        lambda s, k, v: {"κ": 8.0 * k * s.coulomb[0], "d": v.near(0.08, 0.06, 0.12)}, _hysteresis,
    ),
    _library(
        "arm_ripple", "arm: −A sin(n q1 + φ)", "with a second harmonic of 15 %",
        {"A": "{u}", "n": "1", "φ": "rad"},
        lambda s, k, v: {
            "A": 0.6 * k * s.coulomb[0],
            "n": v.one_of(12.0, 8.0, 14.0, 16.0, 20.0),
            "φ": v.near(0.5, -3.0, 3.0),
        }, _ripple,
    ),
    _library(
        "periodic_torque", "arm: +A sin(2π f t + φ)", "with a second harmonic of 15 %",
        {"A": "{u}", "f": "Hz", "φ": "rad"},
        lambda s, k, v: {"A": 0.8 * k * s.coulomb[0], "f": v.near(3.3, 1.5, 6.0), "φ": v.near(0.0, -3.0, 3.0)},
        _beat,
    ),
    _library(
        "arm_backlash", "play of width 2b between motor (ρ θ1) and arm", "harder stop, heavier rotor",
        {"b": "rad", "ρ": "1"}, _backlash_sizes, _backlash,
    ),
)  # fmt: skip


# ---- pendulum, both, sensors -----------------------------------------------------------------------------------


def _drag2(d, p, bench):
    sweep = p["λ"] * d.kind.inertia[2] / d.kind.inertia[3]
    d.put(drag2=p["c"], drag2_e=1.8 if bench else 2.0, drag2_sweep=sweep)


def _stribeck2(d, p, bench):
    d.put(strib2=p["ΔF"], strib2_v=p["vs"], strib2_tail=1.0 if bench else 0.0)


def _asymmetry2(d, p, bench):
    d.put(asym2=p["a"], asym_turn=at.SMOOTH_ALGEBRAIC if bench else at.SMOOTH_TANH)


def _sharpness(d, p, bench):
    turn = at.SMOOTH_ALGEBRAIC if bench else at.SMOOTH_TANH
    d.put(r1=p["r1"], r2=p["r2"], turn1=turn, turn2=turn)


def _payload(d, p, bench):
    # a fraction m of m2 at l2, both as θ1 … θ5 tell them; the other form: nearer the joint, put on over 0.1 s
    place = (0.75 if bench else 1.0) * d.kind.pendulum_com
    d.put(pay_m=p["m"] * d.kind.pendulum_mass, pay_s=place, pay_arm=d.kind.arm_length, pay_t=p["t0"])
    d.put(pay_ramp=0.1 if bench else 0.0)


def _tilt(d, p, bench):
    ax, ay = p["αx"], p["αy"]
    exact = (-math.sin(ax), -math.sin(ay) * math.cos(ax), math.cos(ay) * math.cos(ax))
    d.up = exact if bench else (-ax, -ay, 1.0)
    d.put(nx=d.up[0], ny=d.up[1], nz=d.up[2])


def _encoder_offset(d, p, bench):
    d.encoders.offset2, d.encoders.offset2_creep = p["b"], 0.005 if bench else 0.0


def _eccentricity1(d, p, bench):
    d.encoders.eccentricity1, d.encoders.off_centre = (p["a"], p["b"]), bench


def _eccentricity2(d, p, bench):
    d.encoders.eccentricity2, d.encoders.off_centre = (p["a"], p["b"]), bench


def _sharpness_sizes(s, k, v):
    r = s.sharpness / (1.0 + 9.0 * k)
    return {"r1": r, "r2": r}


def _eccentricity_sizes(s, k, v):
    return {"a": 0.05 * k * v.sign(), "b": 0.05 * k * v.sign()}


_REST = (
    _library(
        "pendulum_quadratic_drag", "−c w |w| along w = q̇2 + λ (θ3/θ4) cos q2 q̇1, on both joints", "power 1.8",
        {"c": "{u}·s²/rad²", "λ": "1"},
        lambda s, k, v: {"c": 0.8 * k * s.inertia[3], "λ": v.near(0.0, 0.5, 1.1)}, _drag2,
    ),
    _library(
        "pendulum_stribeck", "pendulum: −ΔF exp(−(q̇2/vs)²) tanh(r q̇2)", "ΔF/(1 + (q̇2/vs)²)",
        {"ΔF": "{u}", "vs": "rad/s"},
        lambda s, k, v: {"ΔF": 2.0 * k * s.coulomb[1], "vs": v.near(0.3, 0.2, 0.5)}, _stribeck2,
    ),
    _library(
        "pendulum_coulomb_asymmetry", "pendulum: −a |tanh(r q̇2)|", "turns over as (r q̇2)²/(1 + (r q̇2)²)",
        {"a": "{u}"}, lambda s, k, v: {"a": 0.7 * k * v.sign() * s.coulomb[1]}, _asymmetry2,
    ),
    _library(
        "friction_sharpness", "tanh(r1 q̇1), tanh(r2 q̇2) with other r", "x/√(1 + x²) in place of tanh x",
        {"r1": "s/rad", "r2": "s/rad"}, _sharpness_sizes, _sharpness,
    ),
    _library(
        "payload_step", "θ1 … θ5 change at t0 as by a mass m·m2 at the centre of mass",
        "nearer the joint, put on over 0.1 s", {"m": "1", "t0": "s"},
        lambda s, k, v: {"m": 0.22 * k * s.inertia[3] / s.inertia[1], "t0": v.near(8.0, 5.0, 13.0)}, _payload,
    ),
    _library(
        "base_tilt", "gravity tilted by αx, αy (linear in them)", "gravity turned exactly",
        {"αx": "rad", "αy": "rad", "G1": "{u}"},
        lambda s, k, v: {"αx": 0.016 * k * v.sign(), "αy": 0.011 * k * v.sign(), "G1": s.weight_moment}, _tilt,
    ),
    _library(
        "pendulum_encoder_offset", "y2 = q2 + b", "b creeps by 0.5 % a second", {"b": "rad"},
        lambda s, k, v: {"b": 0.01 * k * v.sign()}, _encoder_offset,
    ),
    _library(
        "pendulum_encoder_eccentricity", "y2 = q2 + a sin q2 + b (cos q2 − 1)", "exact geometry of a disc off centre",
        {"a": "rad", "b": "rad"}, _eccentricity_sizes, _eccentricity2,
    ),
    _library(
        "arm_encoder_eccentricity", "y1 = q1 + a sin q1 + b (cos q1 − 1)", "exact geometry of a disc off centre",
        {"a": "rad", "b": "rad"}, _eccentricity_sizes, _eccentricity1,
    ),
)  # fmt: skip

EFFECTS: tuple[BenchEffect, ...] = (*_COMMAND, *_ARM_FRICTION, *_ARM_TORQUES, *_REST)
