"""Torques on the arm's row of model (5) that the paper leaves out: friction beyond viscous + Coulomb, spring, cogging,
play. Cables with other laws are in `cable`."""

import math
from collections.abc import Mapping

from ..compiled import compiled
from ..elementary import exp, log, sincos, tanh
from .declaration import EffectType, FrictionMemory, Parameter
from .stribeck import other_exponent, stribeck_level, stribeck_parameters
from .words import Quantity, by_direction, either, near_standstill, percent


def _stribeck(v1, r1, ΔF, vs, δ):
    return -stribeck_level(v1, ΔF, vs, δ) * tanh(r1 * v1), 0.0


def _coulomb_asymmetry(v1, r1, a):
    return -a * abs(tanh(r1 * v1)), 0.0


def _quadratic_drag(v1, c):
    return -c * v1 * abs(v1), 0.0


def _spring(q1, k, q1n):
    return -k * (q1 - q1n), 0.0


def _ripple(q1, A, n, φ):
    return -A * sincos(n * q1 + φ)[0], 0.0


def _position_friction(q1, v1, r1, a, b):
    s, c = sincos(q1)
    return -(a * s + b * c) * tanh(r1 * v1), 0.0


def _friction_drift(t, v1, theta8, r1, a):
    change = a * t
    return -theta8 * (change if change > -1.0 else -1.0) * tanh(r1 * v1), 0.0  # friction drives nothing


def _viscous_drift(t, v1, theta6, a):
    change = a * t
    return -theta6 * (change if change > -1.0 else -1.0) * v1, 0.0


def _periodic(t, A, f, φ):
    return A * sincos(2.0 * math.pi * f * t + φ)[0], 0.0


def _presliding(v1, theta8, r1, σ0, z):
    # takes the Coulomb torque out and puts the bristle's in; σ0 = inf is a rigid bristle: Coulomb again
    if math.isinf(σ0):
        return 0.0, 0.0
    return theta8 * tanh(r1 * v1) - σ0 * z, 0.0


# The bristle settles at σ0 |q̇1| / θ8. Faster than this [1/s] it is at its end value within any step
# that the step rule allows, and following it exactly would make Runge–Kutta unstable (2.8 / h).
_FASTEST_BRISTLE = 1000.0
_LEAST_TO_GO = 1e-9  # of the bristle's end value, where an exponent below 1 has no finite rate


def _presliding_rate(v1, theta8, σ0, i, z):
    if math.isinf(σ0):
        return 0.0
    settled = theta8 / σ0 if v1 > 0.0 else -theta8 / σ0
    if theta8 <= 0.0:
        return _FASTEST_BRISTLE * (settled - z)
    rate = σ0 * abs(v1) / theta8
    if i != 1.0:
        to_go = 1.0 - z / settled
        if to_go >= 0.0:  # else a step went too far, and it comes back as for i = 1: the power has nothing to say there
            rate *= exp((i - 1.0) * log(to_go if to_go > _LEAST_TO_GO else _LEAST_TO_GO))
    return min(rate, _FASTEST_BRISTLE) * (settled - z)


def _bristle_of_stops(stops: Mapping[str, float]) -> tuple[float, dict[str, float]]:
    """The level at which stop elements slip, and a bristle that yields nearly as abruptly as they do."""
    level = stops["κ"] * stops["d"] + stops["κ2"] * stops["d2"]
    return level, {"σ0": stops["κ"] + stops["κ2"], "i": 0.5}


def _other_shape(own: Mapping[str, float]) -> tuple[dict[str, float], ...]:
    """A bristle that yields later, and more abruptly; and one that yields from the start and never quite slips."""
    return () if own["i"] != 1.0 else ({**own, "i": 0.5}, {**own, "i": 1.5})


# The stop that the rotor hits: a stiff damped contact. Rotor and arm swing against each other in it at 200 rad/s where
# the pendulum gives way, which is fast against the arm and slow enough for the step rule, whatever the rotor's share.
_STOP_RATE = 200.0
_STOP_DAMPING = 0.7
_MOST_OF_ROTOR = 0.9  # of the inertia that the arm has where the pendulum gives way


