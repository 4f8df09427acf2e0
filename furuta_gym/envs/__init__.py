"""Gymnasium environments of the Furuta pendulum: `FurutaID-v0`, one env or a compiled batch of them.

Importing this package needs Gymnasium only; the compiled code is loaded when an environment is made.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .furuta import FurutaEnv
    from .vector import FurutaVectorEnv

__all__ = ["ENV_ID", "MAX_EPISODE_STEPS", "FurutaEnv", "FurutaVectorEnv", "register"]

ENV_ID = "FurutaID-v0"
MAX_EPISODE_STEPS = 1000  # 10 s at the default 100 Hz


def register() -> None:
    """Make `FurutaID-v0` known to Gymnasium; calling it again changes nothing."""
    from gymnasium.envs.registration import register as gymnasium_register
    from gymnasium.envs.registration import registry

    if ENV_ID not in registry:
        gymnasium_register(
            id=ENV_ID,
            entry_point="furuta_gym.envs.furuta:FurutaEnv",
            vector_entry_point="furuta_gym.envs.vector:FurutaVectorEnv",
            max_episode_steps=MAX_EPISODE_STEPS,
        )


def __getattr__(name: str) -> Any:
    if name == "FurutaEnv":
        from .furuta import FurutaEnv

        return FurutaEnv
    if name == "FurutaVectorEnv":
        from .vector import FurutaVectorEnv

        return FurutaVectorEnv
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
