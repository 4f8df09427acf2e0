"""Torques of a cable on the arm's row: stiffer to one side, taut to one side, and friction that remembers."""

from collections.abc import Mapping

from ..compiled import compiled
from .declaration import EffectType, FrictionMemory, Parameter


def _cable(q1, k, q1n, k3, q1s):
    return -k * (q1 - q1n) - k3 * ((q1 - q1s) ** 3 - (q1n - q1s) ** 3), 0.0


def _cable_coefficients(k, q1n, k3, q1s):
    # of 1, q1, q1², q1³
    rest = k * q1n + k3 * ((q1n - q1s) ** 3 + q1s**3)
    return rest, -k - 3.0 * k3 * q1s * q1s, 3.0 * k3 * q1s, -k3


def _cable_and_spring(spring: Mapping[str, float], cable: Mapping[str, float]) -> dict[str, float]:
    """The cable that pulls as this one and a spring do; it is without torque at an angle between theirs."""
    from scipy.optimize import brentq  # slow to import, and seldom asked for

    def pull(q1: float) -> float:
        return spring["k"] * (q1 - spring["q1n"]) - _cable(q1, **cable)[0]

    low, high = sorted((spring["q1n"], cable["q1n"]))
    rest = low if pull(low) >= 0.0 else high
    if pull(low) < 0.0 < pull(high):
        rest = float(brentq(pull, low, high))  # type: ignore[arg-type]
    return {**cable, "k": cable["k"] + spring["k"], "q1n": rest}


def _taut(q1, k1, k2, q1n, qt):
    pull = k1 * min(q1 - qt, 0.0) + k2 * max(q1 - qt, 0.0)
    rest = k1 * min(q1n - qt, 0.0) + k2 * max(q1n - qt, 0.0)
    return rest - pull, 0.0


def _taut_coefficients(k1, k2, q1n, qt):
    # of 1, min(q1 − qt, 0), max(q1 − qt, 0)
    return k1 * min(q1n - qt, 0.0) + k2 * max(q1n - qt, 0.0), -k1, -k2


def _taut_and_spring(spring: Mapping[str, float], cable: Mapping[str, float]) -> dict[str, float]:
    """The taut cable that pulls as this one and a spring do."""
    k1, k2, qt = cable["k1"] + spring["k"], cable["k2"] + spring["k"], cable["qt"]
    rest = cable["q1n"] - qt
    pull = cable["k1"] * min(rest, 0.0) + cable["k2"] * max(rest, 0.0) + spring["k"] * (spring["q1n"] - qt)
    k = k1 if pull < 0.0 else k2
    return {"k1": k1, "k2": k2, "q1n": qt + (pull / k if k > 0.0 else 0.0), "qt": qt}


def _hysteresis(q1, κ, d, κ2, d2, y, y2):
    return -κ * min(max(q1 - y, -d), d) - κ2 * min(max(q1 - y2, -d2), d2), 0.0


@compiled(forceinline=True)
def _creep(v1, z, d, ρ):
    """How fast the angle moves at which an element hangs, while the deflection z grows."""
    return ρ * v1 * min(abs(z) / d, 1.0) if v1 * z > 0.0 else 0.0


def _hysteresis_rate(q1, v1, d, d2, ρ, y, y2):
    if ρ == 0.0:
        return 0.0, 0.0
    return _creep(v1, q1 - y, d, ρ), _creep(v1, q1 - y2, d2, ρ)


def _hysteresis_update(q1, d, d2, y, y2):
    return min(max(y, q1 - d), q1 + d), min(max(y2, q1 - d2), q1 + d2)


def _wider_hysteresis(own: Mapping[str, float]) -> tuple[dict[str, float], ...]:
    """A third of the stiffness in a second element, which slips earlier, or later; and elements that yield
    gradually."""
    κ, d = own["κ"], own["d"]
    two = [{"κ": 0.7 * κ, "κ2": 0.3 * κ, "d2": factor * d} for factor in (0.5, 2.0) if not own["κ2"]]
    gradual = [{"ρ": 0.6, "d": 1.3 * d}] if not own["ρ"] else []
    return tuple({**own, **change} for change in (*two, *gradual))


