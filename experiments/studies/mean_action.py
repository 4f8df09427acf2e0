"""The mean action of a training script while it learns, judged as learners of stable-baselines3 are.

It is found where CleanRL keeps it: the script's own `agent.actor_mean`, and the wrappers of its first environment, with
the statistics of observations that they have by then. The training goes on as if nothing had been asked: no random
number is drawn, no statistic moves.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import gymnasium
import numpy as np
from gymnasium.wrappers import ClipAction, NormalizeObservation
from numpy.typing import NDArray

Array = NDArray[np.float32]
Policy = Callable[[Array], Array]


def wrappers_of(envs: Any, own: gymnasium.Env) -> list[gymnasium.Wrapper] | None:
    """What stands around `own` where it is the first of `envs`, innermost first.

    None where `envs` is no `SyncVectorEnv`, or where a wrapper changes observations or actions in a way that is not
    known here.
    """
    if not isinstance(envs, gymnasium.vector.SyncVectorEnv):
        return None
    found: list[gymnasium.Wrapper] = []
    outer: Any = envs.envs[0]
    while outer is not own:
        if not isinstance(outer, gymnasium.Wrapper) or not _known(outer):
            return None
        found.append(outer)
        outer = outer.env
    return found[::-1]


def _known(wrapper: gymnasium.Wrapper) -> bool:
    if isinstance(wrapper, gymnasium.ActionWrapper):
        return isinstance(wrapper, ClipAction)
    return isinstance(wrapper, gymnasium.ObservationWrapper) or (
        wrapper.observation_space == wrapper.env.observation_space
    )


@contextmanager
def mean_policy(own: gymnasium.Env) -> Iterator[tuple[Policy, int] | None]:
    """The running script's policy without noise, for observations (L, n) of `own`, and the number of its environments.

    None where the script keeps no `agent.actor_mean` and `envs`, or where `own` is not the first of them. Statistics
    of observations stand still inside of the context.
    """
    script = sys.modules["__main__"]
    actor = getattr(getattr(script, "agent", None), "actor_mean", None)
    envs: Any = getattr(script, "envs", None)
    stack = None if actor is None else wrappers_of(envs, own)
    if actor is None or stack is None:
        yield None
        return
    import torch

    changes = [w for w in stack if isinstance(w, gymnasium.ObservationWrapper)]
    place = next(actor.parameters()).device

    def policy(seen: Array) -> Array:
        rows = list(seen)
        for wrapper in changes:
            rows = [wrapper.observation(row) for row in rows]
        with torch.no_grad():
            mean = actor(torch.as_tensor(np.stack(rows), dtype=torch.float32, device=place))
        return mean.cpu().numpy().clip(-1.0, 1.0)

    with ExitStack() as later:
        for wrapper in changes:
            if isinstance(wrapper, NormalizeObservation):
                later.callback(setattr, wrapper, "update_running_mean", wrapper.update_running_mean)
                wrapper.update_running_mean = False
        yield policy, len(envs.envs)
