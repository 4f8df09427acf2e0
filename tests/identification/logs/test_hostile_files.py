"""What reading a log must survive: files that kill a library, unfold without end, or are no files at all."""

from __future__ import annotations

import base64
import io
import json
import os
import time
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from identification.logs import apart, apart_child, bags, mat_file, opening
from identification.logs.formats import read_table
from identification.logs.log import LogError
from identification.logs.number_block import number_block
from identification.logs.reading import read_log
from tests.files import quietly, rows, warned, write_csv

KILLS_SCIPY = zlib.decompress(
    base64.b85decode(
        b"c-r%I4DoSvQZUssQ1EpO(M`+DNmU5QNi0drFUqx2D9A6)tk6+#E=o--Nlj76&$CkS&CgTt%P&(fGFC7!v@$TaGBH*#GB7e@AOkRZ`tkv("
        b"03c=qVh$(`0<2IzBM`HIX+{PG3<EycLm3Vbio*e9o&l11ELhBAf|^$hqy>Py#3Tj=05wV(&H"
    )
)
"""A MAT file of 264 bytes that ends the process of scipy's reader (signal 11)."""


def test_a_mat_file_that_kills_its_reader(tmp_path: Path) -> None:
    (tmp_path / "log.mat").write_bytes(KILLS_SCIPY)
    with pytest.raises(LogError, match=r"log\.mat: not a readable MAT file \(.*(died|corrupt|read|mat)"):
        read_log(tmp_path / "log.mat")


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "its reader died of it, exit code -11"),
        ("import time; time.sleep(60)", "reading it took more than 1 s"),
        ("import sys; sys.exit('x' * 2000)", r"its reader died of it, exit code 1\)"),
        ("raise OSError('y' * 2000)", r"its reader died of it, exit code 1: OSError: y{291}\)"),
    ],
)
def test_the_child_is_watched(body: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "child.py").write_text(body)
    (tmp_path / "log.mat").write_bytes(b"")
    monkeypatch.setattr(apart, "_CHILD", tmp_path / "child.py")
    monkeypatch.setattr(mat_file, "MAT", replace(mat_file.MAT, longest=1))
    with pytest.raises(LogError, match=rf"log\.mat: not a readable MAT file \({words}"):
        read_log(tmp_path / "log.mat")


class _Pipe(io.RawIOBase):
    """Takes what is written to it, and has a descriptor that nothing else can use."""

    def __init__(self) -> None:
        self.written = b""

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return 10**6

    def write(self, part) -> int:
        self.written += bytes(part)
        return len(part)


