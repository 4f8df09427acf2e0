"""A batch of environments in compiled code: which lanes are reset, which blocks a thread takes, what goes out.

lanes (blocks, rows, width) and streams (blocks, width), without the first axis where one block is meant; codes, sizes
and numbers are those of `kernels`; table, root, switches and ranges those of `Randomization.tables`; mask (N,). Filled
in place, one row for each env: observation, state, measured, command, rewards, terminated, truncated.
"""

import numpy as np

from ..plant.compiled import compiled
from . import kernels as k
from .threads import finish, take


@compiled
def _publish(lanes, i, k0, sizes, observation, state, measured, command):
    first = k.first_frame_row(sizes)
    for j in range(observation.shape[1]):
        observation[i, j] = lanes[first + j, k0]
    for j in range(4):
        state[i, j] = lanes[k.N_FIXED + j, k0]
        measured[i, j] = lanes[k.READING1 + j, k0]
    command[i] = lanes[k.COMMAND, k0]


@compiled
def reset_batch(
    lanes,
    streams,
    codes,
    sizes,
    numbers,
    table,
    root,
    switches,
    ranges,
    mask,
    start,
    observation,
    state,
    measured,
    command,
):
    """Start a new episode where `mask` is True; start (N, 4), NaN where it is drawn. Publish every env."""
    width = lanes.shape[2]
    for i in range(mask.shape[0]):
        block, lane = i // width, i % width
        if mask[i]:
            k.reset_lane(
                lanes[block], lane, streams[block], codes, sizes, numbers, table, root, switches, ranges, start[i]
            )
        _publish(lanes[block], i, lane, sizes, observation, state, measured, command)


@compiled(nogil=True)
def step_blocks(
    patience, board, actions, lanes, streams, codes, sizes, numbers, table, root, switches, ranges, max_steps,
    observation, state, measured, command, rewards, terminated, truncated,
):  # fmt: skip
    """Step the blocks that the board gives to this thread, until none is left (see `threads.share`)."""
    work = np.empty((k.work_rows(sizes), lanes.shape[2]))
    nothing = np.full(4, np.nan)
    n = lanes.shape[0]
    b = take(board, n, 0)
    while b < n:
        _step_block(
            b, actions, lanes[b], streams[b], codes, sizes, numbers, table, root, switches, ranges, max_steps, work,
            nothing, observation, state, measured, command, rewards, terminated, truncated,
        )  # fmt: skip
        finish(board)
        b = take(board, n, patience)


@compiled(inline="always")  # compiled within `step_blocks` alone: every caller is compiled with all that it calls
def _step_block(
    b, actions, lanes, streams, codes, sizes, numbers, table, root, switches, ranges, max_steps, work, nothing,
    observation, state, measured, command, rewards, terminated, truncated,
):  # fmt: skip
    width = lanes.shape[1]
    first = b * width
    count = min(width, actions.shape[0] - first)
    for lane in range(count):
        lanes[k.COMMAND, lane] = actions[first + lane, 0]
    k.step_lanes(lanes, streams, codes, sizes, numbers, work)
    for lane in range(count):
        i = first + lane
        if lanes[k.DONE, lane] != 0.0:
            k.reset_lane(lanes, lane, streams, codes, sizes, numbers, table, root, switches, ranges, nothing)
            rewards[i], terminated[i], truncated[i] = 0.0, False, False
        else:
            rewards[i] = lanes[k.REWARD, lane]
            terminated[i] = lanes[k.TERMINATED, lane] != 0.0
            truncated[i] = lanes[k.STEPS, lane] >= max_steps
            lanes[k.DONE, lane] = 1.0 if terminated[i] or truncated[i] else 0.0
        _publish(lanes, i, lane, sizes, observation, state, measured, command)
