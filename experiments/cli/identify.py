"""`furuta identify`: logs in, plant file out."""

from __future__ import annotations

import math
import shlex
import warnings
from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from identification.estimation.methods import DEFAULT, METHODS

from . import options as opt
from .letters import without_controls
from .output import busy, print_json
from .reading import Reading, reads_logs
from .reading import read as read_logs

if TYPE_CHECKING:
    from furuta_gym.plant import Plant
    from furuta_gym.plant.effects.declaration import EffectType
    from identification.estimation.estimate import Estimate
    from identification.logs.log import Log
    from identification.validation.gap import Gap
    from identification.validation.one_rig import OneByOne

PREDICTED = 60_000
"""Samples of long logs that the error is measured on."""


@reads_logs
def identify_command(
    logs: opt.Logs,
    reading: Reading,
    output: Annotated[Path, typer.Option("-o", "--output", help="Plant file to write (.json).")],
    method: Annotated[
        str, typer.Option(help="; ".join(f"{name}: {m.summary}" for name, m in METHODS.items()) + ".")
    ] = DEFAULT,
    fix: Annotated[
        list[str] | None, typer.Option(help="Known parameters: theta4=0.012 (alone: the start plant's value).")
    ] = None,
    prior: Annotated[list[str] | None, typer.Option(help="Roughly known: theta2=0.012±0.001 (or +-).")] = None,
    effects: Annotated[
        str,
        typer.Option(help="Fit these effects too: arm_spring,input_delay (names: furuta effects)."),
    ] = "",
    physical: Annotated[
        bool, typer.Option("--physical", help="Keep to what a rigid arm and pendulum can have.")
    ] = False,
    start: Annotated[
        str | None, typer.Option(help="Plant to start from: table3, qube, large or a file; default: from the logs.")
    ] = None,
    profile: Annotated[
        list[str] | None, typer.Option(help="Profile likelihood of a parameter, theta2; repeat it, or use commas.")
    ] = None,
    u_max: Annotated[
        float | None,
        typer.Option(
            help="Largest command of the rig; default: the largest in the logs, plus margin unless they stop there."
        ),
    ] = None,
    every_sample: Annotated[
        bool,
        typer.Option(
            "--all", help="Fit every sample of long logs (above 300 000 together), not the most informative stretches."
        ),
    ] = False,
    plot: Annotated[
        Path | None, typer.Option(help="Picture (.png) of the fitted logs, measured and predicted 0.3 s ahead.")
    ] = None,
    report: opt.Report = None,
    as_json: opt.AsJson = False,
) -> None:
    """Estimate θ1 … θ9 and r, with uncertainty, from logs of one rig (several are fitted jointly)."""
    opt.output_file(output, [".json"], logs)
    opt.report_file(report, logs)
    if plot is not None:
        opt.output_file(plot, [".png"], logs)
    fixed, priors = opt.fixed_values(fix), opt.prior_values(prior)
    profiled = [n.strip() for text in profile or () for n in text.split(",") if n.strip()]
    if method not in METHODS:
        raise ValueError(f"--method {method!r}: expected one of {', '.join(METHODS)}")
    if u_max is not None and not 0 < u_max < math.inf:
        raise ValueError(f"--u-max {u_max:g}: expected the largest command that the amplifier gives, above 0")
    named = opt.names(effects)
    if method != DEFAULT and (fixed or priors or named or physical or profiled):
        only = "--fix, --prior, --effects, --physical and --profile"
        raise ValueError(f"{only} work with --method {DEFAULT}, not with {method}")
    opt.library_effects("--effects", named)
    from furuta_gym.plant import Plant

    for name in ("theta1", "theta4"):
        if (value := fixed.get(name)) is not None and value <= 0:
            raise ValueError(f"--fix {name}={value:g}: it is an inertia; expected a number above 0")
    known = None if start is None else Plant.resolve(start)  # a wrong name is told before the logs are read
    _check_known([*fixed, *priors], named, known)
    _check_profiles(profiled, fixed, priors, named, known)
    read = read_logs(logs, reading, known)
    from identification.estimation.identify import identify

    if not as_json:
        for log in read:
            typer.echo(without_controls(str(log)))
    with busy("fitting …", "identify", _fitted(sum(map(len, read)), method, every_sample)):
        known_of_it: dict[str, Any] = {"fixed": fixed, "priors": priors, "effects": named, "physical": physical}
        known_of_it["start"] = start
        estimate = identify(read, method=method, u_max=u_max, every_sample=every_sample, **known_of_it)
    gap, remark = _adequacy(estimate, read)
    apart = _one_by_one(estimate, gap, read, known_of_it)
    profiles = []
    for name in profiled:
        with busy(f"profiling {name} …"):
            profiles.append(estimate.profile(name))
    fitted, again = shlex.join(map(str, logs)), reading.again(logs, read)
    page = ""
    if report is not None:
        from experiments.report import render
        from experiments.report.estimate_page import estimate_page

        page = render(estimate_page(estimate, read, gap, remark, str(output), f"{fitted}{again}", again))
    picture = _drawn(gap, read) if plot is not None and gap is not None else b""
    from experiments.replaced import limits_lost
    from furuta_gym.files import write_whole

    if lost := limits_lost(output, estimate.plant):
        warnings.warn(f"{lost}, or start from a plant file that has them (--start)", stacklevel=1)

    try:
        estimate.save(output)  # after all else is made: Ctrl-C meanwhile leaves nothing new
    except OSError:  # as of a full disk: the numbers are there, and a fit may have taken minutes
        typer.echo(str(estimate), err=as_json)
        raise
    if report is not None:
        write_whole(report, page)
    if plot is not None and picture:
        write_whole(plot, picture)
    if as_json:
        found = {"profiles": {p.name: p.to_dict() for p in profiles}} if profiles else {}
        measured = gap.to_dict() if gap is not None else {"gap": None, "gap_remark": remark}
        measured["one_by_one"] = None if apart is None else apart.to_dict()
        print_json(estimate.to_dict() | measured | found | {"plant": str(output)})
        return
    typer.echo(gap.told("on the fitted logs") if gap is not None else f"Not predicted: {remark}")
    if apart is not None:
        typer.echo(f"  {apart}.")
    typer.echo(str(estimate))
    for p in profiles:
        std = float(estimate.std[estimate.names.index(p.name)])
        beside = f"; ± 1.96 standard deviations: {_interval(estimate.value(p.name), std)}" if math.isfinite(std) else ""
        typer.echo(f"{p}{beside}")
    typer.echo(
        "Written: " + ", ".join(str(p) for p in (output, report, plot if gap is not None else None) if p is not None)
    )
    if apart is not None:
        first = f"furuta identify {shlex.quote(str(logs[0]))}{again} -o {shlex.quote(str(output))}"
        typer.echo(f"Next: {first}   (then the other logs, each to a plant file of its own)")
        return
    typer.echo(f"Next: {_next(gap, fitted, output, again)}")


