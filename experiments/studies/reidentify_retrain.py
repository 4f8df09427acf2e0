"""Does it pay to re-identify, redesign and retrain? `python -m experiments.studies.reidentify_retrain`.

Three rigs of the bench hide an effect. Each is recorded; model (5) is identified; controllers are designed and a
policy is trained on it; all balance the rig itself, or swing it up. Then the diagnosis names what is missing,
controllers and policy are made anew for the plant with the effect, and play the same rig from the same starts.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from controllers import DesignError, make_controller
from controllers.comparison.statistics import Interval
from experiments.bench import Rig
from experiments.bench_runs import Contrast, Run, contrast, summary
from experiments.cli.errors import explained
from experiments.studies.hidden_rigs import LEARNED, TASKS, Task, as_the_lab_knows, recorded, task_named
from furuta_gym.files import write_whole
from identification.diagnosis.diagnose import diagnose

SCHEMA = "furuta-reidentify-retrain/2"
FIGURE_WORDS = {
    "rms_q1": "rms q1 [rad]",
    "rms_q2": "rms q2 [rad]",
    "energy": "∫u² dt",
    "settling": "up after [s]",
}


@dataclass(frozen=True)
class Arguments:
    """task and rigs of `hidden_rigs`; runs on the bench of `duration` seconds for each controller; policies (training
    seeds) of `steps` env steps for each plant; recording [s] of each log, made by `experiments`; most: effects that are
    looked for."""

    task: str
    rigs: tuple[str, ...]
    runs: int
    duration: float
    steps: int
    policies: int = 2
    recording: float = 10.0
    experiments: tuple[str, ...] = ("paper",)
    seed: int = 0
    most: int = 6

    @classmethod
    def usual(cls, task: str = "balance", seed: int = 0) -> Arguments:
        """All rigs of a task. Raises ValueError for another task."""
        usual = task_named(task)
        return cls(task, tuple(usual.rigs), usual.runs, usual.duration, usual.steps, seed=seed)

    @classmethod
    def quick(cls, task: str = "balance", seed: int = 0) -> Arguments:
        """Small enough for a test: one rig, one policy that has hardly learned."""
        return cls(task, ("late",), 3, 2.0 if task == "balance" else 6.0, 30_000, 1, 6.0, seed=seed, most=1)


@dataclass
class Story:
    """What happened to one rig. runs[controller][stage]: its runs on the bench, stage "before" or "after"."""

    task: Task
    rig: str
    hidden: str
    verdict: str
    found: list[str]
    runs: dict[str, dict[str, list[Run]]] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    @property
    def contrasts(self) -> dict[str, Contrast]:
        """Of the designs: policies differ from training to training by more than runs of one tell."""
        pairs = {n: r for n, r in self.runs.items() if len(r) == 2 and n != LEARNED}
        return {n: contrast(r["before"], r["after"], self.task.figures) for n, r in pairs.items()}

    def summary(self, runs: list[Run]) -> dict[str, Interval]:
        """Success and the figures of the task."""
        return summary(runs, self.task.figures)


def tell_story(name: str, arguments: Arguments, folder: Path, say: Callable[[str], None]) -> Story:
    """Record, diagnose, make controllers for both plants, run them; policies are kept in `folder`."""
    task = TASKS[arguments.task]
    rig = task.rigs[name]
    say(f"{name}: recording and diagnosing")
    found = diagnose(recorded(rig, arguments.experiments, arguments.recording, arguments.seed), most=arguments.most)
    (hidden,) = rig.truth()["effects"]
    values = ", ".join(f"{k} = {v['value']:.3g} {v['unit']}" for k, v in hidden["parameters"].items())
    story = Story(task, name, f"{hidden['name']} ({values})", found.verdict, [])
    if found.before is None or found.plant is None:
        raise ValueError(f"{name}: the diagnosis ended with {found.verdict!r} and no plant; record longer logs")
    stages = {"before": as_the_lab_knows(found.before.plant, rig), "after": as_the_lab_knows(found.plant, rig)}
    story.found = [str(effect) for effect in stages["after"].effects]
    for stage, plant in stages.items():
        plant.save(folder / f"{stage}.json")
        for design in task.designs:
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
            policy = task.learned(plant, folder / f"{stage}-{i}.zip", arguments.seed + i, arguments.steps)
            learned += _runs(rig, policy, arguments, 1 + i)  # seeds of its own, so that no trial counts twice
    return story


def _runs(rig: Rig, controller: Any, arguments: Arguments, group: int = 0) -> list[Run]:
    first = 1000 * (arguments.seed + 1 + group)  # not the seeds of the logs
    play = TASKS[arguments.task].play
    return [play(rig, controller, first + i, arguments.duration) for i in range(arguments.runs)]


def table(story: Story) -> Table:
    """Controller by controller, before → after, 95 % intervals in brackets."""
    added = "; ".join(story.found) or "nothing added"
    shown = Table(title=f"{story.rig}: hides {story.hidden}\nverdict {story.verdict}: {added}", show_lines=True)
    figures = [FIGURE_WORDS[name] for name in story.task.figures]
    for head in ("controller", "success [%]", *figures, "after against before"):
        shown.add_column(head)
    for name, stages in story.runs.items():
        cells = [story.summary(runs) for runs in stages.values()]
        success = "\n".join(
            f"{100 * c.value:.0f} [{100 * c.low:.0f}, {100 * c.high:.0f}]" for c in (cell["success"] for cell in cells)
        )
        columns = ["\n".join(str(c[figure]) for c in cells) for figure in story.task.figures]
        shown.add_row(name, success, *columns, story.contrasts[name].verdict if name in story.contrasts else "–")
    return shown


def to_dict(arguments: Arguments, stories: list[Story]) -> dict[str, Any]:
    """For machines: every run."""

    def figures(story: Story, runs: Mapping[str, list[Run]]) -> dict[str, Any]:
        return {
            stage: {name: interval.to_dict() for name, interval in story.summary(rows).items()}
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
                "controllers": {name: figures(story, runs) for name, runs in story.runs.items()},
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
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for plants, policies and results.json; default: out/reidentify_retrain/TASK."),
    ] = None,
    task: Annotated[str, typer.Option(help=f"{' or '.join(TASKS)}.")] = "balance",
    seed: Annotated[int, typer.Option(help="Of logs, runs and policies.", min=0)] = 0,
    quick: Annotated[bool, typer.Option("--quick", help="One rig, small; for a look at what it does.")] = False,
) -> None:
    """Controllers and policies before and after the missing effect was found, on the rigs that hide it."""
    began = time.perf_counter()
    progress = Console(stderr=True)
    with explained():
        task_named(task)
        out = out or Path("out/reidentify_retrain") / task
        stories = run((Arguments.quick if quick else Arguments.usual)(task, seed), out, progress.print)
    console = Console()
    console = console if console.is_terminal else Console(width=140)
    for story in stories:
        console.print(table(story))
        for what, why in story.left_out.items():
            console.print(f"• left out: {what}: {why}", highlight=False)
    console.print(f"{time.perf_counter() - began:.0f} s. Look at: {out / 'results.json'}", highlight=False)


if __name__ == "__main__":
    typer.run(main)
