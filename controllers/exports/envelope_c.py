"""The envelope of `controllers.envelope` in C99, for the headers of designed controllers and of policies."""

import math
from typing import Any

from ..envelope import FARTHEST, JUMP, LARGEST, Envelope, speed_samples

_C = """\
/* Why the controller is off; it stays off, with a command of 0, until {prefix}_reset. */
enum {{
    {P}_ON = 0,      /* it works */
    {P}_READING = 1, /* {bad} readings in a row were no angles, or half a turn from the last good one */
    {P}_ARM = 2,     /* arm beyond {arm_text} */
    {P}_SPEED = 3,   /* arm faster than {speed_text}{count_text} */
    {P}_TILT = 4,    /* pendulum farther from upright than {tilt_text} */
    {P}_LAW = 5,     /* the law gave no number */
    {P}_HELD = 6     /* {held_text} */
}};

typedef struct {{
    {prefix}_law_state law;
    {real} u;   /* last command */
    {real} from; /* arm's reading that its speed is taken from */
    int since;  /* samples since then */
    {real} q1;  /* last good reading */
    {real} q2;
    long good;  /* readings so far, as long as the soft start lasts; an int may end at 32767 */
    int missed; /* bad readings in a row */
    {real} low; /* of the pendulum, while the arm's reading stands */
    {real} high;
    long pushed; /* samples with a command that must move the arm, while its reading stands */
    int off;    /* {P}_ON or why it is off */
}} {prefix}_state;

static inline void {prefix}_reset({prefix}_state *s)
{{
    {prefix}_law_reset(&s->law);
    s->u = {zero};
    s->from = {zero};
    s->since = 0;
    s->q1 = {zero};
    s->q2 = {zero};
    s->good = 0;
    s->missed = 0;
    s->low = {zero};
    s->high = {zero};
    s->pushed = 0;
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

/* As {prefix}_step, with `extra` added to the law's command within the envelope: an excitation. */
static inline {real} {prefix}_step_with(
    {prefix}_state *s, {real} q1, {real} q2, {real} reference, {real} extra)
{{
    {real} u;
    if (s->off != {P}_ON) return {zero};
{clock}    if (!({prefix}_within(q1, {far}) && {prefix}_within(q2, {far}) && {prefix}_within(reference, {far}))
        || (s->good > 0 && !({prefix}_within(q1 - s->q1, {jump}) && {prefix}_within(q2 - s->q2, {jump})))) {{
        s->u = {zero};
        if (s->missed < {bad}) s->missed += 1;
        return s->missed >= {bad} ? {prefix}_latch(s, {P}_READING) : {zero};
    }}
    if (!{prefix}_within(q1, {arm})) return {prefix}_latch(s, {P}_ARM);
{speed}{tilt}{held}    if (s->good > 0) {{
        for (int i = 1; i <= s->missed; ++i) {{ /* what the law missed, on the line to this reading */
            const {real} part = ({real})i / ({real})(s->missed + 1);
            (void){prefix}_law(&s->law, s->q1 + part * (q1 - s->q1), s->q2 + part * (q2 - s->q2), reference);
        }}
    }}
    s->missed = 0;
    s->q1 = q1;
    s->q2 = q2;
    if (s->good <= {ramp}) s->good += 1;
    u = {prefix}_law(&s->law, q1, q2, reference) + extra;
    if (!{prefix}_within(u, {large})) return {prefix}_latch(s, {P}_LAW);
{soft}{slew}    if (u < -{u_max}) u = -{u_max};
    if (u > {u_max}) u = {u_max};
    s->u = u;
    return u;
}}

static inline {real} {prefix}_step({prefix}_state *s, {real} q1, {real} q2, {real} reference)
{{
    return {prefix}_step_with(s, q1, q2, reference, {zero});
}}
"""


