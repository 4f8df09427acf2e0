"""Learn a policy on the compiled batch, keep it with a record of how it was made, and go on where it stopped.

policy.zip          the best network met (stable-baselines3's file)
policy.json         the record: command, seed, versions, plant, env options, settings, evaluation
policy.checkpoint/  only while learning or after an interruption: what `resume` goes on from
"""

import hashlib
import json
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from furuta_gym.envs.options import TASKS, Options, Setup
from furuta_gym.plant import Plant

from .evaluation import compare
from .learned import algorithm_class, read_record
from .recipes import EPISODE, Recipe, discount, observation_scale, recipe, training_period

SCHEMA = "furuta-policy/1"
TRIALS = 200  # of the evaluation at the end
_EVALUATIONS = 20  # on the way; the best network is kept
_EVALUATION_ENVS = 32
_OTHER_SEED = 1_000_000  # episodes that choose the best network are not those that train it


@dataclass(frozen=True)
class Training:
    """What to learn, and on what.

    plant: rig. task: "balance" or "swing_up". algorithm: "ppo", "sac" or "tqc". steps: env steps in all.
    randomize: a plant from its covariance for each episode; effect_probabilities: effects that come and go, as in
    `FurutaEnv`. sample_time [s], history, observe_command: as in `FurutaEnv`; see `recipes.training_period`.
    Raises ValueError where the env would, or if the algorithm is unknown or steps < 1.
    """

    plant: Plant
    task: str = "balance"
    algorithm: str = "ppo"
    steps: int = 1_000_000
    seed: int = 0
    randomize: bool = False
    effect_probabilities: Mapping[str, float] = field(default_factory=dict)
    sample_time: float | None = None
    history: int = 1
    observe_command: bool = False

    def __post_init__(self) -> None:
        if self.task not in TASKS:
            raise ValueError(f"--task {self.task!r}: expected one of {', '.join(TASKS)}")
        if self.steps < 1:
            raise ValueError(f"--steps {self.steps}: expected at least 1")
        if self.seed < 0:
            raise ValueError(f"--seed {self.seed}: expected a whole number of at least 0")
        if self.randomize and self.plant.covariance is None:
            raise ValueError(
                "--randomize draws plants from the covariance that identification stores, and this plant has none; "
                "identify it from a log with `furuta identify`, or leave --randomize out"
            )
        recipe(self.algorithm, self.task)
        Setup(Options.of({"plant": self.plant} | self.env))  # refuses what the env would refuse

    @property
    def env(self) -> dict[str, Any]:
        """The options of `FurutaID-v0`, the plant apart."""
        return {
            "task": self.task,
            "sample_time": training_period(self.plant, self.sample_time),
            "normalize_action": True,
            "history": self.history,
            "observe_command": self.observe_command,
            "randomize": self.randomize,
            "effect_probabilities": dict(self.effect_probabilities),
        }

    def batch(self, envs: int) -> Any:
        """A `VecEnv` of so many rigs, with episodes of `recipes.EPISODE` seconds."""
        from furuta_gym.envs.sb3 import FurutaVecEnv

        options = self.env
        longest = round(EPISODE / options["sample_time"])
        return FurutaVecEnv(envs, plant=self.plant, max_episode_steps=longest, **options)


