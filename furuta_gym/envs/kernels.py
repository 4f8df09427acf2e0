"""The compiled step of `FurutaID-v0`: command, motion, encoders, velocity filter, observation, reward, end of episode.

A block holds L envs side by side as the columns ("lanes") of one array (rows, L): single envs are a block of one lane,
the vector env has many blocks of many lanes, and both run the same code, so that they agree to the last bit.

    rows of a block: N_FIXED rows named below | X (4 + memory) | P | past commands (H) | their times (H) |
                     observation frames, oldest first (history · frame)
"""

import math

import numpy as np

from ..plant.advance import acting_row, until_next, workspace
from ..plant.compiled import compiled
from ..plant.effects.dispatch import command_delays, filter_command, map_command, store_filter
from ..plant.elementary import sincos
from ..plant.integration import plain_steps, runge_kutta
from ..sensors import read_encoders
from .draws import draw_parameters, draw_ranges
from .streams import normal_pair, uniform

# Rows of a block before X.
TIME, STEPS, SPAN, COMMAND, READING1, READING2, SPEED1, SPEED2, REWARD, TERMINATED, DONE, BEFORE, WANTED = range(13)
SENT = 13  # what the rig's computer sends; a weaker supply than it knows of gives less: COMMAND
# What may differ from episode to episode beside the plant: `ranges.RIG` names them in this order.
NOISE1, NOISE2, OFFSET1, OFFSET2, SUPPLY, JITTER, PUSH, PUSH_RATE, N_FIXED = range(14, 23)

# Entries of `sizes`.
(STATE_ROWS, PARAMETER_ROWS, SUBSTEPS, PAST_COMMANDS, STRETCHES, HISTORY, FRAME, SAMPLES, N_SIZES) = range(9)

# Entries of `numbers`; of a pair or four the first is named. Flags say whether any episode can have it.
SAMPLE_TIME, U_MAX, ACTION_SCALE, VELOCITY_GAIN, NOISY, JITTERY, PUSHED = range(7)
COUNT1, ARM_LIMIT, PENDULUM_LIMIT, SPEED_LIMIT, SPEED_SCALE, SPEED_SHARE, ARM_SPEED, START_Q2 = 7, *range(9, 16)
TOLERANT, LONGEST, START_SPREAD, CENTRED, CALM, SPARING, GENTLE, ARM_MARGIN, REWARD_SCALE, SLEW = (
    16,
    17,
    18,
    *range(22, 29),
)
RIG = 29  # the rows NOISE1 … of an episode in which nothing is drawn
N_NUMBERS = RIG + N_FIXED - NOISE1

BALANCE_LIMIT = 0.5  # rad; |q2| beyond it ends an episode of `balance`
WINDING_LIMIT = 5e3  # rad; the compiled sine is exact up to 1e4
START_BALANCE = (0.2, 0.1, 0.2, 0.2)  # half-widths of the uniform start: q1, q2 [rad], q̇1, q̇2 [rad/s]
START_SWING_UP = (0.2, 0.05, 0.0, 0.0)

# The tolerant reward: inside these nothing is lost (see `tolerant_reward_of`).
CALM_ANGLE = 0.1  # rad, of the pendulum
CALM_TRAVEL = 0.3  # rad, of the arm
CALM_SPEED = 0.15  # of the pendulum's own, ω
FREE_COMMAND = 0.3  # of u_max

# Reward: half-value widths of its factors (see `reward_of`).
UPRIGHT_WIDTH = 0.2  # rad
CENTRE_WIDTH = 1.0  # rad
CHANGE_WIDTH = 0.1  # of u_max


