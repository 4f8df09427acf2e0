"""The model of stable-baselines3 that a training run learns with, and the rigs that it learns on."""

from typing import Any

from furuta_gym.envs.vector import FurutaVectorEnv

from ..learned.sb3_files import algorithm_class
from .recipes import Recipe, discount, observation_scale
from .setup import Training


def make_model(training: Training) -> Any:
    """A model of stable-baselines3 that has learned nothing yet, on its batch of rigs."""
    from torch import nn

    from .sb3 import ScaledObservation

    plan = training.recipe
    scale = observation_scale(training.plant, training.history, training.observe_command)
    network = {
        "features_extractor_class": ScaledObservation,
        "features_extractor_kwargs": {"scale": scale},
        "net_arch": list(plan.layers),
        "activation_fn": getattr(nn, plan.activation),
    }
    policy: Any = "MlpPolicy"
    if plan.cells:
        from .remembering import RememberingPolicy

        policy = RememberingPolicy
        network["lstm_hidden_size"] = plan.cells
    return algorithm_class(plan.name)(
        policy,
        learning_env(training),
        gamma=discount(training.setup.sample_time),
        policy_kwargs=network | ({} if plan.log_std is None else {"log_std_init": plan.log_std}),
        seed=training.seed,
        device="cpu",
        **dict(plan.settings) | {"learning_rate": _rate(plan)},
    )


def _rate(plan: Recipe) -> Any:
    """The learning rate: a number, or a function of the share of the steps that is left."""
    first = float(plan.settings["learning_rate"])
    return first if plan.last_rate == 1.0 else lambda left: first * max(left, plan.last_rate)


def learning_rigs(model: Any) -> FurutaVectorEnv:
    """The batch that a model learns on, under stable-baselines3's wrappers."""
    return model.env.unwrapped.batch


def learning_env(training: Training) -> Any:
    """The batch of rigs that a run learns on, with scaled rewards."""
    from stable_baselines3.common.vec_env import VecMonitor

    from .sb3 import ScaledReward

    return VecMonitor(ScaledReward(training.batch(training.recipe.envs), training.recipe.reward_scale))
