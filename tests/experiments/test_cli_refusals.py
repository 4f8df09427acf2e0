"""What the commands refuse before any work is done: places that cannot be written, files of another kind."""

from __future__ import annotations

from pathlib import Path

import pytest

from furuta_gym.plant import QUBE
from tests.commands import furuta, refused


@pytest.fixture
def blocked(tmp_path: Path) -> Path:
    """A folder that cannot be made, because a file has its name."""
    (tmp_path / "taken").write_text("")
    return tmp_path / "taken" / "below"


def test_an_output_that_cannot_be_written_is_told_before_the_work(recorded: Path, blocked: Path, tmp_path: Path):
    plant = QUBE.save(tmp_path / "rig.json")
    for command in (
        ("identify", recorded, "-o", blocked / "rig.json"),
        ("simulate", "--plant", "qube", "-o", blocked / "log.csv"),
        ("validate", plant, recorded, "--plots", blocked),
        ("validate", plant, recorded, "--json", blocked / "gap.json"),
        ("compare", "--plant", "qube", "--controllers", "lqr", "-o", blocked),
        ("diagnose", recorded, "-o", blocked),
        ("trials", "-o", blocked),
    ):
        refused(furuta(*command), "taken", "nothing can be written")


@pytest.mark.filterwarnings("ignore:.*Was the pendulum held")
def test_noise_that_the_plant_file_has_can_be_switched_off(tmp_path: Path):
    from identification.logs.log import read_log

    plant = QUBE.replace(sensors={"encoder_counts": [0, 0], "noise_std": [1e-2, 1e-2]}).save(tmp_path / "rig.json")
    spread = {}
    for name, options in (("own", ()), ("none", ("--noise", "0"))):
        log = tmp_path / f"{name}.csv"
        done = furuta("simulate", "--plant", plant, "--controller", "none", "--duration", "1", *options, "-o", log)
        assert done.exit_code == 0, done.output
        spread[name] = read_log(log, constant_command="ignore").q1.std()
    assert spread["own"] > 5e-3 > 1e-3 > spread["none"]


def test_a_log_given_for_a_plant_is_told(recorded: Path):
    refused(furuta("validate", recorded, recorded), "is no plant file", "furuta identify")


def test_a_run_of_one_sample_is_no_log(tmp_path: Path):
    to = ("-o", tmp_path / "log.csv")
    refused(furuta("simulate", "--plant", "qube", "--controller", "lqr", "--sample-time", "0.5", *to), "--sample-time")
    refused(furuta("simulate", "--plant", "qube", "--duration", "0.005", *to), "--duration is too short")
    assert not list(tmp_path.iterdir())
