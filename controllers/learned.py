"""Policies trained with stable-baselines3 on `FurutaID-v0`, played from encoder readings like any controller."""

import json
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.envs.options import SAMPLE_TIME
from furuta_gym.plant import Plant
from furuta_gym.sensors import FilteredDifference, Sensors

from .base import Controller, Reference
from .design import choose_sensors

FRAME = 5  # q1, sin q2, cos q2, q̇1, q̇2
SPEED_LIMIT = 200.0  # rad/s, as in the env's observation


class LearnedController(Controller):
    """A policy on the env's observation, rebuilt from readings: [q1, sin q2, cos q2, q̇1, q̇2] and, with
    `observe_command`, the last command / u_max; `history` of them, oldest first.

    predict: observations (L, n) to actions (L, 1). normalized: actions are shares of `trained_u_max`, the command's
    limit where it was trained (default: the plant's), and so is the last command that it sees. every: the policy looks
    and acts at every n-th call and holds its command in between, so that one trained at n · sample_time plays on a
    faster clock exactly as it was trained.
    """

    def __init__(
        self,
        name: str,
        predict: Any,
        plant: Plant,
        sample_time: float,
        *,
        velocity_cutoff: float = 100.0,
        history: int = 1,
        observe_command: bool = False,
        normalized: bool = False,
        trained_u_max: float | None = None,
        every: int = 1,
        arm_limit: float = 2 * np.pi,
        tasks: tuple[str, ...] = ("balance",),
        reference: Reference = 0.0,
    ) -> None:
        super().__init__(name, sample_time, plant.u_max, reference)
        self.plant, self.unit = plant, plant.unit
        self.predict = predict
        self.tasks = tasks
        self.history = history
        self.observe_command = observe_command
        self.trained_u_max = float(trained_u_max or plant.u_max)
        self.scale = self.trained_u_max if normalized else 1.0
        self.every = every
        self.arm_limit = arm_limit
        self.velocity_cutoff = velocity_cutoff
        self._velocity = FilteredDifference(velocity_cutoff)
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
        self._calls = 0

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
            frame.append(self._last / self.trained_u_max + 0.0 * q1)
        newest = np.atleast_2d(np.stack(frame, axis=-1)).astype(np.float32)
        self._frames = [*self._frames[1:], newest] if self._frames else [newest] * self.history
        action = np.asarray(self.predict(np.concatenate(self._frames, axis=1)), dtype=float).reshape(-1)
        u = np.clip(self.scale * action, -self.u_max, self.u_max)
        self._last = u if y.ndim == 2 else float(u[0])
        return self._last


