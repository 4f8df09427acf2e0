"""`furuta simulate`: a plant, a controller and an excitation in; a log out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import options as opt
from .output import print_json

if TYPE_CHECKING:
    from controllers import Controller
    from furuta_gym.plant import Plant


class Start(StrEnum):
    """Where the pendulum starts."""

    hanging = "hanging"
    upright = "upright"


def simulate_command(
    plant: Annotated[str, typer.Option(help="table3, qube, large, or a plant file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Log to write: .csv, .parquet, .npz or .mat.")],
    controller: Annotated[
        str,
        typer.Option(
            help="paper-lqr, lqr, dlqr, lqg, …, a policy *.zip, or none (the excitation is the whole command)."
        ),
    ] = "none",
    design_plant: Annotated[
        str | None,
        typer.Option(help="Plant that the controller is designed for; default: the simulated one, its effects known."),
    ] = None,
    printed_sign: Annotated[
        bool, typer.Option("--printed-sign", help="Play paper-lqr as printed, u = +K x; it falls.")
    ] = False,
    excitation: Annotated[
        str,
        typer.Option(
            help="Added to the command: paper, square, chirp, prbs, multisine, none, or a file of `furuta excite`."
        ),
    ] = "none",
    amplitude: Annotated[
        float | None, typer.Option(help="Scale of the excitation, in the command's unit. Default: 1.")
    ] = None,
    effect: Annotated[
        list[str] | None, typer.Option(help="Add an effect, NAME:p=v,… or NAME at a noticeable size; repeat for more.")
    ] = None,
    duration: Annotated[float, typer.Option(help="In seconds.")] = 20.0,
    sample_time: Annotated[float | None, typer.Option(help="In seconds; default: the plant's, else 0.002.")] = None,
    encoder_counts: Annotated[
        str | None,
        typer.Option(help="Counts per revolution, one or two; 0 reads exactly. Default: the plant's, or 4096."),
    ] = None,
    noise: Annotated[
        str | None,
        typer.Option(help="Standard deviation of the readings in rad, one or two. Default: the plant's, or 0."),
    ] = None,
    torque_noise: Annotated[
        str, typer.Option(help="Intensity of white torque in unit²·s: arm, or arm,pendulum.")
    ] = "0",
    start: Annotated[
        Start | None, typer.Option(help="Default: upright with a balancing controller, else hanging.")
    ] = None,
    trust: opt.Trust = False,
    seed: opt.Seed = 0,
    as_json: opt.AsJson = False,
) -> None:
    """Simulate a rig and write what its computer would have recorded."""
    opt.log_file(output, [Path(plant), Path(excitation)])
    if not 0 < duration <= 3600:
        raise ValueError(f"--duration {duration}: expected seconds, above 0 and at most 3600")
    opt.within("--sample-time", sample_time, 0.0, 1.0, "seconds, above 0 and at most 1")
    opt.within("--amplitude", amplitude, -1e9, 1e9, "a finite number")
    if amplitude is not None and excitation == "none":
        raise ValueError("--amplitude scales the excitation: use it with --excitation, such as --excitation paper")
    for option, said in (("--design-plant", design_plant is not None), ("--trust", trust)):
        if said and controller == "none":
            raise ValueError(f"{option} is about a controller: use it with --controller, such as --controller lqr")
    scale = 1.0 if amplitude is None else amplitude
    import numpy as np

    from controllers.design import design_plant_for
    from furuta_gym.plant import Plant
    from furuta_gym.simulation import FALLEN, open_loop, simulate

    rig = opt.with_effects(Plant.resolve(plant), effect)
    sensors = _sensors(rig, encoder_counts, noise)
    known = design_plant_for(rig, design_plant).replace(sample_time=rig.sample_time)  # it is played on the rig's clock
    policy = _controller(controller, known, sample_time, sensors, printed_sign, trust)
    torques = opt.numbers("--torque-noise", torque_noise)
    if min(torques) < 0:
        raise ValueError(f"--torque-noise {torque_noise}: expected intensities that are not negative")
    balances = policy is not None and "swing_up" not in policy.tasks
    at = start or (Start.upright if balances else Start.hanging)
    off = np.random.default_rng([seed, 1]).uniform(-0.01, 0.01)
    run = simulate(
        rig,
        policy or open_loop(0.0),
        duration,
        policy.sample_time if policy else sample_time,
        sensors,
        _signal(excitation, scale, duration, seed),
        x0=(0.0, off if at is Start.upright else np.pi, 0.0, 0.0),
        torque_noise=(torques[0], torques[1] if len(torques) == 2 else 0.0),
        seed=seed,
        q2_limit=FALLEN if balances and at is Start.upright else np.inf,
    )
    from identification.logs.log import Log, write_log

    if len(run) < 2:
        raise ValueError(
            "the run has one sample, which is no log: --duration is too short"
            if run.fell is None
            else "the pendulum falls within the first sample: --sample-time is too long for this controller"
        )
    counts = sensors.encoder_counts
    log = Log.from_run(
        _rounded(run),
        rig.unit,
        counts if min(counts) > 0 else None,  # type: ignore[arg-type,type-var]
        device=f"simulated {plant}",
        controller_gain=getattr(policy, "feedback_gain", None),
        metadata={"controller": controller, "excitation": f"{excitation} {scale:g}", "seed": str(seed)}
        | ({"effects": "; ".join(map(str, rig.effects))} if rig.effects else {}),
    )
    output.parent.mkdir(parents=True, exist_ok=True)
    write_log(output, log)
    _report(output, log, run, at, as_json, _passed(rig, run))


@dataclass(frozen=True)
class _Stamped:
    """A run with stamps as people write them: 0.002 where a sum of steps gave 0.0020000000000000018."""

    t: Any
    measured: Any
    command: Any


def _rounded(run: Any) -> _Stamped:
    return _Stamped(run.t.round(12), run.measured, run.command)


def _passed(rig: Plant, run: Any) -> dict[str, float]:
    """Limits of the rig that the arm passes, with the first time [s]."""
    found = {}
    for name, column in (("arm_travel", 0), ("arm_speed", 2)):
        beyond = abs(run.state[:, column]) > rig.limit(name, math.inf)
        if beyond.any():
            found[name] = float(run.t[beyond.argmax()])
    return found


def _report(output: Path, log: Any, run: Any, at: Start, as_json: bool, passed: dict[str, float]) -> None:
    from furuta_gym.simulation import FALLEN

    for name, when in passed.items():
        typer.echo(
            f"Warning: the arm passes limits.{name} of the plant at t = {when:.3f} s. The run goes on here; on the rig "
            "an exported controller is switched off there.",
            err=True,
        )
    largest = [float(abs(run.state[:, i]).max()) for i in (0, 1)]
    fell = None if run.fell is None else float(run.fell)
    if as_json:
        print_json(
            {"log": str(output), "samples": len(log), "duration_s": log.duration, "fell_at_s": fell}
            | {"max_abs_q1": largest[0], "max_abs_q2": largest[1], "limits_passed_at_s": passed}
        )
        return
    typer.echo(f"{output}: {len(log)} samples over {log.duration:.4g} s at {1e3 * log.sample_time:.4g} ms")
    typer.echo(f"  max |q1| = {largest[0]:.3f} rad, max |q2| = {largest[1]:.3f} rad, start {at}")
    if fell is not None:
        typer.echo(f"  The pendulum FELL: |q2| passed {FALLEN:g} rad at t = {fell:.3f} s; the log ends there.")


def _sensors(plant: Any, counts: str | None, noise: str | None) -> Any:
    from dataclasses import replace

    from controllers.design import choose_sensors

    sensors = choose_sensors(plant, None)
    if counts is not None:
        values = opt.numbers("--encoder-counts", counts)
        sensors = replace(sensors, encoder_counts=(values[0], values[-1]))
    if noise is not None:
        values = opt.numbers("--noise", noise)
        sensors = replace(sensors, noise_std=(values[0], values[-1]))
    return sensors


def _controller(
    name: str, plant: Any, sample_time: float | None, sensors: Any, printed: bool, trust: bool
) -> Controller | None:
    if printed and name != "paper-lqr":
        raise ValueError("--printed-sign is about the paper's controller: use it with --controller paper-lqr")
    if name == "none":
        return None
    from controllers import make_controller

    options = {"printed_sign": True} if printed else {}
    return make_controller(name, plant, sample_time, sensors, trust=trust, **options)


def _signal(name: str, amplitude: float, duration: float, seed: int) -> Any:
    if name == "none":
        return None
    from identification.design.signals import EXCITATIONS, excitation

    if name not in EXCITATIONS and Path(name).suffix:
        from identification.design.recorded import read_signal

        return read_signal(name, amplitude)
    return excitation(name, amplitude, duration, seed)
