"""`furuta identify`: logs in, plant file out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from identification.estimation.methods import DEFAULT, METHODS, method_named

from . import options as opt
from .output import busy, print_json
from .reading import Reading, reads_logs
from .reading import read as read_logs

if TYPE_CHECKING:
    from identification.estimation.estimate import Estimate
    from identification.logs.log import Log


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
        float | None, typer.Option(help="Largest command of the rig; default: guessed from the logs.")
    ] = None,
    every_sample: Annotated[
        bool,
        typer.Option(
            "--all", help="Fit every sample of long logs (above 300 000 together), not the most informative stretches."
        ),
    ] = False,
    report: opt.Report = None,
    as_json: opt.AsJson = False,
) -> None:
    """Estimate θ1 … θ9 and r, with uncertainty, from logs of one rig (several are fitted jointly)."""
    opt.output_file(output, [".json"], logs)
    opt.report_file(report, logs)
    fixed, priors = opt.fixed_values(fix), opt.prior_values(prior)
    profiled = [n.strip() for text in profile or () for n in text.split(",") if n.strip()]
    method_named(method)
    if method != DEFAULT and (fixed or priors or physical or profiled):
        raise ValueError(f"--fix, --prior, --physical and --profile work with --method {DEFAULT}, not with {method}")
    _check_profiles(profiled, fixed)
    from furuta_gym.plant import Plant

    known = None if start is None else Plant.resolve(start)  # a wrong name is told before the logs are read
    read = read_logs(logs, reading, known)
    from identification.estimation.identify import identify

    if not as_json:
        for log in read:
            typer.echo(str(log))
    with busy("fitting …", "identify", sum(map(len, read))):
        estimate = identify(
            read,
            start,
            method,
            fixed=fixed,
            priors=priors,
            physical=physical,
            u_max=u_max,
            every_sample=every_sample,
        )
    page = _page(estimate, read, output) if report is not None else ""
    estimate.save(output)
    if report is not None:
        from furuta_gym.files import write_whole

        write_whole(report, page)
    profiles = []
    for name in profiled:
        with busy(f"profiling {name} …"):
            profiles.append(estimate.profile(name))
    if as_json:
        found = {"profiles": {p.name: p.to_dict() for p in profiles}} if profiles else {}
        print_json(estimate.to_dict() | found | {"plant": str(output)})
        return
    typer.echo(str(estimate))
    for p in profiles:
        std = float(estimate.std[estimate.names.index(p.name)])
        typer.echo(f"{p}; ± 1.96 standard deviations: {_interval(estimate.value(p.name), std)}")
    typer.echo(f"Written: {output}" + (f", {report}" if report is not None else ""))
    typer.echo(f"Next: furuta validate {output} LOG   (a log that was not fitted)")


def _page(estimate: Estimate, logs: Sequence[Log], output: Path) -> str:
    """The report, with the error on the fitted logs where it can be measured."""
    from experiments.report import render
    from experiments.report.estimate_page import estimate_page
    from identification.validation.gap import validate

    gap, remark = None, ""
    with busy("predicting …"):
        try:
            gap = validate(estimate.plant, logs)
        except ValueError as error:
            remark = str(error)
    return render(estimate_page(estimate, logs, gap, remark, output.name))


def _check_profiles(names: list[str], fixed: Iterable[str]) -> None:
    """Before the fit: a name that cannot be profiled. Raises ValueError."""
    from furuta_gym.plant import THETA_NAMES

    known = [n for n in (*THETA_NAMES, "r") if n not in set(fixed)]
    if strange := [n for n in names if n not in known]:
        raise ValueError(f"--profile {', '.join(strange)}: expected a free parameter, one of {', '.join(known)}")


def _interval(value: float, std: float) -> str:
    return f"{value - 1.96 * std:.4g} to {value + 1.96 * std:.4g}"
