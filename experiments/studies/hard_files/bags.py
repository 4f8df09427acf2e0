"""Bags of ROS 1 and ROS 2 and MCAP files with damaged bytes, or with definitions and messages that mean harm."""

from __future__ import annotations

import io
import json
import random
import tempfile
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

from identification.logs.checks import LogError
from identification.logs.formats import read_table

from .damage import damaged_bytes, damaged_tree

FORMATS = (".bag", ".mcap", ".folder")
_RUN = "__import__('os').open('it-ran', 65)"
_DEFINITIONS = (
    f"string A={_RUN}\nfloat64 a\n", f'string A="""+{_RUN}+"""\nfloat64 a\n', f"float64 a {_RUN}\n",
    f"float64 a\n================================================================================\nMSG: x/{_RUN}\n",
    "string[2000000000] a\n", "x/msg/Y[100000][3] a\n", "x/msg/Y a\n", "float64[99999999999] a\n", "float64 A=1e999\n",
    "uint8[] a\nstring[] b\n", "float64 self\nfloat64 rawdata\nfloat64 typestore\n", "", "\0", "float64 a\n" * 3000,
    "string<=99999999999999999999 a\n", "x/msg/dataclass a\nfloat64 T\n", "@a\nfloat64 __class__\n",
)  # fmt: skip
_KINDS = ("x/msg/Y", f"x/msg/{_RUN}", "../x", "x/msg/1", "x/msg/class", "x", "", f'x/msg/Y\nfloat64 a\n"""\n{_RUN}')
_MESSAGES: tuple[Any, ...] = (
    {"header": {"stamp": {"sec": 10**30, "nsec": 1}}, "a": 1.0}, {"header": {"stamp": {"sec": 1, "nsec": []}}, "a": 1},
    {"a": 10**400}, {"name": ["a", "a"], "position": [1, 2]}, [[[[[[1.0]]]]]], {"a": "1"}, {"": {"": 1}}, [], 1.0,
    {"a": float("nan")}, {"name": [{}], "position": [1]}, {str(k): k for k in range(300)},
)  # fmt: skip


def bag_case(draw: random.Random) -> tuple[str, bytes]:
    """Format and content; that of a folder is a zip of its files."""
    ending = draw.choice(FORMATS)
    if ending == ".mcap" and draw.random() < 0.6:
        return ending, _hostile(draw)
    raw = draw.choice(_whole(ending))
    if ending != ".folder":
        return ending, damaged_bytes(draw, raw)
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    for name in files:
        if name == "metadata.yaml" and draw.random() < 0.6:
            files[name] = _metadata(draw, files[name])
        elif draw.random() < 0.5:
            files[name] = damaged_bytes(draw, files[name])
    return ending, _zipped(files)


def try_bag(ending: str, raw: bytes, folder: Path) -> str:
    """ "read" or "refused"; a fault is raised."""
    path = folder / f"case{ending}"
    if ending == ".folder":
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            for old in path.glob("*"):
                old.unlink()
            archive.extractall(path)
    else:
        path.write_bytes(raw)
    try:
        table = read_table(path)
    except LogError as error:
        if path.name not in str(error) or len(str(error)) > 3000:
            raise AssertionError(f"no file name, or too long: {str(error)[:200]}") from None
        return "refused"
    for column in table.columns:
        table.numbers(column)
    return "read"


def _hostile(draw: random.Random) -> bytes:
    """An MCAP file with a definition, a name or messages that nobody needs."""
    from mcap.writer import Writer

    out = io.BytesIO()
    writer = Writer(out)
    writer.start()
    plain = draw.random() < 0.4
    text = draw.choice(_DEFINITIONS).encode()
    kind = draw.choice(_KINDS) if draw.random() < 0.5 else "x/msg/Y"
    schema = writer.register_schema(kind, draw.choice(("ros2msg", "ros2idl", "ros1msg", "jsonschema")), text)
    channel = writer.register_channel(
        draw.choice(("/a", "", "a/" * 200, "é")), "json" if plain else draw.choice(("cdr", "ros1", "protobuf")), schema
    )
    message = json.dumps(draw.choice(_MESSAGES)).encode() if draw.random() < 0.9 else b"[" * 100_000
    packed = bytes((0, 1, 0, 0)) + draw.choice((b"", b"\0" * 64, b"\xff" * 64, b"\1\0\0\0" * 16))
    for k in range(draw.choice((0, 1, 30, 30, 30))):
        stamp = draw.choice((0, 2**63, 2**64 - 1)) if draw.random() < 0.05 else k * 10**7
        writer.add_message(channel, stamp, message if plain else packed, stamp)
    writer.finish()
    return damaged_bytes(draw, out.getvalue(), 1) if draw.random() < 0.2 else out.getvalue()


def _metadata(draw: random.Random, raw: bytes) -> bytes:
    """Another metadata.yaml: JSON is YAML too."""
    from ruamel.yaml import YAML

    tree = YAML(typ="safe").load(raw.decode())
    about = tree["rosbag2_bagfile_information"]
    if draw.random() < 0.5:
        about[draw.choice(("compression_mode", "storage_identifier"))] = draw.choice(("file", "message", "mcap", "x"))
        about["compression_format"] = draw.choice(("zstd", "", "x"))
        about["relative_file_paths"] = [draw.choice(("../case.bag", "/etc/passwd", "?vfs=x", "", "metadata.yaml"))]
    else:
        tree = damaged_tree(draw, tree)
    text = json.dumps(tree).encode("utf-8", "surrogatepass")
    tags = (b"a: !!python/object/apply:os.open ['it-ran', 65]\n", b"a: &a [1]\nb: [*a, *a]\n", text)
    return draw.choice(tags) if draw.random() < 0.2 else text


@cache
def _whole(ending: str) -> list[bytes]:
    """Undamaged files to start from."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    old = ending == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if old else Stores.LATEST)
    kind = "std_msgs/msg/Float64"
    found = []
    for storage in rosbag2.StoragePlugin if not old else (None,):
        with tempfile.TemporaryDirectory() as room:
            path = Path(room) / ("whole.bag" if old else "whole")
            plugin: dict[str, Any] = {} if old else {"version": 9, "storage_plugin": storage}
            with (rosbag1 if old else rosbag2).Writer(path, **plugin) as writer:
                topics = [writer.add_connection(f"/{name}", kind, typestore=store) for name in ("q1", "q2", "u")]
                for k in range(60):
                    message = store.types[kind](0.1 * k)
                    pack = store.serialize_ros1 if old else store.serialize_cdr
                    for topic in topics:
                        writer.write(topic, k * 10**7, bytes(pack(message, kind)))  # type: ignore[arg-type]
            if ending == ".bag":
                found.append(path.read_bytes())
            elif ending == ".folder":
                found.append(_zipped({file.name: file.read_bytes() for file in path.iterdir()}))
            else:
                found += [file.read_bytes() for file in path.glob("*.mcap")]
    return found


def _zipped(files: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return out.getvalue()
