"""Does it pay to train swing-ups on drawn plants? `python -m experiments.studies.randomized_training --task swing_up`.

A rig of the bench is recorded twice: for 10 s with the paper's excitation, and for 3 s with a small dither. Model (5)
is identified from each. Policies are trained on these plants as they are, on plants drawn from their covariance, with
the ranges of the recipe `robust`, and on the plant with the effects that the diagnosis of the long log names. All have
the network, observation and reward of the recipe `robust`. They swing up the rig itself, and rigs of its kind whose
parts differ. Policies and plants are files: what is there is not made again, and a folder of another rig is refused.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from controllers import make_controller
from controllers.comparison.statistics import Interval, over_seeds, over_seeds_rate
from controllers.comparison.trials import run_trials, swing_up_starts
from controllers.comparison.variations import built_later
from controllers.design import choose_sensors
from controllers.training.recipes import RECIPES
from controllers.training.train import Training, train
from experiments.bench import Rig
from experiments.bench_runs import SWING_UP
from experiments.studies.hidden_rigs import SWING_UP_RIGS, TASKS, as_the_lab_knows, recorded
from experiments.studies.leaderboard.summary import WORST
from furuta_gym.envs.ranges import draws
from furuta_gym.files import write_whole
from furuta_gym.plant import Plant
from identification.diagnosis.diagnose import diagnose
from identification.estimation.identify import identify

SCHEMA = "furuta-randomized-swing-up/1"
MADE_WITH = "made_with.json"
SEED = 40_000  # of the trials; trainings have seeds from 0 on
RIG, OTHERS = "the rig", "built ±20 %, 8 ms late"
Scores = dict[str, dict[str, dict[str, Interval]]]


@dataclass(frozen=True)
class Arm:
    """What a policy is trained on. plant: of the "long" or the "short" log, or "named". randomize: as in `Training`;
    None for `ranges_around`."""

    plant: str
    randomize: bool | Mapping[str, str] | None


POSTERIOR = {"theta": "posterior"}
ARMS = {
    "nominal": Arm("long", False),
    "posterior": Arm("long", POSTERIOR),
    "ranged": Arm("long", None),
    "with the named effects": Arm("named", False),
    "with the named effects, ranged": Arm("named", None),
    "nominal, poor log": Arm("short", False),
    "posterior, poor log": Arm("short", POSTERIOR),
    "ranged, poor log": Arm("short", None),
}


@dataclass(frozen=True)
class Size:
    """policies of `steps` env steps for each arm, trials of each on rigs that differ, runs of each on the rig."""

    rig: str = "late"
    policies: int = 3
    steps: int = 4_000_000
    trials: int = 200
    runs: int = 20
    duration: float = SWING_UP
    most: int = 6

    @classmethod
    def quick(cls) -> Size:
        """Small enough for a test."""
        return cls(policies=1, steps=20_000, trials=4, runs=1, duration=6.0, most=1)


def run(size: Size, out: Path, say: Callable[[str], None] = print) -> Scores:
    """scores[arm][where][figure]; where: `RIG`, `OTHERS`. Policies, plants and results.json go to `out`.

    Raises ValueError if `out` holds plants that were made with another rig or size."""
    rig = SWING_UP_RIGS[size.rig]
    out.mkdir(parents=True, exist_ok=True)
    plants = _plants(rig, size, out, say)
    others = built_later(true_plant(rig), 20, 8, size.trials, SEED)
    scores: Scores = {}
    for name, arm in ARMS.items():
        policies = [_policy(name, arm, plants[arm.plant], seed, size, out, say) for seed in range(size.policies)]
        say(f"{name}: trials")
        scores[name] = {
            RIG: _on_the_rig(rig, policies, size),
            OTHERS: _on_others(plants[arm.plant], others, policies, size),
        }
        write_whole(out / "results.json", _as_json(size, plants, scores))  # the next arm takes minutes
    return scores


def true_plant(rig: Rig) -> Plant:
    """The rig's own constants without what it hides."""
    s = rig.constants
    return as_the_lab_knows(Plant(theta=s.theta, friction_sharpness=s.sharpness, unit=s.unit), rig)


def _plants(rig: Rig, size: Size, out: Path, say: Callable[[str], None]) -> dict[str, Plant]:
    """The identified plants by name, from files where they are there. Raises ValueError if `out` holds those of another
    rig, or of a diagnosis that looked for another number of effects."""
    files = {name: out / f"{name}.json" for name in ("long", "named", "short")}
    made_with, wanted = out / MADE_WITH, {"rig": size.rig, "most": size.most}
    if made_with.exists() or any(file.exists() for file in files.values()):
        had = json.loads(made_with.read_bytes()) if made_with.exists() else "nobody knows what"
        if had != wanted:
            raise ValueError(f"{out} holds plants made with {had}, and now {wanted} is asked for; take another --out")
    if not all(file.exists() for file in files.values()):
        say("recording, identifying and diagnosing")
        found = diagnose(recorded(rig, ("paper",), 10.0), most=size.most)
        if found.before is None or found.plant is None:
            raise ValueError(f"the diagnosis ended with {found.verdict!r} and no plant")
        short = identify(recorded(rig, ("dither",), 3.0, seed=1)).plant
        write_whole(made_with, json.dumps(wanted) + "\n")
        for name, plant in (("long", found.before.plant), ("named", found.plant), ("short", short)):
            as_the_lab_knows(plant, rig).save(files[name])
    return {name: Plant.load(file) for name, file in files.items()}


