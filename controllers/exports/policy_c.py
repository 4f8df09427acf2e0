"""A learned policy as one C99 header: its observation made from readings, its network, its command."""

import math
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.envs.options import SPEED_LIMIT
from furuta_gym.files import write_whole

from ..envelope import Envelope
from ..learned.cells import Cells
from ..learned.layers import Layer, network_in
from ..learned.policy import LearnedController
from .c import _number, columns_note, effects_note, limits_note
from .envelope_c import envelope_c

_HEADER = """\
/* Learned policy "{name}" of a Furuta pendulum ({task}). C99, needs math.h, string.h; the network in
 * single precision, the rest in {real}.
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
 * Exported for theta = {theta} ({unit}){effects}.
{limits} */
#ifndef {guard}
#define {guard}

#include <math.h>
#include <string.h>

"""

_STEP = """\
typedef struct {{
    {real} q[2], v[2]; /* last readings, filtered velocities */
    {real} u, passed;  /* last command, and what of it supply and slew let pass */
    float seen[{size}];   /* the observation, oldest frame first */
{memory}    int started;
}} {prefix}_law_state;

static inline void {prefix}_law_reset({prefix}_law_state *s)
{{
    memset(s, 0, sizeof *s);
}}

static inline {real} {prefix}_clip({real} x, {real} limit)
{{
    return x < -limit ? -limit : x > limit ? limit : x;
}}

static inline void {prefix}_layer(const float *weight, const float *bias, int n, int m, const float *x, float *y)
{{
    for (int i = 0; i < m; ++i) {{
        y[i] = bias[i];
        for (int j = 0; j < n; ++j) y[i] += weight[i * n + j] * x[j];
    }}
}}

static inline {real} {prefix}_law({prefix}_law_state *s, {real} q1, {real} q2, {real} reference)
{{
{arrays}
    const {real} q[2] = {{q1, q2}};
    for (int i = 0; i < 2; ++i) {{
        if (s->started) s->v[i] += {gain} * ((q[i] - s->q[i]) / {period} - s->v[i]);
        s->q[i] = q[i];
    }}
{passed}    const float frame[{frame}] = {{
        (float){prefix}_clip(q1 - reference, {arm}),
        (float){sin}(q2),
        (float){cos}(q2),
        (float){prefix}_clip(s->v[0], {speed}),
        (float){prefix}_clip(s->v[1], {speed}),
{command}    }};
    memmove(s->seen, s->seen + {frame}, sizeof(float) * ({size} - {frame}));
    for (int i = s->started ? {size} - {frame} : 0; i < {size}; i += {frame}) memcpy(s->seen + i, frame, sizeof frame);
    s->started = 1;
    float {scaled}[{size}];
    for (int i = 0; i < {size}; ++i) {scaled}[i] = s->seen[i] * scale[i];
{cells}{layers}    s->u = {prefix}_clip({unit_per_action} * {action}, {limit});
    return s->u;
}}

"""


_CELLS = """\
    float gates[{gates}];
    {prefix}_layer(cells_w, cells_bias, {size}, {gates}, scaled, gates);
    for (int i = 0; i < {gates}; ++i) {{
        for (int j = 0; j < {count}; ++j) gates[i] += cells_r[i * {count} + j] * s->output[j];
    }}
    float x0[{outputs}];
    for (int i = 0; i < {count}; ++i) {{
        const float taken = 0.5f + 0.5f * tanhf(0.5f * gates[i]);
        const float kept = 0.5f + 0.5f * tanhf(0.5f * gates[i + {count}]);
        const float shown = 0.5f + 0.5f * tanhf(0.5f * gates[i + 3 * {count}]);
        s->content[i] = kept * s->content[i] + taken * tanhf(gates[i + 2 * {count}]);
        s->output[i] = shown * tanhf(s->content[i]);
        x0[i] = s->output[i];
    }}
"""