CABLE_EFFECTS = (
    EffectType(
        name="arm_cable",
        title="a cable that stiffens to one side",
        place="arm",
        equation="arm: −k (q1 − q1n) − k3 ((q1 − q1s)³ − (q1n − q1s)³)",
        symptom="with no command the arm is drawn to one angle, and more strongly the further it turns to one side",
        says=lambda k, q1n, q1s: f"A cable pulls the arm towards {q1n}: {k} where it is softest, at {q1s}",
        parameters=(
            Parameter("k", "{u}/rad", "stiffness where the cable is softest, at q1s", 0.5, "theta5", lower=0.0),
            Parameter(
                "q1n",
                "rad",
                "angle without torque",
                0.3,
                lower=-20.0,
                upper=20.0,
                role="shape",
                span="linear",
                of_a_day=True,
            ),
            Parameter("k3", "{u}/rad³", "stiffening: 3 k3 (q1 − q1s)² is added to k", 0.5, "theta5", lower=0.0),
            Parameter(
                "q1s",
                "rad",
                "angle at which it is softest",
                -0.5,
                lower=-20.0,
                upper=20.0,
                role="shape",
                span="linear",
                of_a_day=True,
            ),
        ),
        kernels={"torque": _cable},
        linear=_cable_coefficients,
        includes={"arm_spring": _cable_and_spring},
        mistaken_for=("arm_spring", "arm_taut_cable", "arm_ripple", "base_tilt"),
    ),
    EffectType(
        name="arm_taut_cable",
        title="a cable that comes taut at one angle",
        place="arm",
        equation="arm: −(g(q1) − g(q1n)), g(q) = k1 (q − qt) for q < qt, k2 (q − qt) beyond",
        symptom="the arm is drawn back on one side of some angle only, where the cable is taut",
        says=lambda k1, k2, qt: f"A cable pulls at the arm with {k1} below {qt} and with {k2} above",
        parameters=(
            Parameter("k1", "{u}/rad", "stiffness below qt (0: slack)", 0.3, "theta5", lower=0.0),
            Parameter("k2", "{u}/rad", "stiffness above qt (0: slack)", 1.5, "theta5", lower=0.0),
            Parameter(
                "q1n",
                "rad",
                "angle without torque",
                0.1,
                lower=-20.0,
                upper=20.0,
                role="shape",
                span="linear",
                of_a_day=True,
            ),
            Parameter(
                "qt",
                "rad",
                "angle at which it comes taut",
                0.3,
                lower=-20.0,
                upper=20.0,
                role="shape",
                grid=(-1.5, -0.8, -0.3, 0.0, 0.3, 0.8, 1.5),
                of_a_day=True,
            ),
        ),
        kernels={"torque": _taut},
        linear=_taut_coefficients,
        includes={"arm_spring": _taut_and_spring},
        mistaken_for=("arm_cable", "arm_spring", "arm_ripple", "base_tilt"),
    ),
    EffectType(
        name="arm_hysteresis",
        title="friction of the arm that builds up with its travel",
        place="arm",
        # Prandtl–Ishlinskii. The memory y is the angle at which the element hangs, z = clip(q1 − y, ±d): so the torque
        # is a function of the state, and with ρ = 0 a step that does not reverse ends at the exact y however long.
        # With ρ = 1 the deflection grows as Dahl's does, and springs back as a stop's.
        equation=(
            "arm: −κ z − κ2 z2, z ← clip(z + Δq1, ±d), z2 ← clip(z2 + Δq1, ±d2) "
            "(stops; at the start as if the arm came from q1 = 0); while |z| grows, z ← z + (1 − ρ |z|/d) Δq1"
        ),
        symptom="after a reversal the arm's friction builds up over some hundredths of a radian, at any speed",
        says=lambda κ, d: f"After a reversal the arm's friction builds up over {d} at {κ}",
        parameters=(
            Parameter("κ", "{u}/rad", "stiffness before it slips", 4.0, "theta8", lower=0.0),
            Parameter(
                "d",
                "rad",
                "deflection at which it slips",
                0.1,
                lower=1e-4,
                upper=10.0,
                role="shape",
                grid=(0.02, 0.05, 0.1, 0.3),
                travel=True,
            ),
            Parameter("κ2", "{u}/rad", "stiffness of a second element", 0.0, "theta8", lower=0.0, optional="κ2"),
            Parameter(
                "d2",
                "rad",
                "deflection at which the second slips",
                0.3,
                lower=1e-4,
                upper=10.0,
                role="shape",
                optional="κ2",
                travel=True,
            ),
            Parameter(
                "ρ",
                "1",
                "how gradually the elements yield: 0 as a stop, 1 from the start",
                0.0,
                lower=0.0,
                upper=1.0,
                role="shape",
                optional="ρ",
            ),
        ),
        kernels={"torque": _hysteresis, "rate": _hysteresis_rate, "update": _hysteresis_update},
        memory=("y", "y2"),
        travels=lambda d, κ2, d2: (d, d2) if κ2 else (d,),
        friction_memory=FrictionMemory("stop", True, lambda level, travel: {"κ": level / travel, "d": travel}),
        wider=_wider_hysteresis,
        mistaken_for=("arm_presliding", "arm_stribeck"),
    ),
)
