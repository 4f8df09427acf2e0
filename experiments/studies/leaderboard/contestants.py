"""Who takes part: designed controllers, and policies that are learned once for each seed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controllers import make_controller
from controllers.base import DesignError
from controllers.training import Training, train
from furuta_gym.plant import Plant


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


def learn(contestant: Contestant, seed: int, plant: Plant, folder: Path, command: str) -> None:
    """Train one policy, or go on with a training that was stopped; nothing where it is there already."""
    path = policy_file(folder, contestant, seed)
    if path.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    training = Training.of_recipe(
        plant,
        contestant.recipe,
        task="swing_up",
        algorithm=contestant.algorithm,
        steps=contestant.steps,
        seed=seed,
    )
    train(training, path, resume=path.with_suffix(".checkpoint").exists(), command=command)


def made(contestant: Contestant, seed: int, plant: Plant, folder: Path, sample_time: float) -> Any:
    """The controller, to be played. Raises DesignError where a design does not apply."""
    if contestant.design:
        return make_controller(contestant.design, plant, sample_time)
    path = policy_file(folder, contestant, seed)
    return make_controller(path, plant, sample_time)


__all__ = ["ALL", "Contestant", "DesignError", "chosen", "learn", "made", "policy_file"]
