"""What is odd about a file and yet right: comments that look like metadata, very fine and very coarse encoders."""

from __future__ import annotations

import re

import numpy as np
import pytest

from identification.logs.log import LogError, LogWarning
from identification.logs.reading import read_log
from tests.factories import paper_log
from tests.files import csv, quietly, rows, warned


@pytest.mark.parametrize(
    "comment", ["2024-05-01 12:33:05", "12:30 started", "1. channel: arm", ": nothing", "t: seconds", "q1: the arm"]
)
def test_a_comment_that_only_looks_like_metadata_is_harmless(tmp_path, comment):
    log = quietly(csv(tmp_path, head=f"# {comment}\n"))
    assert len(log.metadata) <= 1
    assert all(key.isidentifier() for key in log.metadata)


def test_known_facts_may_be_written_with_blanks(tmp_path):
    log = quietly(csv(tmp_path, head="# encoder counts: 4096\n# input unit: Nm\n"))
    assert log.encoder_counts == (4096, 4096)
    assert log.input_unit == "N·m"


@pytest.mark.parametrize("declared", [None, 20000])
def test_fine_encoders_in_degrees_are_believed_and_unwrapped(tmp_path, declared):
    """5000 lines, all four edges; hanging zero, so that balancing wraps at ±180°."""
    log, _ = paper_log(counts=20000)
    hanging = np.rad2deg(np.remainder(log.q2, 2 * np.pi)) - 180.0  # 0 where the pendulum hangs
    table = {"t": log.t, "q1": np.rad2deg(log.q1), "q2": hanging, "u": log.u}
    with pytest.warns(LogWarning, match="Taken as a wrapped encoder"):
        read = read_log(csv(tmp_path, table), unit="deg", pendulum_zero="hanging", encoder_counts=declared)
    assert np.ptp(read.q2) == pytest.approx(np.ptp(log.q2), abs=1e-6)


def test_coarse_encoders_in_radians_are_believed_where_they_are_declared(tmp_path):
    log, _ = paper_log(counts=300)
    table = {"t": log.t, "q1": log.q1, "q2": log.q2, "u": log.u}
    assert "looks like degrees" in warned(csv(tmp_path, table))
    assert "looks like degrees" not in warned(csv(tmp_path, table), encoder_counts=300)


def test_encoder_counts_are_told_from_degrees_and_read(tmp_path):
    log, _ = paper_log(counts=4096)
    table = {"t": log.t, "u": log.u} | {q: np.round(getattr(log, q) * 4096 / (2 * np.pi)) for q in ("q1", "q2")}
    path = csv(tmp_path, table)
    for options in ({}, {"unit": "deg"}, {"encoder_counts": 4096}):
        assert "looks like encoder counts" in warned(path, **options)
    assert warned(path, unit="counts", encoder_counts=4096) == ""
    read = read_log(path, unit="counts", encoder_counts=4096)
    assert read.q1 == pytest.approx(log.q1, abs=1e-9)
    assert "q2 = q2*2*pi/4096" in read.read_as
    with pytest.raises(LogError, match="--encoder-counts"):
        read_log(path, unit="counts")


@pytest.mark.parametrize("above", ["sep=;\n", "Pendulum rig 3, second run\n", "% saved by the lab's logger\n\n"])
def test_a_title_above_the_header_is_passed_over(tmp_path, above):
    log, _ = paper_log(counts=4096)
    lines = ["t;q1;q2;u", *(";".join(map(str, row)) for row in np.column_stack([log.t, log.q1, log.q2, log.u]))]
    path = tmp_path / "log.csv"
    path.write_text(above + "\n".join(lines), encoding="utf-8")
    assert read_log(path).q2 == pytest.approx(log.q2)


def test_a_decimal_comma_in_quotes_makes_no_title_of_the_header(tmp_path):
    path = tmp_path / "log.csv"
    body = "".join(f"{0.01 * k:.2f},{0.1 * (k % 3)},{0.1 * (k % 5)},{k % 2}\n" for k in range(1, 60))
    path.write_text('t,q1,q2,u\n0,0,0,"1,5"\n' + body)
    assert quietly(path).u[:2] == pytest.approx([1.5, 1.0])


