"""A learned policy as an ONNX model: observation in, command out."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from furuta_gym.envs.options import SPEED_LIMIT
from furuta_gym.files import write_whole
from furuta_gym.plant import Plant

from ..learned.cells import Cells
from ..learned.layers import Network, network_in
from ..learned.policy import LearnedController, load_to_export
from ..learned.policy_file import read_record

OPSET = 17

_OBSERVATION = (
    "q1, sin q2, cos q2, v1, v2 in rad and rad/s (q2 = 0 upright); v is a filtered difference, "
    "v += (1 - exp(-velocity_cutoff * sample_time)) * ((y - y_last) / sample_time - v), zero at the first sample"
)


_MEMORY = (
    "give next_cells_output and next_cells_content back as cells_output and cells_content at the next step; zeros at "
    "the first step, and after each pause"
)


def onnx_model(network: Network, scale: float, u_max: float, about: dict[str, Any]) -> Any:
    """The network as an `onnx.ModelProto`.

    Input `observation` (N, n) float32. Outputs (N, 1): `action`, as the policy's `predict` gives it, and `command`,
    scale times the action within ± u_max. A recurrent policy has two more inputs (N, cells), `cells_output` and
    `cells_content`, and the outputs `next_cells_output` and `next_cells_content`; the metadata say what to do with
    them. about: strings for the model's metadata.
    """
    from onnx import TensorProto, helper, numpy_helper

    nodes, constants = [], []

    def constant(name: str, value: Any) -> str:
        constants.append(numpy_helper.from_array(np.asarray(value, dtype=np.float32), name))
        return name

    def node(kind: str, inputs: list[str], output: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    def cell_state(prefix: str, cells: Cells) -> list[tuple[str, int]]:
        return [(prefix + name, cells.size) for name in ("cells_output", "cells_content")]

    x = node("Mul", ["observation", constant("scale", network.scale)], "scaled")
    inputs, outputs = [("observation", network.size)], [("action", 1), ("command", 1)]
    if (cells := network.cells) is not None:
        parts = [constant(f"cells_{name}", getattr(cells, name)) for name in ("w", "r", "bias")]
        sums = node("Gemm", ["cells_output", parts[1], parts[2]], "kept_sums", transB=1)
        sums = node("Add", [sums, node("Gemm", [x, parts[0]], "taken_sums", transB=1)], "sums")
        names = ["taken", "kept", "new", "shown"]
        nodes.append(helper.make_node("Split", [sums], [f"{n}_sum" for n in names], axis=1))
        taken, kept, new, shown = (node("Tanh" if n == "new" else "Sigmoid", [f"{n}_sum"], f"{n}_gate") for n in names)
        carried, added = node("Mul", [kept, "cells_content"], "carried"), node("Mul", [taken, new], "added")
        content = node("Tanh", [node("Add", [carried, added], "next_cells_content")], "shown_content")
        y = node("Mul", [shown, content], "next_cells_output")
        x = node("Concat", [y, x], "cells_and_input", axis=1) if cells.beside else y
        inputs, outputs = inputs + cell_state("", cells), outputs + cell_state("next_", cells)
    for i, layer in enumerate(network.layers):
        parts = [x, constant(f"weight_{i}", layer.weight), constant(f"bias_{i}", layer.bias)]
        x = node("Gemm", parts, f"layer_{i}", transB=1)
        if layer.activation:
            x = node({"ReLU": "Relu"}.get(layer.activation, layer.activation), [x], f"active_{i}")
    limit = constant("limit", network.limit)
    if network.squashed:
        node("Mul", [node("Tanh", [x], "squashed"), limit], "action")
    else:
        node("Clip", [x, constant("lowest", -network.limit), limit], "action")
    node("Mul", ["action", constant("unit", scale)], "unclipped")
    node("Clip", ["unclipped", constant("least", -u_max), constant("most", u_max)], "command")

    def values(of: list[tuple[str, int]]) -> list[Any]:
        return [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["N", n]) for name, n in of]

    graph = helper.make_graph(nodes, "policy", values(inputs), values(outputs), constants)
    model = helper.make_model(
        graph, producer_name="furuta-gym", opset_imports=[helper.make_opsetid("", OPSET)], ir_version=9
    )
    helper.set_model_props(model, {key: str(text) for key, text in about.items()})
    return model


def export_onnx(
    policy: str | os.PathLike[str],
    plant: Plant,
    path: str | os.PathLike[str],
    sample_time: float | None = None,
    *,
    trust: bool = False,
) -> Path:
    """Write the policy file for `plant` as ONNX; its metadata say how an observation is made.

    sample_time [s]: the policy's own, if it is given. Returns the path.

    Raises ValueError for what `load_to_export` refuses (trust: see `load_policy`), or without the package onnx.
    """
    controller = load_to_export(policy, plant, sample_time, trust=trust)
    try:
        import onnx
    except ImportError as error:
        raise ValueError("ONNX needs the package onnx: `pip install onnx`") from error
    about = _about(controller, plant, Path(policy))
    model = onnx_model(network_in(controller), controller.scale, plant.u_max, about)
    onnx.checker.check_model(model)
    return write_whole(path, model.SerializeToString())


def _about(controller: LearnedController, plant: Plant, policy: Path) -> dict[str, Any]:
    more = "; then the last command that reached the motor / trained_u_max" if controller.observe_command else ""
    clipped = f"; q1 within ±{2 * controller.arm_limit:.6g} rad, speeds within ±{SPEED_LIMIT:g} rad/s"
    cells = network_in(controller).cells
    remember = {} if cells is None else {"memory": _MEMORY}
    past = f"; {controller.history} of them, oldest first; at the first step all are the first one"
    past = past if controller.history > 1 else ""
    record = read_record(policy)
    return remember | {
        "observation": f"{_OBSERVATION}{clipped}{more}{past}",
        "sample_time": controller.every * controller.sample_time,
        "velocity_cutoff": controller.velocity_cutoff,
        "u_max": plant.u_max,
        "trained_u_max": controller.trained_u_max,
        "unit": plant.unit,
        "limits": json.dumps(dict(plant.limits or {})),
        "task": controller.tasks[-1],
        "trained": json.dumps({key: record.get(key) for key in ("algorithm", "seed", "steps", "plant_sha256")}),
    }