@compiled(forceinline=True)
def reward_of(q1, q2, v1, v2, command_share, numbers):
    """Reward in [0, 1] of true state and command / u_max; `FurutaEnv` has the formula."""
    speed_scale, centre, rest = numbers[SPEED_SCALE], numbers[CENTRED], numbers[CALM]
    _, c = sincos(q2)
    upright = 0.25 * (1.0 + c) + 0.5 / (1.0 + 2.0 * (1.0 - c) / UPRIGHT_WIDTH**2)
    centred = (1.0 - centre) + centre / (1.0 + (q1 / CENTRE_WIDTH) ** 2)
    calm = (1.0 - rest) + rest / (1.0 + (v1 * v1 + v2 * v2) / (speed_scale * speed_scale))
    return upright * centred * calm * (1.0 - numbers[SPARING] * command_share * command_share)


@compiled(forceinline=True)
def _beyond(x, limit, width):
    """((|x| − limit)/width)² beyond the limit, 0 inside."""
    far = max(abs(x) - limit, 0.0) / width
    return far * far


@compiled(forceinline=True)
def tolerant_reward_of(q1, q2, v1, v2, command_share, numbers):
    """`reward_of` with flat tops: 1 where the rig is upright, centred and calm enough; `FurutaEnv` has the formula."""
    speed_scale, centre, rest = numbers[SPEED_SCALE], numbers[CENTRED], numbers[CALM]
    _, c = sincos(q2)
    lean = math.sqrt(max(2.0 * (1.0 - c), 0.0))
    upright = 0.5 * min((1.0 + c) / (1.0 + math.cos(CALM_ANGLE)), 1.0)
    upright += 0.5 / (1.0 + _beyond(lean, CALM_ANGLE, UPRIGHT_WIDTH))
    centred = (1.0 - centre) + centre / (1.0 + _beyond(q1, CALM_TRAVEL, CENTRE_WIDTH))
    calm = (1.0 - rest) + rest / (1.0 + _beyond(math.sqrt(v1 * v1 + v2 * v2) / speed_scale, CALM_SPEED, 1.0))
    sparing = 1.0 - numbers[SPARING] * _beyond(command_share, FREE_COMMAND, 1.0 - FREE_COMMAND)
    return upright * centred * calm * sparing


@compiled(forceinline=True)
def extra_factors_of(q1, change_share, numbers):
    """The factors of a gentle command (its change / u_max) and of the margin before the arm's limit, in [0, 1]."""
    gentle, margin = numbers[GENTLE], numbers[ARM_MARGIN]
    factor = (1.0 - gentle) + gentle / (1.0 + abs(change_share) / CHANGE_WIDTH)
    if margin > 0.0:
        near = min(max(abs(q1) - (numbers[ARM_LIMIT] - margin), 0.0) / margin, 1.0)
        factor *= 1.0 - near * near
    return factor


_BESIDE = 8  # rows of `_move` beside those of the integration


@compiled
def work_rows(sizes):
    """Rows of the work space that a block's step needs."""
    return workspace(sizes[STATE_ROWS], 0)[0].shape[0] + _BESIDE


@compiled
def first_frame_row(sizes):
    """Row of a block at which the observation begins."""
    return N_FIXED + sizes[STATE_ROWS] + sizes[PARAMETER_ROWS] + 2 * sizes[PAST_COMMANDS]


@compiled
def block_rows(sizes):
    """Rows of a block."""
    return first_frame_row(sizes) + sizes[HISTORY] * sizes[FRAME]


@compiled
def _held(X, P, codes, start, h, command, W, substeps, work):
    """Carry X over `substeps` steps of h (L,) from start (L,), under the command (L,) as the amplifier gets it."""
    if codes.shape[0] == 0:
        plain_steps(X, h, substeps, command, W, P)
        return
    map_command(P, codes, command)
    runge_kutta(X, start, h, substeps, command, W, P, codes, work)
    since, torque = work[-1], work[-3]
    for k in range(X.shape[1]):
        since[k] = h[k] * substeps
    filter_command(command, since, X, P, codes, torque)
    store_filter(X, codes, torque)


