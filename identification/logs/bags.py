"""Bags of ROS 1 and ROS 2, and MCAP files: messages of several topics become one table.

Every number of a message is a column, `topic.field`; entries of a list are named as the message names them (`name` of
a JointState), else numbered. The topic with the most messages gives the clock, the others are taken at the stamp
nearest to it, and hold their last value where they pause. Needs the extra `ros`. A child process reads them: a small
file can unfold without end.
"""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from furuta_gym.extras import install

from .apart import Apart
from .checks import LogError
from .table import Table

BAG = Apart(
    script=Path(__file__).with_name("bag_child.py"),
    what="bag",
    missing=f"bags need the package {{package}}: {install('ros')}",
    longest=60,
    for_size=4e-6,  # an hour of two topics at 1 kHz has some 500 MB
    unpacks=True,
)


def read_bag(path: Path) -> Table:
    """A `.bag` of ROS 1, or the folder of a bag of ROS 2. Raises LogError."""
    return _table(path, BAG, "rosbags")


def read_mcap(path: Path) -> Table:
    """An MCAP file with messages in JSON or as ROS writes them. Raises LogError."""
    return _table(path, replace(BAG, what="MCAP file"), "mcap")


def _table(path: Path, reader: Apart, package: str) -> Table:
    if find_spec(package) is None:
        raise LogError(f"{path.name}: {reader.missing.format(package=package)}")
    facts, columns = reader.read(path)
    if "refused" in facts:
        raise LogError(f"{path.name}: {facts['refused']}")
    notes = tuple(f"{path.name}: {note}" for note in facts["notes"])
    silent = {column: f"{path.name}: {said}" for column, said in facts["silent"].items()}
    return Table(path.name, columns, units={"time": "s"}, notes=notes, silent=silent)
