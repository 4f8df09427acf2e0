"""The options of `FurutaID-v0`: checked once, and turned into the numbers that the compiled step takes."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from numbers import Real
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..arguments import ArgumentError
from ..plant.effects import Effect
from ..plant.parameters import pendulum_frequency
from ..plant.plant import Plant
from ..plant.plant_file import ARM_TRAVEL
from ..plant.sets import with_spread
from ..sensors import Sensors, difference_gain
from ..simulation import CLOCK_ROUNDING, MOST_STEPS, too_many_steps
from . import kernels as k
from .randomization import Randomization, randomization
from .ranges import RIG, Draws, draws, with_drawn_effects, within_an_episode
from .registration import MAX_EPISODE_STEPS

TASKS = ("balance", "swing_up")
REWARDS = ("smooth", "tolerant")
REWARD_WEIGHTS: dict[str, float] = {"centred": 0.5, "calm": 0.5, "sparing": 0.25, "gentle": 0.0}
"""What each factor of the reward can take away, unless `reward_weights` says otherwise."""
SAMPLE_TIME = 0.01  # s, where the plant has none of its own
SHORTEST_SAMPLE = 1e-4
"""Shortest sample time [s] of an env."""
SPEED_LIMIT = 200.0  # rad/s; the observation's velocities are clipped here
PUSH_RATE = 0.5  # 1/s, of pushes whose rate is not drawn
_FEWEST_SUBSTEPS = 2
_FRICTION_STEP = 0.4  # longest Runge–Kutta step times the friction's rate
_BRISTLE_STEP = 2.5e-3  # s; a bristle, of at most 1000 1/s, makes longer steps unstable
_NO_COVARIANCE = (
    "this plant has no covariance to draw from; identify it from a log (`furuta identify`), which stores one, or give "
    "ranges such as theta=physical:0.2"
)


@dataclass(frozen=True)
class Options:
    """What `FurutaEnv` documents, one field each. Raises ValueError (got, expected) on anything impossible."""

    plant: Plant | Mapping[str, Any] | str | os.PathLike[str] = "table3"
    task: str = "balance"
    randomize: bool | str | Mapping[str, Any] | Sequence[str] = False
    effect_probabilities: Mapping[str, float] = field(default_factory=dict)
    sample_time: float | None = None
    encoder_counts: float | tuple[float, float] | None = None
    noise_std: float | tuple[float, float] | None = None
    encoder_offset: tuple[float, float] | None = None
    velocity_cutoff: float | None = None
    delay: float | None = None
    jitter: float = 0.0
    history: int = 1
    observe_command: bool = False
    normalize_action: bool = False
    scale_observation: bool = False
    reward: str = "smooth"
    reward_weights: Mapping[str, float] = field(default_factory=dict)
    reward_scale: float = 1.0
    start_spread: tuple[float, float, float, float] | None = None
    action_time: float | None = None
    time_limit: float | None = None
    arm_limit: float | None = None
    arm_margin: float = 0.0
    pendulum_limit: float | None = None
    longest_step: float = 2.5e-3

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Options":
        """From keyword arguments; an unknown one is refused with the list of those that exist."""
        known = [f.name for f in fields(cls)]
        if strange := sorted(set(given) - set(known)):
            raise TypeError(f"no option {', '.join(strange)}; there are render_mode, {', '.join(known)}")
        return cls(**given)

    def __post_init__(self) -> None:
        if isinstance(self.randomize, Mapping):  # a plant's own cannot be copied
            object.__setattr__(self, "randomize", dict(self.randomize))
        if self.task not in TASKS:
            raise ValueError(f"task must be one of {', '.join(TASKS)}, got {self.task!r}")
        for name in ("observe_command", "normalize_action", "scale_observation"):
            if not isinstance(getattr(self, name), bool | np.bool_):
                raise ValueError(f"{name} must be True or False, got {getattr(self, name)!r}")
        if self.reward not in REWARDS:
            raise ValueError(f"reward must be one of {', '.join(REWARDS)}, got {self.reward!r}")
        _check_weights(self.reward_weights)
        if self.start_spread is not None:
            try:
                spread = np.asarray(self.start_spread, dtype=float)
            except (TypeError, ValueError):
                spread = np.empty(0)
            if spread.shape != (4,) or not ((spread >= 0) & (spread <= 100)).all():
                raise ValueError(f"start_spread must be four half-widths of q1, q2, q̇1, q̇2, got {self.start_spread!r}")
        if not (isinstance(self.history, int | np.integer) and 1 <= self.history <= 100):
            raise ValueError(f"history must be a whole number of samples in [1, 100], got {self.history!r}")
        _check("jitter", self.jitter, 0.0, 0.3, "share of the sample time")
        for name, low, high, unit in (
            ("arm_limit", 0.01, 1e3, "rad"),
            ("action_time", SHORTEST_SAMPLE, 1.0, "s"),
            ("time_limit", 1e-3, 1e6, "s"),
        ):
            if getattr(self, name) is not None:
                _check(name, getattr(self, name), low, high, unit)
        _check("reward_scale", self.reward_scale, 1e-6, 1e6, "")
        _check("arm_margin", self.arm_margin, 0.0, 1e3, "rad")
        _check("longest_step", self.longest_step, 1e-5, 0.05, "s")
        if self.sample_time is not None:
            _check("sample_time", self.sample_time, SHORTEST_SAMPLE, 1.0, "s")
        if self.pendulum_limit is not None:
            _check("pendulum_limit", self.pendulum_limit, 0.01, 1e3, "rad")
        if not isinstance(self.effect_probabilities, Mapping):
            raise ValueError(
                f"effect_probabilities must map effect names to probabilities, got {self.effect_probabilities!r}"
            )


def _check_weights(given: Any) -> None:
    if not isinstance(given, Mapping):
        raise ValueError(f"reward_weights must map {', '.join(REWARD_WEIGHTS)} to numbers, got {given!r}")
    for name, value in given.items():
        if name not in REWARD_WEIGHTS:
            raise ValueError(f"reward_weights: the reward has no {name!r}; it has {', '.join(REWARD_WEIGHTS)}")
        _check(f"reward_weights: {name}", value, 0.0, 1.0, "(what the factor can take away)")


def _check(name: str, value: Any, low: float, high: float, unit: str) -> None:
    if not (isinstance(value, Real) and not isinstance(value, bool) and low <= float(value) <= high):
        raise ValueError(f"{name} must lie in [{low:g}, {high:g}] {unit}".rstrip() + f", got {value!r}")


def _check_once(options: Options, drawn: Draws) -> None:
    """Refuse what is said by an option and drawn by `randomize` as well. Raises ArgumentError."""
    # with a chance, the option is kept at times; of an effect, at times there is none
    drawn_always = {name for name, made in drawn.ranges.items() if made.chance == 1.0}
    twice = {
        "delay": options.delay is not None and "input_delay.d" in drawn.ranges,
        "noise_std": options.noise_std is not None and "noise_std" in drawn_always,
        "encoder_offset": options.encoder_offset is not None and "encoder_offset" in drawn_always,
        "jitter": options.jitter > 0.0 and "jitter" in drawn_always,
    }
    if both := set(drawn.chances) & set(options.effect_probabilities):
        raise ArgumentError(
            "effect_probabilities", f"({', '.join(sorted(both))})", "randomize gives its chance too; give it once"
        )
    for name, is_twice in twice.items():
        if is_twice:
            raise ArgumentError(name, f"of {getattr(options, name)}", "randomize draws it; give one of the two")


def _own_speed(plant: Plant) -> float:
    """Of the pendulum [rad/s], at least 1: the unit of scaled speeds and of the reward's calm."""
    return max(pendulum_frequency(plant.theta), 1.0) if plant.theta[4] > 0 else 1.0