@compiled
def _move(lanes, codes, sizes, work):
    """Carry every lane's X over its SPAN, under its COMMAND or, with a delay, the commands before it."""
    rows, past, substeps = sizes[STATE_ROWS], sizes[PAST_COMMANDS], sizes[SUBSTEPS]
    first_p = N_FIXED + rows
    first_u = first_p + sizes[PARAMETER_ROWS]
    X, P = lanes[N_FIXED:first_p], lanes[first_p:first_u]
    n = work.shape[0] - _BESIDE
    inner, start, h, command, W = work[:n], work[n], work[n + 1], work[n + 2], work[n + 3 : n + 5]
    L = lanes.shape[1]
    W[:] = 0.0
    for k in range(L):
        start[k] = lanes[TIME, k]
        h[k] = lanes[SPAN, k] / substeps
        command[k] = lanes[COMMAND, k]
    if past == 0:
        _held(X, P, codes, start, h, command, W, substeps, inner)
        return
    U, since = lanes[first_u : first_u + past], lanes[first_u + past : first_u + 2 * past]
    delay, source, stop = work[n + 5], work[n + 6], work[n + 7]
    for i in range(past - 1, 0, -1):
        U[i] = U[i - 1]
        since[i] = since[i - 1]
    U[0] = command
    since[0] = start
    command_delays(P, codes, delay)
    for k in range(L):
        source[k] = acting_row(since[:, k], 0, past - 1, delay[k], start[k])
    for stretch in range(sizes[STRETCHES]):
        for k in range(L):
            end = lanes[TIME, k] + lanes[SPAN, k]
            i = int(source[k])
            stop[k] = end
            if i > 0 and stretch < sizes[STRETCHES] - 1:
                stop[k] = until_next(since[i - 1, k], delay[k], start[k], end)
            command[k] = U[i, k]
            h[k] = (stop[k] - start[k]) / substeps
        _held(X, P, codes, start, h, command, W, substeps, inner)
        for k in range(L):
            start[k] = stop[k]
            if source[k] > 0.0 and stop[k] < lanes[TIME, k] + lanes[SPAN, k]:
                source[k] -= 1.0


@compiled
def _frame(lanes, k, first, sizes, numbers):
    """Write the newest observation frame of lane k into rows first …, inside the observation space's bounds."""
    speed = numbers[SPEED_LIMIT]
    s, c = sincos(lanes[READING2, k])
    lanes[first, k] = _clip(lanes[READING1, k], 2.0 * numbers[ARM_LIMIT])
    lanes[first + 1, k] = _clip(s, 1.0)
    lanes[first + 2, k] = _clip(c, 1.0)
    lanes[first + 3, k] = _clip(lanes[SPEED1, k], speed) * numbers[SPEED_SHARE]
    lanes[first + 4, k] = _clip(lanes[SPEED2, k], speed) * numbers[SPEED_SHARE]
    if sizes[FRAME] > 5:
        lanes[first + 5, k] = lanes[SENT, k] / numbers[U_MAX]


@compiled(forceinline=True)
def _clip(x, limit):
    """x inside ±limit; NaN becomes −limit."""
    x = x if x > -limit else -limit
    return x if x < limit else limit


@compiled(forceinline=True)
def _sense(lanes, streams, codes, sizes, numbers, work):
    """Readings and velocities of all lanes that have just moved by a sample, and their clock."""
    rows, L = sizes[STATE_ROWS], lanes.shape[1]
    first_p = N_FIXED + rows
    X, P = lanes[N_FIXED:first_p], lanes[first_p : first_p + sizes[PARAMETER_ROWS]]
    noise, Y = work[0:2], work[2:4]
    noise[:] = 0.0
    if numbers[NOISY] > 0.0:
        for k in range(L):
            if lanes[DONE, k] == 0.0:
                e1, e2 = normal_pair(streams, k)
                noise[0, k] = lanes[NOISE1, k] * e1
                noise[1, k] = lanes[NOISE2, k] * e2
    read_encoders(X, P, codes, lanes[OFFSET1:SUPPLY], noise, numbers[COUNT1 : COUNT1 + 2], Y)
    gain, period = numbers[VELOCITY_GAIN], numbers[SAMPLE_TIME]
    for k in range(L):
        for axis in range(2):
            speed = lanes[SPEED1 + axis, k]
            difference = (Y[axis, k] - lanes[READING1 + axis, k]) / period
            lanes[SPEED1 + axis, k] = speed + gain * (difference - speed)
            lanes[READING1 + axis, k] = Y[axis, k]
    for k in range(L):
        lanes[TIME, k] += lanes[SPAN, k]


