"""What controllers are compared in: the plant as it is, pushes, wrong parameters, delays, encoders, effects."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.arguments import ArgumentError
from furuta_gym.plant import EFFECTS, Effect, Plant
from furuta_gym.plant.parameters import pendulum_frequency
from furuta_gym.plant.plant_file import ARM_TRAVEL
from furuta_gym.sensors import Sensors

from .statistics import Interval, success_rate, typical, worst
from .trials import Outcome, Starts, balance_starts, run_trials, swing_up_starts
from .variations import built_later, built_name, later, noisier, other_plants, possible, weaker

USUAL_GROUPS = ("balance", "push", "parameters", "delay", "quantisation", "effects", "swing_up")
GROUPS = (*USUAL_GROUPS, "map")
METRICS = ("rms_q1", "rms_q2", "energy", "roughness", "settling", "largest_q1")
WORST = ("settling", "largest_q1", "roughness", "energy")  # told of the worst 5 % too
SWING_UP_EFFECTS = (
    "actuator_lag",
    "input_dead_zone",
    "input_offset",
    "arm_spring",
    "arm_stribeck",
    "arm_backlash",
    "pendulum_encoder_offset",
    "base_tilt",
)
"""What rigs have most often; a swing-up is played with these unless effects are named."""

MAP_DELAYS = (0, 4, 8, 12, 16, 20, 24)  # ms
MAP_ERRORS = (0, 10, 20, 30)  # %, of masses, lengths, inertias, frictions and gain
SWING_UP_DURATION = 15.0  # s, at least
SWING_UP_PUSH = 0.5  # of the pendulum's frequency, once it is up

_PUSH_TIME = 0.5  # s
_AFTER_PUSH = 4.0  # s
_HALVINGS = 9


@dataclass(frozen=True)
class Condition:
    """One row of the comparison: the plants, sensors and starts of its trials.

    plants: one, or one for each trial. kind: "balance", "swing_up", or "push" (the largest push is searched). tap: of a
    swing-up, the push between a third and a half of its duration, as a share of the pendulum's frequency; the settling
    time then counts from it. arm_travel [rad]: what the arm must stay within; None for each plant's own.
    """

    name: str
    group: str
    kind: str
    plants: Plant | Sequence[Plant]
    sensors: Sensors
    trials: int
    duration: float
    tap: float = 0.0
    arm_travel: float | None = None

    def score(self, policy: Any, sample_time: float, seed: int) -> dict[str, Interval]:
        """Play `policy` and sum up: success rate, and the other figures over the successful trials, of which the
        settling time leaves out those that never settled: its n is then smaller.

        worst_FIGURE is the mean of the worst 5 %."""
        if self.kind == "push":
            return {"largest_push": typical(self._largest_push(policy, sample_time, seed), seed=seed)}
        outcome = self.play(policy, self.starts(seed), sample_time, seed)
        figures = {"success": success_rate(outcome.success)}
        figures |= {m: typical(_succeeded(outcome, m), seed=seed) for m in METRICS}
        return figures | {f"worst_{m}": worst(self._told(outcome, m), seed=seed) for m in WORST}

    def _told(self, outcome: Outcome, figure: str) -> NDArray[np.float64]:
        """Of the trials that succeeded; for the settling time of all, those that failed or never settled with the
        whole duration."""
        if figure == "settling":
            return np.where(outcome.success & np.isfinite(outcome.settling), outcome.settling, self.duration)
        return _succeeded(outcome, figure)

    def play(self, policy: Any, starts: Starts, sample_time: float, seed: int) -> Outcome:
        return run_trials(
            self.plants,
            policy,
            starts,
            self.duration,
            sample_time,
            self.sensors,
            swing_up=self.kind == "swing_up",
            arm_travel=self.arm_travel,
            seed=seed,
        )

    def starts(self, seed: int) -> Starts:
        """How its trials begin; the same for every policy."""
        rng = np.random.default_rng([seed, 1])
        one = self.plants if isinstance(self.plants, Plant) else self.plants[0]
        plants = [self.plants] if isinstance(self.plants, Plant) else self.plants
        least = min(plant.limit("arm_travel", ARM_TRAVEL) for plant in plants)
        travel = least if self.arm_travel is None else self.arm_travel
        if self.kind == "swing_up":
            starts = swing_up_starts(self.trials, rng, travel)
            if not self.tap:
                return starts
            size = self.tap * pendulum_frequency(one.theta) * rng.choice([-1.0, 1.0], self.trials)
            return replace(starts, push=size, push_time=self.duration * rng.uniform(1 / 3, 1 / 2, self.trials))
        return balance_starts(one, self.trials, self.duration, rng, travel=travel)

    def _largest_push(self, policy: Any, sample_time: float, seed: int) -> NDArray[np.float64]:
        """The largest survived push (trials,) [rad/s] up to 3 √(θ5/θ4), by bisection in all trials side by side."""
        assert isinstance(self.plants, Plant)
        starts = self.starts(seed)
        side = np.sign(starts.push)
        low, high = np.zeros(self.trials), np.full(self.trials, 3.0 * pendulum_frequency(self.plants.theta))
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            pushed = replace(starts, x0=0.2 * starts.x0, push=side * middle, push_time=np.full(self.trials, _PUSH_TIME))
            survived = self.play(policy, pushed, sample_time, seed).success
            low, high = np.where(survived, middle, low), np.where(survived, high, middle)
        return low


def _succeeded(outcome: Outcome, figure: str) -> NDArray[np.float64]:
    """A figure of the trials that succeeded and have it."""
    values = getattr(outcome, figure)[outcome.success]
    return values[np.isfinite(values)]


def check_groups(groups: Sequence[str]) -> None:
    """Raises ArgumentError for a group of trials that is not one of `GROUPS`."""
    if strange := [group for group in groups if group not in GROUPS]:
        raise ArgumentError("groups", ", ".join(map(repr, strange)), f"expected of {', '.join(GROUPS)}")


def nominal(plant: Plant, sensors: Sensors, task: str, trials: int, duration: float) -> Condition:
    """The task, "balance" or "swing_up", on the plant as it is; a swing-up has 15 s at least."""
    if task == "swing_up":
        return Condition("swing-up", task, task, plant, sensors, trials, max(duration, SWING_UP_DURATION))
    return Condition(task, task, task, plant, sensors, trials, duration)


def conditions(
    plant: Plant,
    sensors: Sensors,
    trials: int,
    small_trials: int,
    duration: float,
    groups: Iterable[str] = USUAL_GROUPS,
    effects: Iterable[str] | None = None,
    seed: int = 0,
) -> list[Condition]:
    """The conditions of the named groups; effects act at their default size.

    Effects are by default the whole library, in swing-ups `SWING_UP_EFFECTS`, less those that the plant carries.
    Delays beyond the longest that a plant can have are left out.

    Raises ValueError for an unknown group or effect, and for effects asked for that the plant carries already.
    """
    chosen = list(groups)
    check_groups(chosen)
    asked = None if effects is None else list(effects)
    near, swinging = (list(EFFECTS), SWING_UP_EFFECTS) if asked is None else (asked, asked)
    for name in near:
        Effect(name)  # complains about a name that is none, whatever the groups are
    carried = {e.name for e in plant.effects}
    if asked is not None and (already := carried.intersection(asked)) and {"effects", "swing_up"}.intersection(chosen):
        raise ArgumentError(
            "effects",
            ", ".join(sorted(already)),
            "the plant carries it already, so no trial can add it; name others, or compare on the plant without it",
        )
    short = min(duration, 10.0)

    def near_upright(name: str, group: str, plants: Plant | Sequence[Plant], s: Sensors = sensors) -> Condition:
        return Condition(name, group, "balance", plants, s, small_trials, short)

    found: list[Condition] = []
    for group in chosen:
        if group == "balance":
            found.append(nominal(plant, sensors, group, trials, duration))
        elif group == "push":
            found.append(Condition("push", group, "push", plant, sensors, small_trials, _PUSH_TIME + _AFTER_PUSH))
        elif group == "parameters":
            found += [near_upright(n, group, p) for n, p in other_plants(plant, small_trials, seed)]
        elif group == "delay":
            found += [near_upright(f"delay {ms} ms", group, later(plant, ms)) for ms in possible(plant, (4, 8, 16, 32))]
        elif group == "quantisation":
            for counts in (2048, 1024, 512, 256):
                coarse = replace(sensors, encoder_counts=counts)
                found.append(near_upright(f"{counts} counts", group, plant, coarse))
        elif group == "effects":
            for name in near:
                if name not in carried:
                    found.append(near_upright(name, group, plant.with_effects(plant.default_effect(name))))
        elif group == "map":
            found += _map(replace(nominal(plant, sensors, "swing_up", small_trials, duration), group=group), seed)
        else:
            hanging = nominal(plant, sensors, group, trials, duration)
            found += [hanging, *_harder(hanging, small_trials, swinging, seed)]
    return found


def _harder(plain: Condition, trials: int, effects: Sequence[str], seed: int) -> list[Condition]:
    """A swing-up with what a rig may have: a later command, a weaker supply, another θ, effects, noisier readings,
    coarser encoders, a push."""
    plant, sensors = plain.plants, plain.sensors
    assert isinstance(plant, Plant)
    rigs: list[tuple[str, Plant | Sequence[Plant]]] = []
    rigs += [(f"{ms} ms late", later(plant, ms)) for ms in possible(plant, (4, 8, 16, 24))]
    rigs += [(f"supply {percent} %", weaker(plant, percent)) for percent in (80, 60)]
    rigs += other_plants(plant, trials, seed)
    rigs += [(built_name(20, ms), built_later(plant, 20, ms, trials, seed)) for ms in possible(plant, (0, 8))]
    added = [name for name in effects if name != "input_delay" and plant.effect(name) is None]
    rigs += [(name, plant.with_effects(plant.default_effect(name))) for name in added]
    found = [replace(plain, name=f"swing-up, {name}", plants=rig, trials=trials) for name, rig in rigs]
    for mrad in (1, 3):
        found.append(replace(plain, name=f"swing-up, noise {mrad} mrad", sensors=noisier(sensors, mrad), trials=trials))
    for counts in (1024, 512):
        coarse = replace(sensors, encoder_counts=counts)
        found.append(replace(plain, name=f"swing-up, {counts} counts", sensors=coarse, trials=trials))
    return [*found, replace(plain, name="swing-up, pushed", trials=trials, tap=SWING_UP_PUSH)]


def _map(plain: Condition, seed: int) -> list[Condition]:
    """Swing-ups over delay and error of the rig."""
    assert isinstance(plain.plants, Plant)
    return [
        replace(plain, name=map_name(ms, percent), plants=built_later(plain.plants, percent, ms, plain.trials, seed))
        for percent in MAP_ERRORS
        for ms in possible(plain.plants, MAP_DELAYS)
    ]


def map_name(ms: float, percent: float) -> str:
    """Name of a condition of the group "map"."""
    return f"map, ±{percent:g} %, {ms:g} ms late"
