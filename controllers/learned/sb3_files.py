"""Files of stable-baselines3. Reading one runs what is pickled in it: only for those who said that they trust it."""

from __future__ import annotations

import json
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from furuta_gym.envs.options import SPEED_LIMIT
from furuta_gym.extras import install

from .layers import Network, network_of

FRAME = 5  # q1, sin q2, cos q2, q̇1, q̇2
_SPELLED = {"crossq": "CrossQ"}  # the others are capitals


def algorithm_class(name: str) -> Any:
    """The class of stable-baselines3 or sb3-contrib. Raises ValueError without them or for another name."""
    try:
        import stable_baselines3
        from stable_baselines3.common.base_class import BaseAlgorithm

        found = getattr(stable_baselines3, name, None)
        if found is None:
            import sb3_contrib

            found = getattr(sb3_contrib, name, None)
    except ImportError as error:
        raise ValueError(f"this needs stable-baselines3 ({error}); {install('rl')}") from error
    if not (isinstance(found, type) and issubclass(found, BaseAlgorithm)):
        raise ValueError(f"no algorithm {name!r} in stable-baselines3 or sb3-contrib")
    return found


def read_sb3(path: Path, record: dict[str, Any]) -> tuple[Network, dict[str, Any]]:
    """The network of a trusted zip and the record given, with steps and seed of the zip where it does not say them.

    Raises ValueError for one that `network_of` refuses, and for one that learned from normalised observations."""
    model = load_sb3(path, str(record.get("algorithm") or algorithm_of(path)))
    shape, actions = model.observation_space.shape, model.action_space.shape
    if len(shape or ()) != 1 or actions != (1,):
        raise ValueError(f"{path} was made for observations of shape {shape} and actions of shape {actions}")
    env = record.get("env") or {}  # which then says it if observations were scaled
    frame = FRAME + bool(isinstance(env, Mapping) and env.get("observe_command"))
    ours = "schema" in record or "normalized_observations" in record
    if model.num_timesteps and getattr(model, "_last_obs", None) is None and not ours:
        warnings.warn(
            f"{path} was loaded and saved again, so it does not show whether it learned from VecNormalize, whose "
            f'statistics are not played. If it did not, write "normalized_observations": false into '
            f"{path.with_suffix('.json')}",
            stacklevel=2,
        )
    if record.get("normalized_observations", False) is not False or _normalised(model, frame):
        raise ValueError(
            f"{path} was trained on normalised observations: its record says so, or the sine and the cosine that it "
            "saw last are those of no angle. The running statistics of VecNormalize or NormalizeObservation are not "
            "played from readings. Train without, and scale observations by constants inside the network, see "
            "docs/how-to/own_training_script.md"
        )
    if _scaled(model.observation_space) and isinstance(env, Mapping):
        record = record | {"env": {**env, "scale_observation": True}}
    own = {"steps": model.num_timesteps, "seed": model.seed}
    return network_of(model), record | {name: value for name, value in own.items() if record.get(name) is None}


def _normalised(model: Any, frame: int) -> bool:
    """Whether the newest frame of the observations (L, n) that the model saw last is none of the env's."""
    seen = getattr(model, "_last_obs", None)
    n = model.observation_space.shape[0]
    if seen is None or n % frame:
        return False
    newest = np.asarray(seen, dtype=float).reshape(-1, n)[:, n - frame :]
    return bool(np.abs(np.hypot(newest[:, 1], newest[:, 2]) - 1.0).max() > 1e-3)


def _scaled(space: Any) -> bool:
    """Whether the bound of the arm's speed is another than that of observations in rad/s."""
    return space.shape[0] > 3 and abs(float(space.high[3]) - SPEED_LIMIT) > 1e-3


def load_sb3(path: Path, algorithm: str, env: Any = None) -> Any:
    """The model in a trusted zip. Raises ValueError if it cannot be read."""
    try:
        return algorithm_class(algorithm).load(path, env=env, device="cpu")
    except (ValueError, KeyError, AssertionError, AttributeError, TypeError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: cannot be read as a {algorithm} policy of stable-baselines3: {error}") from error


def algorithm_of(path: Path) -> str:
    """The algorithm that wrote a zip, from the module of its policy class; runs nothing.

    Raises ValueError for a zip of something else, and where the policy class is no algorithm's own."""
    try:
        with zipfile.ZipFile(path) as archive:
            data = json.loads(archive.read("data"))
        module = str(data["policy_class"]["__module__"])  # such as stable_baselines3.sac.policies
    except (zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no policy that stable-baselines3 saved: {error}") from error
    if module.startswith(("sb3_contrib.common.recurrent", "controllers.training.remembering")):
        return "RecurrentPPO"
    if module.startswith("stable_baselines3.common"):
        return "PPO"  # A2C shares its policies; a record tells them apart
    library, _, inside = module.partition(".")
    algorithm = inside.partition(".")[0]
    if library not in ("stable_baselines3", "sb3_contrib") or algorithm in ("", "common"):
        raise ValueError(
            f"{path}: the module of its policy class, {module}, does not tell the algorithm; write it into "
            f'{path.with_suffix(".json")}, as {{"algorithm": "PPO"}}'
        )
    return _SPELLED.get(algorithm, algorithm.upper())