@compiled(forceinline=True)
def _judge(lanes, sizes, numbers):
    """Reward, termination and observation of all lanes at the end of an action."""
    L = lanes.shape[1]
    arm, pendulum, u_max = numbers[ARM_LIMIT], numbers[PENDULUM_LIMIT], numbers[U_MAX]
    fastest, scale = numbers[ARM_SPEED], numbers[REWARD_SCALE]
    if numbers[TOLERANT] > 0.0:  # loops of their own: each becomes SIMD code
        for k in range(L):
            share = lanes[COMMAND, k] / u_max
            q1, q2, v1, v2 = lanes[N_FIXED, k], lanes[N_FIXED + 1, k], lanes[N_FIXED + 2, k], lanes[N_FIXED + 3, k]
            lanes[REWARD, k] = tolerant_reward_of(q1, q2, v1, v2, share, numbers)
    else:
        for k in range(L):
            share = lanes[COMMAND, k] / u_max
            q1, q2, v1, v2 = lanes[N_FIXED, k], lanes[N_FIXED + 1, k], lanes[N_FIXED + 2, k], lanes[N_FIXED + 3, k]
            lanes[REWARD, k] = reward_of(q1, q2, v1, v2, share, numbers)
    if numbers[GENTLE] > 0.0 or numbers[ARM_MARGIN] > 0.0:
        for k in range(L):
            change = (lanes[COMMAND, k] - lanes[BEFORE, k]) / u_max
            lanes[REWARD, k] *= extra_factors_of(lanes[N_FIXED, k], change, numbers)
    if numbers[GENTLE] > 0.0 or numbers[ARM_MARGIN] > 0.0:
        for k in range(L):
            lanes[BEFORE, k] = lanes[COMMAND, k]
    for k in range(L):
        q1, q2, v1, v2 = lanes[N_FIXED, k], lanes[N_FIXED + 1, k], lanes[N_FIXED + 2, k], lanes[N_FIXED + 3, k]
        inside = abs(q1) <= arm and abs(q2) <= pendulum and abs(v1) + abs(v2) < 1e6 and abs(v1) <= fastest
        reward = lanes[REWARD, k]
        lanes[TERMINATED, k] = 0.0 if inside else 1.0
        lanes[REWARD, k] = scale * reward if reward >= 0.0 else 0.0  # not finite: no reward
        lanes[STEPS, k] += 1.0
    frame, history = sizes[FRAME], sizes[HISTORY]
    oldest = first_frame_row(sizes)
    for row in range(oldest, oldest + (history - 1) * frame):
        for k in range(L):
            lanes[row, k] = lanes[row + frame, k]
    newest = oldest + (history - 1) * frame
    for k in range(L):
        _frame(lanes, k, newest, sizes, numbers)


@compiled
def _push(lanes, streams, sizes, period):
    """Taps on pendulums, at random times to a random side: an impulse that changes q̇2 by PUSH, q̇1 as M has it."""
    first_p = N_FIXED + sizes[STATE_ROWS]
    for k in range(lanes.shape[1]):
        if lanes[DONE, k] == 0.0:
            chance = uniform(streams, k)
            side = 1.0 if uniform(streams, k) < 0.5 else -1.0
            if chance < lanes[PUSH_RATE, k] * period:
                size = side * lanes[PUSH, k]
                s, c = sincos(lanes[N_FIXED + 1, k])
                m11 = lanes[first_p, k] + lanes[first_p + 1, k] * s * s
                lanes[N_FIXED + 2, k] -= lanes[first_p + 2, k] * c / m11 * size
                lanes[N_FIXED + 3, k] += size


