"""Trainings and blocks of trials, each kept in a file: what is there is not run again.

policies/NAME-SEED.zip           a policy and its record beside it
trials/NAME-SEED/CONDITION.json  what happened in each trial of a condition
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from controllers.comparison.conditions import Condition
from controllers.design import choose_sample_time
from controllers.training.setup import plant_sha256
from experiments.workers import workers
from furuta_gym.files import read_json, write_whole
from furuta_gym.plant import Plant

from .contestants import MEND, Contestant, DesignError, check_policy, learn, made
from .rigs import SEED, sizes

FIGURES = ("settling", "largest_q1", "roughness", "energy")
Tell = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Block:
    """The trials of one controller in one condition, (trials,) each. made_with: what they follow from, see `made_with`.
    refused: why the controller could not be made."""

    contestant: str
    seed: int
    condition: str
    success: list[bool]
    left_travel: list[bool]
    figures: dict[str, list[float]]
    made_with: dict[str, str | float]
    refused: str = ""

    def array(self, figure: str) -> NDArray[np.float64]:
        """A figure of the trials that succeeded."""
        return np.array(self.figures[figure])[np.array(self.success, dtype=bool)]


def block_file(folder: Path, contestant: Contestant, seed: int, condition: str) -> Path:
    """Where a block is kept."""
    plain = re.sub(r"[^\w.]+", "-", condition).strip("-")
    return folder / "trials" / f"{contestant.name}-{seed}" / f"{plain}.json"


def made_with(plant: Plant, row: Condition) -> dict[str, str | float]:
    """What the trials of a condition follow from, its name and the controller's apart; as a block keeps it."""
    return {"plant_sha256": plant_sha256(plant), "trials": row.trials, "duration": row.duration, "seed": SEED}


def read_block(file: Path) -> Block | None:
    """A block that is there and whole, else None."""
    try:
        return Block(**read_json(file.read_bytes()))
    except (OSError, ValueError, TypeError):
        return None


def run(
    contestants: Sequence[Contestant],
    seeds: int,
    plant: Plant,
    conditions: Sequence[Condition],
    folder: Path,
    *,
    command: str,
    backend: str = "loky",
    jobs: int = 1,
    tell: Tell = lambda stage, done, of: None,
) -> list[Block]:
    """Train what is not trained, play what is not played, and return all blocks. Stop it when you like.

    backend, jobs: see `experiments.workers`; workers of a Dask cluster must see the same folder. Raises ValueError
    as `collected` does, before any work."""
    folder.mkdir(parents=True, exist_ok=True)
    there = {(b.contestant, b.seed, b.condition) for b in collected(contestants, seeds, plant, conditions, folder)}
    pairs = _pairs(contestants, seeds)
    with workers(backend, jobs):
        trainings = [delayed(learn)(c, seed, plant, folder.absolute(), command) for c, seed in pairs if c.learned]
        _all(trainings, lambda done: tell("training", done, len(trainings)))
        places = [(c, seed, row) for c, seed in pairs for row in conditions]
        missing = [(c, seed, row) for c, seed, row in places if (c.name, seed, row.name) not in there]
        trials = [delayed(play)(c, seed, plant, row, folder.absolute()) for c, seed, row in missing]
        _all(trials, lambda done: tell("trials", done, len(trials)))
    return collected(contestants, seeds, plant, conditions, folder)


def collected(
    contestants: Sequence[Contestant], seeds: int, plant: Plant, conditions: Sequence[Condition], folder: Path
) -> list[Block]:
    """All blocks that are there. Raises ValueError for a policy or a block that was made with something else than what
    is asked for."""
    found = []
    for c, seed in _pairs(contestants, seeds):
        if c.learned:
            check_policy(c, seed, plant, folder)
        for row in conditions:
            file = block_file(folder, c, seed, row.name)
            block = read_block(file)
            if block is None:
                continue
            for key, wanted in made_with(plant, row).items():
                if (had := block.made_with.get(key)) != wanted:
                    raise ValueError(f"{file} was played with {key} = {had}, and now {wanted} is asked for; {MEND}")
            found.append(block)
    return found


def _pairs(contestants: Sequence[Contestant], seeds: int) -> list[tuple[Contestant, int]]:
    """Each contestant with each seed of its training."""
    return [(c, seed) for c in contestants for seed in (range(seeds) if c.learned else (0,))]


def _all(tasks: list, tell: Callable[[int], None]) -> None:
    for done, _ in enumerate(Parallel(return_as="generator_unordered", pre_dispatch="2*n_jobs")(tasks), 1):
        tell(done)


def play(contestant: Contestant, seed: int, plant: Plant, row: Condition, folder: Path) -> None:
    """Play one block and keep it. The rigs, starts and noise are the same for all."""
    T = choose_sample_time(plant, None)
    try:
        policy = made(contestant, seed, plant, folder, T)
    except DesignError as error:
        empty: dict[str, list[float]] = {name: [] for name in FIGURES}
        block = Block(contestant.name, seed, row.name, [], [], empty, made_with(plant, row), str(error))
    else:
        outcome = row.play(policy, row.starts(SEED), T, SEED)
        block = Block(
            contestant.name,
            seed,
            row.name,
            outcome.success.tolist(),
            outcome.left_travel.tolist(),
            {name: sizes(getattr(outcome, name)) for name in FIGURES},
            made_with(plant, row),
        )
    file = block_file(folder, contestant, seed, row.name)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, json.dumps(asdict(block), ensure_ascii=False, allow_nan=False) + "\n")
