"""Files of other programs, each made by its own library: every one becomes the log that was put into it."""

from __future__ import annotations

import gzip
import itertools
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments import demo
from identification import Log, LogError, read_log
from identification.logs.bag_child import _joined, _Topic
from identification.logs.checks import LogWarning
from identification.logs.formats import read_table
from identification.logs.layouts import from_variables
from identification.logs.proposal import propose
from identification.logs.table import Table

# three seconds of a stored log: one that is simulated at the import would be compiled by every worker at its start
STORED = read_log(Path(demo.__file__).parent / "logs" / "paper.csv")
LOG = Log(0.004 * np.arange(750), STORED.q1[:1500:2], STORED.q2[:1500:2], STORED.u[:1500:2], input_unit="V")
NAMES = ("time", "theta", "alpha", "voltage")
SIGNALS = dict(zip(NAMES, (LOG.t, LOG.q1, LOG.q2, LOG.u), strict=True))
MATRIX = np.column_stack(list(SIGNALS.values()))


def is_log(found: Log, tolerance: float = 1e-9) -> bool:
    pairs = ((found.t - found.t[0], LOG.t), (found.q1, LOG.q1), (found.q2, LOG.q2), (found.u, LOG.u))
    return all(a.shape == b.shape and np.allclose(a, b, atol=tolerance, rtol=0) for a, b in pairs)


def proposed(path: Path) -> Log:
    """Read as `propose` says, which must be sure of the columns and their units."""
    proposal = propose(read_table(path))
    assert not proposal.fatal, proposal.fatal
    return read_log(path, **proposal.mapping.arguments())


# --- text --------------------------------------------------------------------------------------------------


def text(sep: str = ",", comma: bool = False, head: str = "", names=NAMES, end: str = "\n", t=LOG.t) -> str:
    cells = [[repr(float(v)).replace(".", "," if comma else ".") for v in row] for row in MATRIX]
    if not np.issubdtype(np.asarray(t).dtype, np.floating):
        cells = [[str(stamp), *row[1:]] for stamp, row in zip(t, cells, strict=True)]
    return head + end.join([sep.join(names), *(sep.join(row) for row in cells), ""])


STAMPS = pd.Timestamp("2025-03-14T09:26:53") + pd.to_timedelta(LOG.t, unit="s")
NEW_YEAR = pd.Timestamp("2025-12-31T23:59:58.5") + pd.to_timedelta(LOG.t, unit="s")
LABVIEW = (
    "LabVIEW Measurement\t\nSeparator\tTab\nDate\t2024/05/03\n***End_of_Header***\t\n\t\nChannels\t3\n"
    "Samples\t750\t750\t750\nX0\t0\t0\t0\n***End_of_Header***\n"
)
TEXTS: dict[str, bytes] = {
    "utf-8": text().encode(),
    "utf-8 with mark": text().encode("utf-8-sig"),
    "utf-16": text(names=("Zeit", "Arm [rad]", "Pendel [rad]", "Spannung [V]")).encode("utf-16"),
    "latin-1": text(";", True, "# Prüfstand\n", ("Zeit [s]", "Arm", "Pendel", "Spannung [V]")).encode("latin-1"),
    "cp1252": text("\t", True, "# „Prüfstand“ – 1 €\n").encode("cp1252"),
    "percent comments": text(head="% rig 3\n% 2025\n").encode(),
    "row of units": text(head=",".join(NAMES) + "\n", names=("s", "rad", "rad", "V")).encode(),
    "iso times": text(t=[s.isoformat() for s in STAMPS]).encode(),
    "iso times with a zone": text(";", True, t=[f"{s.isoformat(sep=' ')}+01:00" for s in STAMPS]).encode(),
    "windows": text(end="\r\n").encode(),
    "german times": text(";", True, t=[s.strftime("%d.%m.%Y %H:%M:%S,%f") for s in STAMPS]).encode(),
    "german times at new year": text(";", True, t=[s.strftime("%d.%m.%Y %H:%M:%S,%f") for s in NEW_YEAR]).encode(),
    "american times": text(t=[s.strftime("%m/%d/%Y %I:%M:%S.%f %p") for s in STAMPS]).encode(),
    "american times at new year": text(t=[s.strftime("%m/%d/%Y %I:%M:%S.%f %p") for s in NEW_YEAR]).encode(),
    "times of the day over midnight": text(t=[s.strftime("%H:%M:%S.%f") for s in NEW_YEAR]).encode(),
    "commas and tabs": text(",\t").encode(),
    "semicolons and tabs": text(";\t", True).encode(),
    "tabs at the ends": text(end="\t\n").encode(),
    "separator of Excel": text(";", True, "sep=;\n").encode(),
    "measurement of LabVIEW": text("\t", head=LABVIEW, names=("X_Value", "Arm", "Pendulum", "Voltage")).encode(),
    "its column of comments": text("\t", head=LABVIEW, names=("X_Value", *NAMES[1:], "Comment")).encode(),
}


