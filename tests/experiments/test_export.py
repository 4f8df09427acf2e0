"""`furuta export`: each format to its file, and refusals that write nothing."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from furuta_gym.plant import QUBE
from tests.commands import furuta, refused


@pytest.mark.parametrize(
    ("arguments", "name", "words"),
    [
        (("--controller", "lqg"), "lqg.h", ("furuta_lqg_step", "#ifndef")),
        (("lqr", "--format", "c", "--sample-time", "0.005"), "lqr.c", ("once every 0.005 s",)),
        (("lqg", "--single", "--soft-start", "0.1"), "lqg.h", ("static inline float furuta_lqg_step", "/ 26.0f")),
        (("--format", "mjcf"), "rig.xml", ("<mujoco", "frictionloss")),
    ],
)
def test_exports(arguments: tuple[str, ...], name: str, words: tuple[str, ...], tmp_path: Path) -> None:
    result = furuta("export", "qube", *arguments, "-o", tmp_path / name, "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["written"] == str(tmp_path / name)
    text = (tmp_path / name).read_text(encoding="utf-8")
    assert all(word in text for word in words)


POLICIES = Path(__file__).parents[2] / "controllers" / "policies"
POLICY = POLICIES / "balance-qube.zip"
REFUSED = {
    "inconsistent": (("table3",), "rig.xml", ("θ4 ≥ θ2", "Export qube, large or an identified plant instead")),
    "controller in MJCF": (("qube", "lqr"), "rig.xml", ("MJCF", "lqr")),
    "no controller": (("qube",), "lqr.h", ("--controller",)),
    "not a policy": (("qube", "lqr"), "lqr.onnx", ("*.zip", "lqr")),
    "no policy": (("qube", "none.zip"), "none.onnx", ("no policy at none.zip",)),
    "two": (("qube", "lqr", "--controller", "lqg"), "lqr.h", ("one of them",)),
    "ending": (("qube",), "rig.txt", (".onnx", "--format")),
    "other ending": (("qube", "--format", "mjcf"), "rig.h", (".xml",)),
    "single ONNX": (("qube", "none.zip", "--single"), "none.onnx", ("--single", "C")),
    "swing-up": (("qube", "swing-up"), "up.h", ("no C export",)),
    "period of MJCF": (("qube", "--sample-time", "0.01"), "rig.xml", ("--sample-time", "mjcf")),
    "endless start": (("qube", "lqr", "--soft-start", "1e300"), "lqr.h", ("--soft-start 1e+300", "60")),
    "no period": (("qube", "lqr", "--sample-time", "0"), "lqr.h", ("--sample-time 0.0", "seconds")),
    "no period of a policy": (("qube", str(POLICY), "--sample-time", "0"), "p.h", ("--sample-time 0.0", "seconds")),
    "other period of a policy": (
        ("qube", str(POLICY), "--sample-time", "0.004"),
        "p.h",
        ("--sample-time 0.004", "expected 0.02 s", "policy"),
    ),
    "other period in ONNX": (("qube", str(POLICY), "--sample-time", "0.01"), "p.onnx", ("0.01: expected 0.02 s",)),
    "tiny period": (("qube", str(POLICY), "--sample-time", "1e-320"), "p.h", ("--sample-time", "1e-6")),
    "period that is none": (("qube", str(POLICY), "--sample-time", "nan"), "p.h", ("--sample-time nan",)),
}


def test_the_policy_s_own_period_may_be_said(tmp_path: Path) -> None:
    result = furuta("export", "qube", POLICY, "--sample-time", 0.02, "-o", tmp_path / "p.h")
    assert result.exit_code == 0, result.output
    assert "once every 0.02 s" in (tmp_path / "p.h").read_text(encoding="utf-8")


@pytest.mark.parametrize("controller", ["lqr", POLICY])
def test_a_rig_without_limits_is_told(controller: str | Path, tmp_path: Path) -> None:
    """The arm may turn as far and as fast as it can: whoever runs the header on a rig must know."""
    limited = QUBE.replace(limits={"arm_travel": 2 * math.pi}).save(tmp_path / "rig.json")
    said, silent = (furuta("export", plant, controller, "-o", tmp_path / "c.h") for plant in ("qube", limited))
    assert said.exit_code == silent.exit_code == 0
    told = " ".join(said.stderr.split())
    assert "The plant has no limit arm_travel: the arm may turn 6.28 rad to either side, at any speed" in told
    assert silent.stderr == ""


@pytest.mark.parametrize(
    ("controller", "balances"), [("lqr", True), (POLICY, True), (POLICIES / "swing-up-qube.zip", False)]
)
def test_a_soft_start_of_a_balancer_is_told(controller: str | Path, balances: bool, tmp_path: Path) -> None:
    """Not that of a policy that swings up, nor a start at full size."""
    limited = QUBE.replace(limits={"arm_travel": 2 * math.pi}).save(tmp_path / "rig.json")
    soft, hard = (
        furuta("export", limited, controller, "--soft-start", s, "-o", tmp_path / "c.h").stderr for s in (1, 0)
    )
    assert ("balances only" in soft) is balances
    assert hard == ""
    assert balances or soft == ""


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_write_nothing(case: str, tmp_path: Path) -> None:
    arguments, name, words = REFUSED[case]
    refused(furuta("export", *arguments, "-o", tmp_path / name), *words)
    assert list(tmp_path.iterdir()) == []