def _policy(name: str, arm: Arm, plant: Plant, seed: int, size: Size, out: Path, say: Callable[[str], None]) -> Any:
    path = out / f"{name.replace(', ', '-').replace(' ', '-')}-{size.steps}-{seed}.zip"
    if not path.exists():
        say(f"{name}: training policy {seed + 1} of {size.policies}")
        drawn = ranges_around(plant) if arm.randomize is None else arm.randomize
        said = {"task": "swing_up", "steps": size.steps, "seed": seed, "randomize": drawn}
        train(Training.of_recipe(plant, "robust", **said), path, resume=path.with_suffix(".checkpoint").exists())
    return make_controller(path, plant, plant.sample_time)


def ranges_around(plant: Plant) -> dict[str, str]:
    """The ranges of the recipe `robust`, but for effects that the plant has at a size which they do not reach."""
    wanted = RECIPES["robust"].of(plant)["randomize"]
    reach = draws(wanted, plant).ranges
    beyond = set()
    for name, span in reach.items():
        effect = plant.effect(name.partition(".")[0])
        if effect is not None and not span.bounds[0] <= effect.parameters[name.partition(".")[2]] <= span.bounds[1]:
            beyond.add(effect.name)
    return {name: text for name, text in wanted.items() if name.partition(".")[0] not in beyond}


def _on_the_rig(rig: Rig, policies: Sequence[Any], size: Size) -> dict[str, Interval]:
    """Runs on the bench; each policy has starts and noise of its own."""
    play = TASKS["swing_up"].play
    rows = [
        [play(rig, policy, SEED + 1000 * k + i, size.duration) for i in range(size.runs)]
        for k, policy in enumerate(policies)
    ]
    success = [np.array([r.success for r in row]) for row in rows]
    return figures(success, [np.array([r.settling for r in row]) for row in rows], size.duration)


def _on_others(plant: Plant, others: list[Plant], policies: Sequence[Any], size: Size) -> dict[str, Interval]:
    """The same rigs for all, with the sensors of the plant."""
    T = plant.sample_time
    assert T is not None
    success, settling = [], []
    for k, policy in enumerate(policies):
        starts = swing_up_starts(size.trials, np.random.default_rng([SEED + k, 1]))
        hold = min(5.0, size.duration / 3)
        sensors = choose_sensors(plant, None)
        found = run_trials(others, policy, starts, size.duration, T, sensors, swing_up=True, hold=hold, seed=SEED + k)
        success.append(found.success)
        settling.append(found.settling)
    return figures(success, settling, size.duration)


def figures(success: Sequence[np.ndarray], settling: Sequence[np.ndarray], duration: float) -> dict[str, Interval]:
    """Success, and the mean of the slowest 5 % until upright [s], in which a failure counts with the whole duration.

    One array for each policy; intervals are over policies and trials."""
    times = [np.where(s, t, duration) for s, t in zip(success, settling, strict=True)]
    rate = over_seeds_rate([s.astype(float) for s in success])
    return {"success": rate, "typical": over_seeds(times, _median), "worst": over_seeds(times, _slowest)}


def _median(times: np.ndarray) -> np.ndarray:
    return np.median(times, axis=-1)


def _slowest(times: np.ndarray) -> np.ndarray:
    return np.sort(times, axis=-1)[..., -max(1, round(WORST * times.shape[-1])) :].mean(axis=-1)


def _as_json(size: Size, plants: dict[str, Plant], scores: Scores) -> str:
    rows = {
        arm: {where: {figure: x.to_dict() for figure, x in some.items()} for where, some in places.items()}
        for arm, places in scores.items()
    }
    found = {name: [str(effect) for effect in plant.effects] for name, plant in plants.items()}
    data = {"schema": SCHEMA, "size": asdict(size), "effects": found, "scores": rows}
    return json.dumps(data, ensure_ascii=False, indent=2) + "\n"


def table(scores: Scores) -> Table:
    """Arm by arm."""
    shown = Table(title="95 % intervals in brackets; up after [s]: the median, and the mean of the slowest 5 %")
    shown.add_column("trained on")
    for where in (RIG, OTHERS):
        for what in ("success [%]", "up after", "slowest 5 %"):
            shown.add_column(f"{where}\n{what}", justify="right")
    for arm, places in scores.items():
        cells = []
        for some in places.values():
            s = some["success"]
            cells += [f"{100 * s.value:.3g} [{100 * s.low:.0f}, {100 * s.high:.0f}]"]
            cells += [str(some["typical"]), str(some["worst"])]
        shown.add_row(arm, *cells)
    return shown