@pytest.mark.parametrize("packed", [False, True], ids=["plain", "gz"])
@pytest.mark.parametrize("content", TEXTS.values(), ids=TEXTS)
def test_text(tmp_path: Path, content: bytes, packed: bool) -> None:
    path = tmp_path / ("log.csv.gz" if packed else "log.csv")
    path.write_bytes(gzip.compress(content) if packed else content)
    assert is_log(proposed(path), 1e-8)


def test_a_measurement_of_labview_with_comments_keeps_them(tmp_path: Path) -> None:
    rows = text("\t", head=LABVIEW, names=("X_Value", *NAMES[1:], "Comment")).splitlines()
    start = rows.index("***End_of_Header***") + 2
    path = tmp_path / "log.lvm"
    path.write_text("\n".join(rows[:start] + [f"{row}\tknock" for row in rows[start:]]))
    assert set(read_table(path).columns["Comment"]) == {"knock"}
    assert is_log(proposed(path), 1e-8)


def test_dates_that_are_none_stay_text(tmp_path: Path) -> None:
    for wrong in ("31.02.2025 10:00:00", "14/14/2025 10:00:00", "10:00"):
        path = tmp_path / "log.csv"
        path.write_text(text(t=[wrong] * len(LOG)))
        assert read_table(path).columns["time"].dtype.kind == "O"


def test_another_encoding_is_told(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_bytes(TEXTS["latin-1"])
    assert any("Windows-1252" in str(p) for p in propose(read_table(tmp_path / "log.csv")).problems)


@pytest.mark.parametrize("content", [b"\x1f\x8b\x08\x00rubbish", gzip.compress(text().encode())[:-400]])
def test_a_damaged_packed_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "log.csv.gz").write_bytes(content)
    with pytest.raises(LogError, match=r"log\.csv\.gz: not a readable gzip file"):
        read_table(tmp_path / "log.csv.gz")


@pytest.mark.parametrize("members", [1, 2, 7])
def test_a_packed_file_of_several_members_is_read_whole_or_refused(
    tmp_path: Path, members: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = text().encode()
    cuts = np.linspace(0, len(content), members + 1).astype(int)
    packed = b"".join(gzip.compress(content[a:b]) for a, b in itertools.pairwise(cuts))
    path = tmp_path / "log.csv.gz"
    path.write_bytes(packed + bytes(512))  # a tape fills up its block
    assert is_log(proposed(path), 1e-8)
    monkeypatch.setattr("identification.logs.text._LARGEST", len(content) - 1)
    with pytest.raises(LogError, match="MB when unpacked"):
        read_table(path)


# --- MAT ---------------------------------------------------------------------------------------------------


def structure_with_time() -> dict:
    label = {"theta": "theta", "alpha": "alpha", "voltage": "voltage"}
    signals = np.zeros(3, dtype=[("values", object), ("label", object), ("dimensions", object)])
    for i, name in enumerate(NAMES[1:]):
        signals[i] = (SIGNALS[name][:, None], label[name], 1.0)
    return {"ScopeData": {"time": LOG.t[:, None], "signals": signals, "blockName": "rig/Scope"}}


def recording() -> dict:
    channels = np.zeros(3, dtype=[("Name", object), ("Data", object)])
    for i, name in enumerate(NAMES[1:]):
        channels[i] = (f'"Model Root/{name}"', SIGNALS[name])
    return {"exp001": {"X": {"Name": "", "Data": LOG.t}, "Y": channels, "Description": {"General": "dSPACE"}}}


def timed(name: str) -> dict:
    return {"Time": LOG.t, "Data": SIGNALS[name].reshape(1, 1, -1)}


MATS: dict[str, Callable[[], dict]] = {
    "vectors": lambda: SIGNALS,
    "rows": lambda: {name: values[None, :] for name, values in SIGNALS.items()},
    "structure": lambda: {"data": SIGNALS, "Ts": 0.004},
    "structures in a structure": lambda: {"run": {"rig": "3", "signals_of_run": SIGNALS}},
    "structure with time": structure_with_time,
    "pairs of time and data": lambda: {name: timed(name) for name in NAMES[1:]},
    "recording with X and Y": recording,
}
MATRICES = {"matrix": MATRIX, "to file": MATRIX.T}


@pytest.mark.parametrize("make", MATS.values(), ids=MATS)
def test_mat_5(tmp_path: Path, make: Callable[[], dict]) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "log.mat", make())
    assert is_log(proposed(tmp_path / "log.mat"))


