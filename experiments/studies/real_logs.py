"""Measured logs of two laboratories: fit, validate on other runs, say what is wrong, and find what is missing.

`python -m experiments.studies.real_logs FOLDER`, FOLDER with `qube_darmstadt/` and `qube_mcgill/` (docs/real_logs.md
says where they come from). Writes real_logs.json and real_logs.md, and prints the latter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from experiments.cli.errors import explained
from experiments.cli.output import busy, write_json
from experiments.report.examination import plain
from furuta_gym.files import write_whole
from furuta_gym.plant import THETA_NAMES, Plant
from identification.diagnosis.diagnose import diagnose
from identification.diagnosis.held_out import HeldOut
from identification.diagnosis.learned import Learned
from identification.diagnosis.learning import learned_from
from identification.diagnosis.outcome import Diagnosis
from identification.estimation.estimate import Estimate
from identification.estimation.identify import identify
from identification.logs.log import Log
from identification.logs.reading import read_logs
from identification.validation.gap import Gap, validate

SCHEMA = "furuta-real-logs/1"
_MAPPING = {"pendulum_zero": "hanging", "flip": "q2", "encoder_counts": 2048, "input_unit": "V"}
_FRICTION = THETA_NAMES[5:]


@dataclass(frozen=True)
class Rig:
    """A laboratory's logs: the files fitted, and groups of files held out. witnesses: groups that the diagnosis judges
    names on; the others it never sees. skip [s]: left out at each start."""

    name: str
    folder: str
    fitted: tuple[str, ...]
    held_out: dict[str, tuple[str, ...]]
    witnesses: tuple[str, ...]
    skip: float = 0.0


RIGS = (
    Rig(
        "Darmstadt, hanging chirps",
        "qube_darmstadt",
        ("chirp_p1V5_250Hz_00", "chirp_m1V5_250Hz_00"),
        {
            "the other chirps": tuple(f"chirp_{s}1V5_250Hz_0{k}" for s in "pm" for k in (1, 2)),
            "swing-ups, 250 Hz, 10 s": tuple(f"swingup_250Hz_10s_0{k}" for k in range(3)),
            "swing-ups, 250 Hz, 5 s": tuple(f"swingup_250Hz_5s_0{k}" for k in range(3)),
            "swing-ups, 500 Hz, 5 s": tuple(f"swingup_500Hz_5s_0{k}" for k in range(3)),
        },
        ("the other chirps",),
    ),
    Rig(
        "McGill, upright with PRBS",
        "qube_mcgill",
        ("balance_prbs_20230828T161301",),
        {
            "another run": ("balance_prbs_20230828T161334",),
            "a third run": ("balance_prbs_20230828T161408",),
            "a fourth run": ("balance_prbs_20230828T161441",),
        },
        ("another run", "a third run", "a fourth run"),
        skip=1.0,  # the hand-over to the controller
    ),
)


@dataclass(frozen=True)
class Finding:
    """What came out for a rig: the fit, the same fit with friction free to be negative, what the diagnosis says (None
    where it was not asked), and the gaps by name, of the model without effects, with those found, and with what was
    learned from the rest, judged by all held-out logs (None where nothing was)."""

    rig: Rig
    estimate: Estimate
    unbounded: Estimate
    diagnosis: Diagnosis | None
    gaps: dict[str, Gap | str]
    gaps_after: dict[str, Gap | str]
    learned: Learned | None = None
    gaps_learned: dict[str, Gap | str] = field(default_factory=dict)


def study(folder: Path, rig: Rig, look: bool = True) -> Finding:
    """Fit and validate one rig. look: find what is missing, too (some minutes).

    Raises OSError where a file is missing; a log that a plant loses is told in words.
    """
    logs = _read(folder, rig, rig.fitted)
    estimate = identify(logs)
    unbounded = identify(logs, negative_friction=True)
    witnesses = [log for n in rig.witnesses if n in rig.held_out for log in _read(folder, rig, rig.held_out[n])]
    diagnosis = diagnose(logs, witnesses) if look else None
    after = diagnosis.after.plant if diagnosis and diagnosis.after else estimate.plant
    if diagnosis and diagnosis.second and diagnosis.second.better:
        after = diagnosis.second.plant
    before_and_after = [_gaps(plant, folder, rig) for plant in (estimate.plant, after)]
    learned = None
    if diagnosis and diagnosis.after:
        everything = tuple(log for files in rig.held_out.values() for log in _read(folder, rig, files))
        held = HeldOut(tuple(logs), everything, diagnosis.policy)
        noise = diagnosis.naming.final.noise if diagnosis.naming else None
        learned = learned_from(after, diagnosis.after.zeros, held, noise)
    more = _gaps(learned.plant, folder, rig) if learned else {}
    return Finding(rig, estimate, unbounded, diagnosis, *before_and_after, learned=learned, gaps_learned=more)


def _gaps(plant: Plant, folder: Path, rig: Rig) -> dict[str, Gap | str]:
    gaps: dict[str, Gap | str] = {}
    for name, files in rig.held_out.items():
        try:
            gaps[name] = validate(plant, _read(folder, rig, files))
        except ValueError as error:
            gaps[name] = str(error)
    return gaps


def _read(folder: Path, rig: Rig, files: Sequence[str]) -> tuple[Log, ...]:
    return read_logs([folder / rig.folder / f"{f}.csv" for f in files], skip=rig.skip, **_MAPPING)


def report(found: Sequence[Finding]) -> str:
    """Markdown: a section a rig."""
    return "\n\n".join(_section(f) for f in found) + "\n"


def _section(found: Finding) -> str:
    estimate, rig = found.estimate, found.rig
    lines = [f"### {rig.name}", "", f"Fitted: {', '.join(rig.fitted)}.", "", "```", str(estimate), "```", ""]
    lines += ["Friction free to be negative:", ""]
    lines += ["| | θ6 | θ7 | θ8 | θ9 |", "|---|---|---|---|---|"]
    cells = [_signed(found.unbounded, name) for name in _FRICTION]
    lines += [f"| value ± 1 sd | {' | '.join(cells)} |", ""]
    lines += [
        "| held out | rms q1, q2 [mrad] | floor [mrad] | of readings alone | fit [%] | rms over floor | verdict |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, gap in found.gaps.items():
        if isinstance(gap, str):
            lines.append(f"| {name} | — | — | — | — | — | {gap} |")
            continue
        pairs = (1e3 * gap.rms, 1e3 * gap.floor, 1e3 * gap.reading_floor, gap.fit_percent)
        numbers = " | ".join(f"{a:.3g}, {b:.3g}" for a, b in pairs)
        lines.append(f"| {name} | {numbers} | {gap.ratio_to_floor:.2f} | {gap.verdict} |")
    return "\n".join([*lines, "", *_missing(found)])


def _missing(found: Finding) -> list[str]:
    """What the diagnosis found, and what it does to every group of held-out logs."""
    if found.diagnosis is None:
        return []
    after = found.diagnosis.after
    lines = ["Diagnosis:", "", "```", str(found.diagnosis), "```", ""]
    if after is None or not found.diagnosis.added:
        return lines
    lines += ["```", str(after), "```", ""]
    lines += [
        "| held out | rms q1, q2 [mrad]: model (5) | with effects | median error [mrad]: model (5) | with effects |",
        "|---|---|---|---|---|",
    ]
    for name, gap in found.gaps.items():
        new = found.gaps_after[name]
        if not isinstance(gap, str) and not isinstance(new, str):
            cells = [
                *(1e3 * g.rms for g in (gap, new)),
                *(1e3 * np.median(np.abs(g.errors), axis=0) for g in (gap, new)),
            ]
            lines.append(f"| {name} | " + " | ".join(f"{a:.3g}, {b:.3g}" for a, b in cells) + " |")
    if found.learned is not None:
        became = "added" if found.learned.added else "refused"
        lines += ["", f"Learned beside them ({found.learned.evidence:.0f} nats), {became}: {found.learned.reason}.", ""]
        lines += ["| held out | rms q1, q2 [mrad] | median error [mrad] |", "|---|---|---|"]
        for name, gap in found.gaps_learned.items():
            if not isinstance(gap, str):
                rms, median = 1e3 * gap.rms, 1e3 * np.median(np.abs(gap.errors), axis=0)
                lines.append(f"| {name} | {rms[0]:.3g}, {rms[1]:.3g} | {median[0]:.3g}, {median[1]:.3g} |")
    return lines


def _signed(estimate: Estimate, name: str) -> str:
    i = estimate.names.index(name)
    value, std = float(estimate.values[i]), float(estimate.std[i])
    return f"{value:+.2g} ± {std:.1g}" + (" (negative)" if value < -2 * std else "")


def to_json(found: Sequence[Finding]) -> dict[str, Any]:
    """Estimates and gaps by rig."""
    rigs = [
        {
            "name": f.rig.name,
            "fitted": list(f.rig.fitted),
            "estimate": f.estimate.to_dict(),
            "negative_friction": f.unbounded.to_dict(),
            "diagnosis": f.diagnosis and f.diagnosis.to_dict(),
            "held_out": {n: g if isinstance(g, str) else g.to_dict()["gap"] for n, g in f.gaps.items()},
            "learned": f.learned and f.learned.to_dict(),
            "held_out_after": {n: g if isinstance(g, str) else g.to_dict()["gap"] for n, g in f.gaps_after.items()},
        }
        for f in found
    ]
    return plain({"schema": SCHEMA, "rigs": rigs})  # a share of a gap that is no gap is no number


def main(
    folder: Annotated[Path, typer.Argument(help="Folder that holds qube_darmstadt/ and qube_mcgill/.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to.")] = Path("out/real_logs"),
) -> None:
    """Fit the measured logs, validate on runs that were not fitted, find what is missing, report."""
    with explained():
        missing = [str(folder / rig.folder) for rig in RIGS if not (folder / rig.folder).is_dir()]
        if missing:
            raise ValueError(f"no such folder: {', '.join(missing)}; expected the measured logs there")
        with busy("fitting …"):
            found = [study(folder, rig) for rig in RIGS]
        text = report(found)
        typer.echo(text)
        write_whole(output / "real_logs.md", text)
        write_json(output / "real_logs.json", to_json(found))


if __name__ == "__main__":
    typer.run(main)