class Setup:
    """Everything that one env and a batch of them share: the plant, the spaces, and the compiled step's constants.

    numbers (f8) and sizes (i8) are indexed by the names in `kernels`.
    """

    def __init__(self, options: Options) -> None:
        self.options = options
        plant = Plant.resolve(options.plant)
        self.sample_time = float(options.sample_time or plant.sample_time or SAMPLE_TIME)
        _check("sample_time", self.sample_time, SHORTEST_SAMPLE, 1.0, "s")
        drawn = draws(options.randomize, plant)
        _check_once(options, drawn)
        self.draws = drawn = replace(drawn, chances={**drawn.chances, **options.effect_probabilities})
        if drawn.posterior:
            plant = with_spread(plant)
            if plant.covariance is None:
                raise ArgumentError("randomize", "(theta from the plant's covariance)", _NO_COVARIANCE)
        if options.delay is not None:
            _check("delay", options.delay, 0.0, 0.1, "s")
            plant = plant.with_effects(Effect("input_delay", {"d": options.delay}))
            if plant.covariance is not None:
                plant = plant.replace(covariance=plant.covariance.without("input_delay.d"))
        self.plant = plant
        self.sensors = _sensors(plant, options)
        self.arm_limit = float(options.arm_limit or plant.limit("arm_travel", ARM_TRAVEL))
        if not options.arm_margin < self.arm_limit:
            raise ValueError(
                f"arm_margin must be less than the arm's limit of {self.arm_limit:g} rad, got {options.arm_margin:g}"
            )
        self.supply = plant.supply
        self.speed_unit = _own_speed(plant) if options.scale_observation else 1.0
        # an action is never shorter than asked for, so that 20 ms are never more than 50 actions a second; but for the
        # rounding of a clock that was read from stamps, see `same_clock`
        self.samples = max(1, math.ceil((options.action_time or 0.0) / self.sample_time * (1.0 - CLOCK_ROUNDING)))
        self.action_period = self.samples * self.sample_time
        self.longest = (
            math.inf if options.time_limit is None else max(1, round(options.time_limit / self.action_period))
        )
        # a limit that `gymnasium.make` or a batch was given is not known here
        episode = (self.longest if self.longest < math.inf else MAX_EPISODE_STEPS) * self.action_period
        self.draws = drawn = within_an_episode(drawn, plant, episode)
        self.random: Randomization = randomization(
            with_drawn_effects(plant, drawn), drawn.posterior, drawn.chances, drawn.physical, drawn.ranges
        )
        self.jitter = self.random.largest("jitter", options.jitter)
        self.codes = self.random.plant.packed().codes
        self.substeps = self._substeps()
        self.sizes = self._sizes()
        self.numbers = self._numbers()
        self.observation_space, self.action_space = self._spaces()

    @property
    def doubt(self) -> str:
        """What to know of a plant whose log did not show every parameter, in a sentence; "" where it did.

        Parameters that `randomize` draws from ranges, or all together by theta=physical, are not in doubt."""
        if self.random.told:
            return self.random.told
        lost = [n for n in self.plant.not_identified if n not in self.draws.ranges]
        if not lost or self.draws.physical:
            return ""
        names = ", ".join(n.replace("theta", "θ") for n in lost)
        return (
            f"the log of this plant did not show {names}. Their values are taken as they stand, and may be far off. "
            "`furuta identify` says what to record"
        )

    def _substeps(self) -> int:
        """Runge–Kutta steps a sample, at least two: see `FurutaEnv` for the rule and its error."""
        share = self.random.physical
        asked = self.options.longest_step * (1.0 - share) / (1.0 + share)  # the lightest rig moves the fastest
        longest = min(asked, _FRICTION_STEP / _friction_rate(self.random, self.draws.posterior))
        memories = (effect.type.friction_memory for effect in self.random.plant.effects)
        if any(memory is not None and memory.element == "bristle" for memory in memories):
            longest = min(longest, _BRISTLE_STEP)
        n = self.sample_time * (1.0 + self.jitter) / longest - 1e-9
        if not n <= MOST_STEPS:
            raise too_many_steps(self.sample_time, n, None if longest < asked else self.options.longest_step)
        return max(_FEWEST_SUBSTEPS, math.ceil(n))

    def _sizes(self) -> NDArray[np.int64]:
        o, packed = self.options, self.random.plant.packed()
        delay = self.random.plant.effect("input_delay")
        past = stretches = 0
        if delay is not None:
            shortest = self.sample_time * (1.0 - self.jitter)
            past = math.ceil(self.random.longest_delay / shortest) + 2
            stretches = 1 + math.ceil((1.0 + self.jitter) / (1.0 - self.jitter) - 1e-9)
        sizes = np.zeros(k.N_SIZES, dtype=np.int64)
        sizes[k.STATE_ROWS] = packed.rows
        sizes[k.PARAMETER_ROWS] = packed.p.size
        sizes[k.SUBSTEPS] = self.substeps
        sizes[k.PAST_COMMANDS] = past
        sizes[k.STRETCHES] = stretches
        sizes[k.HISTORY] = o.history
        sizes[k.FRAME] = 6 if o.observe_command else 5
        sizes[k.SAMPLES] = self.samples
        return sizes

    def _numbers(self) -> NDArray[np.float64]:
        o, plant, sensors = self.options, self.plant, self.sensors
        balance = o.task == "balance"
        numbers = np.zeros(k.N_NUMBERS)
        numbers[k.SAMPLE_TIME] = self.sample_time
        numbers[k.U_MAX] = plant.u_max
        numbers[k.ACTION_SCALE] = plant.u_max if o.normalize_action else 1.0
        numbers[k.VELOCITY_GAIN] = difference_gain(sensors.velocity_cutoff, self.sample_time)
        rig = [*np.broadcast_to(sensors.noise_std, 2), *sensors.offset, self.supply, o.jitter, 0.0, PUSH_RATE]
        numbers[k.RIG :] = rig
        drawn = self.draws.ranges
        numbers[k.NOISY] = max(rig[:2]) > 0.0 or "noise_std" in drawn
        numbers[k.JITTERY] = self.jitter > 0.0
        numbers[k.PUSHED] = "push" in drawn
        numbers[k.COUNT1 : k.COUNT1 + 2] = sensors.resolution
        numbers[k.ARM_LIMIT] = self.arm_limit
        numbers[k.ARM_SPEED] = plant.limit("arm_speed", math.inf)
        numbers[k.SPEED_SHARE] = 1.0 / self.speed_unit
        numbers[k.LONGEST] = self.longest
        numbers[k.PENDULUM_LIMIT] = o.pendulum_limit or (k.BALANCE_LIMIT if balance else k.WINDING_LIMIT)
        numbers[k.SPEED_LIMIT] = SPEED_LIMIT
        numbers[k.SPEED_SCALE] = _own_speed(plant)
        numbers[k.START_Q2] = 0.0 if balance else math.pi
        spread = k.START_BALANCE if balance else k.START_SWING_UP
        within = (min(spread[0], 0.5 * self.arm_limit), *spread[1:])
        numbers[k.START_SPREAD : k.START_SPREAD + 4] = within if o.start_spread is None else o.start_spread
        numbers[k.TOLERANT] = o.reward == "tolerant"
        numbers[k.CENTRED : k.GENTLE + 1] = list((REWARD_WEIGHTS | dict(o.reward_weights)).values())
        numbers[k.ARM_MARGIN], numbers[k.REWARD_SCALE] = o.arm_margin, o.reward_scale
        numbers[k.SLEW] = plant.limit("slew", math.inf)
        return numbers

    def _spaces(self) -> tuple[spaces.Box, spaces.Box]:
        speed = SPEED_LIMIT / self.speed_unit
        high = np.array([2 * self.arm_limit, 1.0, 1.0, speed, speed], dtype=np.float32)
        if self.options.observe_command:
            high = np.append(high, np.float32(1.0))
        high = np.tile(high, self.options.history)
        limit = np.float32(1.0 if self.options.normalize_action else self.plant.u_max)
        return (
            spaces.Box(-high, high, dtype=np.float32),
            spaces.Box(-limit, limit, (1,), dtype=np.float32),
        )


