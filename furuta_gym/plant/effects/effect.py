"""An effect of the library with values: what a plant carries."""

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from furuta_gym.declared import checked

from ..covariance import NORMAL_95
from ..plant_file import EffectEntry, ParameterEntry
from .declaration import EffectType
from .library import CARRIED, EFFECTS

_WRITTEN = {p.typed: p.name for kind in CARRIED.values() for p in kind.parameters}


def as_written(name: str) -> str:
    """A parameter's name as the equations have it, from that or its spelling without Greek letters."""
    return _WRITTEN.get(name, name)


_LARGEST = 1e100  # of any value; an estimate that runs off ends below it
_UNEVEN = 1.5  # times as far up as down, from which an interval is shown


def _number(what: str, raw: Any) -> float:
    try:
        return float(raw)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{what} must be a number, got {raw!r}") from None


def where_to_look(strange: Iterable[str], known: Iterable[str] = EFFECTS) -> str:
    """The end of a message about names that are not known: the nearest that are, and where the library is listed."""
    names = list(known)
    near = dict.fromkeys(n for name in strange for n in difflib.get_close_matches(name, names, n=1))
    hint = f"; did you mean {', '.join(near)}?" if near else "."
    return f"{hint} `furuta effects` lists the library"


@dataclass(frozen=True)
class Effect:
    """One effect switched on in a plant.

    `parameters` may leave out what should stay at its neutral value or, for a shape parameter, its default.
    `std` holds standard deviations, where an estimator found them. Raises ValueError for an unknown effect or
    parameter, a value out of bounds or not a number; the message lists what is allowed.
    """

    name: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    std: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or self.name not in CARRIED:
            raise ValueError(f"unknown effect {self.name!r}{where_to_look([str(self.name)], CARRIED)}")
        values = {p.name: p.neutral if p.role == "size" else p.default for p in self.type.parameters}
        values.update(self._checked(self.parameters))
        object.__setattr__(self, "parameters", MappingProxyType(values))
        if not isinstance(self.std, Mapping):
            raise ValueError(f"effect {self.name}: std must be a mapping, got {self.std!r}")
        std = {as_written(k): _number(f"effect {self.name}: std of {k}", v) for k, v in self.std.items()}
        if strange := set(std) - set(values):
            raise ValueError(f"effect {self.name} has no parameter {sorted(strange)}; it has {list(values)}")
        if bad := [k for k, v in std.items() if not 0 <= v < math.inf]:
            raise ValueError(f"effect {self.name}: std of {', '.join(bad)} must be finite and not negative")
        object.__setattr__(self, "std", MappingProxyType(std))

    def _checked(self, given: Mapping[str, float]) -> dict[str, float]:
        known = {p.name: p for p in self.type.parameters}
        checked = {}
        for key, raw in given.items():
            name = as_written(key)
            if name not in known:
                raise ValueError(f"effect {self.name} has no parameter {key!r}; it has {', '.join(known)}")
            if name in checked:
                raise ValueError(f"effect {self.name}: {name} is given twice")
            value = _number(f"effect {self.name}: {name}", raw)
            p = known[name]
            free = p.role == "size" and value == p.neutral  # off, though perhaps on the open end of its range
            if not free and not (abs(value) <= _LARGEST and p.lower <= value <= p.upper):
                unit = "" if p.unit == "1" else f" {p.unit.replace('{u}', '(unit of the command)')}"
                raise ValueError(
                    f"effect {self.name}: {name} must lie in [{p.lower:g}, {p.upper:g}]{unit}, got {value:g}"
                )
            if p.integer and value != round(value):
                raise ValueError(f"effect {self.name}: {name} must be a whole number, got {value:g}")
            checked[name] = value
        return checked

    def __hash__(self) -> int:
        return hash((self.name, *sorted(self.parameters.items()), *sorted(self.std.items())))

    def __reduce__(self) -> tuple[Any, ...]:
        return Effect, (self.name, dict(self.parameters), dict(self.std))

    @property
    def type(self) -> EffectType:
        return CARRIED[self.name]

    @classmethod
    def parse(cls, text: str, left_out: Callable[[str], "Effect"] | None = None) -> "Effect":
        """Read `name:parameter=value,…` as the command line gives it.

        Parameters that the text leaves out are those of `left_out(name)`, such as `Plant.default_effect`."""
        name, _, rest = text.partition(":")
        pairs = [item.partition("=") for item in rest.split(",") if item.strip()]
        for key, equals, value in pairs:
            if not equals or not value.strip():
                raise ValueError(f"effect {text!r}: expected NAME:parameter=value,…, got {key!r} without a value")
        keys = [key.strip() for key, _, _ in pairs]
        if twice := sorted({key for key in keys if keys.count(key) > 1}):
            raise ValueError(f"effect {text!r}: {', '.join(twice)} is given twice")
        given = cls(name.strip(), {key.strip(): value for key, _, value in pairs})  # type: ignore[misc]
        if left_out is None:
            return given
        named = {as_written(key): given.parameters[as_written(key)] for key in keys}
        return cls(given.name, {**left_out(given.name).parameters, **named})

    def sentence(self, unit: str) -> str:
        """What it does to the rig, in words and with its size, without a full stop; unit: of the command."""
        return self.type.sentence(self.parameters, unit)

    def interval(self, name: str) -> tuple[float, float] | None:
        """95 % interval of a parameter within its bounds, None without a standard deviation. Of one whose logarithm is
        estimated it is that of the logarithm: a value known to a factor of two is not known to lie near zero."""
        std = self.std.get(name)
        if std is None:
            return None
        p = next(p for p in self.type.parameters if p.name == name)
        value = self.parameters[name]
        if p.logarithmic and value > 0.0:
            factor = math.exp(min(NORMAL_95 * std / value, 100.0))
            low, high = value / factor, value * factor
        else:
            low, high = value - NORMAL_95 * std, value + NORMAL_95 * std
        return max(low, p.lower), min(high, p.upper)

    def shown(self, name: str) -> str:
        """A parameter's value with its standard deviation, or with its interval where that lies unevenly around it."""
        value, std = self.parameters[name], self.std.get(name)
        if not std:
            return f"{value:.4g}"
        low, high = self.interval(name) or (value, value)
        if high - value > _UNEVEN * (value - low):
            return f"{value:.4g} ({low:.2g} … {high:.2g})"
        return f"{value:.4g} ± {std:.2g}"

    def to_dict(self, unit: str) -> dict[str, Any]:
        units = {p.name: p.unit.format(u=unit) for p in self.type.parameters}
        return {
            "name": self.name,
            "parameters": {
                k: {"value": None if math.isinf(v) else v, "std": self.std.get(k), "unit": units[k]}
                for k, v in self.parameters.items()
            },
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], unit: str | None = None) -> "Effect":
        """Inverse of `to_dict`; a null value is the neutral one (JSON has no infinity). unit: of the plant's command.

        Raises ValueError for what makes no effect, and for a parameter whose unit is another than the plant's asks for.
        """
        entry = checked(data, EffectEntry, "effect")
        items = {k: p if isinstance(p, ParameterEntry) else ParameterEntry(p) for k, p in entry.parameters.items()}
        read = cls(
            entry.name,
            {k: p.value for k, p in items.items() if p.value is not None},
            {k: p.std for k, p in items.items() if p.std is not None},
        )
        expected = {} if unit is None else {p.name: p.unit.format(u=unit) for p in read.type.parameters}
        for key, parameter in items.items():
            given, wanted = parameter.unit, expected.get(as_written(key))
            if given is not None and wanted is not None and given != wanted:
                raise ValueError(
                    f"effect {read.name}: {key} is given in {given!r}, but the plant's command is in {unit}: expected "
                    f"{wanted}; convert the value, or leave the unit out"
                )
        return read

    def __str__(self) -> str:
        if self.type.learned:
            sizes = [abs(v) for k, v in self.parameters.items() if k.startswith("c")]
            return f"{self.name}({len(sizes)} coefficients up to {max(sizes):.4g})"
        return (
            f"{self.name}({', '.join(f'{p.name} = {self.shown(p.name)}' for p in self.type.in_play(self.parameters))})"
        )