@compiled(forceinline=True)
def _rotor_inertia(theta1, theta3, theta4, ρ):
    """Of the motor's side. What is left on the arm's side keeps the mass matrix positive definite."""
    return min(ρ * theta1, _MOST_OF_ROTOR * (theta1 - theta3 * theta3 / theta4))


@compiled(forceinline=True)
def _contact_torque(theta1, theta3, theta4, inertia, b, s, w):
    """Torque from rotor to arm when the rotor leads by s [rad] at w [rad/s]; stops push, they never pull."""
    both = theta1 - theta3 * theta3 / theta4
    reduced = inertia * (both - inertia) / both
    stiffness, damping = reduced * _STOP_RATE**2, 2.0 * _STOP_DAMPING * reduced * _STOP_RATE
    if s > b:
        return max(0.0, stiffness * (s - b) + damping * w)
    if s < -b:
        return min(0.0, stiffness * (s + b) + damping * w)
    return 0.0


def _backlash_theta(theta1, plant_theta1, plant_theta3, plant_theta4, b, ρ):
    return theta1 - _rotor_inertia(plant_theta1, plant_theta3, plant_theta4, ρ) if b > 0.0 else theta1


def _backlash(tau, plant_theta1, plant_theta3, plant_theta4, b, ρ, s, w):
    if b <= 0.0:
        return 0.0, 0.0
    inertia = _rotor_inertia(plant_theta1, plant_theta3, plant_theta4, ρ)
    return _contact_torque(plant_theta1, plant_theta3, plant_theta4, inertia, b, s, w) - tau, 0.0


def _backlash_rate(tau, a1, plant_theta1, plant_theta3, plant_theta4, b, ρ, s, w):
    if b <= 0.0:
        return 0.0, 0.0
    inertia = _rotor_inertia(plant_theta1, plant_theta3, plant_theta4, ρ)
    into_arm = _contact_torque(plant_theta1, plant_theta3, plant_theta4, inertia, b, s, w)
    return w, (tau - into_arm) / inertia - a1


