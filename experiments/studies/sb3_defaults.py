"""Do learners with their own defaults learn the environments? `python -m experiments.studies.sb3_defaults`.

Stable-baselines3's PPO and SAC, given nothing but an id: `PPO("MlpPolicy", "FurutaSwingUp-v0")`. The policy is judged
every few thousand steps, on 50 starts that are the same each time. A run is a file below `--work`; what is there is not
run again. Writes sb3_defaults.json and sb3_defaults_tables.md.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from joblib import Parallel, delayed

from experiments.cli.errors import explained
from experiments.cli.output import check_folder, counted, errors, write_json
from experiments.workers import workers
from furuta_gym.envs.registration import TASK_IDS, options_of
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.files import read_json, write_whole

SCHEMA = "furuta-sb3-defaults/1"
STARTS = 50
SEED = 70_000  # of the starts
LENGTH = 10.0  # s of an episode that judges; its last 5 s must be upright
HELD = 5.0  # s
UPRIGHT = 0.2  # rad
ENOUGH, LAST = 0.95, 3  # success in so many of the last evaluations
BUDGET = {("ppo", "swing_up"): 500_000, ("ppo", "balance"): 500_000, ("sac", "swing_up"): 50_000}
BUDGET |= {("sac", "balance"): 50_000}
EVALUATIONS = 20


@dataclass(frozen=True)
class Run:
    """One training. evaluations: (steps, CPU time so far [s], success of the starts) each."""

    algorithm: str
    env_id: str
    seed: int
    steps: int
    evaluations: list[tuple[int, float, float]]
    cpu_s: float
    versions: dict[str, str]

    @property
    def stays(self) -> bool:
        """Whether the last evaluations are all good enough."""
        return all(success >= ENOUGH for _, _, success in self.evaluations[-LAST:])

    @property
    def reached_at(self) -> int | None:
        """Steps of the first evaluation that is good enough."""
        return next((steps for steps, _, success in self.evaluations if success >= ENOUGH), None)


def success(predict: Any, env_id: str, **changes: Any) -> float:
    """Share of the starts whose last 5 s are upright, the arm within its limit all the time.

    changes: options of the environment that are not those of its id."""
    options: dict[str, Any] = options_of(env_id) | changes | {"time_limit": LENGTH}
    batch = FurutaVectorEnv(STARTS, max_episode_steps=None, **options)
    observation, _ = batch.reset(seed=SEED)
    steps, held = round(LENGTH / batch.setup.action_period), round(HELD / batch.setup.action_period)
    good = np.ones(STARTS, dtype=bool)
    for k in range(steps - 1):  # the next one would begin anew
        observation, _, terminated, _, info = batch.step(predict(observation))
        q2 = info["state"][:, 1]
        lean = np.abs(q2 - 2 * np.pi * np.round(q2 / (2 * np.pi)))
        good &= ~terminated & ((lean < UPRIGHT) | (k < steps - 1 - held))
    return float(good.mean())


def learn(algorithm: str, env_id: str, seed: int, steps: int, file: Path) -> None:
    """Train with the library's defaults and keep what was measured on the way."""
    import stable_baselines3
    import torch
    from stable_baselines3.common.callbacks import BaseCallback

    import furuta_gym  # noqa: F401  (registers the ids)
    from controllers.training.record import versions

    class Judge(BaseCallback):
        def _on_step(self) -> bool:
            if self.num_timesteps <= steps and self.num_timesteps % (steps // EVALUATIONS) == 0:
                spent = time.process_time() - began - sum(pauses)
                paused = time.process_time()
                rate = success(lambda seen: self.model.predict(seen, deterministic=True)[0], env_id)
                found.append((self.num_timesteps, round(spent, 1), rate))
                pauses.append(time.process_time() - paused)
            return True

    torch.set_num_threads(1)
    kind = getattr(stable_baselines3, algorithm.upper())
    model = kind("MlpPolicy", env_id, seed=seed, device="cpu")
    found: list[tuple[int, float, float]] = []
    pauses: list[float] = []
    began = time.process_time()
    model.learn(steps, callback=Judge())
    spent = time.process_time() - began - sum(pauses)
    done = Run(algorithm, env_id, seed, steps, found, round(spent, 1), versions())
    file.parent.mkdir(parents=True, exist_ok=True)
    write_json(file, {"schema": SCHEMA} | asdict(done))


def read_run(file: Path) -> Run | None:
    """A run that is there and whole, else None."""
    try:
        data = read_json(file.read_bytes())
        data.pop("schema")
        data["evaluations"] = [tuple(one) for one in data["evaluations"]]
        return Run(**data)
    except (OSError, ValueError, TypeError, KeyError):
        return None


def table(runs: Sequence[Run]) -> str:
    """Markdown: a row for each run."""
    lines = [
        "| learner | environment | seed | steps | CPU [s] | 95 % first at | last three evaluations [%] | stays |",
        "|---" * 8 + "|",
    ]
    for r in runs:
        last = ", ".join(f"{100 * x:.0f}" for _, _, x in r.evaluations[-LAST:])
        first = "never" if r.reached_at is None else f"{r.reached_at:,}"
        row = (r.algorithm.upper(), r.env_id, r.seed, f"{r.steps:,}", f"{r.cpu_s:.0f}", first, last)
        lines.append("| " + " | ".join(map(str, row)) + f" | {'yes' if r.stays else '**no**'} |")
    stay = sum(r.stays for r in runs)
    lines += ["", f"{stay} of {len(runs)} runs stay at 95 % or more."]
    return "\n".join(lines) + "\n"


def _words(text: str, known: Iterable[str], option: str) -> list[str]:
    words = [word.strip() for word in text.split(",") if word.strip()]
    if not words or not set(words) <= set(known):
        raise ValueError(f"{option} {text!r}: expected some of {', '.join(known)}")
    return words


def main(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for JSON and table.")] = Path(
        "out/sb3_defaults"
    ),
    work: Annotated[Path, typer.Option(help="Folder of the runs.")] = Path("out/sb3_defaults"),
    algorithms: Annotated[str, typer.Option(help="ppo, sac.")] = "ppo,sac",
    tasks: Annotated[str, typer.Option(help="swing_up, balance.")] = "swing_up,balance",
    seeds: Annotated[int, typer.Option(help="Trainings of each.", min=1)] = 5,
    steps: Annotated[int | None, typer.Option(help="Of each; default: 500 000 of PPO, 50 000 of SAC.", min=20)] = None,
    backend: Annotated[str, typer.Option(help="loky, or dask (cluster at DASK_SCHEDULER_ADDRESS, or here).")] = "loky",
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 1,
) -> None:
    """Train, judge, and tabulate; also what an earlier run left in `--work`."""
    with explained():
        check_folder(output)
        pairs = [
            (a, t)
            for t in _words(tasks, TASK_IDS, "--tasks")
            for a in _words(algorithms, ("ppo", "sac"), "--algorithms")
        ]
        todo = [(a, TASK_IDS[t], seed, steps or BUDGET[a, t]) for seed in range(seeds) for a, t in pairs]
        files = [work.absolute() / f"{a}-{env_id}-{seed}-{n}.json" for a, env_id, seed, n in todo]
        missing = [(*run, file) for run, file in zip(todo, files, strict=True) if read_run(file) is None]
        try:
            with workers(backend, jobs), counted("trainings") as tell:
                calls = (delayed(learn)(*arguments) for arguments in missing)
                for done, _ in enumerate(Parallel(return_as="generator_unordered", pre_dispatch="2*n_jobs")(calls), 1):
                    tell(done, len(missing))
        except KeyboardInterrupt:
            errors.print("Stopped. The same command goes on from here.")
            raise typer.Exit(130) from None
        runs = sorted((r for r in map(read_run, files) if r is not None), key=lambda r: (r.env_id, r.algorithm, r.seed))
        data = [asdict(r) | {"stays": r.stays, "reached_at": r.reached_at} for r in runs]
        write_json(output / "sb3_defaults.json", {"schema": SCHEMA, "runs": data})
        text = table(runs)
        write_whole(output / "sb3_defaults_tables.md", text)
        typer.echo(text)


if __name__ == "__main__":
    typer.run(main)
