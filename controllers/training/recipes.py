"""Settings with which `FurutaID-v0` is learned, by algorithm: what is given to stable-baselines3, and why.

Steps are cheap here (a compiled batch) and network updates are not, so PPO, which makes few large updates from many
steps, learns the swing-up in seconds of CPU. SAC and TQC make an update for every few steps: they need a tenth of the
steps and more time, and are there for those who want to compare, or whose steps are dear.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from furuta_gym.plant import Plant
from furuta_gym.plant.parameters import pendulum_frequency
from furuta_gym.simulation import period_of

HORIZON = 2.0  # s; rewards so far ahead count 1/e. A swing-up takes half a second to two
EPISODE = 8.0  # s; long enough to swing up and then to hold, which is where most of the reward is
PERIOD = 0.02  # s; a tenth of the fastest motion of the rigs here. A shorter one makes each action matter less
RECURRENT = "recurrent"
ALGORITHMS = ("ppo", "sac", "tqc", RECURRENT)


@dataclass(frozen=True)
class Recipe:
    """How an algorithm is set up.

    name: of its class. envs: size of the batch. reward_scale: factor on the env's reward while learning.
    layers, activation: hidden layers of actor and critic. log_std: log standard deviation of the first policy's
    actions in shares of u_max; None where the algorithm finds its own. settings: keyword arguments of the algorithm.
    last_rate: share of the learning rate that is left at the end, to which it falls in proportion to the steps.
    episode: length of those that it learns from [s]. cells: LSTM cells of actor and critic each; 0 for no memory.
    """

    name: str
    envs: int
    reward_scale: float
    layers: tuple[int, ...]
    activation: str
    log_std: float | None
    settings: Mapping[str, Any]
    last_rate: float = 1.0
    episode: float = EPISODE
    cells: int = 0

    @property
    def off_policy(self) -> bool:
        """Whether it learns from a memory of past steps."""
        return "buffer_size" in self.settings


@dataclass(frozen=True)
class Given:
    """What a named recipe gives a training run that says nothing else: fields of `Training` of the same names.

    ranges: of `randomize`, for all plants. cable: largest stiffness of a cable at the arm [u_max per rad]; 0 for none.
    """

    steps: int = 2_000_000
    ranges: Mapping[str, str] = field(default_factory=dict)
    cable: float = 0.0
    history: int = 1
    observe_command: bool = False
    reward_weights: Mapping[str, float] = field(default_factory=dict)
    arm_margin: float = 0.0

    def of(self, plant: Plant) -> dict[str, Any]:
        """Fields of `Training` by name, for a plant."""
        ranges = dict(self.ranges)
        if self.cable:
            ranges["arm_spring.k"] = f"uniform:0,{self.cable * plant.u_max:.6g}"
            ranges["arm_spring.q1n"] = "uniform:-0.5,0.5"
        found = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("ranges", "cable")}
        return found | {"randomize": ranges or False}


# `robust`: six observations with their commands are 120 ms of the past, four times the longest delay: enough to tell
# how late, how heavy and how strong the rig is. The cable is a share of what the motor has. A command that changes by a
# tenth of u_max costs 15 % of the reward, which is what makes it calm; the margin keeps the arm away from its limit.
RECIPES = {
    "plain": Given(),
    "robust": Given(
        steps=8_000_000,
        ranges={"theta": "physical:0.2", "input_delay": "uniform:0,0.03"},
        cable=0.06,
        history=6,
        observe_command=True,
        reward_weights={"gentle": 0.3},
        arm_margin=1.0,
    ),
}


def recipe(algorithm: str, task: str, name: str = "plain") -> Recipe:
    """The settings of one of `ALGORITHMS` for "balance" or "swing_up", and for a recipe of `RECIPES`.

    Raises ValueError for another algorithm or recipe."""
    if name not in RECIPES:
        raise ValueError(f"--recipe {name!r}: expected one of {', '.join(RECIPES)}")
    if algorithm == "ppo":
        plain = Recipe("PPO", 64, 0.1, (32, 32), "Tanh", _FIRST_NOISE[task], dict(_PPO))
        return plain if name == "plain" else _wider(plain)
    if algorithm == RECURRENT:
        kept = Recipe("RecurrentPPO", 256, 0.1, (32, 32), "Tanh", _FIRST_NOISE[task], dict(_RECURRENT), 0.1, cells=64)
        return kept if name == "plain" else replace(kept, last_rate=0.02, episode=6.0)
    if algorithm in ("sac", "tqc"):
        return Recipe(algorithm.upper(), 16, 1.0, (64, 64), "ReLU", None, dict(_OFF_POLICY))
    raise ValueError(f"--algo {algorithm!r}: expected one of {', '.join(ALGORITHMS)}")


def _wider(plain: Recipe) -> Recipe:
    """For rigs that differ: a larger network, twice the rigs in a batch, and a learning rate that falls to 2 %.

    A policy for all rigs is found early and made calm late. Shorter episodes have more of the swing-up in them."""
    settings = dict(plain.settings) | {"batch_size": 4096, "learning_rate": 5e-4}
    return replace(plain, envs=128, layers=(64, 64), settings=settings, last_rate=0.02, episode=6.0)


# How hard a new policy shakes the rig. To leave the bottom it takes most of u_max, though a unit Gaussian is too much:
# it learns to switch between the limits first, and only then to be calm. To balance it takes a quarter.
_FIRST_NOISE = {"swing_up": -0.5, "balance": -1.5}

# 64 envs · 128 steps make a batch of 8192: at 50 Hz each env sees 2.6 s, a whole swing-up, between two updates.
# Four minibatches, five times over, keep the CPU spent on the network near that spent on the plant.
_PPO: dict[str, Any] = {
    "n_steps": 128,
    "batch_size": 2048,
    "n_epochs": 5,
    "learning_rate": 3e-4,
    "gae_lambda": 0.95,
    "ent_coef": 0.0,  # the first noise is enough to find the top, and an entropy bonus would keep the arm shaking
}

# Memory is learned from sequences that are gone through step by step, so wide batches are cheap and long ones are not:
# 256 envs · 64 steps. Each sees 1.3 s between two updates; what the cells hold is carried on to the next. Batches are
# twice PPO's, so a larger rate does no harm. Robust keeps the small layers: what tells rigs apart is in the cells.
_RECURRENT: dict[str, Any] = _PPO | {"n_steps": 64, "batch_size": 4096, "learning_rate": 1e-3}

# One update for every two steps; 800 steps of chance first, in 16 rigs, fill the memory with all angles.
_OFF_POLICY: dict[str, Any] = {
    "buffer_size": 300_000,
    "batch_size": 256,
    "learning_rate": 1e-3,
    "learning_starts": 800,
    "train_freq": 1,
    "gradient_steps": 8,
    "ent_coef": "auto",
}


def training_period(plant: Plant, sample_time: float | None) -> float:
    """The policy's period [s]: the caller's, else the multiple of the plant's sample time that is nearest to 20 ms.

    A policy acts on every n-th sample of a rig whose clock is n times faster, see `LearnedController`.
    """
    if sample_time is not None:
        return period_of(sample_time)
    if plant.sample_time is None:
        return PERIOD
    return plant.sample_time * max(1, round(PERIOD / plant.sample_time))


def discount(period: float) -> float:
    """γ for `HORIZON` at this period [s], so that a change of period does not change what is wanted."""
    return math.exp(-period / HORIZON)


def observation_scale(plant: Plant, history: int, observe_command: bool) -> list[float]:
    """Factors that bring every entry of the observation to about one: speeds are counted in the pendulum's
    frequency."""
    w = pendulum_frequency(plant.theta) or 1.0  # without weight there is none
    frame = [1.0, 1.0, 1.0, 1.0 / w, 1.0 / w] + [1.0] * observe_command
    return frame * history
