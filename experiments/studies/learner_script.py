"""Does a training script that knows nothing of this project learn? `python -m experiments.studies.learner_script FILE`.

FILE is a script in CleanRL's manner, such as its `ppo_continuous_action.py`: it takes `--env-id`, `--seed` and
`--total-timesteps`. It gets an id and nothing else. At each twentieth of the steps the environment (`watched_env`)
plays 50 starts with the script's mean action, as `sb3_defaults` does, if it keeps its network as CleanRL does
(`mean_action`). It also says how each episode ended, with the noise that the script explores with: an episode is good
if the pendulum is upright all through its last half. A run is a text file below `--work`; what is there is not run
again. Writes learner_script.json and learner_script_tables.md.
"""

from __future__ import annotations

import json
import os
import re
import resource
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from experiments.cli.errors import explained
from experiments.cli.output import check_folder, counted, errors, write_json
from experiments.studies.sb3_defaults import ENOUGH, LAST
from experiments.studies.watched_env import EVERY, OPTIONS, PREFIX
from furuta_gym.envs.registration import TASK_IDS
from furuta_gym.files import write_whole

SCHEMA = "furuta-learner-script/2"
BLOCKS = 20
_ROOT = Path(__file__).resolve().parents[2]
_EPISODE = re.compile(r"watched: step=(\d+), held=([01])")
_JUDGED = re.compile(r"^judged: step=(\d+), success=([\d.]+), cpu_s=([\d.]+)$", re.MULTILINE)
_SPENT = re.compile(r"^cpu_s=([\d.]+)$", re.MULTILINE)


@dataclass(frozen=True)
class Run:
    """One training.

    good: share of good episodes in each twentieth of the steps (None: none ended there). evaluations: (steps, success
    of the starts with the mean action) each; none where the script keeps its network in another way. cpu_s: without
    the evaluations [s]. env_options: those of the environment that differ from its id's.
    """

    script: str
    env_id: str
    seed: int
    steps: int
    good: list[float | None]
    cpu_s: float | None
    evaluations: list[tuple[int, float]] = field(default_factory=list)
    env_options: dict[str, Any] = field(default_factory=dict)

    @property
    def stays(self) -> bool:
        """Whether the last three twentieths are all good enough: of the mean action, else of the episodes."""
        last = [success for _, success in self.evaluations[-LAST:]] or self.good[-LAST:]
        return all(share is not None and share >= ENOUGH for share in last)

    @property
    def reached_at(self) -> int | None:
        """Steps of the first evaluation that is good enough."""
        return next((steps for steps, success in self.evaluations if success >= ENOUGH), None)


