"""A plant as a value: parameters, effects, uncertainty and where they came from; one JSON file each."""

import dataclasses
import json
import math
import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import astuple
from numpy.typing import NDArray

from furuta_gym.declared import checked, plain
from furuta_gym.files import in_short, read_json, write_whole

from .covariance import Covariance
from .effects.effect import Effect
from .effects.library import NUMBERS
from .file_remarks import remarks
from .integration_step import friction_rate, rest_slopes
from .layout import SHARPNESS_ROWS, THETA_ROWS, ParameterLayout
from .parameters import FRICTION_SHARPNESS, THETA_NAMES, theta_vector
from .plant_file import FIELDS, SCHEMA, PlantFile
from .rigid_body import physical_consistency

_OWN = ("friction_sharpness", "unit", "u_max", "sample_time")
_MAPPINGS = ("sensors", "provenance", "checks", "limits", "randomize")


class Packed(NamedTuple):
    """A plant as `integration` takes it: p (rows of the layout,), codes (effects, 3), rows of X."""

    p: NDArray[np.float64]
    codes: NDArray[np.int64]
    rows: int


@dataclass(frozen=True, eq=False)
class Plant:
    """Model (5) with numbers in it.

    theta: θ1 … θ9 (9,), in command units (see `parameters.THETA_MEANING`).
    friction_sharpness: r [s/rad] of tanh(r q̇), or one for each axis.
    unit: the command's unit {u}, "V" or "N·m". u_max [{u}]: largest command. sample_time [s]: if known.
    effects: what acts besides model (5). covariance: over θ and effect parameters, as estimated.
    sensors, provenance, checks: free mappings that go to the file with it.
    limits: of the rig, see `plant_file.LimitsEntry`. randomize: ranges to train over, see `envs.ranges`; both optional.
    Raises ValueError for numbers that no plant can have, as a mass matrix that is not positive definite.
    """

    theta: NDArray[np.float64]
    friction_sharpness: float | tuple[float, float] = FRICTION_SHARPNESS
    unit: str = "V"
    u_max: float = 10.0
    sample_time: float | None = None
    effects: tuple[Effect, ...] = ()
    covariance: Covariance | None = None
    sensors: Mapping[str, Any] | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    checks: Mapping[str, Any] = field(default_factory=dict)
    limits: Mapping[str, float] | None = None
    randomize: Mapping[str, str] | None = None

    def __post_init__(self) -> None:
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        put("theta", theta_vector(self.theta))
        for name in _OWN:
            put(name, plain(getattr(self, name)))
        for name in (*_OWN, *_MAPPINGS):
            checked(getattr(self, name), FIELDS[name], name)
        r = np.atleast_1d(self.friction_sharpness)
        put("friction_sharpness", float(r[0]) if r.size == 1 else (float(r[0]), float(r[1])))
        if not all(isinstance(effect, Effect) for effect in self.effects):
            raise ValueError(f"effects must be Effect values, got {self.effects!r}")
        names = [effect.name for effect in self.effects]
        # in the library's order: what a plant does must not depend on the order in which its effects were named
        put("effects", tuple(sorted(self.effects, key=lambda effect: NUMBERS[effect.name])))
        if twice := sorted({n for n in names if names.count(n) > 1}):
            raise ValueError(f"effect {', '.join(twice)} is given twice; an effect can act once")
        put("provenance", self.provenance or {})
        put("checks", self.checks or {})
        if len(self.provenance.get("torque_noise") or ()) == 1:
            raise ValueError("provenance.torque_noise must be two numbers, got one")
        put("limits", self.limits and {name: float(value) for name, value in self.limits.items()})
        put("randomize", self.randomize and {name: str(value) for name, value in self.randomize.items()})
        for name in _MAPPINGS:
            if (value := getattr(self, name)) is not None:
                put(name, MappingProxyType(plain(value)))

    def __reduce__(self) -> tuple[Any, ...]:
        return Plant.from_dict, (self.to_dict(),)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Plant) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        # of numbers and names: as text, equal plants differ where one has 10 and one 10.0, or keys in another order
        effects = ((effect.name, *effect.parameters.values()) for effect in self.effects)
        return hash((*self.theta.tolist(), self.friction_sharpness, self.unit, self.u_max, *effects))

    def replace(self, **changes: Any) -> "Plant":
        """A copy with some fields changed."""
        return dataclasses.replace(self, **changes)

    def with_effects(self, *effects: Effect) -> "Plant":
        """A copy to which `effects` are added (an effect already there is replaced)."""
        new = {effect.name: effect for effect in (*self.effects, *effects)}
        return self.replace(effects=tuple(new.values()))

    def keeping(self, test: Callable[[Effect], bool]) -> "Plant":
        """A copy with those of its effects for which `test` is true."""
        return self.replace(effects=tuple(effect for effect in self.effects if test(effect)))

    def without(self, *names: str) -> "Plant":
        """A copy without the effects of these names, which it need not have."""
        return self.keeping(lambda effect: effect.name not in names)

    def without_fit(self) -> "Plant":
        """A copy without what its fit says of it: covariance, checks, provenance."""
        return self.replace(covariance=None, checks={}, provenance={})

    def effect(self, name: str) -> Effect | None:
        return next((e for e in self.effects if e.name == name), None)

    def limit(self, name: str, otherwise: float) -> float:
        """The rig's limit `name` (see `plant_file.LimitsEntry`), or what to take where the file has none."""
        return float((self.limits or {}).get(name, otherwise))

    @property
    def moved_by_hand(self) -> tuple[str, ...]:
        """Names (theta6, EFFECT.PARAMETER) of what was moved by hand after the fit."""
        return tuple(self.provenance.get("moved") or ())

    @property
    def supply(self) -> float:
        """Largest command [{u}] that the motor gets: u_max, or the rig's supply if that is less."""
        return min(self.u_max, self.limit("supply", math.inf))

    @property
    def sharpness(self) -> tuple[float, float]:
        """(r1, r2) [s/rad]."""
        r = self.friction_sharpness
        return r if isinstance(r, tuple) else (r, r)

    @property
    def sharpening(self) -> Effect | None:
        """The effect that gives friction another sharpness than `sharpness`; None without one."""
        return next((effect for effect in self.effects if effect.type.sharpens), None)

    @property
    def sharpest(self) -> tuple[float, float]:
        """Largest sharpness (r1, r2) [s/rad] that friction has, that of an effect included."""
        other = self.sharpening
        r1, r2 = other.parameters.values() if other else self.sharpness
        return max(r1, self.sharpness[0]), max(r2, self.sharpness[1])

    @property
    def friction_rate(self) -> float:
        """λ [1/s]: how fast friction stops a slow motion near upright, that of the effects included."""
        p, codes, rows = self._packed
        return friction_rate(rest_slopes(p, codes, rows), 1.0, 1.0)

    @property
    def not_identified(self) -> tuple[str, ...]:
        """Parameters that the fit's logs did not show, as the plant file's verdict has it; () where it has none."""
        verdict = self.checks.get("identifiability")
        names = verdict.get("not_identified") if isinstance(verdict, Mapping) else None
        return tuple(str(name) for name in names) if isinstance(names, list | tuple) else ()

    def noticeable(self, name: str) -> float:
        """Size of a θ, or of a carried effect's "effect.parameter", in its unit: the value, or what is worth noticing
        if that is more; 1 where both are zero."""
        if name in THETA_NAMES:
            return self._scale[name]
        effect, _, parameter = name.partition(".")
        found = (e.parameters[parameter] for e in (self.effect(effect), self.default_effect(effect)) if e is not None)
        return max((abs(value) for value in found if math.isfinite(value)), default=0.0) or 1.0

    @property
    def _scale(self) -> dict[str, float]:
        # an estimate that ended at zero friction must not make every friction effect vanish
        floor = {
            "theta6": 0.02 * self.theta[0],
            "theta7": 0.02 * self.theta[3],
            "theta8": 0.02 * abs(self.theta[4]),
            "theta9": 5e-4 * abs(self.theta[4]),
        }
        return {n: float(max(abs(v), floor.get(n, 0.0))) for n, v in zip(THETA_NAMES, self.theta, strict=True)}

    def default_effect(self, name: str) -> Effect:
        """The effect at a size worth noticing on this plant (the declaration's defaults, scaled)."""
        effect = Effect(name)
        scale = self._scale | {"u_max": self.u_max, "1/u_max²": self.u_max**-2}
        values = {p.name: p.default * (scale[p.relative_to] if p.relative_to else 1.0) for p in effect.type.parameters}
        return Effect(name, values)

    @cached_property
    def layout(self) -> ParameterLayout:
        """Which row of the packed parameters holds which parameter."""
        return ParameterLayout.of(self.effects)

    @cached_property
    def _packed(self) -> Packed:
        p = np.empty(self.layout.size)
        p[THETA_ROWS], p[SHARPNESS_ROWS] = self.theta, self.sharpness
        codes, rows = [], 4
        for effect in self.effects:
            own = self.layout.rows_of(effect.name)
            p[own.start : own.stop] = [effect.parameters[name] for name in effect.type.parameter_names]
            codes.append((NUMBERS[effect.name], own.start, rows))
            rows += len(effect.type.memory)
        return Packed(p, np.array(codes, dtype=np.int64).reshape(-1, 3), rows)

    def packed(self) -> Packed:
        """Flat arrays for the compiled code (fresh copies)."""
        return Packed(self._packed.p.copy(), self._packed.codes.copy(), self._packed.rows)

    def to_dict(self) -> dict[str, Any]:
        r = self.friction_sharpness
        return {
            "schema": SCHEMA,
            "theta": {name: float(v) for name, v in zip(THETA_NAMES, self.theta, strict=True)},
            "unit": self.unit,
            "friction_sharpness": list(r) if isinstance(r, tuple) else r,
            "covariance": self.covariance.to_dict() if self.covariance else None,
            "effects": [effect.to_dict(self.unit) for effect in self.effects],
            "sensors": plain(self.sensors) if self.sensors is not None else None,
            "sample_time": self.sample_time,
            "u_max": self.u_max,
            "provenance": plain(self.provenance),
            "checks": plain(self.checks) | physical_consistency(self.theta, self.covariance).to_dict(),
        } | {name: dict(value) for name in ("limits", "randomize") if (value := getattr(self, name)) is not None}

    def to_json(self) -> str:
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Plant":
        """Read the mapping of a plant file. Raises ValueError on another schema or bad values."""
        schema = data.get("schema") if isinstance(data, Mapping) else None
        if schema != SCHEMA:
            raise ValueError(
                f'not a plant this version can read: expected "schema": "{SCHEMA}", got {schema!r}'
                + ("; a newer furuta-gym wrote it" if str(schema).startswith("furuta-plant/") else "")
                + ("; write that line into a plant file made by hand" if schema is None else "")
            )
        read = checked(data, PlantFile)
        return cls(
            theta=theta_vector(astuple(read.theta)),
            effects=tuple(Effect.from_dict(effect, read.unit) for effect in data.get("effects") or ()),
            covariance=Covariance.from_dict(data["covariance"]) if read.covariance is not None else None,
            **{name: data[name] for name in (*_OWN, *_MAPPINGS) if name in data},
        )

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the plant file; whole or not at all."""
        return write_whole(path, self.to_json() + "\n")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Plant":
        """Read a plant file. Raises FileNotFoundError or ValueError, each naming the file."""
        if os.path.isdir(path):
            raise ValueError(
                f"{path} is a folder; expected a plant file, as `furuta identify LOG -o rig.json` writes it"
            )
        try:
            data = read_json(Path(path).read_text(encoding="utf-8"))
            plant = cls.from_dict(data)
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            at = f": line {error.lineno}, column {error.colno}" if isinstance(error, json.JSONDecodeError) else ""
            raise ValueError(
                f"{path} is no plant file (JSON), as `furuta identify LOG -o rig.json` writes it{at}"
            ) from None
        except FileNotFoundError:
            raise FileNotFoundError(f"no plant file at {path}; make one with `furuta identify LOG -o {path}`") from None
        except ValueError as error:
            raise ValueError(f"{path}: {in_short(error)}") from error
        carried = [f"{effect.name}.{name}" for effect in plant.effects for name in effect.parameters]
        for message in remarks(data, plant.unit, plant.u_max, carried):
            warnings.warn(f"{path} {message}", stacklevel=2)
        return plant

    @classmethod
    def resolve(cls, source: "Plant | Mapping[str, Any] | str | os.PathLike[str]") -> "Plant":
        """A plant from a plant, its dictionary (`to_dict`), the name of a known set (`PLANTS`), or a plant file."""
        if isinstance(source, Plant):
            return source
        if isinstance(source, Mapping):
            return cls.from_dict(source)
        if str(source) in PLANTS:
            return PLANTS[str(source)]
        if not Path(source).exists():
            raise FileNotFoundError(
                f"no plant {str(source)!r}: neither a file nor one of the known sets {', '.join(PLANTS)}; "
                f"make one with `furuta identify LOG -o {Path(source).with_suffix('.json')}`"
            )
        return cls.load(source)

    def __str__(self) -> str:
        std = self.covariance.std_of(THETA_NAMES) if self.covariance else {}
        rows = [f"Plant in {self.unit}, r = {self.friction_sharpness} s/rad, |u| ≤ {self.u_max:g} {self.unit}"]
        for name, value in zip(THETA_NAMES, self.theta, strict=True):
            width = f" ± {std[name]:.2g}" if name in std else ""
            rows.append(f"  {name} = {value:.5g}" + (" (not identified)" if name in self.not_identified else width))
        rows += [f"  + {effect}" for effect in self.effects]
        return "\n".join(rows)


PLANTS: dict[str, Plant] = {}
"""The sets that come with the package, by name. `sets`, which the package imports, puts them in."""
