"""Policies with memory: recurrent PPO of sb3-contrib, which finds out the rig within an episode.

`furuta train` and the exports know networks without memory only, so these live in the study: a zip with a record and
all parameters as plain numbers. A training that is stopped begins anew.
"""

from __future__ import annotations

import json
import time
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controllers import tensors
from controllers.learned import LearnedController
from controllers.learning_state import parameters_of, put_parameters
from controllers.policy_file import LEARNING, RECORD, SCHEMA, read_learning, read_record
from controllers.recipes import discount, observation_scale
from controllers.training import Training
from controllers.training_model import learning_env
from furuta_gym.files import write_whole
from furuta_gym.plant import Plant

CELLS = 64
RATE = 5e-4
SETTINGS = {"n_steps": 128, "batch_size": 2048, "n_epochs": 5, "gae_lambda": 0.95, "ent_coef": 0.0}


def training_of(plant: Plant, recipe: str, steps: int | None, seed: int) -> Training:
    """As the recipe has it, with one observation and the last command: the past is the policy's own to remember."""
    return Training.of_recipe(plant, recipe, task="swing_up", steps=steps, seed=seed, history=1, observe_command=True)


def recurrent_model(training: Training) -> Any:
    """The model, with nothing learned. Raises ValueError without sb3-contrib."""
    try:
        from sb3_contrib import RecurrentPPO
    except ImportError as error:
        raise ValueError(f"this needs sb3-contrib ({error}); pip install 'furuta-gym[rl]'") from error
    from controllers.sb3 import ScaledObservation

    scale = observation_scale(training.plant, training.history, training.observe_command)
    return RecurrentPPO(
        "MlpLstmPolicy",
        learning_env(training),
        gamma=discount(training.setup.sample_time),
        learning_rate=lambda left: RATE * max(left, 0.02),
        seed=training.seed,
        device="cpu",
        policy_kwargs={
            "features_extractor_class": ScaledObservation,
            "features_extractor_kwargs": {"scale": scale},
            "lstm_hidden_size": CELLS,
            "shared_lstm": True,
            "enable_critic_lstm": False,
            "net_arch": [32],
            "log_std_init": -0.5,
        },
        **SETTINGS,
    )


def learn_recurrent(plant: Plant, recipe: str, steps: int | None, seed: int, path: Path) -> None:
    """Train, and write the policy with its record."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        training = training_of(plant, recipe, steps, seed)
        model = recurrent_model(training)
        wall, cpu = time.perf_counter(), time.process_time()
        model.learn(training.steps)
        spent = {"wall_s": round(time.perf_counter() - wall, 2), "cpu_s": round(time.process_time() - cpu, 2)}
    finally:
        torch.set_num_threads(threads)
    record = training.identity | {
        "schema": SCHEMA,
        "algorithm": "RecurrentPPO",
        "seed": seed,
        "steps": int(model.num_timesteps),
        "not_trained_for": training.not_trained_for,
        "settings": SETTINGS | {"learning_rate": RATE, "lstm_hidden_size": CELLS},
        "spent": spent,
    }
    raw = BytesIO()
    with zipfile.ZipFile(raw, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(RECORD, json.dumps(record, ensure_ascii=False, allow_nan=False))
        archive.writestr(LEARNING, tensors.to_bytes(parameters_of(model)))
    write_whole(path, raw.getvalue())


def load_recurrent(path: Path, plant: Plant, sample_time: float) -> Recurrent:
    """The policy as a controller, on the clock of the rig. Raises ValueError where the file is none."""
    record = read_record(path)
    training = training_of(plant, str(record.get("recipe")), 1, 0)
    model = recurrent_model(training)
    put_parameters(model, read_learning(path))
    every = max(1, round(training.setup.sample_time / sample_time))
    return Recurrent(path.name, model.policy, plant, sample_time, every, training.setup.arm_limit)


class Recurrent(LearnedController):
    """Plays a recurrent policy of sb3-contrib; its memory begins empty."""

    def __init__(self, name: str, policy: Any, plant: Plant, sample_time: float, every: int, arm_limit: float) -> None:
        self._policy = policy
        super().__init__(
            name,
            None,
            plant,
            sample_time,
            observe_command=True,
            normalized=True,
            every=every,
            arm_limit=arm_limit,
            tasks=("balance", "swing_up"),
        )

    def _start(self) -> None:
        super()._start()
        self.predict = _Memory(self._policy)


class _Memory:
    """Observations (L, n) to actions (L, 1), one after the other."""

    def __init__(self, policy: Any) -> None:
        self.policy, self.state = policy, None

    def __call__(self, seen: NDArray[np.float32]) -> NDArray[np.float64]:
        fresh = np.full(len(seen), self.state is None)
        action, self.state = self.policy.predict(seen, self.state, fresh, deterministic=True)
        return action
