"""Who takes part: designed controllers, and policies that are learned once for each seed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controllers import make_controller
from controllers.base import DesignError
from controllers.learned.policy_file import read_record
from controllers.training.resuming import check_same
from controllers.training.train import Training, train
from furuta_gym.plant import Plant

MEND = "ask for the same, or choose another --work"


@dataclass(frozen=True)
class Contestant:
    """name: in tables and file names. design: of `CONTROLLERS`; or algorithm and recipe of `furuta train`, with steps
    (None: the recipe's)."""

    name: str
    words: str
    design: str = ""
    algorithm: str = ""
    recipe: str = "plain"
    steps: int | None = None

    @property
    def learned(self) -> bool:
        return not self.design


# Steps of SAC and TQC: what learns in a few minutes; eight million, as the recipe has it, would take a day.
ALL = (
    Contestant("swing-up", "designed: energy, then LQR", design="swing-up"),
    Contestant("planned", "designed: the fastest plan, followed", design="planned"),
    Contestant("ppo", "PPO, one rig", algorithm="ppo"),
    Contestant("ppo-robust", "PPO, recipe robust", algorithm="ppo", recipe="robust"),
    Contestant("sac", "SAC, one rig", algorithm="sac", steps=40_000),
    Contestant("sac-robust", "SAC, recipe robust", algorithm="sac", recipe="robust", steps=100_000),
    Contestant("tqc", "TQC, one rig", algorithm="tqc", steps=40_000),
    Contestant("tqc-robust", "TQC, recipe robust", algorithm="tqc", recipe="robust", steps=100_000),
    Contestant("recurrent", "recurrent PPO, one rig", algorithm="recurrent"),
    Contestant("recurrent-robust", "recurrent PPO, recipe robust", algorithm="recurrent", recipe="robust"),
)


def chosen(names: str) -> tuple[Contestant, ...]:
    """Those named, separated by commas, in the order of `ALL`; all for "". Raises ValueError for another name."""
    wanted = {name.strip() for name in names.split(",") if name.strip()}
    if strange := wanted - {c.name for c in ALL}:
        raise ValueError(f"no contestant {', '.join(sorted(strange))}; there are {', '.join(c.name for c in ALL)}")
    return tuple(c for c in ALL if not wanted or c.name in wanted)


def policy_file(folder: Path, contestant: Contestant, seed: int) -> Path:
    """Where a learned policy is kept."""
    return folder / "policies" / f"{contestant.name}-{seed}.zip"


def training_of(contestant: Contestant, seed: int, plant: Plant) -> Training:
    """How a learned one is made."""
    return Training.of_recipe(
        plant,
        contestant.recipe,
        task="swing_up",
        algorithm=contestant.algorithm,
        steps=contestant.steps,
        seed=seed,
    )


def check_policy(contestant: Contestant, seed: int, plant: Plant, folder: Path) -> None:
    """Raises ValueError where the policy that is there was trained in another way than is asked for."""
    path, training = policy_file(folder, contestant, seed), training_of(contestant, seed, plant)
    if not path.exists():
        return
    record = read_record(path)
    check_same(training, record, path, MEND)
    rollout = training.recipe.envs * training.recipe.settings.get("n_steps", 1)  # to whole ones of which steps go up
    if not training.steps <= record.get("steps", 0) < training.steps + rollout:
        raise ValueError(
            f"{path} was trained with steps = {record.get('steps')}, and now {training.steps} is asked for; {MEND}"
        )


def learn(contestant: Contestant, seed: int, plant: Plant, folder: Path, command: str) -> None:
    """Train one policy, or go on with a training that was stopped; nothing where it is there already."""
    path = policy_file(folder, contestant, seed)
    if path.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    resume = path.with_suffix(".checkpoint").exists()
    train(training_of(contestant, seed, plant), path, resume=resume, command=command)


def made(contestant: Contestant, seed: int, plant: Plant, folder: Path, sample_time: float) -> Any:
    """The controller, to be played. Raises DesignError where a design does not apply."""
    if contestant.design:
        return make_controller(contestant.design, plant, sample_time)
    path = policy_file(folder, contestant, seed)
    return make_controller(path, plant, sample_time)


__all__ = ["ALL", "MEND", "Contestant", "DesignError", "check_policy", "chosen", "learn", "made", "policy_file"]
