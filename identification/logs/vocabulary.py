"""The words that people put above the columns of a log: what is meant, and in which unit."""

from __future__ import annotations

import re
import unicodedata

ROLES: dict[str, tuple[str, ...]] = {
    "t": (
        *("t", "time", "timestamp", "seconds", "sec", "clock", "stamp", "zeit", "zeitstempel", "uhrzeit"),
        *("temps", "tiempo", "tempo", "datetime", "date", "datum", "simtime", "logtime"),
    ),
    "q1": (
        *("q1", "theta", "arm", "theta1", "motor", "rotor", "servo", "phi", "armangle", "armwinkel", "drehwinkel"),
        *("bras", "brazo", "braccio", "arm_angle", "rotaryarm", "motor_angle", "motorangle", "motorwinkel", "base"),
    ),
    "q2": (
        *("q2", "alpha", "pendulum", "theta2", "pend", "pole", "beta", "pendel", "pendelwinkel", "pendulum_angle"),
        *("pendulumangle", "pendule", "pendulo", "pendolo", "pole_angle", "rod", "stab", "link"),
    ),
    "u": (
        *("u", "voltage", "volts", "command", "input", "tau", "torque", "vm", "motor_voltage", "motorvoltage"),
        *("spannung", "motorspannung", "ankerspannung", "stellgroesse", "stellsignal", "drehmoment", "moment"),
        *("eingang", "tension", "commande", "voltaje", "tensione", "comando", "cmd", "control", "action", "effort"),
        *("volt", "pwm", "duty"),
    ),
}
"""Names of each signal, the usual first."""

OTHER = frozenset(
    (
        *("speed", "velocity", "vel", "dot", "rate", "omega", "geschwindigkeit", "vitesse", "velocidad", "acc"),
        *("accel", "acceleration", "beschleunigung", "ref", "reference", "soll", "sollwert", "target", "setpoint"),
        *("desired", "des", "error", "err", "fehler", "current", "strom", "courant", "estimate", "est", "hat"),
        *("observer", "filtered", "filt", "index", "sample", "samples", "step", "nr", "no", "number", "count"),
        *("temperature", "temp", "temperatur", "dtheta", "dalpha", "dphi", "dq1", "dq2", "q1d", "q2d", "thetad"),
        *("alphad", "mode", "state", "status", "flag", "reward", "deriv", "derivative"),
    )
)
"""Words of columns that are none of the four: speeds, references, errors, estimates, row numbers."""

_CURRENTS = frozenset(
    ("current", "strom", "courant", "corriente", "corrente", "motorstrom", "stromsollwert", "i", "iq")
)
_COMMANDED = frozenset(
    (
        *("cmd", "command", "commanded", "ref", "reference", "set", "setpoint", "soll", "sollwert", "des", "desired"),
        *("target", "demand"),
    )
)
_NO_CURRENT = frozenset(
    (
        *("u", "v", "volt", "volts", "voltage", "spannung", "tension", "tau", "torque", "drehmoment", "moment"),
        *(word for role in ("q1", "q2") for word in ROLES[role] if word not in ("motor", "servo", "rotor")),
        *("angle", "winkel", "position", "pos", "speed", "velocity", "omega"),
    )
)

_UNITS = {
    "s": ("s", "sec", "secs", "second", "seconds", "sekunden", "sek"),
    "ms": ("ms", "msec", "milliseconds", "millisekunden"),
    "us": ("us", "µs", "μs", "usec", "microseconds"),
    "ns": ("ns", "nsec", "nanoseconds"),
    "d": ("d", "day", "days", "tage", "tag"),
    "rad": ("rad", "radian", "radians", "bogenmaß"),
    "deg": ("deg", "°", "degree", "degrees", "grad", "º", "degre", "degres", "grados", "gradi"),
    "turns": ("turns", "turn", "rev", "revs", "revolutions", "umdrehungen", "umdr", "tours", "giri", "vueltas"),
    "counts": ("counts", "count", "cnt", "cnts", "ticks", "tick", "inc", "inkr", "inkremente", "impulse", "pulses"),
    "V": ("v", "volt", "volts"),
    "mV": ("mv", "millivolt", "millivolts"),
    "N·m": ("nm", "n·m", "n*m", "n m", "n.m", "newtonmeter", "newton-metre", "n⋅m"),
    "mN·m": ("mnm", "mn·m", "mn*m", "mn m"),
    "A": ("a", "amp", "ampere", "amps"),
    "mA": ("ma",),
    "%": ("%", "percent", "prozent", "pwm"),
}
_UNIT_OF = {word: unit for unit, words in _UNITS.items() for word in words}
_ENDINGS = (
    *("s", "sec", "ms", "us", "ns", "rad", "deg", "degrees", "turns", "rev", "revs", "counts", "ticks"),
    *("v", "volt", "volts", "mv", "nm"),
)
_STRIPPED = tuple(e for e in _ENDINGS if e not in ("volt", "volts"))  # these say what it is as well
_BRACKETS = re.compile(r"[\[({<]\s*([^\])}>]*?)\s*[\])}>]")


