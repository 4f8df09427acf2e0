"""A rig: a kind of pendulum, one individual of it, its instruments, and what it hides."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from . import mujoco_body
from .chain import Draft
from .declaration import FORMS, BenchEffect, Variation
from .effects import find
from .kernels.fields import RIGID
from .sets import ParameterSet, parameter_set


@dataclass(frozen=True)
class HiddenEffect:
    """One hidden effect.

    strength: 0 is no effect, 1 is plain to see (the gap that is left after refitting θ is some times the noise).
    form: "table" (the project's equation) or "bench" (another law of the same cause; effects from outside the
    library have only this one). variation: 0 for typical signs, places and times, other numbers draw them.
    parameters: values that replace those that follow from strength and variation.
    """

    name: str
    strength: float = 1.0
    form: str = ""
    variation: int = 0
    parameters: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        spec = find(self.name)
        if not self.form:
            object.__setattr__(self, "form", spec.forms()[0])
        if self.form not in spec.forms():
            raise ValueError(
                f"{self.name} has no form {self.form!r}. Expected: {', '.join(spec.forms())}"
                + ("." if self.form in FORMS else f" (forms are {', '.join(FORMS)}).")
            )
        if not (math.isfinite(self.strength) and self.strength >= 0):
            raise ValueError(f"{self.name}: strength {self.strength} given, expected a number ≥ 0 (1: plain to see).")
        unknown = sorted(set(self.parameters) - set(spec.units))
        if unknown:
            raise ValueError(f"{self.name} has no parameter {', '.join(unknown)}. Expected: {', '.join(spec.units)}.")
        for key, value in self.parameters.items():
            if math.isnan(value):
                raise ValueError(f"{self.name}: {key} is NaN, expected a number in {spec.units[key]}.")

    @property
    def spec(self) -> BenchEffect:
        """Its entry in the catalogue."""
        return find(self.name)

    def values(self, kind: ParameterSet) -> dict[str, float]:
        """Its parameters on a rig of this kind, in the units of `spec.units` ({u} is the command's unit).

        ValueError at strength 0, where some have none.
        """
        if self.strength == 0.0:
            raise ValueError(f"{self.name} at strength 0 is no effect and has no parameters.")
        sizes = self.spec.sizes(kind, self.strength * kind.plain, Variation(self.variation, self.name))
        return {**sizes, **self.parameters}


@dataclass(frozen=True)
class Rig:
    """A rig of the bench.

    parameter_set: "table3", "servo", "workshop", "desk" or a `ParameterSet`; individual, scatter: which one of that
    kind, and how much they differ (0: all alike). friction: "smooth" (tanh(r q̇), as model (5)) or "hard" (sticks).
    encoder_counts (per turn, arm and pendulum), sample_time [s]: None takes the set's. encoder_noise [rad sd],
    encoder_offset [rad]. clock_jitter: sd of a sample's time over the sample time; stamps tell the true times.
    torque_noise: white torque on both rows, intensities in (command's unit)² s. controller: "lqr" or, for table3,
    "paper". engine: "auto" takes MuJoCo for rigid bodies if it is installed, else Lagrange; or name one.
    """

    parameter_set: str | ParameterSet = "table3"
    effects: Sequence[HiddenEffect] = ()
    individual: int = 0
    scatter: float = 0.0
    friction: str = "smooth"
    encoder_counts: tuple[int, int] | int | None = None
    sample_time: float | None = None
    encoder_noise: float = 0.0
    encoder_offset: tuple[float, float] = (0.0, 0.0)
    clock_jitter: float = 0.0
    torque_noise: tuple[float, float] = (0.0, 0.0)
    controller: str = ""
    engine: str = "auto"
    name: str = "bench rig"

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameter_set", parameter_set(self.parameter_set))
        object.__setattr__(self, "effects", tuple(self.effects))
        if isinstance(self.encoder_counts, int):
            object.__setattr__(self, "encoder_counts", (self.encoder_counts, self.encoder_counts))
        if not self.controller:
            object.__setattr__(self, "controller", "paper" if self.kind.feedback else "lqr")
        self._check()

    def _check(self) -> None:
        def among(what: str, got: str, allowed: tuple[str, ...]) -> None:
            if got not in allowed:
                raise ValueError(f"{what} {got!r} given, expected one of: {', '.join(allowed)}.")

        among("friction", self.friction, ("smooth", "hard"))
        among("engine", self.engine, ("auto", "lagrange", "mujoco"))
        among("controller", self.controller, ("lqr", "paper") if self.kind.feedback else ("lqr",))
        names = [e.name for e in self.effects]
        if len(set(names)) < len(names):
            raise ValueError(f"the same effect is hidden twice: {', '.join(names)}.")
        if self.sample_time is not None and not 1e-4 <= self.sample_time <= 0.05:
            raise ValueError(f"sample_time {self.sample_time} s given, expected 0.0001 to 0.05 s.")
        if min(self.counts) < 100:
            raise ValueError(f"encoder_counts {self.counts} given, expected at least 100 per turn.")
        if not 0.0 <= self.clock_jitter <= 0.2:
            raise ValueError(f"clock_jitter {self.clock_jitter} given, expected 0 to 0.2 of a sample.")
        if min(self.torque_noise) < 0.0 or self.encoder_noise < 0.0:
            raise ValueError("torque_noise and encoder_noise must not be negative.")
        draft = self.draft()
        if draft.fields["hard"][0] and draft.fields["bristle"][0] > 0:
            raise ValueError("hard friction and arm_presliding exclude each other: a bristle never sticks.")
        joints = [e.name for e in self.active if _joint(self.kind, e)]
        if len(joints) > 1:
            raise ValueError(f"only one thing can give between motor and arm, not {' and '.join(joints)}.")
        if self.engine == "mujoco" and not self._rigid(draft):
            raise ValueError(
                "engine='mujoco' needs a set of rigid bodies, an arm heavier than its motor's share, and no mass put "
                "on later; this rig is not so. "
                "Take engine='lagrange' or 'auto'."
            )

    @property
    def kind(self) -> ParameterSet:
        """The kind of rig, before this individual's scatter."""
        return self.parameter_set  # type: ignore[return-value]

    @property
    def active(self) -> tuple[HiddenEffect, ...]:
        """The effects of more than zero strength."""
        return tuple(e for e in self.effects if e.strength > 0.0)

    @property
    def constants(self) -> ParameterSet:
        """The constants of this individual."""
        return self.kind.individual(self.individual, self.scatter)

    @property
    def counts(self) -> tuple[int, int]:
        """Encoder counts per turn."""
        return self.encoder_counts or self.kind.encoder_counts  # type: ignore[return-value]

    @property
    def period(self) -> float:
        """Nominal sample time [s]."""
        return self.sample_time or self.kind.sample_time

    def draft(self) -> Draft:
        """The rig put together: mechanics, command path, encoders."""
        s = self.constants
        d = Draft(s)
        th1, th2, th3, th4, th5, fv1, fv2, fc1, fc2 = s.theta
        d.put(th1=th1, th2=th2, th3=th3, th4=th4, th5=th5, fv1=fv1, fv2=fv2, fc1=fc1, fc2=fc2)
        d.put(r1=s.sharpness, r2=s.sharpness, g1=s.weight_moment, hard=int(self.friction == "hard"))
        for effect in self.active:
            effect.spec.build(d, effect.values(s), effect.form == "bench")
        d.put(th1=th1 * (1.0 - d.motor_share))
        return d

    def _rigid(self, draft: Draft) -> bool:
        bodies = self.constants.bodies
        if bodies is None or float(draft.fields["pay_m"][0]) != 0.0:
            return False
        return mujoco_body.arm_about_com(bodies, draft.motor_share * self.constants.inertia[0]) > 0.0

    def mechanics(self) -> tuple[Draft, mujoco_body.MujocoBody | None]:
        """The draft, and MuJoCo's bodies where they move this rig."""
        d = self.draft()
        wanted = self.engine == "mujoco" or (self.engine == "auto" and mujoco_body.available())
        if not (wanted and self._rigid(d)):
            return d, None
        s = self.constants
        assert s.bodies is not None
        body = mujoco_body.make(s.bodies, d.motor_share * s.inertia[0], d.up)
        d.put(**body.addresses)
        return d, body

    def without_effects(self) -> Rig:
        """The same rig, hiding nothing."""
        return replace(self, effects=())

    def truth(self) -> dict[str, Any]:
        """Everything that a log must not tell, for JSON."""
        s = self.constants
        return {
            "rig": self.name,
            "parameter_set": s.name,
            "unit": s.unit,
            "theta": {f"theta{i + 1}": float(v) for i, v in enumerate(s.theta)},
            "friction_sharpness": s.sharpness,
            "base_friction": self.friction,
            "torque_noise": list(self.torque_noise),
            "effects": [
                {
                    "name": e.name,
                    "kind": e.spec.kind,
                    "form": e.form,
                    "strength": e.strength,
                    "says": e.spec.says + (f"; here: {e.spec.other}" if e.form == "bench" and e.spec.other else ""),
                    "parameters": {
                        key: {"value": float(value), "unit": e.spec.units[key].replace("{u}", s.unit)}
                        for key, value in e.values(s).items()
                    },
                }
                for e in self.active
            ],
        }


def _joint(kind: ParameterSet, effect: HiddenEffect) -> bool:
    d = Draft(kind)
    effect.spec.build(d, effect.values(kind), effect.form == "bench")
    return int(d.fields["join"][0]) != RIGID
