"""Learn a policy on the compiled batch, keep it with a record of how it was made, and go on where it stopped.

policy.zip          the best network met, with all that learning goes on from (see `policy_file`)
policy.json         its record again, to be read: command, seed, versions, plant, env options, settings, evaluation
policy.checkpoint/  only while learning or after an interruption: what `resume` goes on from
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from furuta_gym.files import locked

from ..comparison.seeds import FINAL_SEED, OTHER_SEED, RESUMED_SEED, judging
from ..learned.layers import network_of
from ..learned.policy_file import from_stable_baselines3, read_learning, read_record, refusal, write_policy
from ..learned.sb3_files import algorithm_class, load_sb3
from .checkpoint import only_remains, read_checkpoint, remove_checkpoints, write_checkpoint
from .curriculum import evaluation, on_drawn_rigs, reached
from .learning_state import Arrays, memory_of, parameters_of, put_memory, put_parameters
from .model import learning_env, learning_rigs, make_model
from .record import TRIALS, evaluate, record_of, write_record
from .resuming import Progress, check_output, check_same, progress_of
from .running_state import put_running_state, running_state
from .setup import Training
from .spent import Clock

__all__ = ["Training", "train"]

_EVALUATIONS = 20  # on the way; the best network is kept
_EVALUATION_ENVS = 64


def train(
    training: Training,
    path: str | os.PathLike[str],
    *,
    resume: bool = False,
    trust: bool = False,
    tensorboard: str | os.PathLike[str] | None = None,
    command: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Learn, write `path` (*.zip) and its record beside it, and return the record.

    resume: go on from the checkpoint of an interrupted run, up to `training.steps` in all; with the same steps it ends
    where an uninterrupted run would have ended, to the last bit. Without a checkpoint go on from the policy at `path`,
    on episodes of its own. trust: go on from a
    policy of stable-baselines3 too, which runs the code in it. tensorboard: folder for logs. command: as typed, for the
    record. progress(done, of) in env steps.

    Raises ValueError if `path` exists (without resume) or is no *.zip, or if there is nothing to resume or it was made
    for another task, algorithm, plant or observation, a checkpoint also for another seed, or without stable-baselines3.
    """
    path = Path(path)
    checkpoint = path.with_suffix(".checkpoint")
    check_output(path, checkpoint, resume)
    algorithm_class(training.recipe.name)  # says what to install, before anything else fails
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # networks this small lose by sharing
    clock = Clock()
    try:
        with locked(path):
            try:
                if resume:
                    run = _resumed(training, path, checkpoint, trust, clock)
                else:
                    run = _started(training, checkpoint, clock)
                run.learn(tensorboard, progress or (lambda done, of: None))
                return run.finish(path, command)
            finally:
                if only_remains(checkpoint, path.name):  # stopped before there was anything to go on from
                    remove_checkpoints(checkpoint)
    finally:
        torch.set_num_threads(threads)


