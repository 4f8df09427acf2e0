"""Log files: what is written is read again, and the conventions against cases worked out by hand."""

from __future__ import annotations

import hashlib
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from identification.logs.checks import MIN_SAMPLES
from identification.logs.log import Log, LogError, LogWarning, write_log
from identification.logs.reading import read_log, read_logs
from tests.factories import made_log, paper_log
from tests.files import quietly, rows, write_csv

SUFFIXES = [".csv", ".parquet", ".npz", ".mat"]


# --- round trips ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_of_everything_a_log_holds(tmp_path, suffix):
    log = made_log(
        input_unit="Nm",
        encoder_counts=(2048, 1_048_576),
        device="rig: 7, blue",
        controller_gain=(-9.1, -5.3, -41.5, -5.6),
        metadata={"operator": "K. F.", "run": "12"},
    )
    write_log(tmp_path / f"log{suffix}", log)
    back = quietly(tmp_path / f"log{suffix}")
    for name in ("t", "q1", "q2", "u"):
        np.testing.assert_array_equal(getattr(back, name), getattr(log, name))
    for name in ("input_unit", "encoder_counts", "device", "controller_gain", "metadata"):
        assert getattr(back, name) == getattr(log, name)
    assert back.input_unit == "N·m"
    assert back.source == f"log{suffix}"
    assert back.sha256 == hashlib.sha256((tmp_path / f"log{suffix}").read_bytes()).hexdigest()
    assert [p.name for p in tmp_path.iterdir()] == [f"log{suffix}"]


finite = st.floats(-1e6, 1e6, allow_subnormal=False)


@settings(max_examples=25)
@given(
    steps=st.lists(st.floats(1e-4, 0.1), min_size=MIN_SAMPLES, max_size=MIN_SAMPLES + 20),
    start=st.floats(-10, 1e4),
    seed=st.integers(0, 2**32 - 1),
    suffix=st.sampled_from(SUFFIXES),
    device=st.none() | st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Zl", "Zp", "Cs"]), max_size=12),
    gain=st.none() | st.tuples(finite, finite, finite, finite),
)
def test_any_log_survives_the_round_trip(tmp_path_factory, steps, start, seed, suffix, device, gain):
    rng = np.random.default_rng(seed)
    t = start + np.cumsum(steps)
    q = np.cumsum(rng.normal(0, 0.1, (2, len(t))), axis=1).clip(-3, 3)
    log = Log(t, q[0], q[1], rng.normal(size=len(t)), device=device, controller_gain=gain)
    path = tmp_path_factory.mktemp("fuzz") / f"log{suffix}"
    write_log(path, log)
    back = quietly(path)
    for name in ("t", "q1", "q2", "u"):
        np.testing.assert_array_equal(getattr(back, name), getattr(log, name))
    assert (back.device, back.controller_gain) == (log.device, log.controller_gain)


def test_nothing_is_left_behind_when_writing_fails(tmp_path):
    log = made_log(metadata={"a_key_that_is_longer_than_matlab_can_take": "1"})
    with pytest.raises(LogError, match="too long for MAT"):
        write_log(tmp_path / "log.mat", log)
    with pytest.raises(LogError, match=r"cannot write '.xlsx'"):
        write_log(tmp_path / "log.xlsx", log)
    assert list(tmp_path.iterdir()) == []


# --- text files as people write them ----------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "\ufefft,q1,q2,u\r\n{rows:,}",
        "# by hand\n\n  t ; q1 ; q2 ; u\n{rows:;}",
        "t\tq1\tq2\tu\n{rows:\t}",
        "t q1  q2 u\n{rows: }",
        '"t","q1","q2","u"\n{rows:,}',
        "# t,q1,q2,u\n{rows:,}",  # as numpy.savetxt writes a header
        "# device: x\n# t q1 q2 u\n{rows: }",
        "note,t,q1,q2,u,\n{noted}",
    ],
)
def test_csv_dialects(tmp_path, text):
    table = rows()
    values = np.column_stack(list(table.values()))
    for separator in ",;\t ":
        joined = "\n".join(separator.join(map(str, row)) for row in values.tolist())
        text = text.replace(f"{{rows:{separator}}}", joined)
    text = text.replace("{noted}", "\n".join("ok," + ",".join(map(str, row)) + "," for row in values.tolist()))
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode("utf-8"))
    log = quietly(path)
    np.testing.assert_array_equal(np.column_stack([log.t, log.q1, log.q2, log.u]), values)


def test_csv_with_decimal_commas(tmp_path):
    values = np.column_stack(list(rows().values()))
    lines = [";".join(str(v).replace(".", ",") for v in row) for row in values.tolist()]
    (tmp_path / "log.csv").write_text("t;q1;q2;u\n" + "\n".join(lines))
    log = quietly(tmp_path / "log.csv")
    np.testing.assert_array_equal(np.column_stack([log.t, log.q1, log.q2, log.u]), values)


