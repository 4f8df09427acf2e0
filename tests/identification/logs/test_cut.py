"""A bad stretch that is cut out of a log."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.cli.app import app
from furuta_gym import Plant
from furuta_gym.plant import TABLE_3
from identification import Log, LogError, RigMapping, identify, load_mapping, read_log, save_mapping, write_log
from tests.factories import paper_log

WRONG = [
    ("3", "expected FROM:TO"),
    ("3:4:5", "expected FROM:TO"),
    ("a:b", "expected FROM:TO"),
    ("3:inf", "expected FROM:TO"),
    ("4:3", "4 s is not before 3 s"),
    ("3:3", "3 s is not before 3 s"),
]


@pytest.fixture(scope="module")
def spoilt() -> Log:
    """From 4 to 5 s the arm is held by hand: its readings stand still, while the command goes on."""
    log = paper_log(T=0.005, duration=10.0)[0]
    held = (log.t >= 4.0) & (log.t <= 5.0)
    return replace(log, q1=np.where(held, log.q1[np.argmax(held)], log.q1))


def test_a_cut_leaves_the_samples_out_and_cuts_the_log_in_two(spoilt: Log, tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", spoilt)
    log = read_log(tmp_path / "log.csv", skip=1.0, cut=["4:5", (8, 9.5)])
    left_out = ((spoilt.t >= 4) & (spoilt.t <= 5)) | ((spoilt.t >= 8) & (spoilt.t <= 9.5)) | (spoilt.t < 1.0)
    assert np.array_equal(log.t, spoilt.t[~left_out])
    assert np.array_equal(log.u, spoilt.u[~left_out])
    assert (log.cut, log.skipped) == (((4.0, 5.0), (8.0, 9.5)), 1.0)
    assert [piece.t[0] for piece in log.pieces()] == pytest.approx([1.0, 5.005, 9.505])


def test_parameters_from_a_log_with_a_spoilt_stretch_that_is_cut_out_are_right(spoilt: Log, tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", spoilt)
    whole, cut = (identify(read_log(tmp_path / "log.csv", cut=c)).values[:9] for c in ((), ["4:5"]))
    clean, theta = identify(paper_log(T=0.005, duration=10.0)[0]).values[:9], TABLE_3.theta
    bound = np.maximum(3.0 * np.abs(clean - theta), 0.02 * theta)  # as good as from a log that nobody touched
    assert (np.abs(cut - theta) <= bound).all()
    assert (np.abs(whole - theta) > bound).any()


def test_the_plant_file_says_what_was_cut_out_and_cuts_no_other_log(spoilt: Log, tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", spoilt)
    arguments = ["identify", "log.csv", "-o", "rig.json", "--cut", "4:5", "--cut", "8:9"]
    paths = [str(tmp_path / a) if "." in a else a for a in arguments]
    result = CliRunner().invoke(app, paths)
    assert result.exit_code == 0, result.output
    plant = Plant.load(tmp_path / "rig.json")
    assert plant.provenance["logs"][0]["cut_s"] == [[4.0, 5.0], [8.0, 9.0]]
    assert "cut" not in json.dumps(plant.provenance.get("mapping", {}))


@pytest.mark.parametrize(("cut", "words"), WRONG)
def test_a_cut_that_is_none_is_refused_before_anything_is_read(tmp_path: Path, cut: str, words: str) -> None:
    with pytest.raises(LogError, match=words):
        read_log(tmp_path / "not there.csv", cut=[cut])
    said = CliRunner().invoke(app, ["identify", str(tmp_path / "no.csv"), "-o", str(tmp_path / "x.json"), "--cut", cut])
    assert said.exit_code == 2
    assert "--cut" in said.stderr
    assert words in " ".join(said.stderr.split())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("cut", "words"),
    [
        (["20:25"], r"no sample lies .* \(--cut 20:25\).* runs from 0 to 9.995 s"),
        (["0:20"], r"without the stretches that are cut out \(--cut 0:20\): 0 samples"),
        (["0:5", "5:9.9"], r"\(--cut 0:5 --cut 5:9.9\): 19 samples"),
    ],
)
def test_a_cut_beyond_the_log_or_of_all_of_it_is_refused(
    spoilt: Log, tmp_path: Path, cut: list[str], words: str
) -> None:
    write_log(tmp_path / "log.csv", spoilt)
    with pytest.raises(LogError, match=words):
        read_log(tmp_path / "log.csv", cut=cut)


def test_a_rig_file_holds_cuts_as_well(tmp_path: Path) -> None:
    mapping = RigMapping(cut=((1.0, 2.5), (4.0, 5.0)))
    save_mapping(tmp_path / "rig.toml", mapping)
    assert load_mapping(tmp_path / "rig.toml") == mapping
    assert mapping.options() == "--cut 1:2.5 --cut 4:5"
    (tmp_path / "rig.toml").write_text('schema = "furuta-rig/1"\n[samples]\ncut = ["1:2.5", "4:5"]\n')
    assert load_mapping(tmp_path / "rig.toml") == mapping
    (tmp_path / "rig.toml").write_text('schema = "furuta-rig/1"\n[samples]\ncut = ["5:4"]\n')
    with pytest.raises(LogError, match=r"rig\.toml: cut 5:4: 5 s is not before 4 s"):
        load_mapping(tmp_path / "rig.toml")


def test_the_options_of_a_mapping_give_the_same_numbers_again() -> None:
    """An encoder of 20 bits has more than six digits."""
    mapping = RigMapping(
        encoder_counts=(1048576.0, 1048576.0), input_scale=0.00123456789, skip=0.1234567, cut=((1.0, 2.3456789),)
    )
    said = mapping.options()
    for words in ("--encoder-counts 1048576", "--input-scale 0.00123456789", "--skip 0.1234567", "--cut 1:2.3456789"):
        assert words in said


def test_a_cut_at_the_start_leaves_the_clock_and_a_skip_starts_it_anew(tmp_path: Path) -> None:
    log = paper_log(duration=4.0)[0]
    write_log(path := tmp_path / "log.csv", log)
    assert read_log(path, cut="0:0.5").origin == pytest.approx(log.t[0])
    assert read_log(path, skip=1.0).begins == 0.0
    both = read_log(path, skip=1.0, cut="0:1.5")
    assert both.t[0] > 1.5
    assert both.origin == pytest.approx(1.0)
