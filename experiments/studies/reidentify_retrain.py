"""Does it pay to re-identify, redesign and retrain? `python -m experiments.studies.reidentify_retrain`.

Three rigs of the bench hide an effect. Each is recorded; model (5) is identified; controllers are designed and a
policy is trained on it; all balance the rig itself. Then the diagnosis names what is missing, controllers and policy
are made anew for the plant with the effect, and balance the same rig from the same starts.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from controllers import DesignError, make_controller
from controllers.training import Training, train
from experiments.bench import HiddenEffect, Rig, record
from experiments.bench_runs import FIGURES, Contrast, Run, contrast, run_on_bench, summary
from experiments.cli.errors import explained
from furuta_gym.files import write_whole
from furuta_gym.plant import Plant
from identification.diagnosis.diagnose import diagnose
from identification.logs.log import Log, read_log

SCHEMA = "furuta-reidentify-retrain/1"
DESIGNS = ("lqr", "lqg", "lqg-friction")
LEARNED = "ppo"

# Chosen before any of them was run: one effect each in the command, at the joint and on the arm, several times the size
# that is plain to see, each by the bench's own law where it has one. Rigs of two units and three kinds.
RIGS = {
    "late": Rig("servo", [HiddenEffect("input_delay", 3.0)], individual=11, scatter=0.08, name="late"),
    "dead zone": Rig("workshop", [HiddenEffect("input_dead_zone", 3.0)], individual=12, scatter=0.08, name="dead zone"),
    "cable": Rig("table3", [HiddenEffect("arm_spring", 2.0)], individual=13, scatter=0.08, name="cable"),
}


@dataclass(frozen=True)
class Arguments:
    """rigs of `RIGS`; runs on the bench of `duration` seconds for each controller; policies (training seeds) of `steps`
    env steps for each plant; recording [s] of each log, made by `experiments`; most: effects that are looked for."""

    rigs: tuple[str, ...] = tuple(RIGS)
    runs: int = 10
    duration: float = 6.0
    policies: int = 2
    steps: int = 300_000
    recording: float = 10.0
    experiments: tuple[str, ...] = ("paper",)
    seed: int = 0
    most: int = 6

    @classmethod
    def quick(cls, seed: int = 0) -> Arguments:
        """Small enough for a test: one rig, one policy that has hardly learned."""
        return cls(("late",), 3, 2.0, 1, 30_000, 6.0, ("paper",), seed, most=1)


@dataclass
class Story:
    """What happened to one rig. runs[controller][stage]: its runs on the bench, stage "before" or "after"."""

    rig: str
    hidden: str
    verdict: str
    found: list[str]
    runs: dict[str, dict[str, list[Run]]] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    @property
    def contrasts(self) -> dict[str, Contrast]:
        """Of the designs: policies differ from training to training by more than runs of one tell."""
        return {n: contrast(r["before"], r["after"]) for n, r in self.runs.items() if len(r) == 2 and n != LEARNED}


def tell_story(name: str, arguments: Arguments, folder: Path, say: Callable[[str], None]) -> Story:
    """Record, diagnose, make controllers for both plants, run them; policies are kept in `folder`."""
    rig = RIGS[name]
    say(f"{name}: recording and diagnosing")
    found = diagnose(recorded(rig, arguments), most=arguments.most)
    (hidden,) = rig.truth()["effects"]
    values = ", ".join(f"{k} = {v['value']:.3g} {v['unit']}" for k, v in hidden["parameters"].items())
    story = Story(name, f"{hidden['name']} ({values})", found.verdict, [])
    if found.before is None or found.plant is None:
        raise ValueError(f"{name}: the diagnosis ended with {found.verdict!r} and no plant; record longer logs")
    about = {"u_max": rig.kind.u_max, "sample_time": rig.period}  # what a lab knows and a log does not tell
    stages = {"before": found.before.plant.replace(**about), "after": found.plant.replace(**about)}
    story.found = [str(effect) for effect in stages["after"].effects]
    for stage, plant in stages.items():
        plant.save(folder / f"{stage}.json")
        for design in DESIGNS:
            say(f"{name}, {stage}: {design}")
            try:
                controller = make_controller(design, plant, rig.period)
            except DesignError as error:
                story.left_out[f"{design}, {stage}"] = str(error)
                continue
            story.runs.setdefault(design, {})[stage] = _runs(rig, controller, arguments)
        learned = story.runs.setdefault(LEARNED, {}).setdefault(stage, [])
        for i in range(arguments.policies):
            say(f"{name}, {stage}: training policy {i + 1} of {arguments.policies}")
            policy = _policy(plant, arguments, folder / f"{stage}-{i}.zip", arguments.seed + i)
            learned += _runs(rig, policy, arguments, 1 + i)  # seeds of its own, so that no trial counts twice
    return story


def recorded(rig: Rig, arguments: Arguments) -> list[Log]:
    """The logs as files tell them, and nothing else."""
    logs = []
    with tempfile.TemporaryDirectory() as folder:
        for i, experiment in enumerate(arguments.experiments):
            run = record(rig, experiment, seed=arguments.seed + i, duration=arguments.recording)
            logs.append(read_log(run.write(Path(folder) / f"{experiment}.csv")))
    return logs


def _policy(plant: Plant, arguments: Arguments, path: Path, seed: int) -> Any:
    """A balancer learned on `plant`. Three observations and the last command show it a delay, if there is one."""
    training = Training(plant, "balance", LEARNED, arguments.steps, seed, history=3, observe_command=True)
    train(training, path)
    return make_controller(path, plant, plant.sample_time)


def _runs(rig: Rig, controller: Any, arguments: Arguments, group: int = 0) -> list[Run]:
    first = 1000 * (arguments.seed + 1 + group)  # not the seeds of the logs
    return [run_on_bench(rig, controller, first + i, arguments.duration) for i in range(arguments.runs)]


def table(story: Story) -> Table:
    """Controller by controller, before → after, 95 % intervals in brackets."""
    added = "; ".join(story.found) or "nothing added"
    shown = Table(title=f"{story.rig}: hides {story.hidden}\nverdict {story.verdict}: {added}", show_lines=True)
    for head in ("controller", "success [%]", "rms q1 [rad]", "rms q2 [rad]", "∫u² dt", "after against before"):
        shown.add_column(head)
    for name, stages in story.runs.items():
        cells = [summary(runs) for runs in stages.values()]
        success = "\n".join(f"{100 * c['success'].value:.0f}" for c in cells)
        figures = ["\n".join(str(c[figure]) for c in cells) for figure in FIGURES]
        shown.add_row(name, success, *figures, story.contrasts[name].verdict if name in story.contrasts else "–")
    return shown


def to_dict(arguments: Arguments, stories: list[Story]) -> dict[str, Any]:
    """For machines: every run."""

    def figures(runs: Mapping[str, list[Run]]) -> dict[str, Any]:
        return {
            stage: {name: interval.to_dict() for name, interval in summary(rows).items()}
            | {"success_by_run": [run.success for run in rows]}
            for stage, rows in runs.items()
        }

    return {
        "schema": SCHEMA,
        "arguments": asdict(arguments),
        "rigs": {
            story.rig: {
                "hidden": story.hidden,
                "verdict": story.verdict,
                "found": story.found,
                "left_out": story.left_out,
                "controllers": {name: figures(runs) for name, runs in story.runs.items()},
                "after_over_before": {
                    name: {figure: ratio.to_dict() for figure, ratio in c.ratios.items()} | {"verdict": c.verdict}
                    for name, c in story.contrasts.items()
                },
            }
            for story in stories
        },
    }


def run(arguments: Arguments, out: Path, say: Callable[[str], None] = print) -> list[Story]:
    """All rigs; plants and policies of each go to a folder of its own in `out`, the numbers to results.json."""
    stories = []
    folders = {name: out / name.replace(" ", "-") for name in arguments.rigs}
    if there := [str(folder) for folder in folders.values() if folder.exists()]:
        raise ValueError(f"{', '.join(there)} exists; remove it or choose another --out")
    for name, folder in folders.items():
        folder.mkdir(parents=True)
        stories.append(tell_story(name, arguments, folder, say))
        text = json.dumps(to_dict(arguments, stories), ensure_ascii=False, indent=2)  # a later rig may take long
        write_whole(out / "results.json", text + "\n")
    return stories


def main(
    out: Annotated[Path, typer.Option(help="Folder for plants, policies and results.json.")] = Path(
        "out/reidentify_retrain"
    ),
    seed: Annotated[int, typer.Option(help="Of logs, runs and policies.", min=0)] = 0,
    quick: Annotated[bool, typer.Option("--quick", help="One rig, small; for a look at what it does.")] = False,
) -> None:
    """Controllers and policies before and after the missing effect was found, on the rigs that hide it."""
    began = time.perf_counter()
    progress = Console(stderr=True)
    with explained():
        stories = run(Arguments.quick(seed) if quick else Arguments(seed=seed), out, progress.print)
    console = Console()
    console = console if console.is_terminal else Console(width=140)
    for story in stories:
        console.print(table(story))
        for what, why in story.left_out.items():
            console.print(f"• left out: {what}: {why}", highlight=False)
    console.print(f"{time.perf_counter() - began:.0f} s. Look at: {out / 'results.json'}", highlight=False)


if __name__ == "__main__":
    typer.run(main)