class _Run:
    """A model on its way, with its checkpoints' folder. clock: of this sitting; before: how far those before it came.
    best: the parameters that did best at the widest level so far."""

    def __init__(
        self,
        training: Training,
        folder: Path,
        model: Any,
        clock: Clock,
        before: Progress,
        best: Arrays | None = None,
    ) -> None:
        self.training, self.folder, self.model, self.clock, self.before = training, folder, model, clock, before
        self.evaluations = list(before.evaluations)
        self.best_return, self.best = before.best_return, best
        self.rigs = learning_rigs(model)
        self.judges = training.judges(_EVALUATION_ENVS)
        self.rigs.set_level(self.level)
        folder.mkdir(parents=True, exist_ok=True)

    @property
    def level(self) -> float:
        return reached(self.training.curriculum, self.evaluations)

    def learn(self, tensorboard: Any, progress: Callable[[int, int], None]) -> None:
        from .sb3 import EveryNow, Report

        steps = self.training.steps
        if self.model.num_timesteps >= steps:
            return
        self.model.tensorboard_log = None if tensorboard is None else str(tensorboard)
        self.model.learn(
            steps - self.model.num_timesteps,
            callback=[Report(progress, steps), EveryNow(self._judge, max(1, steps // _EVALUATIONS))],
            tb_log_name=f"{self.training.task}-{self.training.algorithm}",
            reset_num_timesteps=not self.before.resumed_at,
        )

    def _judge(self) -> None:
        """Evaluate, keep the best, widen the ranges, and write a checkpoint."""
        at = self.level
        seed = self.training.seed + OTHER_SEED
        found = evaluation(network_of(self.model), self.judges, seed, int(self.model.num_timesteps), at)
        self.model.logger.record("eval/mean_reward", found.mean)
        self.model.logger.record("eval/success", found.success)
        before = self.evaluations[-1].level if self.evaluations else at
        if self.best_return is None or found.mean > self.best_return or at > before:
            self.best_return, self.best = found.mean, parameters_of(self.model)
        self.evaluations.append(found)
        self.rigs.set_level(self.level)
        self._keep()

    def _keep(self) -> None:
        """Write a checkpoint."""
        state = self.training.identity | {"seed": self.training.seed} | self._progress()
        arrays = {"model": parameters_of(self.model), "best": self.best or parameters_of(self.model)}
        arrays["running"] = running_state(self.model, self.rigs)
        if self.training.recipe.off_policy:
            arrays["memory"] = memory_of(self.model)
        write_checkpoint(self.folder, state, arrays)

    def _progress(self) -> dict[str, Any]:
        """How far it is, as `Progress` reads it again."""
        return {
            "steps": int(self.model.num_timesteps),
            "best_return": self.best_return,
            "resumed_at": self.before.resumed_at,
            "evaluations": [e.to_dict() for e in self.evaluations],
            "earlier_seeds": self.before.earlier_seeds,
            "spent": self.clock.after(self.before.spent),
        }

    def finish(self, path: Path, command: str | None) -> dict[str, Any]:
        """Play the best network in the trials that controllers are compared in, and write it with its record."""
        level = self.evaluations[-1].level if self.evaluations else self.level
        record = record_of(self.training, command, self._progress(), level)
        if self.best is not None:  # else there were too few steps for a single evaluation
            put_parameters(self.model, self.best)
        network = network_of(self.model)
        candidate = write_policy(self.folder / path.name, network, record)
        record["evaluation"] = evaluate(candidate, self.training)
        if self.training.setup.random.active:
            record["drawn_rigs"] = on_drawn_rigs(
                network, self.training.judges(TRIALS), judging(FINAL_SEED, self.training.seed)
            )
        write_policy(path, network, record, parameters_of(self.model))
        write_record(path.with_suffix(".json"), record)
        remove_checkpoints(self.folder)
        return record


def _started(training: Training, folder: Path, clock: Clock) -> _Run:
    """A run from nothing."""
    remove_checkpoints(folder)  # of a run that was killed before its first one
    return _Run(training, folder, make_model(training), clock, Progress())


def _resumed(training: Training, path: Path, folder: Path, trust: bool, clock: Clock) -> _Run:
    """The interrupted run in `folder`, or the finished policy at `path`, to be gone on with."""
    kept = read_checkpoint(folder)
    source = path if kept is None else folder
    if kept is None and not path.exists():
        raise ValueError(f"--resume: there is neither {folder} nor {path} to go on from; leave --resume out")
    known = read_record(path) if kept is None else kept[0]
    try:
        check_same(training, known, source, "ask for the same, or train anew under another name")
    except ValueError as error:
        raise ValueError(f"--resume: {error}") from error
    before = progress_of(known, source)
    done = before.steps
    if kept is not None and before.seed not in (None, training.seed):
        raise ValueError(
            f"--resume: {source} was begun with --seed {before.seed}, and now {training.seed} is asked for; "
            f"give --seed {before.seed}, or train anew under another name"
        )
    if kept is None and done >= training.steps:  # a checkpoint as far as that has yet to be made a policy
        raise ValueError(f"--resume: {source} has {done} steps already; give --steps a larger number (the total)")
    if kept is None and from_stable_baselines3(path):
        if not trust:
            raise ValueError(refusal(path))
        model = load_sb3(path, training.recipe.name, learning_env(training))
        best = parameters_of(model)
    else:
        model = make_model(training)
        try:
            arrays = {"best": read_learning(path)} if kept is None else kept[1]
            best = arrays["best"]
            put_parameters(model, best)  # both must fit, so that the best one cannot fail at the end
            put_parameters(model, arrays.get("model", best))
            if training.recipe.off_policy and "memory" in arrays:
                put_memory(model, arrays["memory"])
        except (ValueError, KeyError) as error:
            raise ValueError(f"--resume: {source}: {error}; train anew under another name") from error
    if training.recipe.off_policy:  # a memory that is empty fills by chance first, as at a run's start
        memory = model.replay_buffer
        model.learning_starts += done - memory.size() * memory.n_envs
    model.num_timesteps = done  # the network of a finished policy is the best, not the last
    before.resumed_at.append(done)
    if kept is None and before.seed is not None:
        before.earlier_seeds.append(before.seed)
    run = _Run(training, folder, model, clock, before, best)
    if kept is not None and "running" not in kept[1]:
        raise ValueError(f"--resume: {source} was written by an earlier version; remove it and train anew")
    if kept is not None:
        try:
            put_running_state(model, run.rigs, kept[1]["running"])
        except (ValueError, KeyError, RuntimeError) as error:
            raise ValueError(f"--resume: {source}: {error}; train anew under another name") from error
    else:
        model.set_random_seed(training.seed + RESUMED_SEED + done)  # other episodes than those that it has seen
    return run