def policy_c_header(
    controller: LearnedController, prefix: str | None = None, envelope: Envelope | None = None, single: bool = False
) -> str:
    """The header's text; `prefix` begins its names, by default `furuta_` and the policy's name.

    envelope: around the policy, by default `Envelope.of(controller)`. single: everything in single precision.
    Raises ValueError for a prefix that is no C name, and for a controller whose `predict` is no `Network`.
    """
    prefix = prefix or "furuta_" + re.sub(r"\W", "_", Path(controller.name).stem, flags=re.ASCII)
    if not re.fullmatch(r"[A-Za-z_]\w*", prefix, re.ASCII):
        raise ValueError(f"prefix must be a C name (letters, digits, _), got {prefix!r}")
    network = network_in(controller)
    period = controller.every * controller.sample_time
    envelope = envelope or Envelope.of(controller)
    real = "float" if single else "double"

    def number(x: float) -> str:
        return _number(x, single)

    names = {"prefix": prefix, "T": period, "u_max": envelope.u_max, "real": real}
    text = _HEADER.format(
        name=controller.name,
        task=controller.tasks[-1],
        unit=controller.unit,
        guard=prefix.upper() + "_H",
        theta=", ".join(f"{v:.6g}" for v in controller.plant.theta),
        columns=columns_note(controller.plant),
        effects=effects_note(controller.plant),
        limits=limits_note(controller.plant, envelope, period),
        **names,
    )
    arrays = [_array("scale", network.scale)]
    if (cells := network.cells) is not None:
        arrays += [_array("cells_w", cells.w.ravel()), _array("cells_r", cells.r.ravel())]
        arrays.append(_array("cells_bias", cells.bias))
    layers = []
    for i, layer in enumerate(network.layers):
        arrays += [_array(f"weight{i}", layer.weight.ravel()), _array(f"bias{i}", layer.bias)]
        layers.append(_layer(prefix, i, layer))
    observed = controller.observe_command
    last = f"x{len(network.layers)}[0]"
    limit = number(network.limit)
    tanh = f"{'tanhf' if single else 'tanh'}({last})"
    action = f"{limit} * {tanh}" if network.squashed else f"{prefix}_clip({last}, {limit})"
    body = _STEP.format(
        size=network.size,
        frame=network.size // controller.history,
        arrays="".join(arrays),
        memory="" if cells is None else f"    float output[{cells.size}], content[{cells.size}]; /* of the cells */\n",
        scaled="x0" if cells is None else "scaled",
        cells="" if cells is None else _cells(prefix, cells),
        layers="".join(layers),
        gain=number(1.0 - math.exp(-controller.velocity_cutoff * period)),
        period=number(period),
        arm=number(2.0 * controller.arm_limit),
        speed=number(SPEED_LIMIT),
        sin="sinf" if single else "sin",
        cos="cosf" if single else "cos",
        command=f"        (float)(s->passed / {number(controller.trained_u_max)}),\n" if observed else "",
        passed=_passed(prefix, controller, number) if observed else "",
        unit_per_action=number(controller.scale),
        action=action,
        limit=number(controller.u_max),
        **names,
    )
    return text + body + envelope_c(prefix, period, envelope, number, real) + "\n#endif\n"


def export_policy_c(
    controller: LearnedController, path: str | os.PathLike[str], prefix: str | None = None, **options: Any
) -> Path:
    """Write a learned policy as one C99 header to `path` and return the path.

    prefix begins its names, by default `furuta_` and the policy's name. options: `envelope` and `single` of
    `policy_c_header`. Raises ValueError for what `policy_c_header` refuses.
    """
    return write_whole(path, policy_c_header(controller, prefix, **options))


def _passed(prefix: str, controller: LearnedController, number: Callable[[float], str]) -> str:
    """What supply and slew let pass of the last command."""
    wanted = f"{prefix}_clip(s->u, {number(controller.supply)})"
    most = controller.slew * controller.every * controller.sample_time
    if most == math.inf:
        return f"    s->passed = {wanted};\n"
    return f"    s->passed += {prefix}_clip({wanted} - s->passed, {number(most)});\n"


def _layer(prefix: str, i: int, layer: Layer) -> str:
    m, n = layer.weight.shape
    x = f"x{i + 1}[i]"
    function = {"Tanh": f"tanhf({x})", "ReLU": f"fmaxf({x}, 0.0f)"}
    active = f"    for (int i = 0; i < {m}; ++i) {x} = {function[layer.activation]};\n" if layer.activation else ""
    return f"    float x{i + 1}[{m}];\n    {prefix}_layer(weight{i}, bias{i}, {n}, {m}, x{i}, x{i + 1});\n{active}"


def _cells(prefix: str, cells: Cells) -> str:
    size, count = cells.w.shape[1], cells.size
    text = _CELLS.format(prefix=prefix, size=size, count=count, gates=4 * count, outputs=cells.outputs)
    beside = f"    for (int i = 0; i < {size}; ++i) x0[i + {count}] = scaled[i];\n"
    return text + beside if cells.beside else text


def _array(name: str, values: NDArray[np.float32]) -> str:
    numbers = [f"{float(v):.9g}" for v in values]
    numbers = [n + ("f" if any(c in n for c in ".en") else ".0f") for n in numbers]
    lines = "".join("        " + ", ".join(numbers[k : k + 8]) + ",\n" for k in range(0, len(numbers), 8))
    return f"    static const float {name}[{len(numbers)}] = {{\n{lines}    }};\n"
