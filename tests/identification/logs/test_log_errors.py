"""Every way a log can be wrong: an error or a warning that names the place and says how to mend it."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from identification.logs.checks import LogArgumentError
from identification.logs.formats import read_table
from identification.logs.log import Log, LogError
from identification.logs.proposal import propose
from identification.logs.reading import read_log
from identification.logs.rig_mapping import RigMapping
from tests.factories import paper_log
from tests.files import changed, csv, quietly, rows, warned

# --- files ------------------------------------------------------------------------------------------------


def test_missing_file_lists_its_neighbours(tmp_path):
    csv(tmp_path)
    with pytest.raises(LogError, match=r"does not exist.*In that folder: log\.csv"):
        read_log(tmp_path / "lgo.csv")
    with pytest.raises(LogError, match="does not exist"):
        read_log(tmp_path / "no" / "folder.csv")
    (tmp_path / "dir.csv").mkdir()
    with pytest.raises(LogError, match="is a folder"):
        read_log(tmp_path / "dir.csv")


def test_unknown_ending_lists_the_known_ones(tmp_path):
    (tmp_path / "log.xlsx").write_bytes(b"PK")
    with pytest.raises(LogError, match=r"unknown ending '.xlsx'.*\.csv.*\.parquet.*\.npz.*\.mat"):
        read_log(tmp_path / "log.xlsx")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no rows"),
        (b"# only: comments\n", "no rows"),
        (b"t,q1,q2,u\n", "0 samples"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe", "not a text file"),
        ("t,q1,q2,u\n".encode("utf-16-le"), "not a text file|zero bytes"),
        (b"1,2,3,4\n" * 60, "Expected a header"),
        (b"t,q1,q2,u,u\n" + b"1,2,3,4,5\n", "u twice"),
        (b"t,q1,q2,u\n1,2,3,4\n1,2\n", "line 3 has 2 cells. Expected 4.*cut off"),
        (b"t,q1,q2,u\n1,2,3,4\nEnd of run\nmean;2\n", "line 3 has 1 cell. Expected 4.*notes.*delete lines 3 to 4"),
        (b"t,q1,q2,u\n1,2,3,4\n1,2\n2,2,3,4\n3\n", "line 3 has 2 cells. Expected 4.*cut off"),
        (b"t,q1,q2,u\n1,2,3,4\n1,2,3,4,5\n", "line 3 has 5 cells"),
        (b"t,q1,q2,u\n0,005,0,2,-3,1,1,5\n", "line 2 has 8 cells. .* Are 0,005 and the others decimal .*semicolons"),
        (b"t,q1,q2,u\n.1,.2,.3,1,5\n", "line 2 has 5 cells. Expected 4.* 1,5 in column u a decimal comma.*semicolons"),
        (b"t;q1;q2;u\n1;2;3;4;5\n", "line 2 has 5 cells. Expected 4.*Delete what is too much"),
        (b't,q1,q2,u\n1,2,3,"4\n1,2,3,4\n', "quotation mark|cells"),
    ],
)
def test_files_that_are_no_logs(tmp_path, content, message):
    (tmp_path / "log.csv").write_bytes(content)
    with pytest.raises(LogError, match=message):
        read_log(tmp_path / "log.csv")


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".mat"])
def test_binary_files_that_are_none(tmp_path, suffix):
    (tmp_path / f"log{suffix}").write_bytes(b"not such a file at all" * 50)
    with pytest.raises(LogError, match="not a readable"):
        read_log(tmp_path / f"log{suffix}")


def test_a_damaged_mat_of_version_7_3_is_refused(tmp_path):
    pytest.importorskip("pymatreader")
    header = b"MATLAB 7.3 MAT-file".ljust(116) + b"\0" * 8 + b"\x00\x02IM" + b"\x89HDF\r\n\x1a\n" + b"\0" * 512
    (tmp_path / "log.mat").write_bytes(header)
    with pytest.raises(LogError, match="not a readable MAT file"):
        read_log(tmp_path / "log.mat")


def test_npz_with_objects_is_not_unpickled(tmp_path):
    np.savez(tmp_path / "log.npz", t=np.array([{}], dtype=object))
    with pytest.raises(LogError, match="plain arrays"):
        read_log(tmp_path / "log.npz")


# --- columns ----------------------------------------------------------------------------------------------


def test_missing_column_lists_what_is_there_and_guesses(tmp_path):
    table = rows()
    renamed = {"Time [s]": table["t"], "theta": table["q1"], "Alpha": table["q2"], "motor_volts": table["u"]}
    with pytest.raises(LogError) as caught:
        read_log(csv(tmp_path, renamed))
    message = str(caught.value)
    assert "no column t, q1, q2, u" in message
    assert "Found: Time [s], theta, Alpha, motor_volts" in message
    assert "--columns 't=Time [s],q1=theta,q2=Alpha,u=motor_volts'" in message


def test_missing_column_without_a_guess(tmp_path):
    table = rows()
    table["zz"] = table.pop("u")
    with pytest.raises(LogError, match=r"no column u.*--columns u=\.\.\."):
        read_log(csv(tmp_path, table))


def test_wrongly_mapped_column_is_named_as_the_user_named_it(tmp_path):
    with pytest.raises(LogError, match=r"no column voltage. Found: t, q1, q2, u"):
        read_log(csv(tmp_path), columns="u=voltage")
    with pytest.raises(LogError, match="mapped to two"):
        read_log(csv(tmp_path), columns="q1=q2")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"unit": "grad"}, "expected rad, deg, turns or counts"),
        ({"unit": {"u": "deg"}}, "expected rad, deg, turns or counts, for q1 and q2"),
        ({"pendulum_zero": "down"}, "expected upright or hanging"),
        ({"encoder_counts": -5}, "above 2"),
        ({"encoder_counts": "many"}, "expected numbers"),
        ({"encoder_counts": (1024, 2048, 4096)}, "one or two numbers"),
        ({"input_unit": "A"}, "expected V or N·m"),
        ({"controller_gain": "1,2"}, "four numbers"),
        ({"time_unit": "h"}, "expected one of s, ms, us"),
        ({"constant_command": "maybe"}, "expected error, warn or ignore"),
        ({"flip": "q3"}, "expected q1, q2 or u"),
        ({"cut": "12"}, "expected FROM:TO"),
        ({"columns": "t"}, "expected pairs"),
    ],
)
def test_arguments_that_make_no_sense_are_refused_with_the_files_name(tmp_path, options, message):
    with pytest.raises(LogError, match=rf"^log\.csv: .*{message}"):
        read_log(csv(tmp_path), **options)
    with pytest.raises(LogError, match=rf"^run 7: .*{message}"):
        read_log(csv(tmp_path), table=replace(read_table(csv(tmp_path)), name="run 7"), **options)


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("columns", "t"),
        ("columns", "t=a,t=b"),
        ("columns", {"x": "y"}),
        ("columns", {"t": " "}),
        ("unit", "grad"),
        ("pendulum_zero", "down"),
        ("flip", "q3"),
        ("flip", "u,u"),
        ("encoder_counts", "many"),
        ("encoder_counts", 1),
        ("input_unit", "A"),
        ("input_scale", -1.0),
        ("time_unit", "h"),
        ("skip", -1.0),
        ("skip", "soon"),
    ],
)
def test_an_error_carries_the_argument_it_is_about(argument, value):
    with pytest.raises(LogArgumentError) as raised:
        RigMapping.of(**{argument: value})
    error = raised.value
    assert error.argument == argument
    assert str(error).startswith(f"{argument} {error.got}: ")
    typed = error.renamed("--option", hint=" as typed")
    assert isinstance(typed, LogArgumentError)
    assert str(typed) == f"--option {error.got}: {error.fault} as typed"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_bad_metadata_names_the_file(tmp_path):
    with pytest.raises(LogError, match=r"log\.csv: encoder_counts 'a lot'"):
        read_log(csv(tmp_path, head="# encoder_counts: a lot\n"))
    current = csv(tmp_path, head="# input_unit: A\n")
    for look in (read_log, lambda path: propose(read_table(path))):
        with pytest.raises(LogError, match=r"^log\.csv: input_unit 'A': expected V"):
            look(current)


def test_a_log_of_a_bad_unit_is_refused_by_its_name():
    with pytest.raises(LogError, match=r"^run 7: input_unit 'A': expected V"):
        Log(**rows(), source="run 7", input_unit="A")


# --- numbers ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("oops", "the text 'oops' in column q2 at line 23"),
        ("", "an empty cell in column q2 at line 23"),
        ("nan", r"NaN.*column q2 at line 23.*Delete those rows"),
        ("-inf", "infinity in column q2 at line 23. Expected"),
        ("1.2.3", "the text '1.2.3'"),
    ],
)
def test_cells_that_are_no_numbers(tmp_path, cell, message):
    with pytest.raises(LogError, match=message):
        read_log(csv(tmp_path, head="# device: x\n", **changed("q2", 20, cell)))


def test_text_in_a_column_that_is_not_used_is_harmless(tmp_path):
    assert len(quietly(csv(tmp_path, state=["running"] * 60))) == 60


def test_binary_columns_of_other_kinds(tmp_path):
    np.savez(tmp_path / "log.npz", **rows() | {"u": rows()["u"] * 1j})
    with pytest.raises(LogError, match="column u holds complex numbers"):
        read_log(tmp_path / "log.npz")
    np.savez(tmp_path / "log.npz", **rows() | {"q1": np.zeros(59)})
    with pytest.raises(LogError, match=r"different length .t 60, q1 59"):
        read_log(tmp_path / "log.npz")
    np.savez(tmp_path / "log.npz", **rows() | {"q1": np.full(60, np.nan)})
    with pytest.raises(LogError, match="column q1 at row 1, and 59 more"):
        read_log(tmp_path / "log.npz")


def test_dates_in_parquet(tmp_path):
    import pandas as pd

    frame = pd.DataFrame(rows())
    frame["t"] = pd.to_datetime(frame["t"], unit="s")
    frame.to_parquet(tmp_path / "log.parquet")
    log = quietly(tmp_path / "log.parquet")
    assert np.allclose(log.t, rows()["t"])


# --- clock ------------------------------------------------------------------------------------------------


def test_time_backwards_and_standing_still(tmp_path):
    with pytest.raises(LogError, match=r"runs backwards at line 32 \(from 0.29 s to 0.1 s"):
        read_log(csv(tmp_path, **changed("t", 30, 0.1)))
    with pytest.raises(LogError, match=r"stands still at line 32 \(t = 0.29 s twice.*more digits"):
        read_log(csv(tmp_path, **changed("t", 30, 0.29)))


@pytest.mark.parametrize("n", [2, 49])
def test_too_few_samples(tmp_path, n):
    with pytest.raises(LogError, match=f"{n} samples. Expected at least 50"):
        read_log(csv(tmp_path, rows(n)))


def test_dropped_samples_are_counted_and_stamps_kept(tmp_path):
    keep = np.ones(100, dtype=bool)
    keep[20:25] = keep[60] = False
    table = {k: v[keep] for k, v in rows(100).items()}
    path = csv(tmp_path, table)
    text = warned(path)
    assert "2 gaps in the clock, about 6 samples dropped" in text
    assert "lasts 0.06 s, after t = 0.19 s" in text
    np.testing.assert_array_equal(quietly(path).t, table["t"])


def test_jittered_stamps_are_kept_without_a_warning(tmp_path):
    log, _ = paper_log()
    jitter = np.random.default_rng(0).uniform(-4e-4, 4e-4, len(log))
    table = {"t": log.t + jitter, "q1": log.q1, "q2": log.q2, "u": log.u}
    assert warned(csv(tmp_path, table)) == ""
    np.testing.assert_array_equal(quietly(csv(tmp_path, table)).t, table["t"])


def test_late_samples_of_a_clock_that_jitters_are_no_gaps(tmp_path):
    """A spacing of 5 ms that varies by 28 %: one in 28 is longer than one and a half times the usual."""
    k = np.arange(2000)
    t = 0.005 * k + 0.001 * np.random.default_rng(0).standard_normal(2000)
    table = {"t": t, "q1": np.sin(3.0 * t), "q2": np.cos(5.0 * t), "u": k % 3 - 1.0}
    assert np.sum(np.diff(t) > 1.5 * 0.005) > 20
    path = csv(tmp_path, table)
    assert "gap" not in warned(path)
    assert len(quietly(path).pieces()) == 1

    dropped = {name: np.delete(values, slice(1000, 1004)) for name, values in table.items()}
    assert "1 gap in the clock, about 4 samples dropped" in warned(csv(tmp_path, dropped))


def test_milliseconds_are_suspected(tmp_path):
    assert "time_unit='ms'" in warned(csv(tmp_path, t=rows()["t"] * 30))
    assert "time_unit" not in warned(csv(tmp_path, t=rows()["t"] * 1000), time_unit="ms")


# --- signals ----------------------------------------------------------------------------------------------


def test_constant_command(tmp_path):
    path = csv(tmp_path, u=np.full(60, 1.5))
    with pytest.raises(LogError, match=r"command u is 1.5 in every sample.*--columns u=.*free decay"):
        read_log(path)
    assert "in every sample" in warned(path, constant_command="warn")
    assert "in every sample" in warned(path, constant_command="ignore"), "no free decay: it may be the wrong column"
    assert "command" not in warned(csv(tmp_path, u=np.zeros(60)), constant_command="ignore")


def test_angles_that_never_move(tmp_path):
    text = warned(csv(tmp_path, q1=np.zeros(60), q2=np.full(60, 0.5)))
    assert "q1 is 0 rad in every sample. Was the arm held" in text
    assert "q2 is 0.5 rad in every sample. Was the pendulum held" in text


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("low", [0.0, -0.5])  # of a turn: wrapped to [0, 2π) and to [−π, π)
def test_wrapped_encoders_are_unwrapped_with_a_warning(tmp_path, unit, low):
    t = np.arange(400) * 0.005
    turn = 360.0 if unit == "deg" else 2 * np.pi
    true = turn * 0.4 * t * np.sin(4 * t)
    wrapped = (true - low * turn) % turn + low * turn
    path = csv(tmp_path, {"t": t, "q1": wrapped, "q2": 0.1 * np.sin(t), "u": np.sin(t)})
    assert "Taken as a wrapped encoder and unwrapped" in warned(path, unit=unit)
    q1 = quietly(path, unit=unit).q1
    np.testing.assert_allclose(q1 - q1[0], (true - true[0]) * 2 * np.pi / turn, atol=1e-9)


@pytest.mark.parametrize("counts", [1000, 2048, 2400, 8000])
@pytest.mark.parametrize(("bits", "low"), [(16, 0), (16, -(2**15)), (24, 0)])
def test_a_counter_that_overflows_is_unwrapped_by_what_it_holds(tmp_path, counts, bits, low):
    t = np.arange(400) * 0.005
    true = np.round(0.1 * counts * np.sin(4 * t) - 3.0)  # about zero, where an unsigned counter overflows
    true += 2**bits // 2 if low else 0  # a signed one overflows there
    wrapped = (true - low) % 2**bits + low
    path = csv(tmp_path, {"t": t, "q1": wrapped, "q2": np.round(0.05 * counts * np.sin(t)), "u": np.sin(t)})
    assert "Taken as a wrapped counter" in warned(path, unit="counts", encoder_counts=counts)
    q1 = quietly(path, unit="counts", encoder_counts=counts).q1
    np.testing.assert_allclose(q1 - q1[0], (true - true[0]) * 2 * np.pi / counts, atol=1e-9)


@pytest.mark.parametrize("jump", [27.3, -1.8])  # turns
def test_a_jump_that_is_no_wrap_is_refused(tmp_path, jump):
    t = np.arange(400) * 0.005
    q1 = 0.5 * np.sin(4 * t) + np.where(t > 1.0, 2 * np.pi * jump, 0.0)
    path = csv(tmp_path, {"t": t, "q1": q1, "q2": 0.1 * np.sin(t), "u": np.sin(t)})
    with pytest.raises(LogError, match=r"q1 jumps from .* turns, at t = 1.005 s. Expected angles without jumps"):
        quietly(path)


def table_of(log: Log, **changes):
    return {"t": log.t, "q1": log.q1, "q2": log.q2, "u": log.u} | changes


@pytest.mark.parametrize("counts", [2048, 4096, None])
def test_degrees_declared_as_radians_and_the_reverse(tmp_path, counts):
    log, _ = paper_log(counts=counts)
    degrees = csv(tmp_path, table_of(log, q1=np.rad2deg(log.q1), q2=np.rad2deg(log.q2)))
    assert warned(degrees, unit="deg") == ""
    if counts:  # without steps, small motions in degrees cannot be told from large ones in radians
        assert "q2 moves in steps of" in warned(degrees)
        assert "looks like degrees" in warned(degrees)
        text = warned(csv(tmp_path, table_of(log)), unit="deg")
        assert "looks like radians" in text
        assert f"({counts} counts" in text


def test_degrees_without_steps_are_known_by_their_speed(tmp_path):
    t = np.arange(1000) * 0.005
    swing = 90 * np.sin(5 * t)
    path = csv(tmp_path, {"t": t, "q1": 0.1 * swing, "q2": swing, "u": np.sin(t)})
    assert "q2 reaches a speed of 450 /s, which looks like degrees" in warned(path)


def test_declared_counts_are_compared_with_the_steps_seen(tmp_path):
    log, _ = paper_log(counts=4096)
    path = csv(tmp_path, table_of(log))
    assert warned(path, encoder_counts=4096) == ""
    text = warned(path, encoder_counts=(1024, 4096))
    assert "q1 moves in steps of 0.001534 rad, as an encoder of 4096 counts" in text
    assert "1024 were declared. Count all four edges" in text
    assert "q2 moves" not in text


# --- zero and signs ---------------------------------------------------------------------------------------

TO_OTHER_AXES = {"q1": lambda log: {"q1": -log.q1}, "q2": lambda log: {"q2": -log.q2}, "u": lambda log: {"u": -log.u}}


@pytest.mark.parametrize("axis", TO_OTHER_AXES)
def test_a_turned_axis_is_noticed_and_the_option_given(tmp_path, axis):
    log, _ = paper_log()
    path = csv(tmp_path, table_of(log, **TO_OTHER_AXES[axis](log)))
    assert f"read it with --pendulum-zero upright --flip {axis}." in warned(path)
    assert warned(path, flip=axis) == ""


def test_a_hanging_zero_is_noticed(tmp_path):
    log, _ = paper_log()
    path = csv(tmp_path, table_of(log, q2=log.q2 + np.pi))
    text = warned(path)
    assert "the pendulum falls towards q2 = 0, which should be upright" in text
    assert "read it with --pendulum-zero hanging and no --flip." in text
    assert warned(path, pendulum_zero="hanging") == ""
    upright = csv(tmp_path, table_of(log))
    assert "read it with --pendulum-zero upright and no --flip." in warned(upright, pendulum_zero="hanging")


def test_measured_logs_ask_for_the_options_that_their_laboratories_need(real_data):
    for path in sorted(real_data.glob("*/*.csv")):
        assert "read it with --pendulum-zero hanging --flip q2." in warned(path), path.name
        assert warned(path, pendulum_zero="hanging", flip="q2", encoder_counts=2048) == "", path.name
