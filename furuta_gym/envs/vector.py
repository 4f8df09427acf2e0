"""`FurutaID-v0` as one compiled batch, for `gymnasium.make_vec(..., vectorization_mode="vector_entry_point")`."""

import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ..cores import cores
from ..plant.plant import Plant
from . import kernels as k
from .batch_kernels import reset_batch, step_blocks
from .furuta import start_state
from .options import Options, Setup, drawn_rig
from .registration import MAX_EPISODE_STEPS, PlainSpec, check_time_limit
from .rendering import Scene, Viewer
from .streams import start_stream
from .threads import N_BOARD, share

_WIDTH = 128  # lanes of a block: its work space fits the first-level cache, its loops fill the SIMD registers
_FEWEST_TO_SHARE = 256  # envs; below it, waking another thread costs more than it saves


class FurutaVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """N environments `FurutaID-v0` (see `FurutaEnv` for task, spaces, reward and options), stepped by compiled code.

    Env i equals `FurutaEnv` with the same options, seed and float32 actions, bit for bit, resets included; with
    `reset(seed=s)` env i has seed s + i, and a list gives each its own. Batches of 256 and more are spread over
    the cores; `threads` limits how many.

    max_episode_steps: episodes are truncated here, since a batch has no TimeLimit wrapper; 1000 unless `time_limit` or
    another number is given (`gymnasium.make_vec` gives the 1000 of its id). None: never, as with `time_limit=None`.
    autoreset_mode: NEXT_STEP (default), SAME_STEP (`final_obs` and `final_info` in info) or DISABLED (use
    `reset(options={"reset_mask": mask})`), with Gymnasium's semantics.
    options of reset: `state` (4,) or (N, 4) starts from q1, q2, q̇1, q̇2; NaN is drawn. `reset_mask` (N,) bool.

    info holds arrays over the batch, with the masks `_state`, … of Gymnasium: `state` (N, 4), `measured_state` (N, 4),
    `command` (N,); and `plant` (theta (N, 9), …) where plants are drawn, whenever some env was reset.
    """

    metadata = {  # noqa: RUF012  (Gymnasium's own way)
        "render_modes": ["rgb_array"],
        "render_fps": 100,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    spec = PlainSpec()  # type: ignore[assignment]
    _viewer: Viewer | None = None  # of the class: Gymnasium closes also what could not be made

    def __init__(
        self,
        num_envs: int = 1,
        plant: Plant | Mapping[str, Any] | str | os.PathLike[str] = "table3",
        task: str = "balance",
        *,
        max_episode_steps: int | Literal["default"] | None = "default",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        threads: int | None = None,
        **options: Any,
    ) -> None:
        if not _at_least_one(num_envs):
            raise ValueError(f"num_envs must be a whole number of at least 1, got {num_envs!r}")
        if max_episode_steps == "default":
            max_episode_steps = None if "time_limit" in options else MAX_EPISODE_STEPS
        if max_episode_steps is not None and not _at_least_one(max_episode_steps):
            raise ValueError(
                f"max_episode_steps must be a whole number of at least 1, or None, got {max_episode_steps!r}"
            )
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be 'rgb_array' or None, got {render_mode!r}")
        self.num_envs = int(num_envs)
        self.render_mode = render_mode
        self.autoreset_mode = _mode(autoreset_mode)
        self.setup = setup = Setup(Options.of({"plant": plant, "task": task} | options))
        self.metadata = type(self).metadata | {
            "autoreset_mode": self.autoreset_mode,
            "render_fps": round(1.0 / setup.action_period),
        }
        self.single_observation_space, self.single_action_space = setup.observation_space, setup.action_space
        self.observation_space = batch_space(setup.observation_space, self.num_envs)
        self.action_space = batch_space(setup.action_space, self.num_envs)
        self._limit = math.inf if max_episode_steps is None else float(max_episode_steps)
        self._max_steps = float(min(self._limit, setup.longest))  # of one type, or the kernel is compiled twice
        if threads is not None and not _at_least_one(threads):
            raise ValueError(f"threads must be a whole number of at least 1, got {threads!r}")
        self._threads = cores() if threads is None else int(threads)
        if self.num_envs < _FEWEST_TO_SHARE:
            self._threads = 1
        blocks, width = _blocks(self.num_envs, self._threads)
        self._lanes = np.zeros((blocks, k.block_rows(setup.sizes), width))
        first_p = k.N_FIXED + setup.sizes[k.STATE_ROWS]
        self._parameter_rows = slice(first_p, first_p + setup.sizes[k.PARAMETER_ROWS])
        # every lane needs a possible plant, also those that only fill up the last block
        self._lanes[:, self._parameter_rows] = setup.random.plant.packed().p[:, None]
        self._streams = np.zeros((blocks, width), dtype=np.uint64)
        self._shared = (self._lanes, self._streams, setup.codes, setup.sizes, setup.numbers)
        # what a step reads and writes stays where it is: a thread that is still at the board of the last step takes
        # blocks of the next one
        self._tables = tuple(table.copy() for table in setup.random.tables)
        self._actions, self._board = np.zeros((self.num_envs, 1), dtype=np.float32), np.zeros(N_BOARD, dtype=np.int64)
        self._out: tuple[NDArray[Any], ...] = (*self._arrays(), *_outcome(self.num_envs))
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        self._seeded = self._ready = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        check_time_limit(self.spec, self.setup.longest, self._limit)
        mask = _reset_mask(options, self.num_envs)
        state = start_state(options, self.setup, (self.num_envs, 4), ("state", "reset_mask"))
        if not self._ready and not mask.all():
            raise ResetNeeded("the first reset() must reset every environment")
        self._seed(seed, mask)  # last: a reset that is refused changes nothing
        out = self._arrays()
        reset_batch(*self._shared, *self._tables, mask, state, *out)
        self._ready = True
        self._ended[mask] = False
        for array in out[1:]:
            array[~mask] = 0.0  # as Gymnasium's batches have it
        return out[0], self._info(out, mask, mask)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        if not self._ready:
            raise ResetNeeded("call reset() before step()")
        actions = np.ascontiguousarray(actions, dtype=np.float32)
        if actions.shape != (self.num_envs, 1):
            raise ValueError(f"actions must have shape ({self.num_envs}, 1), got {actions.shape}")
        if np.isnan(actions).any():
            raise ValueError("an action is NaN; check the policy that made it")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._ended.any():
            raise ResetNeeded(
                f"{int(self._ended.sum())} episodes have ended; reset them with "
                "reset(options={'reset_mask': terminated | truncated})"
            )
        self._actions[:] = actions
        arguments = (self._board, self._actions, *self._shared, *self._tables, self._max_steps, *self._out)
        share(lambda patience: step_blocks(patience, *arguments), self._board, len(self._lanes), self._threads)
        copies = tuple(array.copy() for array in self._out)
        out, (rewards, terminated, truncated) = copies[:4], copies[4:]
        fresh, self._ended = self._ended, terminated | truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            fresh = self._ended
            if fresh.any():
                return self._reset_ended(out, rewards, terminated, truncated)
        info = self._info(out, np.ones(self.num_envs, dtype=np.bool_), fresh)
        return out[0], rewards, terminated, truncated, info

    def _reset_ended(self, last: Any, rewards: Any, terminated: Any, truncated: Any) -> tuple[Any, ...]:
        """SAME_STEP: new episodes where one ended; what ended goes to `final_obs` and `final_info`."""
        ended = self._ended
        out = tuple(array.copy() for array in last)
        reset_batch(*self._shared, *self._tables, ended, np.full((self.num_envs, 4), np.nan), *out)
        self._ended = np.zeros_like(ended)
        info = self._info(out, np.ones_like(ended), ended)
        final_obs = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended):
            final_obs[i] = last[0][i]
        for array in last[1:]:
            array[~ended] = 0.0
        info |= {"final_obs": final_obs, "_final_obs": ended.copy()}
        info |= {"final_info": self._info(last, ended, np.zeros_like(ended)), "_final_info": ended.copy()}
        return out[0], rewards, terminated, truncated, info

    def set_level(self, level: float) -> None:
        """From the next reset of each env on, ranges reach only `level` in [0, 1] of the way; see
        `Randomization.narrowed`. For a curriculum. Raises ValueError for another level."""
        random = self.setup.random.narrowed(level, self.setup.numbers[k.RIG :])
        for table, narrowed in zip(self._tables, random.tables, strict=True):
            table[:] = narrowed

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """All that later steps depend on beside the options and the level, as copies: the rigs (rows, N), their random
        streams (N,), who ended (N,)."""
        return {
            "lanes": self._columns().copy(),
            "streams": self._own_streams.view(np.int64).copy(),
            "ended": self._ended.astype(np.uint8),
        }

    def restore(self, snapshot: Mapping[str, NDArray[Any]]) -> None:
        """Go on from what `snapshot` of a batch with the same options gave, on any number of threads.

        Raises ValueError if it does not fit."""
        own = self.snapshot()
        for name, value in own.items():
            given = snapshot.get(name)
            if given is None or given.shape != value.shape or given.dtype != value.dtype:
                raise ValueError(f"the rigs' {name} must be {value.dtype} of shape {value.shape}")
        blocks, rows, width = self._lanes.shape
        whole = np.concatenate([snapshot["lanes"], self._columns(all_lanes=True)[:, self.num_envs :]], axis=1)
        self._lanes[:] = whole.reshape(rows, blocks, width).transpose(1, 0, 2)
        self._own_streams[:] = snapshot["streams"].view(np.uint64)
        self._ended[:] = snapshot["ended"].astype(bool)
        self._seeded = self._ready = True

    def plants(self, indices: Sequence[int] | None = None) -> list[Plant]:
        """The plants of the present episodes, of all envs or of those asked for."""
        if not self.setup.random.active:
            return [self.setup.plant] * (self.num_envs if indices is None else len(indices))
        P = self._columns(self._parameter_rows)
        return [self.setup.random.drawn_plant(P[:, i]) for i in (range(self.num_envs) if indices is None else indices)]

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """A frame (height, width, 3) of each env; None without a render mode. Raises ResetNeeded before a reset."""
        if self.render_mode is None:
            return None
        if not self._ready:
            raise ResetNeeded("call reset() before render()")
        self._viewer = self._viewer or Viewer()
        rows = self._columns()
        return tuple(self._viewer.draw(Scene.of(self.setup, rows[:, i])) for i in range(self.num_envs))

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_viewer": None}  # a window cannot be copied; it is opened again

    def close_extras(self, **kwargs: Any) -> None:
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _seed(self, seed: int | Sequence[int | None] | None, mask: NDArray[np.bool_]) -> None:
        n = self.num_envs
        streams = self._own_streams
        each = [seed] * n if seed is None else _seeds(seed, n)
        if each[0] is not None:
            super().reset(seed=each[0])
        if not self._seeded:
            streams[:] = self.np_random.integers(2**64 - 1, size=n, dtype=np.uint64, endpoint=True)
            self._seeded = True
        for i, own in enumerate(each):
            if own is not None and mask[i]:
                streams[i] = start_stream(np_random(own)[0])

    def _arrays(self) -> tuple[NDArray[Any], ...]:
        n = self.num_envs
        observation = np.empty((n, self.setup.observation_space.shape[0]), dtype=np.float32)
        return observation, np.empty((n, 4)), np.empty((n, 4)), np.empty(n)

    def _info(self, out: tuple[NDArray[Any], ...], mask: NDArray[np.bool_], fresh: NDArray[np.bool_]) -> dict[str, Any]:
        _, state, measured, command = out
        info: dict[str, Any] = {}
        for key, values in (("state", state), ("measured_state", measured), ("command", command)):
            info[key], info[f"_{key}"] = values, mask.copy()
        if self.setup.random.active and fresh.any():
            info["plant"] = _masked(self.setup.random.describe(self._columns(self._parameter_rows)), fresh)
            info["_plant"] = fresh.copy()
            if drawn := drawn_rig(self.setup, self._columns(slice(k.NOISE1, k.N_FIXED))):
                info["rig"], info["_rig"] = _masked(drawn, fresh), fresh.copy()
        return info

    def _columns(self, rows: slice = slice(None), all_lanes: bool = False) -> NDArray[np.float64]:
        """Rows of the blocks, one column for each env (n, N), or for each lane, the last of which are no env's."""
        part = self._lanes[:, rows]
        return part.transpose(1, 0, 2).reshape(part.shape[1], -1)[:, : None if all_lanes else self.num_envs]

    @property
    def _own_streams(self) -> NDArray[np.uint64]:
        """The random streams (N,), a part of the blocks' own memory."""
        return self._streams.reshape(-1)[: self.num_envs]


