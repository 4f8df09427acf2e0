"""Numbers with their units, as an effect's sentence shows them, and sentences that several effects share."""

from __future__ import annotations

import math

_PERCENT = 100.0


class Quantity(float):
    """A number that prints with its unit, angles in degrees: f"{Quantity(0.3, 'rad')}" is "17°".

    A format such as f"{k:.4g}" is that of the bare number.
    """

    unit: str

    def __new__(cls, value: float, unit: str = "") -> Quantity:
        new = super().__new__(cls, value)
        new.unit = unit
        return new

    def __format__(self, spec: str) -> str:
        return super().__format__(spec) if spec else _spoken(float(self), self.unit)


def percent(share: float) -> str:
    """The size of a share: 0.08 and −0.08 are "8 %"."""
    return f"{number(abs(_PERCENT * share), 2)} %"


def either(value: float, positive: str, negative: str) -> str:
    """A word by the sign of a number."""
    return positive if value >= 0 else negative


def near_standstill(joint: str, ΔF: Quantity, vs: Quantity) -> str:
    """Stribeck friction of the arm or the pendulum."""
    return f"Near standstill, below about {vs}, the {joint}'s friction is {ΔF} larger than in motion"


def by_direction(joint: str, a: Quantity) -> str:
    """Friction with another level each way; a: half the difference."""
    side = either(a, "positive", "negative")
    return f"The {joint}'s friction is {Quantity(2 * abs(a), a.unit)} larger turning to the {side} side"


def off_centre(joint: str, a: Quantity, b: Quantity) -> str:
    """An encoder whose reading errs once a turn, by sine and cosine."""
    wrong = Quantity(math.hypot(a, b), a.unit)
    return f"The {joint}'s encoder sits off its centre: over a turn its reading is wrong by ±{wrong}"


def _spoken(value: float, unit: str) -> str:
    if math.isinf(value):
        return "nothing" if value < 0 else "no limit"
    if unit == "rad":
        return f"{number(math.degrees(value), 2)}°"
    if unit == "s" and abs(value) < 0.2:
        return f"{number(1e3 * value)} ms"
    return f"{number(value)} {unit}" if unit not in ("", "1") else number(value)


def number(value: float, digits: int = 3) -> str:
    """With so many digits, without an exponent unless it is very small or large, and with a real minus sign."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    before = math.floor(math.log10(abs(value))) + 1
    plain = -4 < before <= 6
    text = f"{round(value, digits - before):.{max(digits - before, 0)}f}" if plain else f"{value:.{digits}g}"
    if plain and "." in text:
        text = text.rstrip("0").rstrip(".")
    return text.replace("-", "−")
