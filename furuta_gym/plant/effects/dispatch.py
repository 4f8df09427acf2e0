"""Compiled entry points to the effects, written out from the declarations.

For each hook one function walks through the active effects (`codes`) and, for each, runs that effect's kernel over
all lanes. The source of these functions is generated from the library, so that an effect is declared in one place
and its kernel's arguments are bound by name; no active effect costs one comparison.
"""

from typing import Any

from ..compiled import compiled
from ..layout import BASE_NAMES
from .declaration import EffectType
from .library import CARRIED, FILTERS, NUMBERS

_STATES = {"q1": 0, "q2": 1, "v1": 2, "v2": 3}
_SUMS = {"torque": "F", "sensor": "Y"}  # hooks whose results are added up


def _place_of(effect: EffectType, name: str) -> str:
    """The array element that a kernel's argument `name` reads in lane k."""
    if name in effect.parameter_names:
        return f"P[o + {effect.parameter_names.index(name)}, k]"
    if name in effect.memory:
        return f"X[z + {effect.memory.index(name)}, k]"
    if name in _STATES:
        return f"X[{_STATES[name]}, k]"
    if name in BASE_NAMES:  # the rows of TH
        return f"TH[{BASE_NAMES.index(name)}, k]"
    if name.startswith("plant_"):
        return f"P[{BASE_NAMES.index(name[6:])}, k]"
    return {"a1": "K[2, k]"}.get(name, f"{name}[k]")


def _targets(effect: EffectType, hook: str) -> str:
    """Where the kernel's result goes."""
    if hook == "theta":
        return ", ".join(f"TH[{BASE_NAMES.index(name)}, k]" for name in effect.changes) + " ="
    if hook == "rate":
        return ", ".join(f"K[z + {i}, k]" for i in range(len(effect.memory))) + " ="
    if hook == "update":
        return ", ".join(f"X[z + {i}, k]" for i in range(len(effect.memory))) + " ="
    return {"delay": "out[k] =", "command": "u[k] =", "filter": "out[k] ="}[hook]


def _source(function: str, hook: str, arguments: str) -> str:
    lines = [f"def {function}({arguments}):", "    found = False"]
    lines += ["    for i in range(codes.shape[0]):", "        c, o, z = codes[i, 0], codes[i, 1], codes[i, 2]"]
    for effect in CARRIED.values():
        if hook not in effect.kernels:
            continue
        call = f"{effect.name}_{hook}({', '.join(_place_of(effect, a) for a in effect.arguments[hook])})"
        lines += [f"        if c == {NUMBERS[effect.name]}:", "            found = True"]
        lines += ["            for k in range(P.shape[1]):"]
        if hook in _SUMS:
            lines += [f"                a, b = {call}"]
            lines += [f"                {_SUMS[hook]}[{row}, k] += {part}" for row, part in enumerate("ab")]
        else:
            lines += [f"                {_targets(effect, hook)} {call}"]
    return "\n".join([*lines, "    return found"])


def _entry(function: str, hook: str, arguments: str, **options: Any) -> Any:
    names: dict[str, Any] = {"__name__": __name__} | {
        f"{effect.name}_{hook}": effect.kernels[hook] for effect in CARRIED.values() if hook in effect.kernels
    }
    exec(compile(_source(function, hook, arguments), __file__, "exec"), names)
    return compiled(names[function], **options)


# the short ones are inlined: a call hands over some forty numbers for its arrays
command_delays = _entry("command_delays", "delay", "P, codes, out", forceinline=True)
map_command = _entry("map_command", "command", "P, codes, u", forceinline=True)
filter_command = _entry("filter_command", "filter", "u, since, X, P, codes, out", forceinline=True)
modify_theta = _entry("modify_theta", "theta", "t, P, codes, TH", forceinline=True)
add_torques = _entry("add_torques", "torque", "t, X, tau, P, codes, TH, F")
memory_rates = _entry("memory_rates", "rate", "t, X, tau, P, codes, TH, K")
update_memory = _entry("update_memory", "update", "X, P, codes", forceinline=True)
read_sensors = _entry("read_sensors", "sensor", "X, P, codes, Y")

_FILTER = next(iter(FILTERS), -1)


@compiled(forceinline=True)
def store_filter(X, codes, value):
    """Keep the filtered command `value` (L,) in the memory of the active filter, if there is one."""
    for i in range(codes.shape[0]):
        if codes[i, 0] == _FILTER:
            for k in range(X.shape[1]):
                X[codes[i, 2], k] = value[k]


def _asks(*hooks: str) -> Any:
    """A kernel that says whether an active effect has one of these hooks."""
    numbers = tuple(NUMBERS[e.name] for e in CARRIED.values() if e.kernels.keys() & set(hooks))

    def any_has(codes: Any) -> bool:
        for i in range(codes.shape[0]):
            for number in numbers:
                if codes[i, 0] == number:
                    return True
        return False

    return compiled(any_has, forceinline=True)


changes_theta = _asks("theta")
"""Whether an active effect changes θ or r on the way."""
adds_torques = _asks("torque")
changes_memory = _asks("rate")
changes_motion = _asks("filter", "theta", "torque", "rate", "update")
"""Whether an active effect acts within the motion, and not before it (on the command) or after it (on readings)."""
