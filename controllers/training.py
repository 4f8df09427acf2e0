"""Learn a policy on the compiled batch, keep it with a record of how it was made, and go on where it stopped.

policy.zip          the best network met (stable-baselines3's file)
policy.json         the record: command, seed, versions, plant, env options, settings, evaluation
policy.checkpoint/  only while learning or after an interruption: what `resume` goes on from
"""

import json
import math
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .learned import algorithm_class, read_record
from .recipes import discount, observation_scale
from .training_record import OTHER_SEED, evaluate, record_of, write_record
from .training_setup import Training

__all__ = ["Training", "train"]

_EVALUATIONS = 20  # on the way; the best network is kept
_EVALUATION_ENVS = 32


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
    for another task, algorithm, plant or observation, or without stable-baselines3.
    """
    path = Path(path)
    checkpoint = path.with_suffix(".checkpoint")
    _check_output(path, checkpoint, resume)
    algorithm_class(training.recipe.name)  # says what to install, before anything else fails
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # networks this small lose by sharing
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        run = _resumed(training, path, checkpoint) if resume else _started(training, checkpoint)
        run.learn(tensorboard, progress or (lambda done, of: None))
        spent = {"wall_s": round(time.perf_counter() - wall, 2), "cpu_s": round(time.process_time() - cpu, 2)}
        return run.finish(path, command, spent)
    finally:
        torch.set_num_threads(threads)
        if not (checkpoint / "state.json").exists():  # stopped before there was anything to go on from
            shutil.rmtree(checkpoint, ignore_errors=True)


class _Run:
    """A model on its way, with its checkpoint's folder. resumed_at: steps at which earlier sittings ended."""

    def __init__(self, training: Training, folder: Path, model: Any, best_return: float, resumed_at: list[int]) -> None:
        self.training, self.folder, self.model = training, folder, model
        self.best_return, self.resumed_at = best_return, resumed_at
        folder.mkdir(parents=True, exist_ok=True)

    def learn(self, tensorboard: Any, progress: Callable[[int, int], None]) -> None:
        from stable_baselines3.common.callbacks import EvalCallback
        from stable_baselines3.common.vec_env import VecMonitor

        from .sb3 import Report, Then

        steps = self.training.steps
        trial = VecMonitor(self.training.batch(_EVALUATION_ENVS))
        trial.seed(self.training.seed + OTHER_SEED)
        evaluation = EvalCallback(
            trial,
            n_eval_episodes=_EVALUATION_ENVS,
            eval_freq=max(1, steps // (_EVALUATIONS * self.training.recipe.envs)),
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
        """Write the checkpoint, each file whole. Its state comes last: it says that the rest is there."""
        self.best_return = best_return
        save = {"model.zip": self.model.save}
        if self.training.recipe.off_policy:
            save["replay_buffer.pkl"] = self.model.save_replay_buffer
        for name, write in save.items():
            write(self.folder / f"new-{name}")
        for name in save:
            os.replace(self.folder / f"new-{name}", self.folder / name)
        state = self.training.identity | {"best_return": best_return, "resumed_at": self.resumed_at}
        (self.folder / "state.json").write_text(json.dumps(state), encoding="utf-8")

    def finish(self, path: Path, command: str | None, spent: dict[str, float]) -> dict[str, Any]:
        """Play the best network in the trials that controllers are compared in, and write it with its record."""
        best = self.folder / "best_model.zip"
        if not best.exists():  # too few steps for a single evaluation
            self.model.save(best)
        record = record_of(
            self.training,
            command=command,
            steps=int(self.model.num_timesteps),
            resumed_at=self.resumed_at,
            best_return=self.best_return if math.isfinite(self.best_return) else None,
            spent=spent,
        )
        with tempfile.TemporaryDirectory(dir=path.parent) as folder:
            policy = Path(folder) / path.name
            shutil.copy(best, policy)  # not moved: what fails below must not lose it
            write_record(policy.with_suffix(".json"), record)  # tells the trials how the policy sees the rig
            record["evaluation"] = evaluate(policy, self.training)
            write_record(policy.with_suffix(".json"), record)
            os.replace(policy.with_suffix(".json"), path.with_suffix(".json"))
            os.replace(policy, path)
        shutil.rmtree(self.folder)
        return record


def _started(training: Training, folder: Path) -> _Run:
    """A run from nothing."""
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
    model = algorithm_class(plan.name)(
        "MlpPolicy",
        _learning_env(training),
        gamma=discount(training.setup.sample_time),
        policy_kwargs=network | ({} if plan.log_std is None else {"log_std_init": plan.log_std}),
        seed=training.seed,
        device="cpu",
        **plan.settings,
    )
    return _Run(training, folder, model, -math.inf, [])


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
    asked = training.identity
    asked |= asked.pop("env")
    had = known | (known.get("env") or {})
    for key, wanted in asked.items():
        if had.get(key) != wanted:
            raise ValueError(
                f"--resume: {file} was trained with {key} = {had.get(key)!r}, and now {wanted!r} is asked for; "
                "ask for the same, or train anew under another name"
            )
    model = algorithm_class(training.recipe.name).load(file, env=_learning_env(training), device="cpu")
    done = max(
        int(model.num_timesteps), int(known.get("steps", 0))
    )  # the network that is kept is the best, not the last
    model.num_timesteps = done
    if done >= training.steps:
        raise ValueError(f"--resume: {file} has {done} steps already; give --steps a larger number (the total)")
    memory = folder / "replay_buffer.pkl"
    if training.recipe.off_policy and memory.exists():
        model.load_replay_buffer(memory)
    model.set_random_seed(training.seed + done)  # other episodes than those that it has seen
    best = known.get("best_return")
    earlier = [*known.get("resumed_at", []), done]
    run = _Run(training, folder, model, -math.inf if best is None else best, earlier)
    if not (folder / "best_model.zip").exists():
        shutil.copy(path if path.exists() else file, folder / "best_model.zip")
    return run


def _learning_env(training: Training) -> Any:
    from stable_baselines3.common.vec_env import VecMonitor

    from .sb3 import ScaledReward

    return VecMonitor(ScaledReward(training.batch(training.recipe.envs), training.recipe.reward_scale))


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