def unit_of(text: str) -> str | None:
    """The unit that a text such as "deg", "°" or "Grad" means; None if it is none."""
    return _UNIT_OF.get(text.strip().strip("[](){}").strip().lower())


def unit_in(name: str) -> str | None:
    """The unit that a column's name states, in brackets ("Zeit [ms]") or at its end ("t_ms"); None if none."""
    for inside in _BRACKETS.findall(name):
        if unit := unit_of(inside):
            return unit
    bare = _BRACKETS.sub("", name).strip()
    if "/" in bare and (unit := unit_of(bare.rpartition("/")[2])):  # DIN: "Zeit / ms"
        return unit
    last = re.split(r"[\s_.]+", bare)[-1].lower()
    return unit_of(last) if last != bare.lower() and (last in _ENDINGS or last == "°") else None


def core(name: str) -> str:
    """A column's name without its unit and the struct it stands in, in small letters without accents."""
    bare = _BRACKETS.sub("", name).strip()
    if "/" in bare and unit_of(bare.rpartition("/")[2]):
        bare = bare.rpartition("/")[0].strip()
    bare = bare.rpartition("/")[2].rpartition(".")[2] or bare
    plain = _letters(bare)
    return re.sub(rf"_({'|'.join(_STRIPPED)})$", "", plain)


def words(name: str) -> list[str]:
    """The words of a column's name, without its unit: "motorAngle_deg" gives motor, angle."""
    bare = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", _BRACKETS.sub("", name))
    found = [w for w in re.split(r"[^a-z0-9]+", _letters(bare)) if w]
    return found[:-1] if len(found) > 1 and found[-1] in _STRIPPED else found


def is_current(name: str) -> bool:
    """Whether the name of a command says that it is a current: "i_cmd", "motorCurrent", and not "current_voltage"."""
    parts = set(words(name))
    return not parts.isdisjoint(_CURRENTS) and parts.isdisjoint(_NO_CURRENT)


def _letters(text: str) -> str:
    text = text.replace("θ", "theta").replace("ϑ", "theta").replace("α", "alpha").replace("τ", "tau")
    text = text.replace("φ", "phi").replace("ϕ", "phi").replace("β", "beta").lower()
    text = text.replace("ö", "oe").replace("ä", "ae").replace("ü", "ue").replace("ß", "ss")
    return "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c)).strip()


def fits(name: str, role: str) -> int:
    """How well a column's name says that it is t, q1, q2 or u: 3 exactly, 2 by one of its words, 1 by a word that
    others have too, 0 not at all."""
    plain, parts = core(name), words(name)
    if plain in ROLES[role]:
        return 3
    if role == "u" and is_current(name) and not _COMMANDED.isdisjoint(parts):
        return 1  # of a drive that controls the current
    if set(parts) & OTHER or plain in OTHER:
        return 0
    if parts[0:1] == ["u"] and role in ("q1", "u"):
        return int(role == "u")  # u_motor, of which one letter says more than the word
    found = [w for w in parts if w in ROLES[role] and (len(w) > 1 or len(parts) == 1)]
    if not found:
        return 0
    angle = {"angle", "winkel", "position", "pos", "encoder", "joint"}
    weak = {"motor", "servo", "base", "rotor", "input", "control", "moment", "action", "link", "date"}
    if role == "q1" and set(parts) & set(ROLES["u"]) - {"control", "input"}:
        return 0  # motor_voltage
    return 2 if set(found) - weak or set(parts) & angle else 1