def test_arrays_pass_through_pipes_that_have_no_position(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On some systems (glibc 2.39) numpy cannot write an array to a pipe by itself."""
    (tmp_path / "reader.py").write_text("import numpy as np\ndef read(path): return {}, {'t': np.arange(3.0)}\n")
    pipe = _Pipe()
    monkeypatch.setattr("sys.stdout", SimpleNamespace(buffer=io.BufferedWriter(pipe)))
    assert apart_child.main(str(tmp_path / "reader.py"), "log.mat") == 0
    stream = io.BytesIO(pipe.written)
    assert json.loads(stream.readline()) == [{}, ["t"]]
    assert np.lib.format.read_array(stream).tolist() == [0.0, 1.0, 2.0]


def test_a_mat_file_that_unfolds_to_more_than_the_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from scipy.io import savemat

    pytest.importorskip("resource", reason="the system limits no memory")
    savemat(tmp_path / "log.mat", {"t": np.zeros(25_000_000)}, do_compression=True)
    assert (tmp_path / "log.mat").stat().st_size < 300_000
    monkeypatch.setattr(mat_file, "MAT", replace(mat_file.MAT, most=300 << 20))
    with pytest.raises(LogError, match="more memory than a log may take"):
        read_log(tmp_path / "log.mat")


def mcap(path: Path, definition: str, message: bytes, encoding: str = "cdr") -> None:
    writer_of = pytest.importorskip("mcap.writer")
    pytest.importorskip("rosbags")
    with path.open("wb") as file:
        writer = writer_of.Writer(file)
        writer.start()
        schema = writer.register_schema("rig/msg/Reading", "ros2msg", definition.encode())
        channel = writer.register_channel("/rig", encoding, schema)
        for k in range(30):
            writer.add_message(channel, k * 10**7, message, k * 10**7)
        writer.finish()


def test_definitions_in_a_bag_are_read_without_running_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The library compiles readers out of the definitions of a file."""
    monkeypatch.chdir(tmp_path)
    run = "__import__('os').open('it-ran', 65)"
    number = bytes((0, 1, 0, 0)) + np.float64(2.0).tobytes()
    mcap(tmp_path / "log.mcap", f"string A={run}\nstring B=) or {run} or (\nfloat64 a\n", number)
    assert read_table(tmp_path / "log.mcap").numbers("rig.a").tolist() == [2.0] * 30
    mcap(tmp_path / "log.mcap", f"float64 a {run}\nfloat64 {run}\n", number)
    with pytest.raises(LogError, match=r"log\.mcap: not a readable MCAP file \(Could not parse"):
        read_table(tmp_path / "log.mcap")
    assert not (tmp_path / "it-ran").exists()


def test_a_bag_that_unfolds_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A list of fixed length becomes as many lines of code."""
    pytest.importorskip("resource", reason="the system limits no memory")
    mcap(tmp_path / "log.mcap", "string[2000000000] a\n", bytes((0, 1, 0, 0)) + bytes(64))
    assert (tmp_path / "log.mcap").stat().st_size < 10_000
    monkeypatch.setattr(bags, "BAG", replace(bags.BAG, most=400 << 20))
    with pytest.raises(LogError, match=r"log\.mcap: not a readable MCAP file \(it unfolds to more memory"):
        read_table(tmp_path / "log.mcap")


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ({"header": {"stamp": {"sec": 10**30, "nsec": 1}}, "a": 1.0}, "too large"),
        ({"a": 10**400}, "too large"),
        ({f"a{k}": k for k in range(3000)}, "hold 3000 different numbers"),
        ([[]], "no topic has 20 messages with numbers"),
    ],
)
def test_odd_messages_are_told(message: object, words: str, tmp_path: Path) -> None:
    mcap(tmp_path / "log.mcap", "", json.dumps(message).encode(), "json")
    with pytest.raises(LogError, match=rf"log\.mcap: .*{words}"):
        read_table(tmp_path / "log.mcap")


def test_structs_of_structs_are_opened(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "log.mat", {"run": {"data": rows(), "encoder_counts": [2048.0, 4096.0], "note": ["a", "b"]}})
    assert len(quietly(tmp_path / "log.mat")) == 60


def test_parquet_names_the_file(tmp_path: Path) -> None:
    """Broken pages, and metadata that is no text."""
    path = tmp_path / "log.parquet"
    table = pyarrow.table({name: 0.01 * np.arange(60.0) for name in ("t", "q1", "q2", "u")})
    pyarrow.parquet.write_table(table, path, compression="none", use_dictionary=False)
    raw = bytearray(path.read_bytes())
    raw[8:40] = b"\xff" * 32
    path.write_bytes(raw)
    with pytest.raises(LogError, match=r"log\.parquet: not a readable Parquet file \(."):
        read_log(path)
    odd = table.replace_schema_metadata({b"device": b"\xff\xfe", b"encoder_counts": b"4096"})
    pyarrow.parquet.write_table(odd.set_column(3, "u", pyarrow.array(np.arange(60) % 3.0)), path)
    assert quietly(path).encoder_counts == (4096.0, 4096.0)


def test_a_small_file_that_declares_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "MOST_CELLS", 1000)
    zeros = {name: np.zeros(2000) for name in ("t", "q1", "q2", "u")}
    np.savez_compressed(tmp_path / "log.npz", **zeros)  # type: ignore[arg-type]
    pyarrow.parquet.write_table(pyarrow.table(zeros), tmp_path / "log.parquet")
    for name in ("log.npz", "log.parquet"):
        with pytest.raises(LogError, match=rf"{name}: declares 8.*e\+03 numbers"):
            read_log(tmp_path / name)
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w") as archive:
        archive.writestr("t.npy", b"\x93NUMPY\x01\x00")
    with pytest.raises(LogError, match=r"bomb\.npz: not a readable NPZ"):
        read_log(tmp_path / "bomb.npz")


def test_many_columns_take_linear_time(tmp_path: Path) -> None:
    """30 000 columns: 27 s where it is quadratic. The sentence names some of them."""
    names = [f"signal_{n}" for n in range(30_000)]
    (tmp_path / "log.csv").write_text(",".join(names) + "\n" + ",".join("1" * len(names)) + "\n")
    started = time.perf_counter()
    with pytest.raises(LogError, match=r"no column t.*signal_39 and 29960 more") as caught:
        read_log(tmp_path / "log.csv")
    assert time.perf_counter() - started < 5.0
    assert len(str(caught.value)) < 2000


@pytest.mark.skipif(os.name == "nt", reason="pipes and links of POSIX")
def test_what_is_no_file_is_told_as_what_it_is(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    (tmp_path / "gone.csv").symlink_to("nowhere.csv")
    (tmp_path / "zero.csv").symlink_to("/dev/zero")
    for name, words in {
        "pipe.csv": "is a pipe",
        "loop.csv": "is a link that leads back to itself",
        "gone.csv": "is a link to nowhere.csv, which does not exist",
        "zero.csv": "is a device",
        "a\0b.csv": "has a name that no file can have",
        "x" * 300 + ".csv": "cannot be looked at",
    }.items():
        with pytest.raises(LogError, match=words):
            read_log(tmp_path / name)


def test_odd_sizes_are_told(tmp_path: Path) -> None:
    table = rows()
    days = write_csv(tmp_path / "days.csv", table | {"t": 0.002 * np.arange(60) / 86400})
    assert "In days, as spreadsheets keep time, it would be 2 ms: --time-unit d" in warned(days)
    assert quietly(days, time_unit="d").sample_time == pytest.approx(0.002)
    large = write_csv(tmp_path / "large.csv", table | {"u": 2e6 * table["u"]})
    assert "the command u reaches 2e+06" in warned(large)
    usual = write_csv(tmp_path / "usual.csv", table)
    assert "days" not in warned(usual)
    assert "reaches" not in warned(usual)
    for column, value, words in (("q1", 1e300, "column q1 holds 1e"), ("t", 1e-300, "time stands still")):
        values = table[column].tolist()
        values[1] = value
        with pytest.raises(LogError, match=words):
            read_log(write_csv(tmp_path / "huge.csv", table | {column: values}))


def test_what_a_file_says_of_itself_may_be_a_page(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", rows())
    for key in ("angle_unit", "input_unit", "encoder_counts", "pendulum_zero", "controller_gain"):
        (tmp_path / "odd.csv").write_text(f"# {key}: {'x' * 9000}\n{path.read_text()}")
        with pytest.raises(LogError, match="xxx") as caught:
            read_log(tmp_path / "odd.csv")
        assert len(str(caught.value)) < 500


def test_a_log_that_skip_leaves_nothing_of(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"log\.csv after the 0.3 s that are left out \(--skip\): 30 samples"):
        quietly(write_csv(tmp_path / "log.csv", rows()), skip=0.3)


# --- long text files --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("delimiter", "comma", "ending"), [(",", ".", "\n"), (";", ",", "\r\n"), ("\t", ",", "\n"), (" ", ".", "\n")]
)
def test_a_long_file_is_read_as_a_short_one(
    delimiter: str, comma: str, ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Number for number, whatever separates them; with the lines that a message needs."""
    draw = np.random.default_rng(3)
    table = {name: np.cumsum(draw.normal(size=2500)) * 1e-3 for name in ("q1", "q2", "u")}
    lines = [
        delimiter.join(map(repr, row)).replace(".", comma)
        for row in zip(*map(np.ndarray.tolist, table.values()), strict=True)
    ]
    stamped = [f"{repr(0.002 * k).replace('.', comma)}{delimiter}{line}" for k, line in enumerate(lines)]
    path = tmp_path / "log.csv"
    path.write_bytes(ending.join(["# device: rig", delimiter.join(("t", "q1", "q2", "u")), *stamped, ""]).encode())
    assert number_block(path.read_bytes()) is not None
    quick = quietly(path)
    monkeypatch.setattr("identification.logs.formats.number_block", lambda raw: None)
    slow = quietly(path)
    for name in ("t", "q1", "q2", "u"):
        np.testing.assert_array_equal(getattr(quick, name), getattr(slow, name))
    assert quick.device == slow.device == "rig"


@pytest.mark.parametrize("row", ["1,2,3", "1,2,3,4,5", "1,2,x,4", "", "# word", "1,2,nan,4", "1;2;3;4", '"1",2,3,4'])
def test_a_line_that_is_not_plain_is_left_to_the_reader_that_can_say_where(row: str, tmp_path: Path) -> None:
    lines = ["t,q1,q2,u", *(f"{0.002 * k:.3f},0.{k},{k % 7}.5,{k % 3}" for k in range(2500))]
    lines[2200] = row
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    assert number_block(path.read_bytes()) is None
    if row and not row.startswith(("#", '"')):
        with pytest.raises(LogError, match="line 2201"):
            quietly(path)
