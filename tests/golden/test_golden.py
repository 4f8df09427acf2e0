"""The stored logs give what they gave: verdicts, names, sizes with their error bars, gaps, and roll-outs.

Other CPUs round differently, so numbers are held within a hundredth of their standard deviation. `tests.golden.results`
compares two commits bit for bit, and renews the expected results where numbers are meant to change.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.commands import furuta
from tests.golden.results import EXPECTED, LOGS, diagnose_arguments, names, run_envs, written

pytest.importorskip("jinja2", reason="furuta diagnose needs the extra 'report'")

CASES = sorted(path.stem for path in EXPECTED.glob("*.json") if path.stem != "envs")
QUICK = ("none-servo", "still-pendulum", "still-rig")
"""Those that are quick. The others are of `make thorough`, or `python -m tests.golden.results`."""
SHARE = 0.01  # of a standard deviation
SHOT = 1e-4  # of a parameter by multiple shooting
GAP = 5e-3  # of a ratio to the noise floor, which follows a torque noise that a log determines to a few percent
FLOAT32 = 2.0**-23  # observations are stored so: their last bit may turn


def expected(name: str) -> dict[str, Any]:
    return json.loads((EXPECTED / f"{name}.json").read_text(encoding="utf-8"))


def named(effects: list[dict[str, Any]]) -> list[tuple[str, list[str]]]:
    """Each effect's name, and those that it may be confused with."""
    return [(effect["name"], sorted(effect["confused_with"])) for effect in effects]


def ratios(gap: dict[str, Any] | None) -> list[float]:
    """Prediction errors over the noise floor, before and after; nothing where nothing could be predicted."""
    return [gap[side]["ratio_to_floor"] for side in ("before", "after") if gap.get(side)] if gap else []


def deviations(plant: dict[str, Any]) -> dict[str, float]:
    """Standard deviation by the parameter's name; none of a plant of multiple shooting, which has no covariance."""
    covariance = plant["covariance"]
    if covariance is None:
        return {}
    return dict(zip(covariance["names"], np.sqrt(np.diag(covariance["matrix"])), strict=True))


def test_every_stored_log_has_an_expected_result() -> None:
    assert {path.name.removesuffix(".fit.parquet") for path in LOGS.glob("*.fit.parquet")} <= set(CASES)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else pytest.mark.thorough) for name in CASES]
)
def test_a_stored_log_gives_what_it_gave(name: str, tmp_path: Path) -> None:
    if name not in names():
        pytest.skip("its measured log is not here: set FURUTA_DATA to the folder that holds qube_darmstadt/")
    before = expected(name)
    result = furuta(*diagnose_arguments(name, tmp_path / "out"))
    assert result.exit_code == before["diagnose"]["exit"], result.output
    now = written(tmp_path / "out")
    then, found = before["diagnosis.json"], now["diagnosis.json"]
    assert found["verdict"] == then["verdict"]
    assert named(found["effects"]) == named(then["effects"])
    assert ratios(found["gap"]) == pytest.approx(ratios(then["gap"]), rel=GAP)
    for effect, earlier in zip(found["effects"], then["effects"], strict=True):
        for parameter, value in earlier["parameters"].items():
            tolerance = SHARE * value["std"] if value["std"] else 0.0  # a whole number has no error bar
            assert effect["parameters"][parameter]["value"] == pytest.approx(value["value"], rel=0, abs=tolerance), (
                f"{effect['name']}: {parameter}"
            )
    assert ("plant.json" in now) == ("plant.json" in before)
    if "plant.json" in before:
        std = deviations(before["plant.json"])
        for parameter, value in before["plant.json"]["theta"].items():
            tolerance = SHARE * std.get(parameter, 0.0) if std else SHOT * abs(value)
            assert now["plant.json"]["theta"][parameter] == pytest.approx(value, rel=1e-9, abs=tolerance), parameter


def test_roll_outs_of_the_environment_are_the_same() -> None:
    found, before = run_envs(), expected("envs")
    assert found.keys() == before.keys()
    for task, values in before.items():
        assert found[task].keys() == values.keys()
        for quantity, value in values.items():
            rounded = 2 * FLOAT32 if quantity == "observations" else 1e-9
            np.testing.assert_allclose(found[task][quantity], value, rounded, 1e-9, err_msg=f"{task}: {quantity}")