def test_mat_structs_matrices_and_columns(tmp_path):
    table = rows()
    savemat(tmp_path / "struct.mat", {"log": table, "encoder_counts": [2048, 4096], "device": "rig"})
    log = quietly(tmp_path / "struct.mat")
    np.testing.assert_array_equal(log.q2, table["q2"])
    assert (log.encoder_counts, log.device) == ((2048, 4096), "rig")
    savemat(tmp_path / "matrix.mat", {"data": np.column_stack(list(table.values()))})
    log = quietly(tmp_path / "matrix.mat", "t=data.1,q1=data.2,q2=data.3,u=data.4")
    np.testing.assert_array_equal(log.u, table["u"])


def test_npz_with_numeric_metadata(tmp_path):
    np.savez(tmp_path / "a.npz", **rows(), encoder_counts=2048, input_unit="N m", controller_gain=np.arange(4.0))
    log = quietly(tmp_path / "a.npz")
    assert (log.encoder_counts, log.input_unit, log.controller_gain) == ((2048, 2048), "N·m", (0, 1, 2, 3))


def test_parquet_from_pandas(tmp_path):
    import pandas as pd

    pd.DataFrame(rows()).astype({"u": "float32"}).to_parquet(tmp_path / "a.parquet")
    np.testing.assert_array_equal(quietly(tmp_path / "a.parquet").u, rows()["u"])


# --- conventions, by hand ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "expected_q2"),
    [
        ({}, [0.1, 0.2]),
        ({"flip": "q2"}, [-0.1, -0.2]),
        ({"pendulum_zero": "hanging"}, [0.1 - np.pi, 0.2 - np.pi]),
        ({"pendulum_zero": "hanging", "flip": ("q2",)}, [np.pi - 0.1, np.pi - 0.2]),
        ({"unit": "deg"}, [np.deg2rad(0.1), np.deg2rad(0.2)]),
        ({"unit": {"q2": "deg"}, "pendulum_zero": "hanging"}, [np.deg2rad(0.1) - np.pi, np.deg2rad(0.2) - np.pi]),
    ],
)
def test_unit_then_zero_then_sign(tmp_path, options, expected_q2):
    table = rows()
    table["q2"][:2] = [0.1, 0.2]
    log = quietly(write_csv(tmp_path / "log.csv", table), **options)
    np.testing.assert_allclose(log.q2[:2], expected_q2, rtol=1e-12)
    factor = np.pi / 180 if options.get("unit") == "deg" else 1.0
    np.testing.assert_allclose(log.q1, table["q1"] * factor)


def test_degrees_hanging_by_hand(tmp_path):
    """Upright is 180° in this file; 170° is 10° from upright on the side of lower readings."""
    table = rows()
    table["q2"] = np.array([170.0, 190.0, *np.linspace(180, 185, 58)])
    log = quietly(write_csv(tmp_path / "log.csv", table), unit="deg", pendulum_zero="hanging")
    np.testing.assert_allclose(np.rad2deg(log.q2[:3]), [-10, 10, 0], atol=1e-9)
    log = quietly(write_csv(tmp_path / "log.csv", table), unit="deg", pendulum_zero="hanging", flip="q2,u")
    np.testing.assert_allclose(np.rad2deg(log.q2[:3]), [10, -10, 0], atol=1e-9)
    np.testing.assert_array_equal(log.u, -table["u"])


@pytest.mark.parametrize("turns", [-3, -1, 0, 1, 2])
def test_whole_turns_are_taken_off(tmp_path, turns):
    table = rows()
    near_upright = table["q2"]
    table["q2"] = near_upright + np.pi + 2 * np.pi * turns
    log = quietly(write_csv(tmp_path / "log.csv", table), pendulum_zero="hanging")
    np.testing.assert_allclose(log.q2, near_upright, atol=1e-12)


def test_a_hanging_start_does_not_depend_on_the_sign_of_a_count(tmp_path):
    for start in (0.003, -0.003):
        table = rows()
        table["q2"] = start * np.cos(np.arange(60))
        log = quietly(write_csv(tmp_path / "log.csv", table), pendulum_zero="hanging", flip="q2")
        assert log.q2[0] == pytest.approx(np.pi, abs=0.01)


def test_columns_and_times_are_mapped(tmp_path):
    names = {"t": "Time [ms]", "q1": "theta", "q2": "alpha", "u": "volts"}
    table = {names[k]: v for k, v in rows().items()}
    table["Time [ms]"] = 1000 * table["Time [ms]"]
    path = write_csv(tmp_path / "log.csv", table)
    for columns in (names, "t=Time [ms],q1=theta, q2=alpha,u=volts"):
        log = quietly(path, columns, time_unit="ms")
        np.testing.assert_allclose(log.t, rows()["t"], atol=1e-12)
        np.testing.assert_array_equal(log.q2, rows()["q2"])


