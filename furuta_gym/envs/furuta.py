"""One environment: `FurutaID-v0`, and with other defaults `FurutaBalance-v0` and `FurutaSwingUp-v0`."""

import math
import os
from collections.abc import Collection, Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from ..plant.compiled import compiled
from ..plant.plant import Plant
from . import kernels as k
from .options import SPEED_LIMIT, Options, Setup, drawn_rig
from .registration import PlainSpec, check_time_limit
from .rendering import Scene, Viewer
from .streams import start_stream


class FurutaEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A Furuta pendulum as a rig's computer sees it: command in, encoders out, one sample a step.

    This text is the specification. The plant is model (5) with the effects of its plant file, integrated by the same
    compiled code that identification and simulation use. Angles as in the paper: q1 is the arm, q2 the pendulum,
    q2 = 0 upright.

    ## Task
    `balance` starts near upright and ends when the pendulum falls. `swing_up` starts hanging; the pendulum is to be
    swung up and held, in one episode.

    ## Action
    Box(-u_max, u_max, (1,), float32): the command in the plant's own unit (V or N·m), clipped to ±u_max and held for
    one sample, or for `action_time`. Where the plant file has limits of the rig, the command stays within its `supply`
    and nears the action by at most `slew` · T a sample, from none at reset. With `normalize_action=True`
    Box(-1, 1, (1,)): the share of u_max, which is what learners want and what the checkers of Gymnasium and
    stable-baselines3 recommend.

    ## Observation
    Box((5,), float32): [q1, sin q2, cos q2, v1, v2] in rad and rad/s. The angles are encoder readings (counts, offset,
    noise, and the plant's sensor effects), the velocities a causal filtered difference of the readings,
    v ← v + (1 − e^(−ωc T)) (Δy/T − v), which starts from zero at reset. Values are clipped to the space's bounds:
    |q1| ≤ 2 arm_limit, |v| ≤ 200 rad/s. With `scale_observation=True` velocities are counted in ω of the reward below,
    which brings them to about one. With `observe_command=True` the last command as sent / u_max is appended. With
    `history=h` the last h observations follow one another, oldest first; a reset fills them all with the first one.

    ## Reward
    In [0, 1], from the true state after the step and the command u of the step:

        upright · centred · calm · (1 − (u/u_max)²/4)
        upright = (1 + cos q2)/4 + ½/(1 + 2 (1 − cos q2)/0.2²)      half of it is sharp: it halves at |q2| ≈ 0.2 rad
        centred = ½ + ½/(1 + q1²)                                    q1 in rad
        calm    = ½ + ½/(1 + (q̇1² + q̇2²)/ω²)                         ω² = θ5/θ4, the pendulum's own, at least 1

    With `reward="tolerant"` each factor is flat where the rig does well enough, so that a policy that explores is not
    asked for ever less of it: with beyond(x, b, w) = (max(|x| − b, 0)/w)²

        upright = ½ min((1 + cos q2)/(1 + cos 0.1), 1) + ½/(1 + beyond(√(2 − 2 cos q2), 0.1, 0.2))
        centred = ½ + ½/(1 + beyond(q1, 0.3, 1)),   calm = ½ + ½/(1 + beyond(√(q̇1² + q̇2²)/ω, 0.15, 1))
        and the last factor 1 − beyond(u/u_max, 0.3, 0.7)/4

    `reward_weights` says how much of the reward each factor can take away: w = 1/2 of centred and calm, which are
    (1 − w) + w/(1 + …), and 1/4 of the last factor, "sparing". A fifth factor, "gentle", has w = 0 unless it is given:

        gentle = (1 − w) + w/(1 + |Δu|/(0.1 u_max))                 Δu: change of the command since the last action

    and with `arm_margin` = m > 0 [rad] the reward falls to zero before the arm's limit: times
    1 − beyond(q1, arm_limit − m, m).

    Ending an episode early only loses reward.

    ## Start
    Uniform and independent (q1 at most half of `arm_limit`): `balance` |q1| ≤ 0.2, |q2| ≤ 0.1 rad, |q̇1|, |q̇2| ≤ 0.2
    rad/s; `swing_up` |q1| ≤ 0.2, |q2 − π| ≤ 0.05 rad, at rest; or within ± `start_spread` of upright or hanging.
    Effects start with a memory of zeros, which for `arm_hysteresis` is an arm that came from q1 = 0. Before the episode
    the command was zero. `reset(options={"state": [q1, q2, v1, v2]})` starts from a given state (NaN: drawn).

    ## End of an episode
    terminated: |q1| > arm_limit (the cable), |q̇1| > the plant file's `arm_speed` if it has one, in `balance`
    |q2| > pendulum_limit, or a motion beyond what is computed: |q2| > 5000 rad or |q̇1| + |q̇2| ≥ 1e6 rad/s, or not
    finite; all at the end of an action.
    truncated: only by a time limit, whichever comes first: `time_limit` in seconds, and for `FurutaID-v0` 1000 actions
    unless `max_episode_steps` is given to `gymnasium.make`.

    ## Options
    plant: Plant, its dictionary (`Plant.to_dict`), plant file, or the name of a set (`table3`, `qube`, `large`).
        Default `table3`, the paper's. The spec of an env holds a Plant as its dictionary, so that it has a JSON.
    task: `balance` (default) or `swing_up`.
    randomize (False): True draws the plant at every reset from the covariance in its file, truncated to M > 0,
        friction ≥ 0 and the effects' bounds. The three sets have none; there each θ varies by 5 %
        (`plant.sets.SPREAD`). "NAME=RANGE …", or a mapping, draws what is named: `envs.ranges` has the grammar, for θ,
        effects, sensors, supply, jitter and pushes. A plant file with the key "randomize" says what True means.
    effect_probabilities ({}): {name: p} lets an effect act in an episode with probability p; at its own size if the
        plant carries it, else at a size drawn up to `Plant.default_effect` (`input_delay`: 25 ms), and with the
        parameters that `randomize` draws. Works without `randomize` too.
    sample_time (the plant's, else 0.01 s): period T at which the encoders are read.
    action_time (T): how long an action is held [s], rounded up to whole samples; readings and velocities go on at T.
    time_limit (none): length of an episode [s]. In `FurutaID-v0` it only shortens the 1000 actions: a batch refuses one
        beyond them at reset, and a single env warns after 1000 actions. Give `max_episode_steps` then.
    jitter (0): every period is T (1 + jitter · uniform(−1, 1)), at most 0.3. The velocity filter goes on assuming T.
    delay (the plant's): seconds from a sample to its command's effect, fractions of a sample included. It takes the
        place of the plant's own `input_delay`, also where that is drawn from the covariance.
    encoder_counts, noise_std [rad], encoder_offset [rad], velocity_cutoff ωc [rad/s]: see `Sensors`; default is what
        the plant file says, else 4096 counts, no noise, no offset, 100 rad/s.
    history (1), observe_command (False): with a delay, `history=3, observe_command=True` make the state visible again.
    normalize_action (False): see Action. scale_observation (False): see Observation.
    reward_weights ({}): {name: weight in [0, 1]} of centred, calm, sparing, gentle; arm_margin (0): see Reward.
    reward_scale (1): a factor on the reward. Learners of many kinds work best where returns are about ten.
    reward ("smooth"), start_spread (see Start): half-widths of q1, q2 [rad], q̇1, q̇2 [rad/s].
    arm_limit (the plant file's `arm_travel`, else 2π rad), pendulum_limit (0.5 rad in `balance`, else 5000 rad).
    longest_step (2.5 ms): bound on the Runge–Kutta step h. Friction bounds it too, h λ ≤ 0.4 with λ the rate at which
        it stops a slow motion (largest eigenvalue of M⁻¹ (F_v + F_c r) upright) of the stiffest rig that effects and
        theta=physical may give, and a sample has at least two steps.
        Rms error of the angles over 1 s of random commands held for a sample, in counts of a 4096-count encoder:
        hanging 0.3 with commands up to ±u_max and 0.01 with a tenth of that, upright 0.04 with a tenth; falling
        magnifies it, to 3 counts with commands up to ±u_max (the worst of the three sets; `make bench` prints all).
    render_mode: None, `rgb_array` or `human`.

    ## Info
    `state` (4,): true q1, q2, q̇1, q̇2. `measured_state` (4,): the same as the rig's computer has them, q2 unwrapped.
    `command`: as applied, after clipping, before delay and other effects. At reset also `plant` (theta (9,),
    friction_sharpness (2,), effects {name: {parameter: value}}; an effect that is off has its neutral value) when
    plants are drawn, and `rig` {name: value} of what else `randomize` draws; `env.unwrapped.plant` is the same plant as
    a `Plant`.

    ## Randomness
    `reset(seed=…)` reproduces everything that follows: starts, plants, noise, jitter, over any number of episodes.

    ## Versions
    v0: first version.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 100}  # noqa: RUF012  (Gymnasium's own way)
    spec = PlainSpec()  # type: ignore[assignment]

    def __init__(
        self,
        plant: Plant | Mapping[str, Any] | str | os.PathLike[str] = "table3",
        task: str = "balance",
        *,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode must be one of {self.metadata['render_modes']} or None, got {render_mode!r}")
        self.render_mode = render_mode
        self.setup = setup = Setup(Options.of({"plant": plant, "task": task} | options))
        self.observation_space: spaces.Box = setup.observation_space  # pyrefly: ignore[bad-override]
        self.action_space: spaces.Box = setup.action_space  # pyrefly: ignore[bad-override]
        self.metadata = type(self).metadata | {"render_fps": round(1.0 / setup.action_period)}
        self._lanes = np.zeros((k.block_rows(setup.sizes), 1))
        self._stream = np.zeros(1, dtype=np.uint64)
        self._seeded = False
        self._ready = False
        self._size = setup.observation_space.shape[0]
        shared = (self._lanes, self._stream, setup.codes, setup.sizes, setup.numbers)
        self._step_arguments = (*shared, np.empty((k.work_rows(setup.sizes), 1)))
        self._reset_arguments = (*shared, *setup.random.tables)
        self._viewer: Viewer | None = None

    @property
    def plant(self) -> Plant:
        """The plant of the present episode (the drawn one, where plants are drawn)."""
        drawn = self._ready and self.setup.random.active
        return self.setup.random.drawn_plant(self._parameters) if drawn else self.setup.plant

    @property
    def _parameters(self) -> NDArray[np.float64]:
        first = k.N_FIXED + self.setup.sizes[k.STATE_ROWS]
        return self._lanes[first : first + self.setup.sizes[k.PARAMETER_ROWS], 0].copy()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        check_time_limit(self.spec, self.setup.longest, taken=int(self._lanes[k.STEPS, 0]) if self._ready else 0)
        start = start_state(options, self.setup)
        super().reset(seed=seed)  # after that: a reset that is refused changes nothing
        if seed is not None or not self._seeded:
            self._stream[0] = start_stream(self.np_random)
            self._seeded = True
        observation, state, measured = np.empty(self._size, np.float32), np.empty(4), np.empty(4)
        _reset_one(*self._reset_arguments, start, observation, state, measured)
        self._ready = True
        info: dict[str, Any] = {"state": state, "measured_state": measured, "command": 0.0}
        if self.setup.random.active:
            info["plant"] = self.setup.random.describe(self._parameters)
            if rig := drawn_rig(self.setup, self._lanes[k.NOISE1 : k.N_FIXED, 0]):
                info["rig"] = rig
        if self.render_mode == "human":
            self._show()
        return observation, info

    def set_level(self, level: float) -> None:
        """From the next reset on, ranges reach only `level` in [0, 1] of the way; see `Randomization.narrowed`.

        For a curriculum. Raises ValueError for another level."""
        random = self.setup.random.narrowed(level, self.setup.numbers[k.RIG :])
        self._reset_arguments = (*self._reset_arguments[:5], *random.tables)

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        if not self._ready:
            raise ResetNeeded("call reset() before step()")
        try:
            (u,) = action.tolist() if isinstance(action, np.ndarray) else action  # Python's numbers are the faster ones
            u = float(u)
        except (TypeError, ValueError):
            raise ValueError(f"action must be an array of one number, shape (1,), as [0.5], got {action!r}") from None
        if u != u:
            raise ValueError("action is NaN; check the policy that made it")
        # three small arrays are made faster than two and the parts of one
        observation, state, measured = np.empty(self._size, np.float32), np.empty(4), np.empty(4)
        reward, terminated, truncated, command = _step_one(u, *self._step_arguments, observation, state, measured)
        if self.render_mode == "human":
            self._show()
        info = {"state": state, "measured_state": measured, "command": command}
        return observation, reward, terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """The present frame (height, width, 3) in mode rgb_array; mode human draws by itself in reset and step."""
        if self.render_mode is None:
            gym.logger.warn(
                'there is nothing to render without a render_mode; make the env with "rgb_array" or "human"'
            )
            return None
        if not self._ready:
            raise ResetNeeded("call reset() before render()")
        if self.render_mode == "human":
            self._show()
            return None
        return self._open_viewer().draw(Scene.of(self.setup, self._lanes[:, 0]))

    def _show(self) -> None:
        self._open_viewer().show(Scene.of(self.setup, self._lanes[:, 0]))

    def _open_viewer(self) -> Viewer:
        if self._viewer is None:
            self._viewer = Viewer(trail=True)
        return self._viewer

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_viewer": None}  # a window cannot be copied; it is opened again

    def close(self) -> None:
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None


def start_state(
    options: dict[str, Any] | None,
    setup: Setup,
    shape: tuple[int, ...] = (4,),
    known: Collection[str] = ("state",),
) -> NDArray[np.float64]:
    """options["state"], (4,) or of the given shape, NaN where it is left to chance. known: options that there are.
    Raises ValueError otherwise, and for a state that no observation can show."""
    if strange := set(options or {}) - set(known):
        raise ValueError(
            f"reset has no option {', '.join(sorted(map(repr, strange)))}; it takes 'state' (q1, q2, q̇1, q̇2)"
        )
    given = (options or {}).get("state")
    try:
        state = np.full(4, math.nan) if given is None else np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        state = np.empty(0)
    if state.shape not in ((4,), shape) or np.isinf(state).any():
        raise ValueError(f"options['state'] must hold finite q1, q2, q̇1, q̇2, shape (4,) or {shape}, got {given!r}")
    most = np.array([2.0 * setup.arm_limit, 1e3, SPEED_LIMIT, SPEED_LIMIT])
    if (np.abs(state) > most).any():  # NaN is not
        sizes = ", ".join(f"{name} {value:g}" for name, value in zip(("q1", "q2", "q̇1", "q̇2"), most, strict=True))
        raise ValueError(f"options['state'] is out of reach: got {given!r}, expected at most (±) {sizes}")
    return np.ascontiguousarray(np.broadcast_to(state, shape))


@compiled(forceinline=True)
def _publish(lanes, sizes, observation, state, measured):
    first = k.first_frame_row(sizes)
    for i in range(observation.shape[0]):
        observation[i] = lanes[first + i, 0]
    for i in range(4):
        state[i] = lanes[k.N_FIXED + i, 0]
        measured[i] = lanes[k.READING1 + i, 0]


@compiled
def _reset_one(
    lanes, streams, codes, sizes, numbers, table, root, switches, ranges, start, observation, state, measured
):
    only = lanes.shape[1] - 1  # as a literal, it would have all compiled once more
    k.reset_lane(lanes, only, streams, codes, sizes, numbers, table, root, switches, ranges, start)
    _publish(lanes, sizes, observation, state, measured)


@compiled
def _step_one(u, lanes, streams, codes, sizes, numbers, work, observation, state, measured):
    lanes[k.COMMAND, 0] = u
    k.step_lanes(lanes, streams, codes, sizes, numbers, work)
    _publish(lanes, sizes, observation, state, measured)
    late = lanes[k.STEPS, 0] >= numbers[k.LONGEST]
    return lanes[k.REWARD, 0], lanes[k.TERMINATED, 0] > 0.0, late, lanes[k.COMMAND, 0]
