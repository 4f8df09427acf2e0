"""Options that only hand a value on: the function that a command calls gets what was typed, and else its default."""

from __future__ import annotations

import inspect
import math
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from typing import Any

import pytest

from experiments.bench import HiddenEffect
from tests.commands import furuta, some_log

COMMANDS = {
    "identify": ("identify LOG -o rig.json", "identification.estimation.identify", "identify"),
    "validate": ("validate table3 LOG", "identification.validation.gap", "validate"),
    "diagnose": ("diagnose LOG -o found", "identification.diagnosis.diagnose", "diagnose"),
    "simulate": ("simulate --plant qube -o run.csv", "furuta_gym.simulation", "simulate"),
    "train": ("train --plant qube -o policy.zip", "controllers.training.train", "train"),
    "compare": ("compare --plant qube --controllers lqr -o compared", "controllers.comparison.evaluation", "compare"),
    "plan": ("trials --seeds 1 --kinds hard -o trials", "experiments.trials.plan", "make_plan"),
    "run": ("trials --seeds 1 --kinds hard -o trials", "experiments.trials.run", "run_trials"),
    "size": ("bench size --effect arm_spring --set servo", "experiments.bench.cli", "effect_size"),
}
"""What is typed, and the module and the name of what is called."""


@pytest.mark.parametrize(
    ("command", "option", "argument", "value", "default"),
    [
        ("identify", "--physical", "physical", True, False),
        ("identify", "--all", "every_sample", True, False),
        ("identify", "--prior theta2=0.012±0.001", "priors", {"theta2": (0.012, 0.001)}, {}),
        ("validate", "--horizon 0.5", "horizon", 0.5, 0.3),
        ("diagnose", "--max-effects 2", "most", 2, 6),
        ("diagnose", "--minutes 2", "minutes", 2.0, math.inf),
        ("simulate", "--torque-noise 1e-6,1e-8", "torque_noise", (1e-6, 1e-8), (0.0, 0.0)),
        ("simulate", "--torque-noise 1e-6", "torque_noise", (1e-6, 0.0), (0.0, 0.0)),
        ("train", "--observe-command", "training.observe_command", True, False),
        ("train", "--arm-limit 1.5", "training.arm_limit", 1.5, None),
        ("compare", "--jobs 3", "jobs", 3, 1),
        ("plan", "--split final", "split", "final", "dev"),
        ("plan", "--share 0.5", "share", 0.5, 1.0),
        ("plan", "--power", "power", True, False),
        ("plan", "--seed 7", "seed", 7, 0),
        ("run", "--backend dask", "backend", "dask", "loky"),
        (
            *("size", "--form bench", "rig.effects"),
            *((HiddenEffect("arm_spring", form=form),) for form in ("bench", "table")),
        ),
    ],
)
def test_an_option_reaches_what_it_is_for(
    command: str,
    option: str,
    argument: str,
    value: object,
    default: object,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if command == "train":
        pytest.importorskip("stable_baselines3", reason="training needs the extra `rl`")
    typed, module, name = COMMANDS[command]
    signature, calls = inspect.signature(getattr(import_module(module), name)), []

    def asked(*args: Any, **kwargs: Any) -> None:
        bound = signature.bind(*args, **kwargs)
        bound.apply_defaults()
        calls.append(bound.arguments)
        raise ValueError("that is enough")

    monkeypatch.setattr(import_module(module), name, asked)
    monkeypatch.chdir(tmp_path)
    some_log(Path("LOG.csv"), 1000)
    for words in (option, ""):
        assert "that is enough" in furuta(*f"{typed} {words}".replace("LOG", "LOG.csv").split()).stderr
    first, *rest = argument.split(".")
    assert [attrgetter(*rest)(told[first]) if rest else told[first] for told in calls] == [value, default]


def test_a_traceback_is_for_who_asks(tmp_path: Path) -> None:
    command = ("export", "qube", "-o", tmp_path / "lqr.h")
    assert isinstance(furuta(*command).exception, SystemExit)
    raised = furuta("--traceback", *command).exception
    assert isinstance(raised, ValueError)
    assert "C is for controllers" in str(raised)
