"""Reading in a child process: a damaged or hostile file can kill a library, or make it run or grow without end."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from furuta_gym.processes import temporary_folder

from .apart_child import BROKEN, MISSING
from .checks import LogError

_CHILD = Path(__file__).with_name("apart_child.py")


@dataclass(frozen=True)
class Apart:
    """A reader for a child process.

    script: a file with `read(path)`. what: the format in words. missing: what to do without a package that it needs.
    longest: seconds that reading may take, and `for_size` more for each byte of the file. most: bytes of address space
    of the child, where the system can limit it. unpacks: the library unpacks to the temporary folder, where an ended
    child must leave nothing.
    """

    script: Path
    what: str
    missing: str
    longest: int
    for_size: float = 0.0
    most: int = 4 << 30
    unpacks: bool = False

    def read(self, path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Facts, and arrays of numbers or text by name.

        Raises LogError for a file that is not of the format, and where reading it dies, takes longer than `longest` or
        more than `most`.
        """
        longest = self.longest + round(self.for_size * _size(path))
        bounds = [str(longest), str(self.most)]
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONIOENCODING": "utf-8:replace"}
        with temporary_folder("log") if self.unpacks else nullcontext() as room:
            try:
                child = subprocess.run(
                    # -P: the script's folder is no place to import from
                    [sys.executable, "-P", str(_CHILD), str(self.script), os.path.abspath(path), *bounds],
                    stdin=subprocess.DEVNULL,
                    capture_output=True,
                    timeout=longest,
                    env=environment if room is None else environment | {"TMPDIR": str(room)},
                )
            except subprocess.TimeoutExpired:
                raise LogError(self._unreadable(path, f"reading it took more than {longest} s")) from None
        spoken = child.stderr.decode(errors="replace")
        said = " ".join(spoken.split()[-40:])[-300:]
        if child.returncode == MISSING:
            raise LogError(f"{path.name}: {self.missing.format(package=said)}")
        if child.returncode == BROKEN:
            raise LogError(self._unreadable(path, said))
        if child.returncode != 0:
            error = re.findall(r"(?m)^[\w.]+(?:Error|Exception)\b.*$", spoken)[-1:]
            why = f"its reader died of it, exit code {child.returncode}" + "".join(f": {line[:300]}" for line in error)
            raise LogError(f"{self._unreadable(path, why)} Save it again, or as CSV.")
        stream = io.BytesIO(child.stdout)
        facts, names = json.loads(stream.readline())
        return facts, {name: np.lib.format.read_array(stream, allow_pickle=False) for name in names}

    def _unreadable(self, path: Path, why: str) -> str:
        return f"{path.name}: not a readable {self.what} ({why})."


def _size(path: Path) -> int:
    """Bytes of a file, or of the files in a folder."""
    return sum(file.stat().st_size for file in ([path] if path.is_file() else path.iterdir()))