def test_gain_is_mapped_with_its_axes(tmp_path):
    """u = −K x must give the same command in the new axes as in the file's."""
    log, _ = paper_log()
    gain = np.array([-7.3, -4.2, -33.2, -4.5])
    path = tmp_path / "log.csv"
    write_csv(path, {"t": log.t, "q1": np.rad2deg(log.q1), "q2": np.rad2deg(-log.q2), "u": -log.u})
    mapped = quietly(path, unit="deg", flip=("q2", "u"), controller_gain=gain.tolist())
    x_file = np.array([10.0, -3.0, 5.0, 7.0])
    x_ours = np.deg2rad(x_file) * [1, 1, -1, -1]
    assert -(-gain @ x_file) == pytest.approx(-np.array(mapped.controller_gain) @ x_ours)


def test_metadata_is_used_and_given_options_win_with_a_warning(tmp_path):
    head = "# input_unit: N m\n# pendulum_zero: hanging\n# encoder_counts: 2048, 4096\n# room: 12 b\n# device: rig\n"
    path = write_csv(tmp_path / "log.csv", rows(), head)
    log = quietly(path)
    assert (log.input_unit, log.encoder_counts, log.device) == ("N·m", (2048, 4096), "rig")
    assert log.metadata == {"room": "12 b"}
    assert log.q2[0] == pytest.approx(0.1 - np.pi)
    with pytest.warns(LogWarning) as caught:
        log = read_log(path, pendulum_zero="upright", input_unit="V", device="rig")
    text = "\n".join(str(w.message) for w in caught)
    assert "pendulum_zero is hanging in the file and upright as given" in text
    assert "input_unit is N·m in the file and V as given" in text
    assert "device" not in text
    assert log.q2[0] == pytest.approx(0.1)


def test_several_logs_with_different_sample_times(tmp_path):
    for k, T in enumerate((0.001, 0.002)):
        write_log(tmp_path / f"{k}.csv", made_log(T=T))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        logs = read_logs([tmp_path / "0.csv", tmp_path / "1.csv"], encoder_counts=4096)
    assert [log.sample_time for log in logs] == pytest.approx([0.001, 0.002])
    assert {log.encoder_counts for log in logs} == {(4096, 4096)}


def test_a_free_decay_is_read_beside_a_driven_log_only(tmp_path):
    write_log(tmp_path / "free.csv", made_log(u=np.zeros(200)))
    write_log(tmp_path / "driven.csv", made_log())
    with pytest.raises(LogError, match="command u is 0 in every sample"):
        read_logs([tmp_path / "free.csv"])
    with pytest.warns(LogWarning, match="command u is 0 in every sample"):
        assert len(read_logs([tmp_path / "free.csv", tmp_path / "driven.csv"])) == 2
    with pytest.warns(LogWarning), pytest.raises(LogError, match="constant in all 2 logs"):
        read_logs([tmp_path / "free.csv"] * 2)


def test_logs_of_one_rig_share_a_unit(tmp_path):
    write_log(tmp_path / "v.csv", made_log())
    write_log(tmp_path / "n.csv", made_log(input_unit="N·m"))
    with pytest.raises(LogError, match="one unit"):
        read_logs([tmp_path / "v.csv", tmp_path / "n.csv"])
    with pytest.raises(LogError, match="no log was given"):
        read_logs([])


# --- measured logs ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "n", "T", "start"),
    [
        ("qube_darmstadt/chirp_p1V5_250Hz_00.csv", 2500, 0.004, np.pi),
        ("qube_darmstadt/swingup_500Hz_5s_01.csv", 2500, 0.002, np.pi),
        ("qube_mcgill/balance_prbs_20230828T161301.csv", 10_000, 0.002, 0.0),
    ],
)
def test_measured_logs_read_without_a_warning(real_data, name, n, T, start):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        log = read_log(real_data / name, pendulum_zero="hanging", flip="q2", encoder_counts=2048)
    assert len(log) == n
    assert log.sample_time == pytest.approx(T)
    assert log.regular
    assert log.q2[0] == pytest.approx(start, abs=0.1)
    for step in log.encoder_steps:
        assert step == pytest.approx(2 * np.pi / 2048, rel=1e-4)
    for std in log.noise_std:
        assert 0.99 < std / (2 * np.pi / 2048 / np.sqrt(12)) < 1.3


def test_a_measured_log_survives_every_format(real_data, tmp_path):
    log = read_log(
        real_data / "qube_darmstadt/swingup_250Hz_5s_00.csv", pendulum_zero="hanging", flip="q2", device="QUBE"
    )
    for suffix in SUFFIXES:
        write_log(tmp_path / f"log{suffix}", log)
        back = read_log(tmp_path / f"log{suffix}")
        np.testing.assert_array_equal(back.angles, log.angles)
        assert back.device == "QUBE"
