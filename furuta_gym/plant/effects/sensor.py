"""Effects between the true angles and the encoders' readings, before counting."""

from ..elementary import sincos
from .declaration import EffectType, Parameter
from .words import off_centre


def _offset(b):
    return 0.0, b


def _pendulum_eccentricity(q2, a, b):
    s, c = sincos(q2)
    return 0.0, a * s + b * (c - 1.0)


def _arm_eccentricity(q1, a, b):
    s, c = sincos(q1)
    return a * s + b * (c - 1.0), 0.0


def _eccentricity_parameters(of_a_day: bool) -> tuple[Parameter, ...]:
    sine, cosine = "sine part of the reading error", "cosine part of the reading error"
    return (
        Parameter("a", "rad", sine, 0.03, lower=-0.5, upper=0.5, of_a_day=of_a_day),
        Parameter("b", "rad", cosine, 0.03, lower=-0.5, upper=0.5, of_a_day=of_a_day),
    )


SENSOR_EFFECTS = (
    EffectType(
        name="pendulum_encoder_offset",
        title="a wrong zero of the pendulum's encoder",
        place="sensor",
        equation="y2 = q2 + b",
        symptom="the pendulum balances at a reading other than zero, the same for every arm angle",
        says=lambda b: f"The pendulum's encoder reads {b} when the pendulum is upright",
        parameters=(Parameter("b", "rad", "zero error of the pendulum's encoder", 0.012, lower=-1.0, upper=1.0),),
        kernels={"sensor": _offset},
        constant=True,
        reads="pendulum",
        mistaken_for=("base_tilt", "pendulum_coulomb_asymmetry"),
    ),
    EffectType(
        name="pendulum_encoder_eccentricity",
        title="an encoder of the pendulum that sits off its centre",
        place="sensor",
        equation="y2 = q2 + a sin q2 + b (cos q2 − 1)",
        symptom="the pendulum's reading runs ahead and behind once a turn",
        says=lambda a, b: off_centre("pendulum", a, b),
        parameters=_eccentricity_parameters(of_a_day=False),
        kernels={"sensor": _pendulum_eccentricity},
        reads="pendulum",
        mistaken_for=("pendulum_encoder_offset",),
    ),
    EffectType(
        name="arm_encoder_eccentricity",
        title="an encoder of the arm that sits off its centre",
        place="sensor",
        equation="y1 = q1 + a sin q1 + b (cos q1 − 1)",
        symptom="the arm's reading runs ahead and behind once a turn",
        says=lambda a, b: off_centre("arm", a, b),
        parameters=_eccentricity_parameters(of_a_day=True),  # the arm's zero is where it stood at power-on
        kernels={"sensor": _arm_eccentricity},
        reads="arm",
        mistaken_for=("arm_position_friction",),
    ),
)
