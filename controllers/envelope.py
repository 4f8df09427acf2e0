"""The envelope around a controller on a rig: whatever is read, what is commanded is finite, limited, and off in time.

The same rules in Python (`Guarded`) and in the C headers (`envelope_c`), in this order, once a sample:

1. A reading or reference that is no number or beyond ±10⁴ rad commands 0 and is not shown to the controller; after
   `bad_readings` of them in a row the controller goes off.
2. Arm beyond `arm_travel`; arm since the last good reading faster than `arm_speed`, by more than one count of its
   encoder; pendulum beyond `tilt` from upright: off.
3. After missed samples the controller is first called once for each of them, with readings on the line from the last
   good one to the present one. These commands are discarded. So its filters and integrals keep their clock. The law
   is not told that 0 was sent instead, nor what the rules below change: its observer, its delay line and the last
   command that a policy sees hold its own commands, and learn of the difference by the next readings alone.
4. A command that is no number: off.
5. Soft start: the command grows linearly to its full size over `soft_start`.
6. Slew: it changes by at most slew · T a sample, 0 before the first.
7. Clamp: |u| ≤ u_max.

Off means a command of 0 until reset, and the reason is kept.
"""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .base import Controller
from .design import choose_sensors
from .trials import HORIZONTAL

LONGEST_START = 60.0  # s of a soft start
MOST_BAD_READINGS = 1000  # in a row; a rig that reads nothing for so long is not controlled

REASONS = ("on", "reading", "arm", "speed", "tilt", "law")  # indexed by the C header's numbers
FARTHEST = 1e4  # rad; no rig turns so far
_LARGEST = 1e30  # a single-precision number still, and no command


@dataclass(frozen=True)
class Envelope:
    """Limits in the command's unit, rad and s; infinity where there is none. Raises ValueError unless positive.

    soft_start may be zero, which is the default: who balances must act at once. So may resolution, one count of the
    arm's encoder. bad_readings is a whole number.
    """

    u_max: float
    arm_travel: float = 2 * math.pi
    arm_speed: float = math.inf
    tilt: float = math.inf
    slew: float = math.inf
    soft_start: float = 0.0
    bad_readings: int = 3
    resolution: float = 0.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            least = 0.0 if field.name in ("soft_start", "resolution") else math.nextafter(0.0, 1.0)
            if not (isinstance(value, int | float) and value >= least):
                raise ValueError(f"envelope: {field.name} must be a positive number, got {value!r}")
        if not all(map(math.isfinite, (self.u_max, self.soft_start, self.resolution))):
            raise ValueError("envelope: u_max, soft_start and resolution must be finite")
        if type(self.bad_readings) is not int or self.bad_readings > MOST_BAD_READINGS:
            wanted = f"a whole number from 1 to {MOST_BAD_READINGS}"
            raise ValueError(f"envelope: bad_readings must be {wanted}, got {self.bad_readings!r}")
        if self.soft_start > LONGEST_START:
            raise ValueError(f"envelope: soft_start {self.soft_start:g} s, expected {LONGEST_START:g} s at most")

    @classmethod
    def of(cls, controller: Any, **changes: Any) -> "Envelope":
        """From the controller and its encoders, and the plant file's limits where it has them; `changes` that are not
        None win.

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
            resolution=float(choose_sensors(plant, getattr(controller, "sensors", None)).resolution[0]),
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
        self._u = 0.0
        self._last = np.zeros(2)  # good reading
        self._good = self._missed = self._samples = 0

    def __call__(self, y: ArrayLike) -> float:
        reference = self.controller.reference_at(self._samples)
        self._samples += 1
        self._u = self._step(np.array(y, dtype=float), reference)
        return self._u

    def _step(self, q: NDArray[np.float64], reference: float) -> float:
        e, T = self.envelope, self.sample_time
        if self.off != REASONS[0]:
            return 0.0
        if not all(abs(x) <= FARTHEST for x in (*q, reference)):
            self._missed += 1
            return self._latch("reading") if self._missed >= e.bad_readings else 0.0
        if abs(q[0]) > e.arm_travel:
            return self._latch("arm")
        if self._good > 0 and abs(q[0] - self._last[0]) > e.arm_speed * T * (self._missed + 1) + e.resolution:
            return self._latch("speed")
        if abs(q[1]) > e.tilt:
            return self._latch("tilt")
        if self._good > 0:
            for part in np.arange(1, self._missed + 1) / (self._missed + 1):
                self.controller.follow(self._last + part * (q - self._last), reference)
        self._missed, self._last = 0, q
        self._good += 1
        u = float(self.controller.follow(q, reference))
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
    {P}_SPEED = 3,   /* arm faster than {speed_text}{count_text} */
    {P}_TILT = 4,    /* pendulum farther from upright than {tilt_text} */
    {P}_LAW = 5      /* the law gave no number */
}};

typedef struct {{
    {prefix}_law_state law;
    {real} u;   /* last command */
    {real} q1;  /* last good reading */
    {real} q2;
    long good;  /* readings so far, as long as the soft start lasts; an int may end at 32767 */
    int missed; /* bad readings in a row */
    int off;    /* {P}_ON or why it is off */
}} {prefix}_state;

static inline void {prefix}_reset({prefix}_state *s)
{{
    {prefix}_law_reset(&s->law);
    s->u = {zero};
    s->q1 = {zero};
    s->q2 = {zero};
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
{speed}{tilt}    if (s->good > 0) {{
        for (int i = 1; i <= s->missed; ++i) {{ /* what the law missed, on the line to this reading */
            const {real} part = ({real})i / ({real})(s->missed + 1);
            (void){prefix}_law(&s->law, s->q1 + part * (q1 - s->q1), s->q2 + part * (q2 - s->q2), reference);
        }}
    }}
    s->missed = 0;
    s->q1 = q1;
    s->q2 = q2;
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
            f"    if (s->good > 0 && !{prefix}_within(q1 - s->q1, {number(e.arm_speed * T)} * ({real})(s->missed + 1)"
            f" + {number(e.resolution)}))\n        return {prefix}_latch(s, {P}_SPEED);\n"
        )
    if e.tilt < math.inf:
        tilt = f"    if (!{prefix}_within(q2, {number(e.tilt)})) return {prefix}_latch(s, {P}_TILT);\n"
    if ramp:
        soft = f"    if (s->good <= {ramp}) u *= ({real})s->good / {number(ramp + 1.0)};\n"
    if e.slew < math.inf:
        step = number(e.slew * T)
        slew = f"    if (u < s->u - {step}) u = s->u - {step};\n    if (u > s->u + {step}) u = s->u + {step};\n"
    count = ""
    if e.arm_speed < math.inf and e.resolution:
        count = f", by more than a count of {e.resolution:.6g} rad ({2 * math.pi / e.resolution:.6g} a turn)"
    text = lambda value, unit: f"{value:g} {unit}" if value < math.inf else "anything: it has no such limit"  # noqa: E731
    return _C.format(
        prefix=prefix, P=P, real=real, bad=e.bad_readings, ramp=ramp, speed=speed, tilt=tilt, soft=soft, slew=slew,
        zero=number(0.0), far=number(FARTHEST), arm=number(min(e.arm_travel, FARTHEST)), u_max=number(e.u_max),
        large=number(_LARGEST), arm_text=text(e.arm_travel, "rad"), speed_text=text(e.arm_speed, "rad/s"),
        tilt_text=text(e.tilt, "rad"), count_text=count,
    )  # fmt: skip