def drawn_rig(setup: Setup, rows: NDArray[np.float64]) -> dict[str, Any]:
    """What was drawn beside the plant, from the rig's rows (8,) or (8, N): {name: (), (2,), (N,) or (N, 2)}."""
    found, first = {}, 0
    for name, entry in RIG.items():
        if name in setup.draws.ranges:
            part = rows[first : first + entry.values]
            found[name] = part[0].copy() if entry.values == 1 else part.T.copy()
        first += entry.values
    return found


def _friction_rate(random: Randomization, drawn: bool) -> float:
    """λ [1/s]: how fast friction stops a slow motion near upright.

    drawn: with an r that two standard deviations of the plant's covariance may make sharper."""
    plant = random.plant
    r = np.array(plant.sharpness)
    if drawn and plant.covariance is not None:
        std = dict(zip(plant.covariance.names, np.sqrt(np.diag(plant.covariance.matrix)).tolist(), strict=True))
        r = r + 2.0 * np.array([std.get(name, std.get("r", 0.0)) for name in ("r1", "r2")])
    r1, r2 = r.tolist()
    return replace(random, plant=plant.replace(friction_sharpness=(r1, r2))).friction_rate + 1e-9


def _sensors(plant: Plant, options: Options) -> Sensors:
    """The options where given, else what the plant file says of its sensors, else the defaults of `Sensors`."""
    return Sensors.of_file(
        plant.sensors,
        encoder_counts=options.encoder_counts,
        noise_std=options.noise_std,
        offset=options.encoder_offset,
        velocity_cutoff=options.velocity_cutoff,
    )