def _outcome(n: int) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    return np.empty(n), np.empty(n, dtype=np.bool_), np.empty(n, dtype=np.bool_)


def _at_least_one(number: Any) -> bool:
    return isinstance(number, int | np.integer) and bool(number >= 1)


def _blocks(n: int, threads: int) -> tuple[int, int]:
    """(number of blocks, lanes in each) for n envs: equal work for each thread, and no block wider than `_WIDTH`."""
    blocks = math.ceil(n / _WIDTH)
    if threads > 1:
        blocks = math.ceil(blocks / threads) * threads
    return blocks, math.ceil(n / blocks)


def _seeds(seed: int | Sequence[int | None], n: int) -> list[int | None]:
    if isinstance(seed, int | np.integer):
        return [int(seed) + i for i in range(n)]
    if len(seed) != n:
        raise ValueError(f"seed must be one number or a list of {n}, got a list of {len(seed)}")
    return [None if own is None else int(own) for own in seed]


def _reset_mask(options: dict[str, Any] | None, n: int) -> NDArray[np.bool_]:
    given = (options or {}).get("reset_mask")
    if given is None:
        return np.ones(n, dtype=np.bool_)
    mask = np.array(given)  # it goes into infos
    if mask.shape != (n,) or mask.dtype != np.bool_ or not mask.any():
        raise ValueError(f"options['reset_mask'] must be a bool array of shape ({n},) with at least one True")
    return mask


def _masked(values: dict[str, Any], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Gymnasium's form of a vector info: zeros where the mask is False, and the mask beside each key."""
    info: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, dict):
            info[key] = _masked(value, mask)
        else:
            info[key] = np.where(mask.reshape(-1, *[1] * (value.ndim - 1)), value, 0.0)
        info[f"_{key}"] = mask.copy()
    return info


def _mode(given: AutoresetMode | str) -> AutoresetMode:
    """An autoreset mode, or its name or value as text. Raises ValueError for anything else."""
    modes = {**AutoresetMode.__members__, **{mode.value: mode for mode in AutoresetMode}}
    if isinstance(given, AutoresetMode):
        return given
    if given not in modes:
        raise ValueError(f"autoreset_mode must be one of {', '.join(AutoresetMode.__members__)}, got {given!r}")
    return modes[given]