def envelope_c(prefix: str, sample_time: float, envelope: Envelope, number: Any, real: str) -> str:
    """C99 of the envelope around `{prefix}_law`, with {prefix}_state, {prefix}_reset and {prefix}_step.

    number: turns a float into a literal of the type `real` ("double" or "float").
    """
    e, T, P = envelope, sample_time, prefix.upper()
    ramp = math.ceil(e.soft_start / T)
    clock = speed = tilt = held = soft = slew = ""
    if e.arm_speed < math.inf:
        clock = "    if (s->good > 0) s->since += 1;\n"
        speed = (
            f"    if (s->good > 0 && !{prefix}_within(q1 - s->from, {number(e.arm_speed * T)} * ({real})s->since"
            f" + {number(e.resolution)}))\n        return {prefix}_latch(s, {P}_SPEED);\n"
            f"    if (s->good == 0 || s->since >= {speed_samples(T)}) {{\n"
            f"        s->from = q1;\n        s->since = 0;\n    }}\n"
        )
    if e.tilt < math.inf:
        tilt = f"    if (!{prefix}_within(q2, {number(e.tilt)})) return {prefix}_latch(s, {P}_TILT);\n"
    times = [(e.held, f"s->high - s->low > {number(e.stirred)}")] if e.stirred < math.inf else []
    times = [(t, shown) for t, shown in [*times, (e.frozen, "!(s->high > s->low)")] if t < math.inf]
    if watched := bool(times) and e.breakaway < math.inf:
        most = math.ceil(max(t for t, _ in times) / T)
        held = (
            "    if (s->good == 0 || q1 < s->q1 || q1 > s->q1) {\n"
            "        s->pushed = 0;\n"
            "        s->low = s->high = q2;\n"
            f"    }} else if (s->pushed < {most} && !{prefix}_within(s->u, {number(e.breakaway)})) {{\n"
            "        s->pushed += 1;\n"
            "    }\n"
            "    if (q2 < s->low) s->low = q2;\n"
            "    if (q2 > s->high) s->high = q2;\n"
        )
        for longest, shown in times:
            held += f"    if (s->pushed >= {math.ceil(longest / T)} && {shown}) return {prefix}_latch(s, {P}_HELD);\n"
    if ramp:
        soft = f"    if (s->good <= {ramp}) u *= ({real})s->good / {number(ramp + 1.0)};\n"
    if e.slew < math.inf:
        step = number(e.slew * T)
        slew = f"    if (u < s->u - {step}) u = s->u - {step};\n    if (u > s->u + {step}) u = s->u + {step};\n"
    count = ""
    if e.arm_speed < math.inf and e.resolution:
        window = speed_samples(T) * T
        surely = e.arm_speed + e.resolution / window
        turn = f"{2 * math.pi / e.resolution:.6g} a turn"
        count = f", by more than a count ({turn}) in {window:g} s, so surely off from {surely:.3g} rad/s on"
    text = lambda value, unit: f"{value:g} {unit}" if value < math.inf else "anything: it has no such limit"  # noqa: E731
    held_text = "never: it does not watch whether the arm's reading stands"
    if watched:
        seconds = " or ".join(f"{t:g}" for t in dict.fromkeys(t for t, _ in times))
        held_text = f"the arm's reading stood, {seconds} s of it beyond a command of {e.breakaway:.3g}: unplugged?"
    return _C.format(
        prefix=prefix, P=P, real=real, bad=e.bad_readings, ramp=ramp, clock=clock, speed=speed, tilt=tilt, held=held,
        soft=soft, slew=slew, jump=number(JUMP),
        zero=number(0.0), far=number(FARTHEST), arm=number(min(e.arm_travel, FARTHEST)), u_max=number(e.u_max),
        large=number(LARGEST), arm_text=text(e.arm_travel, "rad"), speed_text=text(e.arm_speed, "rad/s"),
        tilt_text=text(e.tilt, "rad"), count_text=count, held_text=held_text,
    )  # fmt: skip
