"""What is to be learned, and on what: everything that a training run must know before it starts."""

import hashlib
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from furuta_gym.envs.options import TASKS, Options, Setup
from furuta_gym.envs.ranges import as_mapping, never_drawn
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import Plant
from furuta_gym.simulation import same_clock

from .curriculum import Curriculum
from .recipes import EPISODE, RECIPES, RECURRENT, Recipe, recipe, training_period

SCHEMA = "furuta-policy/1"


def plant_sha256(plant: Plant) -> str:
    """What a record names the plant by."""
    return hashlib.sha256(plant.to_json().encode()).hexdigest()


@dataclass(frozen=True)
class Training:
    """One training run.

    plant: rig. task: "balance" or "swing_up". algorithm: of `recipes.ALGORITHMS`. steps: env steps in all.
    randomize: True for a plant from its covariance (or as its file says) for each episode, or ranges by name, see
    `furuta_gym.envs.ranges`; effect_probabilities: effects that come and go, as in `FurutaEnv`. sample_time [s],
    history, observe_command, reward_weights, noise_std [rad], arm_limit and arm_margin [rad]: as in `FurutaEnv`; see
    `recipes.training_period`. recipe_name: of `recipes.RECIPES`, says the size of network and batch; `of_recipe` takes
    the other fields from it too. curriculum: how ranges widen with success; None for their whole width from the start.
    Raises ValueError where the env would, or if the algorithm is unknown or steps < 1.
    """

    plant: Plant
    task: str = "balance"
    algorithm: str = "ppo"
    steps: int = 1_000_000
    seed: int = 0
    randomize: bool | Mapping[str, str] = False
    effect_probabilities: Mapping[str, float] = field(default_factory=dict)
    sample_time: float | None = None
    history: int = 1
    observe_command: bool = False
    reward_weights: Mapping[str, float] = field(default_factory=dict)
    noise_std: float | None = None
    arm_limit: float | None = None
    arm_margin: float = 0.0
    recipe_name: str = "plain"
    curriculum: Curriculum | None = None

    @classmethod
    def of_recipe(cls, plant: Plant, name: str, **said: Any) -> "Training":
        """A run as a recipe of `recipes.RECIPES` has it, except for what is said; None says nothing.

        Reward weights that are not said remain the recipe's; ranges that are said replace all of its ranges.
        Raises ValueError for a name that is none."""
        recipe("ppo", "balance", name)  # complains about the name
        given = RECIPES[name].of(plant)
        if said.get("algorithm") == RECURRENT:  # it remembers by itself what a history would show
            given |= {"history": 1, "observe_command": True}
        limit = said.get("arm_limit") or plant.limit("arm_travel", math.inf)
        given["arm_margin"] = min(given["arm_margin"], 0.5 * limit)
        weights = {**given["reward_weights"], **(said.pop("reward_weights", None) or {})}
        given |= {key: x for key, x in said.items() if x is not None}
        given["reward_weights"] = weights
        return cls(plant, recipe_name=name, **given)

    def __post_init__(self) -> None:
        if self.task not in TASKS:
            raise ValueError(f"--task {self.task!r}: expected one of {', '.join(TASKS)}")
        if self.steps < 1:
            raise ValueError(f"--steps {self.steps}: expected at least 1")
        if self.seed < 0:
            raise ValueError(f"--seed {self.seed}: expected a whole number of at least 0")
        _ = self.recipe, self.setup  # both refuse what they cannot do
        if self.curriculum is not None and not self.setup.random.active:
            raise ValueError("a curriculum widens ranges, and nothing is drawn; say what to draw with --randomize")
        clock, period = self.plant.sample_time, self.setup.sample_time
        if clock is not None and not same_clock(max(1, round(period / clock)) * clock, period):
            raise ValueError(
                f"sample_time {period:g} s is no multiple of the plant's {clock:g} s, so the rig cannot play the "
                f"policy; choose a multiple, such as {training_period(self.plant, None):g}"
            )

    @property
    def env(self) -> dict[str, Any]:
        """The options of `FurutaID-v0`, the plant apart."""
        return {
            "task": self.task,
            "sample_time": training_period(self.plant, self.sample_time),
            "normalize_action": True,
            "history": self.history,
            "observe_command": self.observe_command,
            "randomize": self.randomize if isinstance(self.randomize, bool) else as_mapping(self.randomize),
            "effect_probabilities": dict(self.effect_probabilities),
            "reward_weights": dict(self.reward_weights),
            "noise_std": self.noise_std,
            "arm_limit": self.arm_limit,
            "arm_margin": self.arm_margin,
        }

    @cached_property
    def setup(self) -> Setup:
        """These options as the env understands them."""
        return Setup(Options.of({"plant": self.plant} | self.env))

    @property
    def not_trained_for(self) -> list[str]:
        """Effects and properties of a rig that no episode has."""
        missing = never_drawn(self.setup.draws, self.setup.plant, self.effect_probabilities)
        always = {"noise_std"} if max(np.broadcast_to(self.setup.sensors.noise_std, 2)) > 0 else set()
        return [name for name in missing if name not in always]

    @property
    def drawn_otherwise(self) -> str:
        """A sentence on the parameters that the plant's logs did not show, and how episodes draw them; "" for none."""
        return self.setup.random.told

    @cached_property
    def recipe(self) -> Recipe:
        """How the algorithm is set up for the task."""
        return recipe(self.algorithm, self.task, self.recipe_name)

    @property
    def identity(self) -> dict[str, Any]:
        """What a run and its continuation must have in common."""
        return {
            "schema": SCHEMA,
            "algorithm": self.recipe.name,
            "task": self.task,
            "observation_size": int(np.prod(self.setup.observation_space.shape)),
            "sample_time": self.setup.sample_time,
            "env": self.env | {"arm_limit": self.setup.arm_limit},
            "recipe": self.recipe_name,
            "curriculum": None if self.curriculum is None else asdict(self.curriculum),
            "plant_sha256": plant_sha256(self.plant),
        }

    def batch(self, envs: int) -> Any:
        """A `VecEnv` of so many rigs to learn on, with episodes of `recipe.episode` seconds."""
        from furuta_gym.envs.sb3 import FurutaVecEnv

        return FurutaVecEnv(envs, plant=self.plant, time_limit=self.recipe.episode, **self.env)

    def judges(self, envs: int) -> FurutaVectorEnv:
        """The same rigs to be judged on for `recipes.EPISODE` seconds, with Gymnasium's own interface."""
        return FurutaVectorEnv(envs, plant=self.plant, time_limit=EPISODE, **self.env)