class _Network:
    """A stable-baselines3 model that is read when first asked, also after a trip to another process."""

    def __init__(self, path: Path, algorithm: str) -> None:
        self.path, self.algorithm, self._model = path, algorithm, None

    def __getstate__(self) -> dict[str, Any]:
        return {"path": self.path, "algorithm": self.algorithm, "_model": None}

    def model(self) -> Any:
        if self._model is None:
            self._model = algorithm_class(self.algorithm).load(self.path, device="cpu")
        return self._model

    def __call__(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        return self.model().predict(observation, deterministic=True)[0]


def algorithm_class(name: str) -> Any:
    """The class of stable-baselines3 or sb3-contrib. Raises ValueError without them or for another name."""
    try:
        import stable_baselines3

        if hasattr(stable_baselines3, name):
            return getattr(stable_baselines3, name)
        import sb3_contrib

        return getattr(sb3_contrib, name)
    except ImportError as error:
        raise ValueError(
            f"learned policies need stable-baselines3 ({error}); install it with `pip install 'furuta-gym[rl]'`"
        ) from error
    except AttributeError:
        raise ValueError(f"no algorithm {name!r} in stable-baselines3 or sb3-contrib") from None


def read_record(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The training record beside a policy, `policy.json` beside `policy.zip`; empty if there is none.

    Used here: "algorithm", and "env", the options of `FurutaID-v0` that the policy was trained with.
    """
    file = Path(path).with_suffix(".json")
    if not file.exists():
        return {}
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file}: the training record is not JSON: {error}") from error
    if not isinstance(record, dict):
        raise ValueError(f'{file}: a training record is a mapping with "algorithm" and "env"')
    return record


def trained_sample_time(path: str | os.PathLike[str], plant: Plant) -> float:
    """The policy's period [s] from its record; without one, what the env takes for `plant`."""
    return float((read_record(path).get("env") or {}).get("sample_time") or plant.sample_time or SAMPLE_TIME)


def _clock(plant: Plant, trained: float) -> float:
    """The plant's sample time, on every n-th of which the policy acts; its own period where that does not fit."""
    T = plant.sample_time or trained
    return T if abs(max(1, round(trained / T)) * T - trained) < 1e-9 else trained


def load_policy(
    path: str | os.PathLike[str],
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    **options: Any,
) -> LearnedController:
    """The policy in `path` (stable-baselines3's zip) as a controller for `plant`.

    sample_time [s]: of the loop that it is played in; default is the plant's where the trained period is a multiple
    of it, else that period. The training record says how the policy saw the env. Without a record the observation's
    size gives the history, and an action space of ±1 means shares of u_max. Raises FileNotFoundError, or ValueError
    if the file is no policy, was made for another observation, for a plant whose command has another unit, or for a
    sample time that is no multiple of the one asked for.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"no policy at {path}; train one with `furuta train … -o {path}`")
    record = read_record(path)
    env: Mapping[str, Any] = record.get("env") or {}
    rig: Mapping[str, Any] = record.get("plant") or {}
    if rig.get("unit", plant.unit) != plant.unit:
        raise ValueError(
            f"{path} was trained on a plant whose command is in {rig['unit']}; this plant's is in {plant.unit}"
        )
    trained = trained_sample_time(path, plant)
    T = float(sample_time or _clock(plant, trained))
    every = max(1, round(trained / T))
    if env.get("sample_time") is None:  # nothing is known: it acts at every sample
        every = 1
    elif abs(every * T - trained) > 1e-9:
        raise ValueError(
            f"{path} was trained with a sample time of {trained:g} s and is asked to play at {T:g} s; "
            f"pass sample_time={trained:g} or a whole fraction of it, or train it again at {T:g} s"
        )
    network = _Network(path, str(record.get("algorithm") or _algorithm_of(path)))
    try:
        model = network.model()
    except (ValueError, KeyError, AssertionError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: cannot be read as a stable-baselines3 policy: {error}") from error
    observe_command = bool(env.get("observe_command", False))
    frame = FRAME + observe_command
    shape = model.observation_space.shape or ()
    history = int(env.get("history", 0)) or (shape[0] // frame if len(shape) == 1 else 0)
    if shape != (history * frame,) or model.action_space.shape != (1,):
        raise ValueError(
            f"{path} was made for observations of shape {shape} and actions of shape {model.action_space.shape}; "
            f"FurutaID-v0 with history={max(history, 1)} gives ({max(history, 1) * frame},) and takes (1,)"
        )
    if abs(float(model.observation_space.high[3]) - SPEED_LIMIT) > 1e-3:
        raise ValueError(
            f"{path} was trained on scaled observations with speeds from faster samples, as FurutaBalance-v0 and "
            "FurutaSwingUp-v0 give them, which only those environments can play; train it with `furuta train`"
        )
    high = float(model.action_space.high[0])
    normalized = bool(env.get("normalize_action", abs(high - 1.0) < 1e-6 and abs(plant.u_max - 1.0) > 1e-6))
    task = str(env.get("task", "balance"))
    settings = {
        "velocity_cutoff": float(env.get("velocity_cutoff") or choose_sensors(plant, sensors).velocity_cutoff),
        "arm_limit": float(env.get("arm_limit") or 2 * np.pi),
        "tasks": ("balance", "swing_up") if task == "swing_up" else ("balance",),
    }
    return LearnedController(
        path.name,
        network,
        plant,
        T,
        history=history,
        observe_command=observe_command,
        normalized=normalized,
        trained_u_max=rig.get("u_max"),
        every=every,
        **settings | options,
    )


def _algorithm_of(path: Path) -> str:
    """The algorithm that wrote a policy, from the module of its policy class inside the zip."""
    try:
        with zipfile.ZipFile(path) as archive:
            data = json.loads(archive.read("data"))
        module = data["policy_class"]["__module__"]  # such as stable_baselines3.sac.policies
    except (zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no policy that stable-baselines3 saved: {error}") from error
    if module.startswith("stable_baselines3.common"):
        return "PPO"  # A2C shares its policies; a record tells them apart
    return module.split(".")[1].upper()
