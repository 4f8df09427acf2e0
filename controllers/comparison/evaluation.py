"""Compare controllers: the same seeded trials, sensors, limits and sample time for all, encoders only."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

from furuta_gym.plant import Plant
from furuta_gym.processes import worker_options
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import DEFAULT_SAMPLE_TIME, same_clock

from ..base import Controller, DesignError
from ..design import choose_sample_time, choose_sensors, design_plant_for
from ..registry import make_controller
from .conditions import USUAL_GROUPS, Condition, conditions
from .result import Comparison
from .statistics import Interval
from .trained import trained


@dataclass(frozen=True)
class _Task:
    name: str
    policy: Any
    condition: Condition
    sample_time: float
    seed: int

    def run(self) -> dict[str, Interval]:
        return self.condition.score(self.policy, self.sample_time, self.seed)


def compare(
    plant: Plant | str,
    controllers: Sequence[Any],
    *,
    design_plant: Plant | str | None = None,
    trials: int = 200,
    small_trials: int | None = None,
    duration: float = 20.0,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    groups: Iterable[str] = USUAL_GROUPS,
    effects: Iterable[str] | None = None,
    seed: int = 0,
    jobs: int = 1,
    trust: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Play every controller in every condition.

    controllers: names (see `CONTROLLERS`), policy files `*.zip`, `Controller`s, or any policy with a `name`.
    design_plant: what named controllers are designed from, default `plant`; the two differ to see what a wrong model
    costs. trials: of the conditions "balance" and "swing-up"; small_trials of each other condition (default: a
    quarter, but 10 if `trials` is no less). sample_time [s]: default is the plant's, else a whole fraction of the first
    policy file's, at most 2 ms, else 2 ms. sensors: default is what the plant file says, else 4096 counts. jobs: of
    processes.
    effects: of the groups "effects" and "swing_up", see `conditions`. trust: also read policies of stable-baselines3,
    which runs the code in them. progress(done, of): called after each condition. A controller that does not apply to
    the plant is left out, with the reason. Raises ValueError on an unknown name, group or effect, on an effect that the
    plant carries already, and when nothing is left to compare.
    """
    plant, groups = Plant.resolve(plant), list(groups)
    design = design_plant_for(plant, design_plant)
    if trials < 1 or (small_trials is not None and small_trials < 1):
        raise ValueError(f"trials must be at least 1, got {trials} and {small_trials}")
    small = small_trials or min(trials, max(10, trials // 4))
    T, sensors = trial_period(plant, sample_time, controllers), choose_sensors(plant, sensors)
    policies, skipped = _build(controllers, design, T, sensors, trust)
    if not policies:
        raise ValueError("nothing to compare: " + ("; ".join(skipped.values()) or "no controllers were named"))
    rows = conditions(plant, sensors, trials, small, duration, groups, effects, seed)
    tasks = [
        _Task(name, policy, row, T, seed)
        for name, policy in policies.items()
        for row in rows
        if row.kind != "swing_up" or "swing_up" in getattr(policy, "tasks", ())
    ]
    if not rows:
        of = ", ".join(groups)
        raise ValueError(f"nothing to compare: the groups {of} have no trial for this plant; name others")
    if not tasks:
        raise ValueError(
            f"nothing to compare: {', '.join(policies)} cannot swing up; "
            "add swing-up or a policy, or groups in which it balances"
        )
    scores: dict[str, dict[str, dict[str, Interval]]] = {name: {} for name in policies}
    for done, (task, figures) in enumerate(zip(tasks, _run(tasks, jobs), strict=True), start=1):
        scores[task.name][task.condition.name] = figures
        if progress:
            progress(done, len(tasks))
    settings = {
        "trials": trials,
        "small_trials": small,
        "duration": duration,
        "sample_time": T,
        "sensors": sensors.to_dict(),
        "seed": seed,
        "u_max": plant.u_max,
        "designed_for_this_plant": design == plant,
    }
    groups_of = {row.name: row.group for row in rows}
    return Comparison(plant, settings, groups_of, scores, skipped, trained(policies), policies)


def trial_period(plant: Plant, sample_time: float | None, controllers: Sequence[Any]) -> float:
    """Sample time [s] of trials: the caller's, the plant's, or one that the first policy's period is a multiple of."""
    if sample_time is None and plant.sample_time is None:
        for given in controllers:
            if (own := getattr(given, "sample_time", None)) is not None:  # also of one inside an envelope
                return float(own)
            if str(given).endswith(".zip"):
                from ..learned.policy import trained_sample_time

                period = trained_sample_time(str(given), plant)
                return period / ceil(period / DEFAULT_SAMPLE_TIME)  # it acts at every n-th sample
    return choose_sample_time(plant, sample_time)


def _build(
    controllers: Sequence[Any], plant: Plant, sample_time: float, sensors: Sensors, trust: bool
) -> tuple[dict[str, Any], dict[str, str]]:
    policies: dict[str, Any] = {}
    skipped: dict[str, str] = {}
    for given in controllers:
        if isinstance(given, Controller) or (callable(given) and not isinstance(given, str)):
            name, policy = str(getattr(given, "name", type(given).__name__)), given
            if isinstance(given, Controller) and not same_clock(given.sample_time, sample_time):
                raise ValueError(
                    f"{name} is made for {given.sample_time:g} s and the trials sample every {sample_time:g} s; "
                    f"make it for {sample_time:g} s, or pass sample_time={given.sample_time:g}"
                )
        else:
            name = str(given)
            try:
                policy = make_controller(name, plant, sample_time, sensors, trust=trust)
            except DesignError as error:
                skipped[name] = str(error)
                continue
            if policy.name not in policies:  # a policy file goes by its name, two of one name by their paths
                name = policy.name
        if name in policies:
            raise ValueError(f"controller {name} is given twice")
        policies[name] = policy
    return policies, skipped


def _run(tasks: Sequence[_Task], jobs: int) -> Iterable[dict[str, Interval]]:
    if jobs == 1:
        return (task.run() for task in tasks)
    from joblib import Parallel, delayed

    return Parallel(n_jobs=jobs, return_as="generator", **worker_options())(delayed(_Task.run)(task) for task in tasks)  # type: ignore
