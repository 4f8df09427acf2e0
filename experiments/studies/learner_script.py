"""Does a training script that knows nothing of this project learn? `python -m experiments.studies.learner_script FILE`.

FILE is a script in CleanRL's manner, such as its `ppo_continuous_action.py`: it takes `--env-id`, `--seed` and
`--total-timesteps`. It gets an id and nothing else. The environment itself says how each episode ended
(`watched_env`), with the noise that the script explores with: an episode is good if the pendulum is upright all through
its last half. A run is a text file below `--work`; what is there is not run again. Writes learner_script.json and
learner_script_tables.md.
"""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from experiments.cli.errors import explained
from experiments.cli.output import check_folder, counted, errors, write_json
from experiments.studies.sb3_defaults import ENOUGH, LAST
from experiments.studies.watched_env import PREFIX
from furuta_gym.envs.registration import TASK_IDS
from furuta_gym.files import write_whole

SCHEMA = "furuta-learner-script/1"
BLOCKS = 20
_ROOT = Path(__file__).resolve().parents[2]
_EPISODE = re.compile(r"watched: step=(\d+), held=([01])")
_SPENT = re.compile(r"^cpu_s=([\d.]+)$", re.MULTILINE)


@dataclass(frozen=True)
class Run:
    """One training. good: share of good episodes in each twentieth of the steps (None: none ended there)."""

    script: str
    env_id: str
    seed: int
    steps: int
    good: list[float | None]
    cpu_s: float | None

    @property
    def stays(self) -> bool:
        """Whether the last three twentieths are all good enough."""
        return all(share is not None and share >= ENOUGH for share in self.good[-LAST:])


def measured(text: str, script: str, task: str, seed: int, steps: int) -> Run:
    """What a run printed. Raises ValueError where no episode ended in it."""
    found = [(int(step), held == "1") for step, held in _EPISODE.findall(text)]
    if not found:
        raise ValueError(f"no episode ended in {script}; expected a script that trains in the environment of --env-id")
    last = max(step for step, _ in found)  # an environment's own: a script may have several
    blocks: list[list[bool]] = [[] for _ in range(BLOCKS)]
    for step, held in found:
        blocks[BLOCKS * (step - 1) // last].append(held)
    good = [float(np.mean(block)) if block else None for block in blocks]
    spent = _SPENT.search(text)
    return Run(script, TASK_IDS[task], seed, steps, good, float(spent[1]) if spent else None)


def learn(script: Path, task: str, seed: int, steps: int, file: Path) -> None:
    """Run the script, and keep what was printed with the CPU time that it took. Raises ValueError where it fails."""
    folder = file.parent
    folder.mkdir(parents=True, exist_ok=True)
    env_id = f"experiments.studies.watched_env:{PREFIX}{TASK_IDS[task]}"
    path = os.pathsep.join([str(_ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    words = ["--env-id", env_id, "--seed", str(seed), "--total-timesteps", str(steps)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, str(script.absolute()), *words],
        cwd=folder,
        env=os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise ValueError(f"{script} ended with code {done.returncode}: {done.stderr[-500:]}")
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    write_whole(file, f"{done.stdout}cpu_s={spent:.1f}\n")


def table(runs: Sequence[Run]) -> str:
    """Markdown: a row for each run."""
    lines = [
        "| script | environment | seed | steps | CPU [s] | good episodes in the last three twentieths [%] | stays |",
        "|---" * 7 + "|",
    ]
    for r in runs:
        last = ", ".join("none" if share is None else f"{100 * share:.0f}" for share in r.good[-LAST:])
        spent = "" if r.cpu_s is None else f"{r.cpu_s:.0f}"
        row = (r.script, r.env_id, r.seed, f"{r.steps:,}", spent, last, "yes" if r.stays else "**no**")
        lines.append("| " + " | ".join(map(str, row)) + " |")
    return "\n".join([*lines, "", f"{sum(r.stays for r in runs)} of {len(runs)} runs stay at 95 % or more.", ""])


def main(
    script: Annotated[Path, typer.Argument(help="A training script in CleanRL's manner.", exists=True, dir_okay=False)],
    task: Annotated[str, typer.Option(help="swing_up or balance.")] = "swing_up",
    seeds: Annotated[int, typer.Option(help="Trainings.", min=1)] = 5,
    steps: Annotated[int, typer.Option(help="Of each.", min=BLOCKS)] = 500_000,
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
        runs = []
        try:
            with counted("trainings") as tell:
                for seed in range(1, seeds + 1):
                    file = work.absolute() / f"{script.stem}-{task}-{seed}-{steps}.txt"
                    if not file.exists():
                        learn(script, task, seed, steps, file)
                    runs.append(measured(file.read_text(), script.stem, task, seed, steps))
                    tell(len(runs), seeds)
        except KeyboardInterrupt:
            errors.print("Stopped. Trainings that ended are kept; the same command goes on from there.")
            raise typer.Exit(130) from None
        data = [asdict(r) | {"stays": r.stays} for r in runs]
        write_json(output / "learner_script.json", {"schema": SCHEMA, "runs": data})
        text = table(runs)
        write_whole(output / "learner_script_tables.md", text)
        typer.echo(text)


if __name__ == "__main__":
    typer.run(main)
