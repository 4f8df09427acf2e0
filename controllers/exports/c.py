"""A linear controller as one C99 header, to be compiled into a rig's firmware as it stands."""

import math
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.files import write_whole
from furuta_gym.plant import Plant

from ..base import Controller
from ..envelope import Envelope
from ..linear.law import LinearController
from .envelope_c import envelope_c

_HEADER = """\
/* Controller "{name}" of a Furuta pendulum. C99, no dependencies{math}.
 *
 * Call {prefix}_step once every {T:g} s with the encoders' angles and hold the command until the next call:
 *
 *     {prefix}_state s;
 *     {prefix}_reset(&s);
 *     for (;;) u = {prefix}_step(&s, q1, q2, 0.0);
 *
 * q1        arm angle [rad], not wrapped
 * q2        pendulum angle [rad], 0 upright, not wrapped
 * reference arm angle to hold [rad], well within the arm's travel: nothing here limits it
 * returns   command [{unit}], within +-{u_max:g}; 0 once s.off says why it is off
{columns} *
 * Designed for theta = {theta} ({unit}){effects}.
{limits} */
"""

_STEP = """\
typedef struct {{
    {real} z[{n}]; /* internal state */
    int started; /* 0 until the first step */
}} {prefix}_law_state;

static inline void {prefix}_law_reset({prefix}_law_state *s)
{{
    for (int i = 0; i < {n}; ++i) s->z[i] = {zero};
    s->started = 0;
}}

static inline {real} {prefix}_law({prefix}_law_state *s, {real} q1, {real} q2, {real} reference)
{{
    /* rows: next state ({n}), torque{velocity_row}; columns: state ({n}), q1, q2, reference */
{matrix}
    /* how the torque that is really applied enters the next state */
{applied}
    /* first state from the first reading */
{first}
{tables}    q1 -= {q1_zero}; /* angle from the arm's zero [rad] */
    q2 -= {q2_zero}; /* angle from the balance point [rad] */
    if (!s->started) {{
        for (int i = 0; i < {n}; ++i) s->z[i] = first[i][0] * q1 + first[i][1] * q2;
        s->started = 1;
    }}
    {real} out[{rows}];
    for (int i = 0; i < {rows}; ++i) {{
        out[i] = matrix[i][{n}] * q1 + matrix[i][{n} + 1] * q2 + matrix[i][{n} + 2] * reference;
        for (int j = 0; j < {n}; ++j) out[i] += matrix[i][j] * s->z[j];
    }}
    {real} torque = out[{n}]; /* [{unit}] */
    if (torque < {low}) torque = {low};
    if (torque > {high}) torque = {high};
    for (int i = 0; i < {n}; ++i) s->z[i] = out[i] + applied[i] * torque;
    torque += {holding}; /* holds the arm at zero [{unit}] */
{friction}{command}    if (u < -{u_max}) u = -{u_max};
    if (u > {u_max}) u = {u_max};
    return u;
}}
"""

_INVERSE = """\
    int i = 0, end = {points} - 1; /* undo the static map from command to torque, by its table */
    while (end - i > 1) {{
        const int middle = (i + end) / 2;
        if (torque < torques[middle]) end = middle;
        else i = middle;
    }}
    if (torque < torques[i]) torque = torques[i];
    if (torque > torques[end]) torque = torques[end];
    {real} u = commands[i] + (torque - torques[i]) / (torques[end] - torques[i]) * (commands[end] - commands[i]);
"""


def c_header(
    controller: Controller, prefix: str | None = None, envelope: Envelope | None = None, single: bool = False
) -> str:
    """The header's text; `prefix` begins its names, by default `furuta_` and the controller's name.

    envelope: around the law, by default `Envelope.of(controller)`. single: everything in single precision.
    Raises ValueError for a controller that is not linear (learned policies have `export_policy_c`), for a prefix that
    is no C name, and for plants with effects that the header cannot undo (eccentric encoders, cancelled arm effects).
    """
    if not isinstance(controller, LinearController):
        raise ValueError(
            f"{controller.name} is not linear and has no C export; lqr, dlqr, lqg, lqi and the like have, and policies"
        )
    prefix = prefix or "furuta_" + re.sub(r"\W", "_", controller.name)
    if not re.fullmatch(r"[A-Za-z_]\w*", prefix, re.ASCII):
        raise ValueError(f"prefix must be a C name (letters, digits, _), got {prefix!r}")
    envelope = envelope or Envelope.of(controller)
    real, tanh = ("float", "tanhf") if single else ("double", "tanh")

    def number(x: float) -> str:
        return _number(x, single)

    known, plant, law = controller.known, controller.plant, controller.law
    q1_zero, q2_zero = known.offset
    q2_zero += controller.q2e + _encoder_offset(controller)
    share = controller.friction_share
    if share and known.cancels_effects:
        raise ValueError(
            f"{controller.name} cancels effects on the arm that the C header does not know; export dlqr or lqg instead"
        )
    n = law.size
    rows = n + 2 if share else n + 1
    top = np.block([[law.A, law.B], [law.C[None], law.D[None]], [law.E[2:3], law.F[2:3]]])
    friction = (
        f"    torque += {number(share * plant.theta[7])} * {tanh}(out[{n} + 1] * {number(known.plant.sharpness[0])});"
    )
    tables, command = "", f"    {real} u = torque;\n"
    if known.command_map is not None:
        torques, commands = known.command_map
        tables = _array("torques", torques, single) + _array("commands", commands, single)
        command = _INVERSE.format(points=torques.size, real=real)
    low, high = controller.limits
    guard = prefix.upper() + "_H"
    text = _HEADER.format(
        name=controller.name,
        math=" but math.h" if share else "",
        prefix=prefix,
        T=controller.sample_time,
        unit=plant.unit,
        u_max=envelope.u_max,
        theta=", ".join(f"{v:.6g}" for v in plant.theta),
        columns=columns_note(plant) + _zeros_note(q1_zero, q2_zero - controller.q2e),
        effects=effects_note(plant),
        limits=limits_note(plant, envelope, controller.sample_time),
    )
    text += f"#ifndef {guard}\n#define {guard}\n\n" + ("#include <math.h>\n\n" if share else "")
    text += _STEP.format(
        prefix=prefix,
        n=n,
        rows=rows,
        velocity_row=", arm velocity" if share else "",
        matrix=_array("matrix", top[:rows], single),
        applied=_array("applied", law.G, single),
        first=_array("first", law.Z, single),
        tables=tables,
        q1_zero=number(q1_zero),
        q2_zero=number(q2_zero),
        low=number(low),
        high=number(high),
        holding=number(controller.holding_torque),
        friction=friction + "\n" if share else "",
        command=command,
        u_max=number(controller.u_max),
        unit=plant.unit,
        real=real,
        zero=number(0.0),
    )
    text += "\n" + envelope_c(prefix, controller.sample_time, envelope, number, real)
    return text + "\n#endif\n"


