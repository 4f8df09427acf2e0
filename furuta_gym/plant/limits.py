"""Optional keys of a plant file about the rig as a thing: what it can do, and over what a policy is to be trained."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

LIMITS: dict[str, str] = {
    "arm_travel": "rad to either side of zero that cable or stop allow",
    "arm_speed": "rad/s, fastest arm that is allowed",
    "slew": "command units per second, fastest change of the command",
    "supply": "command units, largest command that the supply gives",
}


def checked_limits(given: Any) -> Mapping[str, float] | None:
    """The mapping "limits" with positive finite numbers. Raises ValueError (got, expected) otherwise."""
    if given is None:
        return None
    if not isinstance(given, Mapping):
        raise ValueError(f"limits must be a mapping of {', '.join(LIMITS)} to numbers, got {given!r}")
    found = {}
    for name, value in given.items():
        if name not in LIMITS:
            raise ValueError(f"limits has no {name!r}; it takes {', '.join(f'{n} [{t}]' for n, t in LIMITS.items())}")
        ok = isinstance(value, int | float) and not isinstance(value, bool)
        if not ok or not 0 < value <= 1e9 or not math.isfinite(value):
            raise ValueError(f"limits: {name} must be a positive number ({LIMITS[name]}), got {value!r}")
        found[name] = float(value)
    return MappingProxyType(found)


def checked_ranges(given: Any) -> Mapping[str, str] | None:
    """The mapping "randomize" of names to ranges; what a range means is checked where it is drawn from."""
    if given is None:
        return None
    if not isinstance(given, Mapping) or not all(
        isinstance(v, str | int | float) and not isinstance(v, bool) for v in given.values()
    ):
        raise ValueError(f'randomize must be a mapping such as {{"input_delay": "uniform:0,0.03"}}, got {given!r}')
    return MappingProxyType({str(name): str(value) for name, value in given.items()})
