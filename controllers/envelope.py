"""The envelope around a controller on a rig: whatever is read, what is commanded is finite, limited, and off in time.

The same rules in Python (`Guarded`) and in the C headers (`envelope_c`), in this order, once a sample:

1. A reading or reference that is no number or beyond ±10⁴ rad commands 0 and is not shown to the controller; after
   `bad_readings` of them in a row the controller goes off.
2. Arm beyond `arm_travel`, faster than `arm_speed`, pendulum beyond `tilt` from upright: off.
3. A command that is no number: off.
4. Soft start: the command grows linearly to its full size over `soft_start`.
5. Slew: it changes by at most slew · T a sample, 0 before the first.
6. Clamp: |u| ≤ u_max.

Off means a command of 0 until reset, and the reason is kept.
"""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .base import Controller
from .trials import HORIZONTAL

LONGEST_START = 60.0  # s of a soft start

REASONS = ("on", "reading", "arm", "speed", "tilt", "law")  # indexed by the C header's numbers
FARTHEST = 1e4  # rad; no rig turns so far
_LARGEST = 1e30  # a single-precision number still, and no command


@dataclass(frozen=True)
class Envelope:
    """Limits in the command's unit, rad and s; infinity where there is none. Raises ValueError unless positive.

    soft_start may be zero, which is the default: who balances must act at once.
    """

    u_max: float
    arm_travel: float = 2 * math.pi
    arm_speed: float = math.inf
    tilt: float = math.inf
    slew: float = math.inf
    soft_start: float = 0.0
    bad_readings: int = 3

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            least = 0.0 if field.name == "soft_start" else math.nextafter(0.0, 1.0)
            if not (isinstance(value, int | float) and value >= least):
                raise ValueError(f"envelope: {field.name} must be a positive number, got {value!r}")
        if not (math.isfinite(self.u_max) and math.isfinite(self.soft_start)):
            raise ValueError("envelope: u_max and soft_start must be finite")
        if self.soft_start > LONGEST_START:
            raise ValueError(f"envelope: soft_start {self.soft_start:g} s, expected {LONGEST_START:g} s at most")

    @classmethod
    def of(cls, controller: Any, **changes: Any) -> "Envelope":
        """From the controller, and the plant file's limits where it has them; `changes` that are not None win.

        A controller that only balances goes off when the pendulum is horizontal.
        """
        plant = controller.plant
        limits = plant.limits or {}
        made = cls(
            u_max=min(controller.u_max, limits.get("supply", math.inf)),
            arm_travel=limits.get("arm_travel", 2 * math.pi),
            arm_speed=limits.get("arm_speed", math.inf),
            tilt=math.inf if "swing_up" in controller.tasks else HORIZONTAL,
            slew=limits.get("slew", math.inf),
        )
        return dataclasses.replace(made, **{name: value for name, value in changes.items() if value is not None})


class Guarded:
    """A controller inside its envelope; called like the controller, with readings (2,).

    `off` is why it is off, "on" while it works; `reset` starts anew.
    """

    def __init__(self, controller: Controller, envelope: Envelope | None = None) -> None:
        self.controller = controller
        self.envelope = envelope or Envelope.of(controller)
        self.name, self.sample_time, self.u_max = controller.name, controller.sample_time, self.envelope.u_max
        self.reset()

    def reset(self) -> None:
        self.controller.reset()
        self.off = REASONS[0]
        self._u = self._q1 = 0.0
        self._good = self._missed = 0

    def __call__(self, y: ArrayLike) -> float:
        q1, q2 = (float(v) for v in np.asarray(y, dtype=float))
        self._u = self._step(q1, q2)
        return self._u

    def _step(self, q1: float, q2: float) -> float:
        e, T = self.envelope, self.sample_time
        if self.off != REASONS[0]:
            return 0.0
        if not (abs(q1) < FARTHEST and abs(q2) < FARTHEST):
            self._missed += 1
            return self._latch("reading") if self._missed >= e.bad_readings else 0.0
        if abs(q1) > e.arm_travel:
            return self._latch("arm")
        if self._good > 0 and self._missed == 0 and abs(q1 - self._q1) > e.arm_speed * T:
            return self._latch("speed")
        if abs(q2) > e.tilt:
            return self._latch("tilt")
        self._missed, self._q1 = 0, q1
        self._good += 1
        u = float(self.controller((q1, q2)))
        if not abs(u) <= _LARGEST:
            return self._latch("law")
        ramp = math.ceil(e.soft_start / T)
        if self._good <= ramp:
            u *= self._good / (ramp + 1)
        if e.slew < math.inf:
            u = min(max(u, self._u - e.slew * T), self._u + e.slew * T)
        return min(max(u, -e.u_max), e.u_max)

    def _latch(self, reason: str) -> float:
        self.off = reason
        return 0.0


