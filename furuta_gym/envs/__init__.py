"""Gymnasium environments of the Furuta pendulum, each as one env or as a compiled batch.

`FurutaID-v0` is the rig as its computer has it: command units, a step for each sample. `FurutaBalance-v0` and
`FurutaSwingUp-v0` are the same rig as learners want it: `registration.TASK_OPTIONS` says by which options.

Importing this package needs Gymnasium only; the compiled code is loaded when an environment is made.
"""

from typing import TYPE_CHECKING, Any

from .registration import ENV_ID, MAX_EPISODE_STEPS, TASK_IDS, options_of, register

if TYPE_CHECKING:
    from .furuta import FurutaEnv
    from .vector import FurutaVectorEnv

__all__ = ["ENV_ID", "MAX_EPISODE_STEPS", "TASK_IDS", "FurutaEnv", "FurutaVectorEnv", "options_of", "register"]


def __getattr__(name: str) -> Any:
    if name == "FurutaEnv":
        from .furuta import FurutaEnv

        return FurutaEnv
    if name == "FurutaVectorEnv":
        from .vector import FurutaVectorEnv

        return FurutaVectorEnv
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
