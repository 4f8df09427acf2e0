"""Gymnasium environments of the Furuta pendulum: `FurutaID-v0`, one env or a compiled batch of them.

Importing this package needs Gymnasium only; the compiled code is loaded when an environment is made.
"""

from typing import TYPE_CHECKING, Any

from .registration import ENV_ID, MAX_EPISODE_STEPS, register

if TYPE_CHECKING:
    from .furuta import FurutaEnv
    from .vector import FurutaVectorEnv

__all__ = ["ENV_ID", "MAX_EPISODE_STEPS", "FurutaEnv", "FurutaVectorEnv", "register"]


def __getattr__(name: str) -> Any:
    if name == "FurutaEnv":
        from .furuta import FurutaEnv

        return FurutaEnv
    if name == "FurutaVectorEnv":
        from .vector import FurutaVectorEnv

        return FurutaVectorEnv
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