ARM_EFFECTS = (
    EffectType(
        name="arm_stribeck",
        title="friction of the arm that grows near standstill",
        place="arm",
        equation="arm: −ΔF exp(−|q̇1/vs|^δ) tanh(r q̇1), δ = 2 in the plain law",
        symptom="friction is larger near standstill than the Coulomb level it settles to in motion",
        says=lambda ΔF, vs: near_standstill("arm", ΔF, vs),
        parameters=stribeck_parameters("theta8", 0.5),
        kernels={"torque": _stribeck},
        wider=other_exponent,
        mistaken_for=("arm_quadratic_drag", "friction_sharpness", "arm_presliding", "arm_hysteresis"),
    ),
    EffectType(
        name="arm_coulomb_asymmetry",
        title="friction of the arm that differs by direction",
        place="arm",
        equation="arm: −a |tanh(r q̇1)|",
        symptom="the arm slows faster turning one way than the other",
        says=lambda a: by_direction("arm", a),
        parameters=(Parameter("a", "{u}", "half the difference of the levels", 0.35, relative_to="theta8"),),
        kernels={"torque": _coulomb_asymmetry},
        mistaken_for=("input_offset",),
    ),
    EffectType(
        name="arm_quadratic_drag",
        title="drag on the arm that grows with its speed squared",
        place="arm",
        equation="arm: −c q̇1 |q̇1|",
        symptom="fast turns of the arm lose more speed than viscous friction explains",
        says=lambda c: f"A drag that grows with the square of its speed slows the arm: {c}",
        parameters=(Parameter("c", "{u}·s²/rad²", "drag coefficient", 3.0, relative_to="theta6", lower=0.0),),
        kernels={"torque": _quadratic_drag},
        mistaken_for=("arm_stribeck",),
    ),
    EffectType(
        name="arm_spring",
        title="a cable that pulls like a spring",
        place="arm",
        equation="arm: −k (q1 − q1n)",
        symptom="with no command the arm is drawn to one angle, as by the pendulum encoder's cable",
        says=lambda k, q1n: f"A cable pulls the arm towards {q1n}: {k}",
        parameters=(
            Parameter("k", "{u}/rad", "stiffness", 1.0, relative_to="theta5", lower=0.0),
            Parameter(
                "q1n",
                "rad",
                "angle without torque",
                0.3,
                lower=-20.0,
                upper=20.0,
                role="shape",
                span="product",
                of_a_day=True,
            ),
        ),
        kernels={"torque": _spring},
        mistaken_for=("input_offset", "base_tilt", "arm_ripple", "arm_cable", "arm_taut_cable"),
    ),
    EffectType(
        name="arm_ripple",
        title="cogging of the arm",
        place="arm",
        equation="arm: −A sin(n q1 + φ), n integer",
        symptom="the arm rests and hesitates at evenly spaced angles (cogging)",
        says=lambda A, n: f"The arm's torque ripples {n} times a turn, by ±{A} (cogging)",
        parameters=(
            Parameter("A", "{u}", "amplitude", 0.5, relative_to="theta8", lower=0.0),
            Parameter(
                "n",
                "1",
                "periods a turn",
                12.0,
                lower=1.0,
                upper=60.0,
                role="shape",
                integer=True,
                grid=tuple(range(1, 31)),
            ),
            Parameter(
                "φ",
                "rad",
                "phase",
                0.5,
                lower=-2 * math.pi,
                upper=2 * math.pi,
                role="shape",
                span="phase",
                of_a_day=True,
            ),
        ),
        kernels={"torque": _ripple},
        periods_a_turn="n",
        caution=lambda n: (
            "one period a turn is no cogging: a cable, a spring or a tilted base pulls so; look there" if n == 1 else ""
        ),
        mistaken_for=("arm_spring", "arm_position_friction", "arm_cable", "arm_taut_cable"),
    ),
    EffectType(
        name="arm_position_friction",
        title="friction of the arm that changes over the turn",
        place="arm",
        equation="arm: −(a sin q1 + b cos q1) tanh(r q̇1)",
        symptom="the arm turns more stiffly over one part of its circle",
        says=lambda a, b: (
            f"The arm's friction changes by ±{Quantity(math.hypot(a, b), a.unit)} over a turn; "
            f"it is largest near {Quantity(math.atan2(a, b), 'rad')}"
        ),
        parameters=(
            Parameter("a", "{u}", "sine part of the Coulomb level", 0.5, relative_to="theta8", of_a_day=True),
            Parameter("b", "{u}", "cosine part of the Coulomb level", 0.3, relative_to="theta8", of_a_day=True),
        ),
        kernels={"torque": _position_friction},
        mistaken_for=("arm_ripple",),
    ),
    EffectType(
        name="arm_presliding",
        title="an arm that gives before it slides",
        place="arm",
        equation=(
            "arm: θ8 tanh(r q̇1) replaced by σ0 z, ż = q̇1 (1 − sgn(q̇1) σ0 z / θ8)ⁱ "
            "(Dahl; the rate at which z settles is kept to at most 1000 1/s)"
        ),
        symptom="near standstill the arm springs back a little instead of stopping dead",
        says=lambda σ0: f"Before it slides, the arm gives like a spring of {σ0}",
        parameters=(
            Parameter(
                "σ0",
                "{u}/rad",
                "bristle stiffness; inf is rigid",
                100.0,
                relative_to="theta8",
                neutral=math.inf,
                lower=1e-6,
                grid=(10.0, 30.0, 100.0, 300.0),
                abrupt=True,
            ),
            Parameter(
                "i",
                "1",
                "how gradually the bristle yields: 1 from the start, 0 as a stop",
                1.0,
                lower=0.0,
                upper=2.0,
                role="shape",
                optional="i",
            ),
        ),
        kernels={"torque": _presliding, "rate": _presliding_rate},
        memory=("z",),
        travels=lambda σ0, theta8: (theta8 / σ0,) if σ0 else (),
        friction_memory=FrictionMemory("bristle", False, lambda level, travel: {"σ0": level / travel}),
        friction_of={"arm_hysteresis": _bristle_of_stops},
        wider=_other_shape,
        mistaken_for=("arm_stribeck", "friction_sharpness", "actuator_lag", "arm_hysteresis"),
    ),
    EffectType(
        name="arm_friction_drift",
        title="friction of the arm that drifts",
        place="arm",
        equation="arm: −θ8 a t tanh(r q̇1), a t ≥ −1",
        symptom="Coulomb friction of the arm falls (or rises) during the run, as a motor warms up",
        says=lambda a: (
            f"The arm's Coulomb friction {either(a, 'rises', 'falls')} by {percent(a)} a second during the run"
        ),
        parameters=(Parameter("a", "1/s", "relative change a second", -0.02, lower=-1.0, upper=0.2, of_a_day=True),),
        kernels={"torque": _friction_drift},
        mistaken_for=("arm_viscous_drift", "payload_step"),
    ),
    EffectType(
        name="arm_viscous_drift",
        title="viscous friction of the arm that drifts",
        place="arm",
        equation="arm: −θ6 a t q̇1, a t ≥ −1",
        symptom="viscous friction of the arm changes during the run (grease, magnet temperature)",
        says=lambda a: (
            f"The arm's viscous friction {either(a, 'rises', 'falls')} by {percent(a)} a second during the run"
        ),
        parameters=(Parameter("a", "1/s", "relative change a second", 0.2, lower=-1.0, upper=5.0, of_a_day=True),),
        kernels={"torque": _viscous_drift},
        mistaken_for=("arm_friction_drift",),
    ),
    EffectType(
        name="arm_backlash",
        title="backlash between motor and arm",
        place="arm",
        equation=(
            "play of width 2b between motor and arm: a rotor of inertia ρ θ1, at most 0.9 (θ1 − θ3²/θ4), drives the "
            "arm through a stop"
        ),
        symptom="on each reversal of the command the arm is free for a moment, then is hit",
        says=lambda b: f"There is a backlash of {Quantity(2 * b, b.unit)} between motor and arm",
        parameters=(
            Parameter(
                "b",
                "rad",
                "half-width of the backlash",
                0.01,
                lower=0.0,
                upper=1.0,
                grid=(0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2),
                rough=True,
            ),
            Parameter(
                "ρ",
                "1",
                "share of θ1 on the motor's side of the play; friction and encoder are on the arm's side",
                0.1,
                lower=0.001,
                upper=0.9,
                role="shape",
                grid=(0.1, 0.4),
                spread=1.0,  # a motor without a gear has a few hundredths, one behind a large gear up to a half
            ),
        ),
        kernels={"theta": _backlash_theta, "torque": _backlash, "rate": _backlash_rate},
        memory=("s", "w"),
        travels=lambda b: (2.0 * b,),
        changes=("theta1",),
        mistaken_for=("input_delay", "input_dead_zone", "actuator_lag"),
    ),
    EffectType(
        name="periodic_torque",
        title="a torque that repeats in time",
        place="arm",
        equation="arm: +A sin(2π f t + φ)",
        symptom="a hum or beat of fixed frequency in the arm, whatever the command",
        says=lambda A, f: f"A torque of ±{A} shakes the arm at {f}",
        parameters=(
            Parameter("A", "{u}", "amplitude", 0.5, relative_to="theta8", lower=0.0),
            Parameter("f", "Hz", "frequency", 3.3, lower=0.02, upper=100.0, role="shape", grid="frequencies"),
            Parameter(
                "φ",
                "rad",
                "phase at t = 0",
                0.0,
                lower=-2 * math.pi,
                upper=2 * math.pi,
                role="shape",
                span="phase",
                of_a_day=True,
            ),
        ),
        kernels={"torque": _periodic},
        mistaken_for=("arm_ripple",),
    ),
)
