"""Torques on the pendulum's row, effects on both rows, and changes of the parameters themselves."""

import math

from ..elementary import sincos, tanh
from .declaration import EffectType, Parameter
from .stribeck import other_exponent, stribeck_level, stribeck_parameters
from .words import Quantity, by_direction, either, near_standstill, percent


def _quadratic_drag(q2, v1, v2, plant_theta3, plant_theta4, c, λ):
    # a flat body on the pendulum goes through the air at ℓ q̇2 + L1 cos q2 q̇1, and θ3/θ4 is L1/ℓ at the pendulum's
    # centre of percussion
    sweep = λ * plant_theta3 / plant_theta4 * sincos(q2)[1]
    w = v2 + sweep * v1
    torque = -c * w * abs(w)
    return sweep * torque, torque


def _stribeck(v2, r2, ΔF, vs, δ):
    return 0.0, -stribeck_level(v2, ΔF, vs, δ) * tanh(r2 * v2)


def _coulomb_asymmetry(v2, r2, a):
    return 0.0, -a * abs(tanh(r2 * v2))


def _tilt_coefficients(αx, αy, G1):
    return αx, αy, G1 * αx, G1 * αy


def _tilt(q1, q2, theta5, αx, αy, G1):
    s1, c1 = sincos(q1)
    s2, c2 = sincos(q2)
    e = -αx * s1 + αy * c1
    arm = G1 * e - theta5 * s2 * (αx * c1 + αy * s1)
    return arm, theta5 * c2 * e


def _sharpness(plant_r1, plant_r2, r1, r2):
    return (r1 if r1 > 0.0 else plant_r1), (r2 if r2 > 0.0 else plant_r2)


def _payload(t, theta1, theta2, theta3, theta4, theta5, m, t0):
    if t < t0 or m == 0.0:
        return theta1, theta2, theta3, theta4, theta5
    th3, th5 = theta3 * (1.0 + m), theta5 * (1.0 + m)
    # the pendulum's own mass acts at its centre of mass, so m2 L1² = θ3²/θ2 and the rest scale with m2
    if theta2 > 0.0 and theta3 * theta3 <= theta1 * theta2:
        th1, th4 = theta1 + m * theta3 * theta3 / theta2, theta4 + m * theta2
        if th4 > 0.0 and th1 * th4 > th3 * th3:
            return th1, theta2 * (1.0 + m), th3, th4, th5
    # no rigid body has this θ2: all of θ4 goes with m2 l2² and θ3²/θ4 with m2 L1², which keeps M positive definite
    th1 = theta1 + m * theta3 * theta3 / theta4
    return th1, (theta2 * (1.0 + m) if theta2 > 0.0 else theta2 * th1 / theta1), th3, theta4 * (1.0 + m), th5


def _sharpness_says(r1, r2):
    found = [f"{r} on the {joint}" for r, joint in ((r1, "arm"), (r2, "pendulum")) if r > 0.0]
    return f"Friction sets in with a sharpness of {' and '.join(found) or 'the plant'}"


