"""Variables of a MAT file, read in a child process: a damaged file can kill scipy's reader, or make it run for ever."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from furuta_gym.extras import install

from .apart import Apart

MAT = Apart(
    script=Path(__file__).with_name("mat_child.py"),
    what="MAT file",
    missing="a MAT file of version 7.3, which needs the package pymatreader: "
    f"{install('matlab')}, or save the file with save(..., '-v7').",
    longest=60,  # a log of an hour at 1 kHz takes two
)


def mat_variables(path: Path) -> dict[str, np.ndarray]:
    """Arrays of numbers or text by name, structs opened as `struct.field`. Raises LogError."""
    return MAT.read(path)[1]