@compiled
def reset_lane(lanes, k, streams, codes, sizes, numbers, table, root, switches, ranges, state):
    """Start a new episode in lane k: plant, state, first reading. state (4,): start, NaN where it shall be drawn."""
    rows, n_p, past = sizes[STATE_ROWS], sizes[PARAMETER_ROWS], sizes[PAST_COMMANDS]
    first_p = N_FIXED + rows
    first_u = first_p + n_p
    P = lanes[first_p:first_u]
    draw_parameters(P, k, streams, k, table, root, switches)
    lanes[:first_p, k] = 0.0
    for i in range(N_FIXED - NOISE1):
        lanes[NOISE1 + i, k] = numbers[RIG + i]
    draw_ranges(P, lanes[NOISE1:N_FIXED], k, streams, ranges)
    for i in range(4):
        drawn = (2.0 * uniform(streams, k) - 1.0) * numbers[START_SPREAD + i]
        if i == 1:
            drawn += numbers[START_Q2]
        lanes[N_FIXED + i, k] = drawn if math.isnan(state[i]) else state[i]
    for i in range(past):
        lanes[first_u + i, k] = 0.0
        lanes[first_u + past + i, k] = -math.inf  # before the episode the command was zero for ever
    alone = np.empty((rows + n_p, 1))
    for row in range(rows + n_p):
        alone[row, 0] = lanes[N_FIXED + row, k]
    noise, offset, Y = np.zeros((2, 1)), np.empty((2, 1)), np.empty((2, 1))
    offset[0, 0] = lanes[OFFSET1, k]
    offset[1, 0] = lanes[OFFSET2, k]
    if numbers[NOISY] > 0.0:
        e1, e2 = normal_pair(streams, k)
        noise[0, 0] = lanes[NOISE1, k] * e1
        noise[1, 0] = lanes[NOISE2, k] * e2
    read_encoders(alone[:rows], alone[rows:], codes, offset, noise, numbers[COUNT1 : COUNT1 + 2], Y)
    lanes[READING1, k] = Y[0, 0]
    lanes[READING2, k] = Y[1, 0]
    frame = sizes[FRAME]
    oldest = first_frame_row(sizes)
    for i in range(sizes[HISTORY]):
        _frame(lanes, k, oldest + i * frame, sizes, numbers)


@compiled
def _slew(lanes, most):
    """Bring what is SENT nearer to what is WANTED, by at most `most`."""
    for k in range(lanes.shape[1]):
        lanes[SENT, k] += min(max(lanes[WANTED, k] - lanes[SENT, k], -most), most)


@compiled(inline="always")
def step_lanes(lanes, streams, codes, sizes, numbers, work):
    """One action of every lane of a block, standing in row COMMAND, held for SAMPLES samples."""
    period, scale = numbers[SAMPLE_TIME], numbers[ACTION_SCALE]
    known = numbers[RIG + SUPPLY - NOISE1]
    for k in range(lanes.shape[1]):
        lanes[WANTED, k] = min(max(lanes[COMMAND, k] * scale, -known), known)
        if numbers[SLEW] == math.inf:
            lanes[SENT, k] = lanes[WANTED, k]
    for _ in range(sizes[SAMPLES]):
        if numbers[SLEW] < math.inf:
            _slew(lanes, numbers[SLEW] * period)
        for k in range(lanes.shape[1]):
            most = lanes[SUPPLY, k]
            lanes[COMMAND, k] = min(max(lanes[SENT, k], -most), most)
            lanes[SPAN, k] = period
        if numbers[JITTERY] > 0.0:
            for k in range(lanes.shape[1]):
                if lanes[DONE, k] == 0.0:
                    lanes[SPAN, k] = period * (1.0 + lanes[JITTER, k] * (2.0 * uniform(streams, k) - 1.0))
        if numbers[PUSHED] > 0.0:
            _push(lanes, streams, sizes, period)
        _move(lanes, codes, sizes, work)
        _sense(lanes, streams, codes, sizes, numbers, work)
    _judge(lanes, sizes, numbers)