PENDULUM_EFFECTS = (
    EffectType(
        name="pendulum_quadratic_drag",
        title="air drag on the pendulum",
        place="arm and pendulum",
        equation="w = q̇2 + λ (θ3/θ4) cos q2 q̇1; pendulum: −c w |w|; arm: −c λ (θ3/θ4) cos q2 w |w|",
        symptom="large swings decay faster than small ones (air)",
        says=lambda c: f"A drag that grows with the square of its speed slows the pendulum: {c}",
        parameters=(
            Parameter("c", "{u}·s²/rad²", "drag coefficient", 1.0, relative_to="theta7", lower=0.0),
            Parameter(
                "λ",
                "1",
                "the arm's part in w: drag at ℓ from the joint has λ θ3/θ4 = L1/ℓ, at the end of a thin rod λ = 2/3",
                0.0,
                lower=0.0,
                upper=3.0,
                role="shape",
                grid=(0.0, 0.8),
                spread=1.0,
            ),
        ),
        kernels={"torque": _quadratic_drag},
        mistaken_for=("pendulum_stribeck",),
    ),
    EffectType(
        name="pendulum_stribeck",
        title="friction of the pendulum that grows near standstill",
        place="pendulum",
        equation="pendulum: −ΔF exp(−|q̇2/vs|^δ) tanh(r q̇2), δ = 2 in the plain law",
        symptom="the pendulum sticks near rest more than its friction in motion explains",
        says=lambda ΔF, vs: near_standstill("pendulum", ΔF, vs),
        parameters=stribeck_parameters("theta9", 1.0),
        kernels={"torque": _stribeck},
        wider=other_exponent,
        mistaken_for=("pendulum_quadratic_drag", "friction_sharpness"),
    ),
    EffectType(
        name="pendulum_coulomb_asymmetry",
        title="friction of the pendulum that differs by direction",
        place="pendulum",
        equation="pendulum: −a |tanh(r q̇2)|",
        symptom="the pendulum's joint drags more one way than the other",
        says=lambda a: by_direction("pendulum", a),
        parameters=(Parameter("a", "{u}", "half the difference of the levels", 0.5, relative_to="theta9"),),
        kernels={"torque": _coulomb_asymmetry},
        mistaken_for=("pendulum_encoder_offset", "base_tilt"),
    ),
    EffectType(
        name="base_tilt",
        title="a tilted base",
        place="arm and pendulum",
        equation="e = −αx sin q1 + αy cos q1; arm: +G1 e − θ5 sin q2 (αx cos q1 + αy sin q1); pendulum: +θ5 cos q2 e",
        symptom="the pendulum balances off its zero, by an amount that turns with the arm",
        says=lambda αx, αy: f"The base is tilted by {Quantity(math.hypot(αx, αy), 'rad')}",
        parameters=(
            Parameter(
                "αx",
                "rad",
                "how far the base leans down towards the arm's direction at q1 = 0",
                0.015,
                lower=-0.5,
                upper=0.5,
                of_a_day=True,
            ),
            Parameter(
                "αy",
                "rad",
                "the same towards the arm's direction at q1 = 90°",
                0.01,
                lower=-0.5,
                upper=0.5,
                of_a_day=True,
            ),
            Parameter(
                "G1",
                "{u}",
                "weight moment of arm and carried pendulum, at least θ5 L1/l2 without a counterweight",
                1.5,
                relative_to="theta5",
                lower=0.0,
                role="shape",
                grid=(0.5, 1.5, 4.0),
                span="linear",
                spread=0.8,  # unlimited, it is a spring: a small tilt with it passes for a cable
            ),
        ),
        kernels={"torque": _tilt},
        linear=_tilt_coefficients,
        mistaken_for=("pendulum_encoder_offset", "arm_spring", "input_offset", "arm_cable", "arm_taut_cable"),
    ),
    EffectType(
        name="friction_sharpness",
        title="friction that sets in at another sharpness",
        place="parameters",
        equation="tanh(r1 q̇1), tanh(r2 q̇2): r itself differs (0 keeps the plant's r)",
        symptom="friction turns over more softly or more sharply near standstill than the model's",
        says=_sharpness_says,
        parameters=(
            Parameter(
                "r1",
                "s/rad",
                "sharpness of the arm's Coulomb friction",
                12.0,
                lower=0.0,
                upper=1e4,
                grid=(10.0, 30.0, 300.0, 1000.0),
            ),
            Parameter(
                "r2",
                "s/rad",
                "sharpness of the pendulum's Coulomb friction",
                12.0,
                lower=0.0,
                upper=1e4,
                grid=(10.0, 30.0, 300.0, 1000.0),
            ),
        ),
        kernels={"theta": _sharpness},
        changes=("r1", "r2"),
        mistaken_for=("arm_stribeck", "pendulum_stribeck", "arm_presliding"),
    ),
    EffectType(
        name="payload_step",
        title="a load that changes during the run",
        place="parameters",
        equation="from t0 on θ1 … θ5 change as a mass m·m2 added at the pendulum's centre of mass would change them",
        symptom="the pendulum is heavier from some moment on, or lighter (m < 0)",
        says=lambda m, t0: f"From {t0} on, the pendulum is {percent(m)} {either(m, 'heavier', 'lighter')}",
        parameters=(
            Parameter("m", "1", "added mass over the pendulum's mass", 0.04, lower=-0.9, upper=10.0, of_a_day=True),
            Parameter(
                "t0", "s", "time of the change", 8.0, lower=0.0, role="shape", grid="times", jumps=True, of_a_day=True
            ),
        ),
        kernels={"theta": _payload},
        changes=("theta1", "theta2", "theta3", "theta4", "theta5"),
        mistaken_for=("arm_friction_drift",),
    ),
)
