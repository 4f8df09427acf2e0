"""Variables of a MAT file, read in a child process: a damaged file can kill scipy's reader, or make it run for ever."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from .checks import LogError
from .mat_child import BROKEN, VERSION

LONGEST = 60
"""Seconds that reading may take; a log of an hour at 1 kHz takes two."""
MOST_MEMORY = 4 << 30
"""Bytes of address space of the child, where the system can limit it."""

_CHILD = Path(__file__).with_name("mat_child.py")


def mat_variables(path: Path) -> dict[str, np.ndarray]:
    """Arrays of numbers or text by name, structs opened as `struct.field`.

    Raises LogError for what is no MAT file, and where reading it dies, takes longer than `LONGEST` or
    more than `MOST_MEMORY`.
    """
    try:
        child = subprocess.run(
            # -P: the script's folder is no place to import from
            [sys.executable, "-P", str(_CHILD), os.path.abspath(path), str(LONGEST), str(MOST_MEMORY)],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=LONGEST,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONIOENCODING": "utf-8"},
        )
    except subprocess.TimeoutExpired:
        raise LogError(f"{path.name}: not a readable MAT file (reading it took more than {LONGEST} s).") from None
    if child.returncode == VERSION:
        raise LogError(
            f"{path.name}: a MAT file of version 7.3, which needs the package pymatreader. Install it: "
            "pip install 'furuta-gym[matlab]', or save the file with save(..., '-v7')."
        )
    if child.returncode == BROKEN:
        said = " ".join(child.stderr.decode(errors="replace").split()[-40:])
        raise LogError(f"{path.name}: not a readable MAT file ({said}).")
    if child.returncode != 0:
        raise LogError(
            f"{path.name}: not a readable MAT file (its reader died of it, exit code {child.returncode}). "
            "Save it again, or as CSV."
        )
    stream = io.BytesIO(child.stdout)
    names = json.loads(stream.readline())
    return {name: np.lib.format.read_array(stream, allow_pickle=False) for name in names}
