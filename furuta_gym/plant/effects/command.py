"""Effects between the logged command u and the motor torque τ: the command path is delay → static maps → lag."""

import math
from collections.abc import Mapping

from ..elementary import decay
from .declaration import EffectType, Parameter
from .words import either, percent


def _delay(d):
    return d


def _lag(u, since, tau0, T):
    # exact for a held command; T = 0 is a perfect actuator
    # a select, where a branch would keep lanes from going side by side
    kept = decay(since / T if T > 0.0 else 1e300)
    return u + (tau0 - u) * (kept if T > 0.0 else 0.0)


def _offset(u, b):
    return u + b


def _gain_asymmetry(u, a):
    return u + a * abs(u)


def _cubic_gain(u, a):
    return u + a * u * u * u


_LITTLE = 1e-4  # of s t: below it 1 − exp(−s t) would lose its digits, and its series is exact


def _gain_drift(t, tau, a, s):
    # selects, where branches would keep lanes from going side by side
    x = s * t
    settling = (1.0 - decay(x)) / (s if x > _LITTLE else 1.0)
    change = a * (settling if x > _LITTLE else t * (1.0 - x * (0.5 - x / 6.0)))
    return (change if change > -1.0 else -1.0) * tau, 0.0  # a motor without strength turns no other way round


def _drift_that_settles(own: Mapping[str, float]) -> tuple[dict[str, float], ...]:
    """Faster at first, and slower later."""
    return () if own["s"] else ({"a": 1.3 * own["a"], "s": 0.03}, {"a": 2.0 * own["a"], "s": 0.1})


def _dead_zone(u, w):
    return u - min(max(u, -w), w)


def _saturation(u, m, knee):
    # straight to (1 − knee) m, level from (1 + knee) m, a parabola between
    over = abs(u) - (1.0 - knee) * m
    if not over > 0.0:
        return u
    wide = 2.0 * knee * m
    return math.copysign(m if over >= wide else abs(u) - over * over / (2.0 * wide), u)


COMMAND_EFFECTS = (
    EffectType(
        name="input_delay",
        title="a delay of the command",
        place="input",
        equation="τ(t) = u(t − d)",
        symptom="the arm answers a step of the command late but then as sharply as it should",
        says=lambda d: f"The command reaches the motor {d} late",
        parameters=(
            Parameter(
                "d",
                "s",
                "delay, fractions of a sample too",
                0.006,
                lower=0.0,
                upper=0.1,
                grid=(0.001, 0.003, 0.008, 0.02),
            ),
        ),
        kernels={"delay": _delay},
        mistaken_for=("actuator_lag",),
    ),
    EffectType(
        name="input_offset",
        title="an offset of the command",
        place="input",
        equation="τ = u + b",
        symptom="the arm creeps to one side with no command, or rests off its reference",
        says=lambda b: f"A constant {b} is added to the command",
        parameters=(Parameter("b", "{u}", "constant added to the command", 0.4, relative_to="theta8"),),
        kernels={"command": _offset},
        constant=True,
        mistaken_for=("arm_coulomb_asymmetry", "arm_spring"),
    ),
    EffectType(
        name="input_gain_asymmetry",
        title="a motor that is stronger one way",
        place="input",
        equation="τ = u (1 + a sign u)",
        symptom="equal commands of opposite sign move the arm by different amounts",
        says=lambda a: (
            f"Positive commands act {percent(a)} {either(a, 'more', 'less')} strongly than the mean, "
            f"negative ones as much {either(a, 'less', 'more')}"
        ),
        parameters=(Parameter("a", "1", "half the relative difference of the gains", 0.08, lower=-0.9, upper=0.9),),
        kernels={"command": _gain_asymmetry},
        mistaken_for=("input_offset", "arm_coulomb_asymmetry"),
    ),
    EffectType(
        name="input_cubic_gain",
        title="a gain that changes with the command",
        place="input",
        equation="τ = u + a u³",
        symptom="large commands act more (or less) than in proportion to small ones",
        says=lambda a: f"The motor's gain {either(a, 'rises', 'falls')} with the square of the command: {a}",
        parameters=(Parameter("a", "1/{u}²", "cubic coefficient", 0.3, relative_to="1/u_max²"),),
        kernels={"command": _cubic_gain},
        mistaken_for=("input_saturation", "input_dead_zone"),
    ),
    EffectType(
        name="input_dead_zone",
        title="a dead zone of the command",
        place="input",
        equation="τ = u − clip(u, −w, w)",
        symptom="small commands do nothing; the arm hunts around its reference",
        says=lambda w: f"Commands within ±{w} do nothing",
        parameters=(
            Parameter("w", "{u}", "half-width of the zone", 0.8, relative_to="theta8", lower=0.0, grid=(0.1, 0.4, 1.0)),
        ),
        kernels={"command": _dead_zone},
        mistaken_for=("input_cubic_gain", "arm_stribeck"),
    ),
    EffectType(
        name="input_saturation",
        title="a limit of the motor",
        place="input",
        equation="τ = clip(u, −m, m), its corners rounded over ±knee m",
        symptom="beyond some command the arm accelerates no faster",
        says=lambda m: f"The motor gives no more than {m}",
        parameters=(
            Parameter(
                "m",
                "{u}",
                "largest torque",
                0.15,
                relative_to="u_max",
                neutral=math.inf,
                lower=1e-6,
                grid=(0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.3),
            ),
            Parameter(
                "knee",
                "1",
                "share of m over which the knee is round; 0: sharp",
                0.0,
                lower=0.0,
                upper=1.0,
                role="shape",
                grid=(0.4,),
                jumps=True,
            ),
        ),
        kernels={"command": _saturation},
        mistaken_for=("input_cubic_gain",),
    ),
    EffectType(
        name="actuator_lag",
        title="a lag of the motor",
        place="input",
        equation="T τ̇ + τ = u",
        symptom="the arm's answer to a step of the command is rounded off",
        says=lambda T: f"The motor's torque follows the command with a lag of {T}",
        parameters=(
            Parameter("T", "s", "time constant", 0.01, lower=0.0, upper=1.0, grid=(0.001, 0.003, 0.008, 0.02)),
        ),
        kernels={"filter": _lag},
        memory=("tau0",),
        mistaken_for=("input_delay",),
    ),
    EffectType(
        name="input_gain_drift",
        title="a gain of the motor that drifts",
        place="input",
        equation="arm: a t τ, so that the command acts 1 + a t times as strongly; a (1 − exp(−s t))/s for a t if s > 0",
        symptom="the same command moves the arm less (or more) during the run, as a motor warms or a battery empties",
        says=lambda a, s: (
            f"The motor's gain {either(a, 'rises', 'falls')} by {percent(a)} a second "
            f"{'at first, and less later' if s > 0.0 else 'during the run'}"
        ),
        parameters=(
            Parameter("a", "1/s", "relative change a second, at first", -0.005, lower=-1.0, upper=1.0, of_a_day=True),
            Parameter(
                "s",
                "1/s",
                "rate at which it settles; 0: it does not",
                0.0,
                lower=0.0,
                upper=5.0,
                optional="s",
                of_a_day=True,
            ),
        ),
        kernels={"torque": _gain_drift},
        wider=_drift_that_settles,
        mistaken_for=("arm_friction_drift", "arm_viscous_drift", "payload_step"),
    ),
)