@pytest.mark.parametrize("matrix", MATRICES.values(), ids=MATRICES)
def test_mat_5_matrices_have_no_names_and_are_told_by_motion(tmp_path: Path, matrix: np.ndarray) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "log.mat", {"ans": matrix})
    assert is_log(proposed(tmp_path / "log.mat"))


def write_newer(path: Path, variables: dict) -> None:
    """As MATLAB saves with -v7.3: HDF5 behind a block of 512 bytes, arrays lying, text as numbers, classes as marks."""
    h5py = pytest.importorskip("h5py")

    def put(group, name: str, value) -> None:
        if isinstance(value, dict):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, part in value.items():
                put(inner, key, part)
        elif isinstance(value, str):
            item = group.create_dataset(name, data=np.array([[ord(c)] for c in value], dtype=np.uint16))
            item.attrs["MATLAB_class"] = np.bytes_("char")
        else:
            item = group.create_dataset(name, data=np.atleast_2d(np.asarray(value, dtype=float)))
            item.attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            put(file, name, value)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + b"\0" * 8 + b"\x00\x02IM"
    with path.open("r+b") as file:
        file.write(head)


@pytest.mark.parametrize("variables", [SIGNALS, {"data": SIGNALS | {"rig": "three"}}], ids=["vectors", "structure"])
def test_mat_7_3(tmp_path: Path, variables: dict) -> None:
    pytest.importorskip("pymatreader")
    write_newer(tmp_path / "log.mat", variables)
    assert is_log(proposed(tmp_path / "log.mat"))


def test_the_layouts_leave_what_is_no_signal() -> None:
    table = from_variables(
        "x", {"image": np.zeros((200, 300)), "note": "rig", "t": np.arange(9.0), "gains": [1.0, 2.0]}
    )
    assert list(table.columns) == ["t"]
    assert table.metadata == {"note": "rig", "gains": "1.0 2.0"}


# --- others ------------------------------------------------------------------------------------------------


def test_npz(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", **SIGNALS)
    assert is_log(proposed(tmp_path / "log.npz"))


@pytest.mark.parametrize("ending", ["parquet", "feather"])
@pytest.mark.parametrize("zone", [None, "Europe/Vienna"])
def test_tables_with_dates(tmp_path: Path, ending: str, zone: str | None) -> None:
    frame = pd.DataFrame(SIGNALS)
    frame["time"] = STAMPS.tz_localize(zone)
    getattr(frame, f"to_{ending}")(tmp_path / f"log.{ending}")
    assert is_log(proposed(tmp_path / f"log.{ending}"), 1e-8)


@pytest.mark.parametrize("own_clock", [True, False], ids=["channel of time", "increment"])
def test_tdms(tmp_path: Path, own_clock: bool) -> None:
    nptdms = pytest.importorskip("nptdms")
    units = dict(zip(NAMES, ("s", "rad", "rad", "V"), strict=True))
    properties = {name: {"unit_string": units[name], "wf_increment": 0.004} for name in NAMES}
    used = NAMES if own_clock else NAMES[1:]
    channels = [nptdms.ChannelObject("Run", name, SIGNALS[name], properties[name]) for name in used]
    with nptdms.TdmsWriter(tmp_path / "log.tdms") as writer:
        writer.write_segment([nptdms.RootObject({"operator": "nobody"}), *channels])
    assert is_log(proposed(tmp_path / "log.tdms"), 1e-8)
    (tmp_path / "cut.tdms").write_bytes((tmp_path / "log.tdms").read_bytes()[:60])
    with pytest.raises(LogError, match=r"cut\.tdms"):
        read_log(tmp_path / "cut.tdms")


def stamps() -> list[int]:
    return [round(1e9 * t) + 1_741_944_413_000_000_000 for t in LOG.t]


def test_mcap_with_json(tmp_path: Path) -> None:
    writer_of = pytest.importorskip("mcap.writer")
    with (tmp_path / "log.mcap").open("wb") as file:
        writer = writer_of.Writer(file)
        writer.start()
        schema = writer.register_schema("Rig", "jsonschema", b'{"type": "object"}')
        angles = writer.register_channel("/angles", "json", schema)
        command = writer.register_channel("/motor", "json", schema)
        for k, stamp in enumerate(stamps()):
            reading = {"theta": LOG.q1[k], "alpha": LOG.q2[k]}
            writer.add_message(angles, stamp, json.dumps(reading).encode(), stamp)
            writer.add_message(command, stamp + 300_000, json.dumps({"voltage": LOG.u[k]}).encode(), stamp)
        writer.finish()
    assert is_log(proposed(tmp_path / "log.mcap"), 1e-6)
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "log.mcap").read_bytes()[:300])
    with pytest.raises(LogError, match=r"cut\.mcap"):
        read_log(tmp_path / "cut.mcap")