def test_a_separator_at_the_end_of_the_rows_alone_makes_no_title_of_the_header(tmp_path):
    table = rows()
    lines = ["t,q1,q2,u", *(",".join(map(str, row)) + "," for row in zip(*table.values(), strict=True))]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    assert quietly(path).u == pytest.approx(table["u"])


def test_seconds_that_are_milliseconds_are_refused(tmp_path):
    table = rows()
    path = csv(tmp_path, table | {"t": 1e3 * table["t"]})
    with pytest.raises(LogError, match="--time-unit ms"):
        read_log(path)
    assert quietly(path, time_unit="ms").t == pytest.approx(table["t"])


def test_a_missing_column_with_units_in_its_name_is_guessed(tmp_path):
    table = rows()
    renamed = {"t_ms": table["t"], "theta_deg": table["q1"], "alpha_deg": table["q2"], "volts": table["u"]}
    wanted = re.escape("--columns t=t_ms,q1=theta_deg,q2=alpha_deg,u=volts --unit deg --time-unit ms")
    with pytest.raises(LogError, match=wanted):
        read_log(csv(tmp_path, renamed))


@pytest.mark.parametrize(
    ("mapping", "said"),
    [
        ({}, ""),
        ({"pendulum_zero": "hanging"}, "q1 = q1, q2 = q2 - pi, u = u"),
        ({"pendulum_zero": "hanging", "flip": "q2,u", "unit": "deg"}, "q1 = q1*pi/180, q2 = -(q2*pi/180 - pi), u = -u"),
    ],
)
@pytest.mark.filterwarnings("ignore::identification.logs.checks.LogWarning")
def test_the_log_says_how_it_was_read(tmp_path, mapping, said):
    """As a formula that gives the log's angles from the file's columns."""
    table = rows()
    log = read_log(csv(tmp_path), **mapping)
    assert log.read_as == said
    formula = dict(part.split(" = ") for part in said.split(", ")) if said else {"q1": "q1", "q2": "q2", "u": "u"}
    for ours in formula:
        value = eval(formula[ours], {"pi": np.pi, **table})  # the test's own text
        turns = (getattr(log, ours) - value) / (2 * np.pi)
        assert turns == pytest.approx(np.round(turns[0]), abs=1e-9)


def test_a_unit_given_for_one_angle_leaves_the_other_as_the_file_says(tmp_path):
    log, _ = paper_log(counts=4096)
    path = tmp_path / "log.csv"
    columns = np.column_stack([log.t, np.rad2deg(log.q1), np.rad2deg(log.q2), log.u])
    path.write_text("# angle_unit: deg\nt,q1,q2,u\n" + "\n".join(",".join(map(str, row)) for row in columns.tolist()))
    for unit in (None, "deg", {"q2": "deg"}, "q1=deg"):
        read = read_log(path, unit=unit)
        assert read.q1 == pytest.approx(log.q1)
        assert read.q2 == pytest.approx(log.q2)
    assert "the angle unit of q2 is deg in the file and rad as given" in warned(path, unit={"q2": "rad"})


@pytest.mark.parametrize(
    ("stamps", "unit", "said"),
    [
        (lambda t: 1e3 * t, "ms", "t = t*0.001, q1 = q1, q2 = q2, u = u"),
        (lambda t: 1.7e12 + 1e3 * t, "ms", "t = (t - t[0])*0.001, q1 = q1, q2 = q2, u = u"),
        (lambda t: 1.7e9 + t, "s", "t = t - t[0], q1 = q1, q2 = q2, u = u"),
    ],
)
def test_the_log_says_how_its_stamps_were_read(tmp_path, stamps, unit, said):
    table = rows()
    table["t"] = stamps(table["t"])
    assert quietly(csv(tmp_path, table), time_unit=unit).read_as == said
