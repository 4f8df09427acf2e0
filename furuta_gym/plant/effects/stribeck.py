"""Stribeck friction, as the arm and the pendulum have it: one curve, with its exponent as a wider law."""

from collections.abc import Mapping

from ..compiled import compiled
from ..elementary import decay, exp, log
from .declaration import Parameter

_PLAIN = 2.0  # Gauss's curve
_TINY, _HUGE = 1e-70, 1e70  # of a speed whose fourth power `exp` can still give


@compiled(forceinline=True)
def stribeck_level(v, ΔF, vs, δ):
    """ΔF exp(−|v/vs|^δ), by which friction at speed v is larger than in motion.

    Tustin (1947) has δ = 1, Bo and Pavelescu (1982) δ between 0.5 and 1, Armstrong-Hélouvry (1991) δ = 2.
    """
    speed = abs(v) / vs
    within = speed if speed > _TINY else _TINY
    power = exp(δ * log(within if within < _HUGE else _HUGE))
    return ΔF * decay(speed * speed if δ == _PLAIN else power)  # a select, where a branch would forbid SIMD


def stribeck_parameters(coulomb: str, size: float) -> tuple[Parameter, ...]:
    """Parameters of Stribeck friction beside the Coulomb friction `coulomb`; size: of ΔF, relative to it."""
    return (
        Parameter("ΔF", "{u}", "break-away minus Coulomb torque", size, relative_to=coulomb, lower=0.0),
        Parameter(
            "vs",
            "rad/s",
            "Stribeck speed",
            0.3,
            lower=0.01,
            upper=3.0,
            role="shape",
            grid=(0.05, 0.15, 0.4, 1.0),
            near_rest=True,
        ),
        Parameter(
            "δ",
            "1",
            "exponent: 2 as Gauss's curve, 1 exponential",
            _PLAIN,
            lower=0.5,
            upper=4.0,
            role="shape",
            optional="δ",
        ),
    )


def other_exponent(own: Mapping[str, float]) -> tuple[dict[str, float], ...]:
    """An exponential curve that falls to half at the speed at which Gauss's does, and is higher at rest."""
    return () if own["δ"] != _PLAIN else ({**own, "δ": 1.0, "vs": min(1.2 * own["vs"], 3.0), "ΔF": 1.3 * own["ΔF"]},)