def columns_note(plant: Plant) -> str:
    """A line for the header's comment that says what q1, q2 and u are in the columns of the logs that the plant was
    fitted to; "" if they had the model's own."""
    logs = plant.provenance.get("logs") or [{}]
    read = dict.fromkeys(_commented(str(log.get("read_as", ""))) for log in logs)
    if len(read) == 1:
        return "".join(f" * In the columns of the logs that the plant was fitted to: {said}\n" for said in read if said)
    told = [f" *   {said or 'in the columns q1, q2 and u themselves'}\n" for said in read]
    return "".join([" * The logs that the plant was fitted to were read in several ways:\n", *told])


def limits_note(plant: Plant, envelope: Envelope, period: float) -> str:
    """Lines for the header's comment on what the plant file and the envelope limit. period [s]: of calls."""
    speed = f"up to {envelope.arm_speed:g} rad/s" if math.isfinite(envelope.arm_speed) else "at any speed of the arm"
    reach = f"up to {envelope.arm_travel:.3g} rad to either side, {speed}"
    if envelope.slew < math.inf:
        most = f"{envelope.slew * period:.4g} {plant.unit}"
        reach += f".\n * The command changes by at most {most} from one call to the next, or goes to 0"
    if not plant.limits:
        return f" * The plant file has no limits: {reach}.\n"
    limits = ", ".join(f"{name} {value:g}" for name, value in plant.limits.items())
    return f" * Limits of the plant file: {limits}. This header: {reach}.\n"


def effects_note(plant: Plant) -> str:
    """Lines for the header's comment, each begun by its line break, with the plant's effects; "" without any."""
    return "".join(f"\n * and {_commented(str(effect))}" for effect in plant.effects)


def _zeros_note(q1: float, q2: float) -> str:
    """A line on zeros of the encoders that the step takes off."""
    if not q1 and not q2:
        return ""
    return (
        f" * Taken off here, as the plant file has these readings at the zeros: {q1:.6g} rad of q1, {q2:.6g} rad of "
        "q2.\n"
        " * Export from a plant without them if your firmware sets its counters to zero there.\n"
    )


def _commented(text: str) -> str:
    """A stranger's text in a comment."""
    return " ".join(text.split()).replace("*/", "* /")


def export_c(controller: Controller, path: str | os.PathLike[str], prefix: str | None = None, **options: Any) -> Path:
    """Write a linear controller as one C99 header to `path` and return the path.

    prefix begins its names, by default `furuta_` and the controller's name. options: `envelope` and `single` of
    `c_header`. Raises ValueError for what `c_header` refuses; learned policies go through `export_policy_c`.
    """
    return write_whole(path, c_header(controller, prefix, **options))


def _encoder_offset(controller: LinearController) -> float:
    known = controller.known
    if not known.reads_wrong:
        return 0.0
    effects = [e for e in known.plant.effects if e.type.place == "sensor"]
    if [e.type.wrong_zero for e in effects] != ["pendulum"]:
        raise ValueError(
            "the C header undoes a constant zero error of the pendulum's encoder, not "
            f"{', '.join(e.name for e in effects)}; correct the readings before the call and export from a plant "
            "without these effects"
        )
    (zero,) = effects[0].parameters.values()
    return zero


def _number(x: float, single: bool = False) -> str:
    """A C literal that reads back to the same bits; parentheses keep a minus sign apart."""
    text = repr(float(x))
    if single:
        text = f"{float(np.float32(x)):.9g}"
    text = text if any(c in text for c in ".en") else text + ".0"
    text += "f" if single else ""
    return f"({text})" if x < 0 else text


def _array(name: str, values: NDArray[np.float64], single: bool) -> str:
    head = f"    static const {'float' if single else 'double'} {name}"
    if values.ndim == 1:
        return f"{head}[{values.size}] = {{\n{_lines(values, 8, single)}    }};\n"
    rows = "".join(f"        {{\n{_lines(row, 12, single)}        }},\n" for row in values)
    return f"{head}[{values.shape[0]}][{values.shape[1]}] = {{\n{rows}    }};\n"


def _lines(values: NDArray[np.float64], indent: int, single: bool) -> str:
    """Numbers of one row, four to a line."""
    numbers = [_number(float(x), single).strip("()") for x in values]
    chunks = [numbers[i : i + 4] for i in range(0, len(numbers), 4)]
    return "".join(" " * indent + ", ".join(chunk) + ",\n" for chunk in chunks)
