"""Reads a file in a process of its own, which may die of it or run into its bounds (see `apart`).

Run as a script with a reader's file, the log's file, and the most seconds and bytes that it may take. The reader's
`read(path)` returns facts (JSON) and arrays by name; they are written as a line of JSON, then the arrays in numpy's own
format. It imports nothing of the project, so that it starts quickly.
"""

import json
import runpy
import sys
from typing import BinaryIO

import numpy as np

MISSING, BROKEN = 3, 4
"""Exit codes: a package is not installed (stderr names it), and the file cannot be read (stderr says why)."""


class Pipe:
    """No file for numpy, which would ask the pipe for its position; newer C libraries refuse that."""

    def __init__(self, out: BinaryIO) -> None:
        self._out = out

    def write(self, data: bytes, /) -> int:
        """Number of bytes written."""
        return self._out.write(data)


def limit(seconds: int, size: int) -> None:
    """Bound this process's time, and its address space and the files that it writes [bytes], where the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    bounds = {"RLIMIT_AS": size, "RLIMIT_FSIZE": size, "RLIMIT_CPU": seconds, "RLIMIT_CORE": 0}
    for name, most in bounds.items():
        what = getattr(resource, name)
        hard = resource.getrlimit(what)[1]
        resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def main(reader: str, path: str) -> int:
    """Exit code."""
    try:
        facts, arrays = runpy.run_path(reader)["read"](path)
    except ImportError as error:
        print((error.name or "").partition(".")[0], file=sys.stderr)
        return MISSING
    except MemoryError:
        print("it unfolds to more memory than a log may take", file=sys.stderr)
        return BROKEN
    except Exception as error:  # libraries raise whatever a broken file leads them to
        print(str(error) or type(error).__name__, file=sys.stderr)
        return BROKEN
    out = sys.stdout.buffer
    out.write(json.dumps([facts, list(arrays)]).encode() + b"\n")
    pipe = Pipe(out)
    for array in arrays.values():
        np.lib.format.write_array(pipe, array, allow_pickle=False)
    out.flush()
    return 0


if __name__ == "__main__":
    limit(int(sys.argv[3]), int(sys.argv[4]))
    sys.exit(main(*sys.argv[1:3]))