def train(
    training: Training,
    path: str | os.PathLike[str],
    *,
    resume: bool = False,
    tensorboard: str | os.PathLike[str] | None = None,
    command: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Learn, write `path` (*.zip) and its record beside it, and return the record.

    resume: go on from the checkpoint of an interrupted run, else from the policy at `path`, up to `training.steps` in
    all. It does not repeat what an uninterrupted run would have done: random streams start anew. tensorboard: folder
    for logs. command: as typed, for the record. progress(done, of) in env steps.

    Raises ValueError if `path` exists (without resume) or is no *.zip, or if there is nothing to resume or it was made
    for another task, algorithm, plant or observation; ImportError without stable-baselines3.
    """
    import torch

    path = Path(path)
    checkpoint = path.with_suffix(".checkpoint")
    _check_output(path, checkpoint, resume)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # networks this small lose by sharing
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        run = _resumed(training, path, checkpoint) if resume else _Run.new(training, checkpoint)
        run.learn(tensorboard, progress or (lambda done, of: None))
        spent = {"wall_s": round(time.perf_counter() - wall, 2), "cpu_s": round(time.process_time() - cpu, 2)}
        return run.finish(path, command, spent)
    finally:
        torch.set_num_threads(threads)
        if not (checkpoint / "state.json").exists():  # stopped before there was anything to go on from
            shutil.rmtree(checkpoint, ignore_errors=True)


class _Run:
    """A model on its way. state: steps done, best mean return met, and what was spent in earlier sittings."""

    def __init__(self, training: Training, folder: Path, model: Any, best_return: float, resumed_at: list[int]) -> None:
        self.training, self.folder, self.model = training, folder, model
        self.best_return, self.resumed_at = best_return, resumed_at

    @classmethod
    def new(cls, training: Training, folder: Path) -> "_Run":
        from stable_baselines3.common.vec_env import VecMonitor
        from torch import nn

        from .sb3 import ScaledObservation, ScaledReward

        plan = recipe(training.algorithm, training.task)
        env = training.env
        network = {
            "features_extractor_class": ScaledObservation,
            "features_extractor_kwargs": {
                "scale": observation_scale(training.plant, training.history, training.observe_command)
            },
            "net_arch": list(plan.layers),
            "activation_fn": getattr(nn, plan.activation),
        } | ({} if plan.log_std is None else {"log_std_init": plan.log_std})
        model = algorithm_class(plan.name)(
            "MlpPolicy",
            VecMonitor(ScaledReward(training.batch(plan.envs), plan.reward_scale)),
            gamma=discount(env["sample_time"]),
            policy_kwargs=network,
            seed=training.seed,
            device="cpu",
            **plan.settings,
        )
        folder.mkdir(parents=True, exist_ok=True)
        return cls(training, folder, model, -np.inf, [])

    def learn(self, tensorboard: Any, progress: Callable[[int, int], None]) -> None:
        from stable_baselines3.common.callbacks import EvalCallback
        from stable_baselines3.common.vec_env import VecMonitor

        from .sb3 import Report, Then

        steps, plan = self.training.steps, recipe(self.training.algorithm, self.training.task)
        trial = VecMonitor(self.training.batch(_EVALUATION_ENVS))
        trial.seed(self.training.seed + _OTHER_SEED)
        evaluation = EvalCallback(
            trial,
            n_eval_episodes=_EVALUATION_ENVS,
            eval_freq=max(1, steps // (_EVALUATIONS * plan.envs)),
            best_model_save_path=str(self.folder),
            callback_after_eval=Then(lambda: self._keep(float(evaluation.best_mean_reward))),
            verbose=0,
        )
        evaluation.best_mean_reward = self.best_return
        self.model.tensorboard_log = None if tensorboard is None else str(tensorboard)
        self.model.learn(
            steps - self.model.num_timesteps,
            callback=[Report(progress, steps), evaluation],
            tb_log_name=f"{self.training.task}-{self.training.algorithm}",
            reset_num_timesteps=not self.resumed_at,
        )

    def _keep(self, best_return: float) -> None:
        """Write the checkpoint. The record comes last: it says that the rest is whole."""
        self.best_return = best_return
        self.model.save(self.folder / "model.zip")
        if recipe(self.training.algorithm, self.training.task).off_policy:
            self.model.save_replay_buffer(self.folder / "replay_buffer.pkl")
        state = _identity(self.training) | {"best_return": best_return, "resumed_at": self.resumed_at}
        (self.folder / "state.json").write_text(json.dumps(state), encoding="utf-8")

    def finish(self, path: Path, command: str | None, spent: dict[str, float]) -> dict[str, Any]:
        """Play the best network in the trials that controllers are compared in, and write it with its record."""
        best = self.folder / "best_model.zip"
        if not best.exists():  # too few steps for a single evaluation
            self.model.save(best)
        plan = recipe(self.training.algorithm, self.training.task)
        with tempfile.TemporaryDirectory(dir=path.parent) as folder:
            policy = Path(folder) / path.name
            shutil.move(best, policy)
            record = self._record(plan, command, spent)
            write = lambda: policy.with_suffix(".json").write_text(_text(record), encoding="utf-8")  # noqa: E731
            write()  # the trials need it to know how the policy sees the rig
            record["evaluation"] = evaluate(policy, self.training)
            write()
            os.replace(policy.with_suffix(".json"), path.with_suffix(".json"))
            os.replace(policy, path)
        shutil.rmtree(self.folder)
        return record

    def _record(self, plan: Recipe, command: str | None, spent: dict[str, float]) -> dict[str, Any]:
        training = self.training
        setup = Setup(Options.of({"plant": training.plant} | training.env))
        settings = {"gamma": discount(setup.sample_time), "net_arch": list(plan.layers), "activation": plan.activation}
        settings |= {"log_std_init": plan.log_std, "envs": plan.envs, "reward_scale": plan.reward_scale}
        return _identity(training) | {
            "command": command,
            "env": training.env
            | {"velocity_cutoff": setup.sensors.velocity_cutoff, "arm_limit": setup.options.arm_limit},
            "seed": training.seed,
            "steps": int(self.model.num_timesteps),
            "resumed_at": self.resumed_at,
            "settings": settings | dict(plan.settings),
            "best_return": None if self.best_return == -np.inf else self.best_return,
            "spent": spent,
            "versions": _versions(),
            "plant": training.plant.to_dict(),
        }


def evaluate(policy: Path, training: Training) -> dict[str, Any]:
    """Figures with intervals of `TRIALS` trials of the task on the nominal plant, as `furuta compare` plays them."""
    group = training.task
    result = compare(
        training.plant, [str(policy)], trials=TRIALS, duration=10.0, groups=(group,), seed=training.seed + _OTHER_SEED
    )
    (rows,) = result.scores.values()
    (figures,) = rows.values()
    settings = {key: result.settings[key] for key in ("trials", "sample_time", "seed")}
    return settings | {name: interval.to_dict() for name, interval in figures.items()}


def _resumed(training: Training, path: Path, folder: Path) -> _Run:
    """The interrupted run in `folder`, or the finished policy at `path`, to be gone on with."""
    state, file = folder / "state.json", folder / "model.zip"
    if not state.exists():
        if not path.exists():
            raise ValueError(f"--resume: there is neither {folder} nor {path} to go on from; leave --resume out")
        state, file = path.with_suffix(".json"), path
    try:
        known = json.loads(state.read_text(encoding="utf-8")) if state.parent == folder else read_record(path)
    except ValueError as error:
        raise ValueError(f"{state}: cannot be read: {error}; train anew under another name") from error
    for key, wanted in _identity(training).items():
        if known.get(key) != wanted:
            raise ValueError(
                f"--resume: {file} was trained with {key} = {known.get(key)!r}, and now {wanted!r} is asked for; "
                "ask for the same, or train anew under another name"
            )
    from stable_baselines3.common.vec_env import VecMonitor

    from .sb3 import ScaledReward

    plan = recipe(training.algorithm, training.task)
    env = VecMonitor(ScaledReward(training.batch(plan.envs), plan.reward_scale))
    model = algorithm_class(plan.name).load(file, env=env, device="cpu")
    done = int(model.num_timesteps)
    if done >= training.steps:
        raise ValueError(f"--resume: {file} has {done} steps already; give --steps a larger number (the total)")
    memory = folder / "replay_buffer.pkl"
    if plan.off_policy and memory.exists():
        model.load_replay_buffer(memory)
    model.set_random_seed(training.seed + done)  # other episodes than those that it has seen
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "best_model.zip").exists():
        shutil.copy(path if path.exists() else file, folder / "best_model.zip")
    best = known.get("best_return")
    return _Run(training, folder, model, -np.inf if best is None else best, [*known.get("resumed_at", []), done])


def _identity(training: Training) -> dict[str, Any]:
    """What a run and its continuation must have in common."""
    setup = Setup(Options.of({"plant": training.plant} | training.env))
    return {
        "schema": SCHEMA,
        "algorithm": recipe(training.algorithm, training.task).name,
        "task": training.task,
        "observation_size": int(np.prod(setup.observation_space.shape)),
        "sample_time": setup.sample_time,
        "plant_sha256": hashlib.sha256(training.plant.to_json().encode()).hexdigest(),
    }


def _check_output(path: Path, checkpoint: Path, resume: bool) -> None:
    if path.suffix != ".zip":
        raise ValueError(f"output {path}: expected a name that ends in .zip")
    if path.is_dir() or (checkpoint.exists() and not checkpoint.is_dir()):
        raise ValueError(f"output {path}: there is a folder, or a file {checkpoint}, in the way; choose another name")
    if resume:
        return
    for found in (path, path.with_suffix(".json"), checkpoint):
        if found.exists():
            raise ValueError(f"output {found} exists; go on with it by --resume, remove it, or choose another name")


def _versions() -> dict[str, str]:
    packages = ("furuta-gym", "stable-baselines3", "sb3-contrib", "torch", "gymnasium", "numpy")
    return {"python": platform.python_version()} | {package: version(package) for package in packages}


def _text(record: Mapping[str, Any]) -> str:
    return json.dumps(record, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