def measured(text: str, script: str, task: str, seed: int, steps: int, env_options: Mapping[str, Any]) -> Run:
    """What a run printed. Raises ValueError where no episode ended in it."""
    found = [(int(step), held == "1") for step, held in _EPISODE.findall(text)]
    if not found:
        raise ValueError(f"no episode ended in {script}; expected a script that trains in the environment of --env-id")
    last = max(step for step, _ in found)  # an environment's own: a script may have several
    blocks: list[list[bool]] = [[] for _ in range(BLOCKS)]
    for step, held in found:
        blocks[BLOCKS * (step - 1) // last].append(held)
    good = [float(np.mean(block)) if block else None for block in blocks]
    spent, judged = _SPENT.search(text), _JUDGED.findall(text)
    learning = float(spent[1]) - sum(float(cpu) for *_, cpu in judged) if spent else None
    evaluations = list({int(step): float(success) for step, success, _ in judged}.items())  # of one step the last
    return Run(script, TASK_IDS[task], seed, steps, good, learning, evaluations, dict(env_options))


def learn(script: Path, task: str, seed: int, steps: int, file: Path, env_options: Mapping[str, Any]) -> None:
    """Run the script, and keep what was printed with the CPU time that it took. Raises ValueError where it fails."""
    folder = file.parent
    folder.mkdir(parents=True, exist_ok=True)
    env_id = f"experiments.studies.watched_env:{PREFIX}{TASK_IDS[task]}"
    path = os.pathsep.join([str(_ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    words = ["--env-id", env_id, "--seed", str(seed), "--total-timesteps", str(steps)]
    told = {"OMP_NUM_THREADS": "1", "PYTHONPATH": path, EVERY: str(steps // BLOCKS)}
    told[OPTIONS] = json.dumps(dict(env_options))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, str(script.absolute()), *words],
        cwd=folder,
        env=os.environ | told,
        capture_output=True,
        encoding="utf-8",
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise ValueError(f"{script} ended with code {done.returncode}: {done.stderr[-500:]}")
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    write_whole(file, f"{done.stdout}cpu_s={spent:.1f}\n")


def table(runs: Sequence[Run]) -> str:
    """Markdown: a row for each run."""
    lines = [
        "| script | environment | seed | steps | CPU [s] | 95 % first at | mean action, last three [%] "
        "| episodes with noise, last three twentieths [%] | stays |",
        "|---" * 9 + "|",
    ]
    for r in runs:
        noisy, mean = _shown(r.good[-LAST:]), _shown([success for _, success in r.evaluations[-LAST:]])
        first = "never" if r.reached_at is None else f"{r.reached_at:,}"
        spent = "" if r.cpu_s is None else f"{r.cpu_s:.0f}"
        row = (r.script, ", ".join([r.env_id, *_words(r.env_options)]), r.seed, f"{r.steps:,}", spent)
        row += (first if r.evaluations else "not judged", mean, noisy, "yes" if r.stays else "**no**")
        lines.append("| " + " | ".join(map(str, row)) + " |")
    return "\n".join([*lines, "", f"{sum(r.stays for r in runs)} of {len(runs)} runs stay at 95 % or more.", ""])


def _env_options(words: Sequence[str]) -> dict[str, Any]:
    """Options by name, each value as JSON writes it, else a word. Raises ValueError where there is no NAME=VALUE."""
    found: dict[str, Any] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not (name and equals and text):
            raise ValueError(f"--env-option {word!r}: expected NAME=VALUE, such as time_limit=20")
        try:
            found[name] = json.loads(text)
        except ValueError:
            found[name] = text
    return found


def _words(env_options: Mapping[str, Any]) -> list[str]:
    return [f"{name}={value}" for name, value in env_options.items()]


def _shown(shares: Sequence[float | None]) -> str:
    return ", ".join("none" if share is None else f"{100 * share:.0f}" for share in shares) or "–"


def main(
    script: Annotated[Path, typer.Argument(help="A training script in CleanRL's manner.", exists=True, dir_okay=False)],
    task: Annotated[str, typer.Option(help="swing_up or balance.")] = "swing_up",
    seeds: Annotated[int, typer.Option(help="Trainings.", min=1)] = 5,
    steps: Annotated[int, typer.Option(help="Of each.", min=BLOCKS)] = 500_000,
    env_option: Annotated[
        list[str] | None,
        typer.Option(help="NAME=VALUE of the environment, as gymnasium.make takes it; may be repeated."),
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for JSON and table.")] = Path(
        "out/learner_script"
    ),
    work: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("out/learner_script"),
) -> None:
    """Train with a foreign script, count its episodes, and tabulate."""
    with explained():
        if task not in TASK_IDS:
            raise ValueError(f"--task {task!r}: expected one of {', '.join(TASK_IDS)}")
        check_folder(output)
        changed = _env_options(env_option or [])
        name = re.sub(r"[^\w.=-]+", "-", "-".join([script.stem, *_words(changed), task]))
        runs = []
        try:
            with counted("trainings") as tell:
                for seed in range(1, seeds + 1):
                    file = work.absolute() / f"{name}-{seed}-{steps}.txt"
                    if not file.exists():
                        learn(script, task, seed, steps, file, changed)
                    runs.append(measured(file.read_text(encoding="utf-8"), script.stem, task, seed, steps, changed))
                    tell(len(runs), seeds)
        except KeyboardInterrupt:
            errors.print("Stopped. Trainings that ended are kept; the same command goes on from there.")
            raise typer.Exit(130) from None
        data = [asdict(r) | {"stays": r.stays, "reached_at": r.reached_at} for r in runs]
        write_json(output / "learner_script.json", {"schema": SCHEMA, "runs": data})
        text = table(runs)
        write_whole(output / "learner_script_tables.md", text)
        typer.echo(text)


if __name__ == "__main__":
    typer.run(main)