def ros_messages(store):
    """JointStates with names, and commands a little later."""
    joints, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    time, number = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Float64"]
    extra = {"seq": 0} if "seq" in header.__dataclass_fields__ else {}
    for k, stamp in enumerate(stamps()):
        at = header(**extra, stamp=time(stamp // 10**9, stamp % 10**9), frame_id="")
        angles, empty = np.array([LOG.q1[k], LOG.q2[k]]), np.zeros(0)
        yield "/joint_states", stamp, joints(at, ["arm", "pendulum"], angles, empty, empty)
        yield "/motor/command", stamp + 200_000, number(float(LOG.u[k]))


@pytest.mark.parametrize("storage", ["bag", "SQLITE3", "MCAP"])
def test_bags_of_ros(tmp_path: Path, storage: str) -> None:
    pytest.importorskip("rosbags")
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    old = storage == "bag"
    store = get_typestore(Stores.ROS1_NOETIC if old else Stores.LATEST)
    path = tmp_path / ("log.bag" if old else "log")
    plugin = {} if old else {"version": 9, "storage_plugin": rosbag2.StoragePlugin[storage]}
    kinds = {"/joint_states": "sensor_msgs/msg/JointState", "/motor/command": "std_msgs/msg/Float64"}
    with (rosbag1 if old else rosbag2).Writer(path, **plugin) as writer:
        open_ones = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for topic, stamp, message in ros_messages(store):
            pack = store.serialize_ros1 if old else store.serialize_cdr
            writer.write(open_ones[topic], stamp, bytes(pack(message, kinds[topic])))
    assert is_log(proposed(path), 1e-6)
    if storage == "MCAP":
        (single,) = path.glob("*.mcap")
        assert is_log(proposed(single), 1e-6)


@pytest.mark.parametrize(
    ("file", "package", "extra"),
    [("log.tdms", "nptdms", "labview"), ("log.mcap", "mcap", "ros"), ("log.bag", "rosbags", "ros")],
)
def test_a_missing_package_is_named_with_its_extra(tmp_path: Path, monkeypatch, file, package, extra) -> None:
    import sys

    (tmp_path / file).write_bytes(b"x")
    for name in [n for n in sys.modules if n.split(".")[0] == package] + [
        package,
        f"{package}.reader",
        f"{package}.highlevel",
    ]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(LogError, match=rf"pip install .\.\[{extra}\]"):
        read_log(tmp_path / file)


def joined(times: np.ndarray) -> tuple[Table, np.ndarray]:
    """Joint states at 200 Hz for 10 s, and a command that counts its messages at `times` [s]."""
    stamps = np.arange(2000) * 5_000_000
    states = [{"arm": float(np.sin(3.0 * t)), "pendulum": float(np.pi + 0.3 * np.sin(7.0 * t))} for t in stamps * 1e-9]
    commands = [{"data": float(k % 7)} for k in range(len(times))]
    facts, columns = _joined(
        {"joints": _Topic(stamps.tolist(), states), "cmd": _Topic((times * 1e9).astype(int).tolist(), commands)}
    )
    return Table("x.bag", columns, silent=facts["silent"]), columns["cmd"]


@pytest.mark.filterwarnings("ignore:x.bag. zero or signs")  # of a made-up motion
def test_a_topic_that_stops_is_told_and_holds_its_last_value(tmp_path: Path) -> None:
    (tmp_path / "x.bag").write_bytes(b"x")
    names = {"t": "time", "q1": "joints.arm", "q2": "joints.pendulum", "u": "cmd"}
    table, command = joined(np.arange(400) * 0.005)
    assert set(command[400:]) == {command[399]}
    with pytest.warns(LogWarning, match=r"topic cmd has no message from 1.995 to 9.995 s: .*--cut 1.995:9.995"):
        read_log(tmp_path / "x.bag", names, table=table)
    assert joined(np.arange(2000) * 0.005)[0].silent == {}


def test_a_command_is_held_until_the_next_message() -> None:
    times = np.concatenate([np.arange(200) * 0.005, 6.0 + np.arange(200) * 0.005])
    command = joined(times)[1]
    assert set(command[200:1200]) == {command[199]}  # not from the middle of the pause on what comes after it
    late = joined(7.0 + np.arange(600) * 0.005)[0].silent["cmd"]
    assert "topic cmd has no message from 0 to 7 s: " in late