def _fitted(samples: int, method: str, every_sample: bool) -> int:
    """How many of the logs' samples the fit takes, which its time goes with."""
    from identification.estimation.informative import BUDGET

    return min(samples, BUDGET) if method == DEFAULT and not every_sample else samples


def _next(gap: Gap | None, fitted: str, output: Path, again: str) -> str:
    from identification.validation.adequacy import Adequacy

    if gap is not None and gap.says_little:
        return "record a log in which both angles move all along, and identify that"
    if gap is None or gap.judgement.adequacy is Adequacy.ADEQUATE:
        return f"furuta validate {shlex.quote(str(output))} LOG{again}   (a log that was not fitted)"
    what = f"furuta diagnose {fitted}{again} --held-out LOG -o diagnosis"
    return f"{what}   (LOG: not fitted; works without --held-out too)"


def _adequacy(estimate: Estimate, logs: Sequence[Log]) -> tuple[Gap | None, str]:
    """The error on the fitted logs, of long ones on their most informative part; or None and why."""
    from identification.estimation.informative import informative
    from identification.validation.gap import validate

    part = informative(logs, PREDICTED)
    with busy("predicting …", "validate", min(sum(map(len, logs)), PREDICTED)):
        try:
            return validate(estimate.plant, logs if part is None else part.logs), ""
        except ValueError as error:
            return None, str(error)


def _one_by_one(estimate: Estimate, gap: Gap | None, logs: Sequence[Log], known: Mapping[str, Any]) -> OneByOne | None:
    """Fits of the single logs, where one plant does not explain several together."""
    from identification.validation.adequacy import Adequacy
    from identification.validation.one_rig import one_by_one

    if gap is None or len(logs) < 2 or gap.by_size.adequacy is not Adequacy.INADEQUATE:
        return None
    with busy("fitting every log alone, as one plant does not explain them …"):
        return one_by_one(estimate, gap, logs, **known)


def _drawn(gap: Gap, logs: Sequence[Log]) -> bytes:
    """The picture of --plot, as its file has it."""
    from identification.validation.plots import plot_predictions

    drawn = BytesIO()
    plot_predictions(gap, logs).savefig(drawn, format="png", dpi=120)
    return drawn.getvalue()


_OF_EFFECTS = ", and NAME.PARAMETER of the effects in --effects"


def _check_known(names: Iterable[str], effects: Sequence[str], start: Plant | None) -> None:
    """Before the fit: a name in --fix or --prior that no parameter has. Raises ValueError."""
    from furuta_gym.plant import THETA_NAMES

    own = [f"{kind.name}.{p.name}" for kind in _kinds(effects, start) for p in kind.parameters]
    known = [*THETA_NAMES, "r", "r1", "r2", *own]
    if strange := [name for name in names if name not in known]:
        expected = f"expected one of {', '.join(known)}{'' if own else _OF_EFFECTS}"
        raise ValueError(f"--fix or --prior {', '.join(strange)}: {expected}")


def _check_profiles(
    names: list[str], fixed: Iterable[str], priors: Iterable[str], effects: Sequence[str], start: Plant | None
) -> None:
    """Before the fit: a name that cannot be profiled. Raises ValueError."""
    from furuta_gym.plant import THETA_NAMES

    said = {*fixed, *priors}
    apart = "r" not in said and ({"r1", "r2"} & said or isinstance(start and start.friction_sharpness, tuple))
    kinds = [kind for kind in _kinds(effects, start) if not kind.learned]
    own = [f"{kind.name}.{p.name}" for kind in kinds for p in kind.parameters if not p.integer]
    free = [n for n in (*THETA_NAMES, *(("r1", "r2") if apart else ("r",)), *own) if n not in set(fixed)]
    if strange := [n for n in names if n not in free]:
        expected = f"expected a free parameter, one of {', '.join(free)}{'' if own else _OF_EFFECTS}"
        raise ValueError(f"--profile {', '.join(strange)}: {expected}")


def _kinds(effects: Sequence[str], start: Plant | None) -> list[EffectType]:
    """The effects of --effects and of the start plant, each once."""
    from furuta_gym.plant import EFFECTS

    kinds = [EFFECTS[name] for name in effects] + [effect.type for effect in (start.effects if start else ())]
    return list({kind.name: kind for kind in kinds}.values())


def _interval(value: float, std: float) -> str:
    from furuta_gym.plant.covariance import NORMAL_95

    return f"{value - NORMAL_95 * std:.4g} to {value + NORMAL_95 * std:.4g}"
