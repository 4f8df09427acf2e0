"""`furuta export`: a controller as C, a policy as ONNX, a plant as MJCF."""

from __future__ import annotations

import warnings
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import options as opt
from .output import print_json

if TYPE_CHECKING:
    from controllers.base import Controller
    from furuta_gym.plant import Plant


class Format(StrEnum):
    """Where it is taken: firmware, a network runtime, MuJoCo."""

    c = "c"
    onnx = "onnx"
    mjcf = "mjcf"


ENDINGS = {Format.c: (".h", ".c"), Format.onnx: (".onnx",), Format.mjcf: (".xml", ".mjcf")}


def export_command(
    plant: Annotated[str, typer.Argument(help="table3, qube, large, or a plant file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write: .h, .onnx or .xml.")],
    policy: Annotated[str | None, typer.Argument(help="A learned policy *.zip; the same as --controller.")] = None,
    controller: Annotated[str | None, typer.Option(help="What to export: lqr, dlqr, lqg, … or a policy *.zip.")] = None,
    format: Annotated[
        Format | None, typer.Option(help="c (a controller), onnx (a policy), mjcf (the plant); default: by the ending.")
    ] = None,
    sample_time: Annotated[
        float | None,
        typer.Option(
            help="Of a linear controller, in seconds; default: the plant's, else 0.002. A policy keeps that of "
            "its training."
        ),
    ] = None,
    single: Annotated[bool, typer.Option("--single", help="C in single precision (float) throughout.")] = False,
    soft_start: Annotated[
        float | None, typer.Option(help="C: seconds over which the command grows to its full size.", min=0.0)
    ] = None,
    trust: opt.Trust = False,
    as_json: opt.AsJson = False,
) -> None:
    """Take a result elsewhere: a C header for firmware, ONNX for a policy, MuJoCo XML for the plant."""
    kind = format or _format_of(output)
    opt.output_file(output, ENDINGS[kind], [Path(name) for name in (plant, policy, controller) if name])
    if policy is not None and controller is not None:
        raise ValueError(f"{policy} and --controller {controller}: give one of them")
    if kind is not Format.c and (single or soft_start is not None):
        raise ValueError(f"--single and --soft-start are for C; leave them out with {kind.value}")
    chosen = policy or controller
    from furuta_gym.plant import Plant

    opt.within("--soft-start", None if soft_start == 0 else soft_start, 0.0, 60.0, "seconds, from 0 to 60")
    rig = Plant.resolve(plant)
    with opt.as_typed("sample_time"):
        _write(kind, rig, plant, chosen, output, sample_time, single, soft_start, trust)
    if as_json:
        print_json({"written": str(output), "format": kind.value, "plant": plant, "controller": chosen})
    else:
        typer.echo(f"{output}: {chosen or plant} as {kind.value}")


def _write(
    kind: Format,
    rig: Plant,
    plant: str,
    chosen: str | None,
    output: Path,
    sample_time: float | None,
    single: bool,
    soft_start: float | None,
    trust: bool,
) -> None:
    if kind is Format.mjcf:
        if chosen is not None:
            raise ValueError(f"MJCF holds the plant alone; leave {chosen} out, or take --format c or onnx")
        if sample_time is not None or trust:
            raise ValueError("--sample-time and --trust are for controllers; leave them out with mjcf")
        from controllers.exports.mjcf import export_mjcf

        export_mjcf(rig, output)
    elif kind is Format.onnx:
        if chosen is None or not chosen.endswith(".zip"):
            got = f", not for {chosen}" if chosen else ""
            raise ValueError(
                f"ONNX is for learned policies{got}: furuta export {plant} policy.zip -o {output}. Expected a *.zip"
            )
        from controllers.exports.onnx import export_onnx

        export_onnx(chosen, rig, output, sample_time, trust=trust)
    else:
        if chosen is None:
            raise ValueError("C is for controllers; expected one such as --controller lqg")
        from controllers.envelope import Envelope, unlimited

        made: Controller
        if chosen.endswith(".zip"):
            from controllers.exports.policy_c import export_policy_c
            from controllers.learned.policy import load_to_export

            made = policy = load_to_export(chosen, rig, sample_time, trust=trust)
            envelope = Envelope.of(policy, soft_start=soft_start)
            export_policy_c(policy, output, single=single, envelope=envelope)
        else:
            from controllers import make_controller
            from controllers.exports.c import export_c
            from controllers.registry import held

            made = held(make_controller(chosen, rig, sample_time))
            envelope = Envelope.of(made, soft_start=soft_start)
            export_c(made, output, single=single, envelope=envelope)
        if soft_start and "swing_up" not in made.tasks:
            warnings.warn(
                f"--soft-start {soft_start:g}: {made.name} balances only, and a pendulum that stands needs the full "
                "command at once; expect it to fall. For a first run see docs/how-to/first_run.md",
                stacklevel=2,
            )
        if without := unlimited(rig, envelope.arm_travel):
            warnings.warn(without, stacklevel=2)


def _format_of(output: Path) -> Format:
    for kind, endings in ENDINGS.items():
        if output.suffix.lower() in endings:
            return kind
    every = ", ".join(ending for endings in ENDINGS.values() for ending in endings)
    raise ValueError(f"output {output}: expected a name that ends in {every}, or --format")
