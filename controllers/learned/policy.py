"""Policies learned on `FurutaID-v0`, played from encoder readings like any controller."""

import math
import os
import warnings
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.arguments import ArgumentError
from furuta_gym.envs.options import SAMPLE_TIME, SHORTEST_SAMPLE, SPEED_LIMIT, TASKS, Options
from furuta_gym.plant import Plant
from furuta_gym.plant.plant_file import ARM_TRAVEL
from furuta_gym.sensors import FilteredDifference, Sensors
from furuta_gym.simulation import period_of, same_clock

from ..base import Controller, Reference
from ..design import choose_sensors
from .layers import Network
from .policy_file import from_stable_baselines3, read_policy, read_record
from .sb3_files import FRAME
from .trained_for import never_met


class LearnedController(Controller):
    """A policy on the env's observation, rebuilt from readings: [q1, sin q2, cos q2, q̇1, q̇2] and, with
    `observe_command`, the last command / u_max, as the plant's supply and slew let it pass; `history` of them, oldest
    first.

    predict: observations (L, n) to actions (L, 1), such as a `Network`, or a function without a memory: one is shared
    by all copies, and `reset` does not clear it. velocity_cutoff [rad/s]: default is that of the encoders.
    normalized: actions are shares of `trained_u_max`, the command's limit where it was trained (default: the plant's),
    and so is the last command that it sees. every: the policy looks and acts at every n-th call and holds its command
    in between, so that one trained at n · sample_time plays on a faster clock exactly as it was trained. Only where the
    rig's slew limits a command, loop and env differ: see rule 6 of `controllers.envelope`. record: of the training,
    see `policy_file.read_record`; a comparison says from it how the policy was trained.
    """

    def __init__(
        self,
        name: str,
        predict: Any,
        plant: Plant,
        sample_time: float,
        *,
        velocity_cutoff: float | None = None,
        history: int = 1,
        observe_command: bool = False,
        normalized: bool = False,
        trained_u_max: float | None = None,
        every: int = 1,
        sensors: Sensors | None = None,
        arm_limit: float = ARM_TRAVEL,
        tasks: tuple[str, ...] = ("balance",),
        reference: Reference = 0.0,
        record: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(name, sample_time, plant.u_max, reference)
        self.plant, self.unit = plant, plant.unit
        self.sensors = choose_sensors(plant, sensors)
        self.predict, self.record = predict, dict(record or {})
        self.tasks = tasks
        self.history = history
        self.observe_command = observe_command
        self.trained_u_max = float(trained_u_max or plant.u_max)
        self.scale = self.trained_u_max if normalized else 1.0
        self.every = every
        self.arm_limit = arm_limit
        self.velocity_cutoff = self.sensors.velocity_cutoff if velocity_cutoff is None else velocity_cutoff
        self.supply, self.slew = plant.supply, plant.limit("slew", np.inf)
        self._velocity = FilteredDifference(self.velocity_cutoff)
        self._start()

    def __deepcopy__(self, memo: dict[int, Any]) -> "LearnedController":
        twin = object.__new__(type(self))
        vars(twin).update(vars(self))  # the network is shared; it has no state of its own
        twin._velocity = FilteredDifference(self.velocity_cutoff)
        twin._start()
        return twin

    def _start(self) -> None:
        self._velocity.reset()
        self._frames: list[NDArray[np.float32]] = []
        self._last: Any = 0.0
        self._passed: Any = 0.0
        self._calls = 0
        self._act = self.predict.begin() if isinstance(self.predict, Network) else self.predict

    def _command(self, y: NDArray[np.float64], reference: float) -> Any:
        self._calls += 1
        if (self._calls - 1) % self.every:
            return self._last
        q1, q2 = y[0], y[1]
        v1, v2 = self._velocity.update(q1, q2, self.every * self.sample_time)
        limit = 2 * self.arm_limit
        frame = [
            np.clip(q1 - reference, -limit, limit),
            np.sin(q2),
            np.cos(q2),
            np.clip(v1 + 0.0 * q1, -SPEED_LIMIT, SPEED_LIMIT),
            np.clip(v2 + 0.0 * q1, -SPEED_LIMIT, SPEED_LIMIT),
        ]
        if self.observe_command:
            self._passed = self._let_pass(self._passed)
            frame.append(self._passed / self.trained_u_max + 0.0 * q1)
        newest = np.atleast_2d(np.stack(frame, axis=-1)).astype(np.float32)
        self._frames = [*self._frames[1:], newest] if self._frames else [newest] * self.history
        action = np.asarray(self._act(np.concatenate(self._frames, axis=1)), dtype=float).reshape(-1)
        u = np.clip(self.scale * action, -self.u_max, self.u_max)
        self._last = u if y.ndim == 2 else float(u[0])
        return self._last

    def _let_pass(self, before: Any) -> Any:
        """What supply and slew let pass of the last command, after a period under it."""
        wanted = np.clip(self._last, -self.supply, self.supply)
        most = self.slew * self.every * self.sample_time
        return wanted if most == np.inf else before + np.clip(wanted - before, -most, most)


def trained_sample_time(path: str | os.PathLike[str], plant: Plant) -> float:
    """The policy's period [s]: that of its record; without one, what `FurutaID-v0` takes for `plant`."""
    return _period(_settings(Path(path), read_record(path))[0], plant)


def _period(env: Mapping[str, Any], plant: Plant) -> float:
    return float(env.get("sample_time") or plant.sample_time or SAMPLE_TIME)


def _clock(plant: Plant, trained: float) -> float:
    """The plant's sample time, on every n-th of which the policy acts; its own period where that does not fit."""
    T = plant.sample_time or trained
    return T if same_clock(max(1, round(trained / T)) * T, trained) else trained


def load_policy(
    path: str | os.PathLike[str],
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    *,
    trust: bool = False,
    **options: Any,
) -> LearnedController:
    """The policy in `path` as a controller for `plant`.

    sample_time [s]: of the loop that it is played in; default is the plant's where the trained period is a multiple
    of it, else that period. trust: also read a zip of stable-baselines3, which runs what is in it. The training record
    says how the policy saw the env. Without a record the period is that of `trained_sample_time`, the observation's
    size gives the history, and an action space of ±1 means shares of u_max. Raises FileNotFoundError, or ValueError if
    the file is no policy, was made for another observation, for scaled ones, for a plant whose command has another
    unit, or for a sample time that is no multiple of the one asked for.
    """
    path = Path(path)
    network, record = read_policy(path, trust)
    env, rig = _settings(path, record)
    if rig.get("unit", plant.unit) != plant.unit:
        raise ValueError(
            f"{path} was trained on a plant whose command is in {rig['unit']}; this plant's is in {plant.unit}"
        )
    trained = _period(env, plant)
    T = _clock(plant, trained) if sample_time is None else period_of(sample_time)
    every = max(1, round(trained / T))
    if not same_clock(every * T, trained):
        if env.get("sample_time") is None:
            mend = f"Give --sample-time {trained:g} (sample_time in Python), or train it again by `furuta train`"
            if from_stable_baselines3(path):
                mend = f'Write its own into {path.with_suffix(".json")}, as {{"env": {{"sample_time": 0.02}}}}'
            raise ValueError(
                f"{path} has no record of its sample time, so {trained:g} s are taken, which FurutaID-v0 has for this "
                f"plant, and it cannot play at {T:g} s. {mend}"
            )
        raise ValueError(
            f"{path} was trained with a sample time of {trained:g} s and cannot play at {T:g} s. "
            f"Give --sample-time {trained:g} (sample_time in Python) or a whole fraction of it, or train it again at "
            f"{T:g} s"
        )
    observe_command = bool(env.get("observe_command", False))
    frame = FRAME + observe_command
    history = env.get("history") or network.size // frame
    if network.size != history * frame:
        raise ValueError(
            f"{path} was made for observations of shape ({network.size},); "
            f"FurutaID-v0 with history={max(history, 1)} gives ({max(history, 1) * frame},)"
        )
    if env.get("scale_observation") or env.get("action_time") is not None:
        raise ValueError(
            f"{path} was trained on observations that a controller does not make: scaled ones, or with speeds from "
            "faster samples (action_time), as FurutaBalance-v0 and FurutaSwingUp-v0 have them. Train a policy for "
            "other uses on FurutaID-v0 without scale_observation and action_time"
        )
    shares = abs(network.limit - 1.0) < 1e-6 and abs(plant.u_max - 1.0) > 1e-6
    _check_actions(path, network.limit, env.get("normalize_action"), rig.get("u_max", plant.u_max))
    if from_stable_baselines3(path) and not env:
        period = f"a period of {trained:g} s and actions in {'shares of u_max' if shares else plant.unit}"
        warnings.warn(
            f"{path} has no record of its environment; the task balance, {period} are assumed. Write its options into "
            f'{path.with_suffix(".json")}, as {{"env": {{"task": "swing_up", "sample_time": 0.02}}}}',
            stacklevel=2,
        )
    elif from_stable_baselines3(path) and env.get("normalize_action", shares) and "u_max" not in rig:
        warnings.warn(
            f"the record of {path} does not say the u_max of the plant that it was trained on; this plant's "
            f"{plant.u_max:g} {plant.unit} is assumed, and scales every action. Write it into "
            f'{path.with_suffix(".json")}: "plant": {{"u_max": {plant.u_max:g}, "unit": "{plant.unit}"}}',
            stacklevel=2,
        )
    settings: dict[str, Any] = {
        "velocity_cutoff": float(env.get("velocity_cutoff") or choose_sensors(plant, sensors).velocity_cutoff),
        "arm_limit": float(env.get("arm_limit") or _trained_travel(rig, plant)),
        "tasks": ("balance", "swing_up") if env.get("task") == "swing_up" else ("balance",),
    }
    return LearnedController(
        path.name,
        network,
        plant,
        T,
        history=history,
        observe_command=observe_command,
        normalized=bool(env.get("normalize_action", shares)),
        trained_u_max=rig.get("u_max"),
        every=every,
        sensors=sensors,
        record=record,
        **settings | options,
    )


def load_to_export(
    path: str | os.PathLike[str], plant: Plant, sample_time: float | None = None, *, trust: bool = False
) -> LearnedController:
    """As `load_policy`, for an export, whose step is called at the policy's own period.

    Raises ValueError as there, and for a sample_time [s] that is not that period. Warns of what the plant has and no
    episode of the training had."""
    controller = load_policy(path, plant, trust=trust)
    if missing := not_trained_for(path, plant):
        warnings.warn(missing, stacklevel=2)
    period = controller.every * controller.sample_time
    if sample_time is not None and not same_clock(period_of(sample_time), period):
        fault = f"expected {period:g} s, at which this policy acts, or no sample time"
        raise ArgumentError("sample_time", f"{sample_time:g}", fault)
    return controller


def not_trained_for(path: str | os.PathLike[str], plant: Plant) -> str:
    """What a plant has and no episode of a policy's training had, in a sentence; "" where that is nothing."""
    missing = ", ".join(never_met(read_record(path), plant))
    advice = "Play it on this plant before the rig does: furuta compare --plant PLANT --controllers POLICY"
    return f"{path} was trained without {missing}. {advice}" if missing else ""


def _check_actions(path: Path, largest: float, normalized: bool | None, u_max: float) -> None:
    """Raise ValueError where the record of a policy of stable-baselines3 says other actions than the policy has."""
    if normalized is None or not from_stable_baselines3(path):
        return
    shares = abs(largest - 1.0) < 1e-6
    if shares != normalized and abs(u_max - 1.0) > 1e-6:
        raise ValueError(
            f"{path} gives actions up to {largest:g}, and its record says normalize_action = "
            f"{str(normalized).lower()}, so up to {1.0 if normalized else u_max:g}. Mend the record: true for actions "
            'in [-1, 1], false for commands. If it was trained on a plant with u_max = 1, add "plant": {"u_max": 1.0}'
        )


def _trained_travel(rig: Mapping[str, Any], plant: Plant) -> float:
    """The env's own default of the arm's limit [rad]: that of the plant of the training, where the record has it."""
    if rig.get("theta"):
        return float((rig.get("limits") or {}).get("arm_travel") or ARM_TRAVEL)
    return plant.limit("arm_travel", ARM_TRAVEL)


# as the env and the plant file have them
_RANGES = {"sample_time": (SHORTEST_SAMPLE, 1.0), "velocity_cutoff": (1e-12, 1e12), "arm_limit": (1e-12, 1e9)}


def _settings(path: Path, record: Mapping[str, Any]) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """What the record says of the env and of the plant, each value of its type and within the env's own limits."""
    env, rig = record.get("env") or {}, record.get("plant") or {}
    if not isinstance(env, Mapping) or not isinstance(rig, Mapping):
        raise ValueError(f'{path}: "env" and "plant" of the training record must be mappings')
    if strange := sorted(set(env) - {f.name for f in fields(Options)} - {"max_episode_steps", "render_mode"}):
        raise ValueError(f"{path}: the training record names options that no env has: {', '.join(strange)}")
    wrong = [f"{n} = {env[n]!r}" for n, span in _RANGES.items() if env.get(n) is not None and not _within(env[n], span)]
    wrong += [
        f"{n} = {env[n]!r}" for n in ("observe_command", "normalize_action") if type(env.get(n, True)) is not bool
    ]
    history, task = env.get("history"), env.get("task", "balance")
    if history is not None and not (type(history) is int and 1 <= history <= 100):
        wrong.append(f"history = {history!r}")
    if task not in TASKS:
        wrong.append(f"task = {task!r}")
    limits, effects = rig.get("limits") or {}, rig.get("effects") or []
    if not (isinstance(limits, Mapping) and all(x is None or _within(x, (0.0, math.inf)) for x in limits.values())):
        wrong.append(f"limits = {limits!r}")
    if not (isinstance(effects, list) and all(isinstance(effect, Mapping) for effect in effects)):
        wrong.append(f"effects = {effects!r}")
    if not isinstance(env.get("effect_probabilities") or {}, Mapping):
        wrong.append(f"effect_probabilities = {env['effect_probabilities']!r}")
    for told in (env.get("randomize"), rig.get("randomize")):
        if not isinstance(told if told is not None else False, bool | str | list | Mapping):
            wrong.append(f"randomize = {told!r}")
    if not _within(rig.get("u_max", 1.0), (1e-300, 1e300)):
        wrong.append(f"u_max = {rig['u_max']!r}")
    if wrong:
        raise ValueError(f"{path}: the training record has values that no env has: {', '.join(wrong)}")
    return env, rig


def _within(value: Any, span: tuple[float, float]) -> bool:
    return type(value) in (int, float) and span[0] <= value <= span[1]