_C = """\
/* Why the controller is off; it stays off, with a command of 0, until {prefix}_reset. */
enum {{
    {P}_ON = 0,      /* it works */
    {P}_READING = 1, /* {bad} readings in a row that are no angles */
    {P}_ARM = 2,     /* arm beyond {arm_text} */
    {P}_SPEED = 3,   /* arm faster than {speed_text} */
    {P}_TILT = 4,    /* pendulum farther from upright than {tilt_text} */
    {P}_LAW = 5      /* the law gave no number */
}};

typedef struct {{
    {prefix}_law_state law;
    {real} u;   /* last command */
    {real} q1;  /* last arm angle */
    int good;   /* readings so far, as long as the soft start lasts */
    int missed; /* bad readings in a row */
    int off;    /* {P}_ON or why it is off */
}} {prefix}_state;

static inline void {prefix}_reset({prefix}_state *s)
{{
    {prefix}_law_reset(&s->law);
    s->u = {zero};
    s->q1 = {zero};
    s->good = 0;
    s->missed = 0;
    s->off = {P}_ON;
}}

/* Whether x lies within +-limit; never for a NaN. */
static inline int {prefix}_within({real} x, {real} limit)
{{
    return x >= -limit && x <= limit;
}}

static inline {real} {prefix}_latch({prefix}_state *s, int reason)
{{
    s->off = reason;
    s->u = {zero};
    return {zero};
}}

static inline {real} {prefix}_step({prefix}_state *s, {real} q1, {real} q2, {real} reference)
{{
    {real} u;
    if (s->off != {P}_ON) return {zero};
    if (!({prefix}_within(q1, {far}) && {prefix}_within(q2, {far}) && {prefix}_within(reference, {far}))) {{
        s->u = {zero};
        if (s->missed < {bad}) s->missed += 1;
        return s->missed >= {bad} ? {prefix}_latch(s, {P}_READING) : {zero};
    }}
    if (!{prefix}_within(q1, {arm})) return {prefix}_latch(s, {P}_ARM);
{speed}{tilt}    s->missed = 0;
    s->q1 = q1;
    if (s->good <= {ramp}) s->good += 1;
    u = {prefix}_law(&s->law, q1, q2, reference);
    if (!{prefix}_within(u, {large})) return {prefix}_latch(s, {P}_LAW);
{soft}{slew}    if (u < -{u_max}) u = -{u_max};
    if (u > {u_max}) u = {u_max};
    s->u = u;
    return u;
}}
"""


def envelope_c(prefix: str, sample_time: float, envelope: Envelope, number: Any, real: str) -> str:
    """C99 of the envelope around `{prefix}_law`, with {prefix}_state, {prefix}_reset and {prefix}_step.

    number: turns a float into a literal of the type `real` ("double" or "float").
    """
    e, T, P = envelope, sample_time, prefix.upper()
    ramp = math.ceil(e.soft_start / T)
    speed = tilt = soft = slew = ""
    if e.arm_speed < math.inf:
        speed = (
            f"    if (s->good > 0 && s->missed == 0 && !{prefix}_within(q1 - s->q1, {number(e.arm_speed * T)}))\n"
            f"        return {prefix}_latch(s, {P}_SPEED);\n"
        )
    if e.tilt < math.inf:
        tilt = f"    if (!{prefix}_within(q2, {number(e.tilt)})) return {prefix}_latch(s, {P}_TILT);\n"
    if ramp:
        soft = f"    if (s->good <= {ramp}) u *= ({real})s->good / {number(ramp + 1.0)};\n"
    if e.slew < math.inf:
        step = number(e.slew * T)
        slew = f"    if (u < s->u - {step}) u = s->u - {step};\n    if (u > s->u + {step}) u = s->u + {step};\n"
    text = lambda value, unit: f"{value:g} {unit}" if value < math.inf else "anything: it has no such limit"  # noqa: E731
    return _C.format(
        prefix=prefix, P=P, real=real, bad=e.bad_readings, ramp=ramp, speed=speed, tilt=tilt, soft=soft, slew=slew,
        zero=number(0.0), far=number(FARTHEST), arm=number(min(e.arm_travel, FARTHEST)), u_max=number(e.u_max),
        large=number(_LARGEST), arm_text=text(e.arm_travel, "rad"), speed_text=text(e.arm_speed, "rad/s"),
        tilt_text=text(e.tilt, "rad"),
    )  # fmt: skip
