"""Files of stable-baselines3. Reading one runs what is pickled in it: only for those who said that they trust it."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from furuta_gym.envs.options import SPEED_LIMIT
from furuta_gym.extras import install

from .layers import Network, network_of


def algorithm_class(name: str) -> Any:
    """The class of stable-baselines3 or sb3-contrib. Raises ValueError without them or for another name."""
    try:
        import stable_baselines3

        if hasattr(stable_baselines3, name):
            return getattr(stable_baselines3, name)
        import sb3_contrib

        return getattr(sb3_contrib, name)
    except ImportError as error:
        raise ValueError(f"this needs stable-baselines3 ({error}); {install('rl')}") from error
    except AttributeError:
        raise ValueError(f"no algorithm {name!r} in stable-baselines3 or sb3-contrib") from None


def read_sb3(path: Path, record: dict[str, Any]) -> tuple[Network, dict[str, Any]]:
    """The network of a trusted zip and the record given. Raises ValueError for one that `network_of` refuses."""
    model = load_sb3(path, str(record.get("algorithm") or algorithm_of(path)))
    shape, actions = model.observation_space.shape, model.action_space.shape
    if len(shape or ()) != 1 or actions != (1,):
        raise ValueError(f"{path} was made for observations of shape {shape} and actions of shape {actions}")
    env = record.get("env") or {}  # which then says it if observations were scaled
    if _scaled(model.observation_space) and isinstance(env, Mapping):
        record = record | {"env": {**env, "scale_observation": True}}
    return network_of(model), record


def _scaled(space: Any) -> bool:
    """Whether the bound of the arm's speed is another than that of observations in rad/s."""
    return space.shape[0] > 3 and abs(float(space.high[3]) - SPEED_LIMIT) > 1e-3


def load_sb3(path: Path, algorithm: str, env: Any = None) -> Any:
    """The model in a trusted zip. Raises ValueError if it cannot be read."""
    try:
        return algorithm_class(algorithm).load(path, env=env, device="cpu")
    except (ValueError, KeyError, AssertionError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: cannot be read as a stable-baselines3 policy: {error}") from error


def algorithm_of(path: Path) -> str:
    """The algorithm that wrote a zip, from the module of its policy class; runs nothing."""
    try:
        with zipfile.ZipFile(path) as archive:
            data = json.loads(archive.read("data"))
        module = data["policy_class"]["__module__"]  # such as stable_baselines3.sac.policies
    except (zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no policy that stable-baselines3 saved: {error}") from error
    if module.startswith(("sb3_contrib.common.recurrent", "controllers.remembering")):
        return "RecurrentPPO"
    if module.startswith("stable_baselines3.common"):
        return "PPO"  # A2C shares its policies; a record tells them apart
    return module.split(".")[1].upper()
