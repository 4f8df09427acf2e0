"""Reads a MAT file in a process of its own: scipy's reader can die of a damaged one (see `mat_file`).

Run as a script with the file's name and the most seconds and bytes that it may take. Writes a line of JSON with the
names, then the arrays in numpy's own format. It imports nothing of the project, so that it starts quickly.
"""

import json
import sys
from typing import Any

import numpy as np

VERSION, BROKEN = 3, 4
"""Exit codes: a MAT file of version 7.3 without the package for it, and one that cannot be read (why is on stderr)."""

_DEPTH = 6  # levels of structs that are opened
_PARTS = 64  # structs in an array that are opened
_TEXT = 80  # letters kept of what is neither numbers nor text


def plain(name: str, value: Any, depth: int = 0) -> dict[str, np.ndarray]:
    """Arrays of numbers and text by name: fields of structs as `struct.field`, of arrays of them as `struct.1.field`,
    anything else as short text."""
    if _is_struct(value) and depth < _DEPTH:
        fields = value if isinstance(value, dict) else {f: getattr(value, f) for f in value._fieldnames}
        found: dict[str, np.ndarray] = {}
        for field, inner in fields.items():
            found |= plain(f"{name}.{field}", inner, depth + 1)
        return found
    if isinstance(value, list):
        array = np.empty(len(value), dtype=object)
        array[:] = value
        array = array if any(_is_struct(part) for part in value) else np.asarray(value)
    else:
        array = np.asarray(value)
    parts = array.ravel().tolist() if array.dtype.kind == "O" and array.size <= _PARTS else []
    if any(_is_struct(part) for part in parts) and depth < _DEPTH:  # an array of structs, or cells
        found = {}
        for number, part in enumerate(parts, 1):
            found |= plain(f"{name}.{number}", part, depth + 1)
        return found
    if array.dtype.kind not in "biufcUSMm":
        items = [str(item)[:_TEXT] for item in array.ravel().tolist()]
        array = np.array(items, dtype=str).reshape(array.shape)
    return {name: array}


def _is_struct(value: object) -> bool:
    return isinstance(value, dict) or hasattr(value, "_fieldnames")


def newer(path: str) -> dict:
    """Variables of a file of version 7.3. Raises ImportError without the package for it."""
    from pymatreader import read_mat

    return read_mat(path)


def limit(seconds: int, size: int) -> None:
    """Bound this process's time and address space [bytes], where the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for what, most in ((resource.RLIMIT_AS, size), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(what)[1]
        resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def main(path: str) -> int:
    """Exit code."""
    from scipy.io import loadmat

    try:
        try:
            variables = loadmat(path, squeeze_me=True, struct_as_record=False)
        except NotImplementedError:
            variables = newer(path)
        flat: dict[str, np.ndarray] = {}
        for name, value in variables.items():
            if not name.startswith("__"):
                flat |= plain(name, value)
    except ImportError:
        return VERSION
    except MemoryError:
        print("it unfolds to more memory than a log may take", file=sys.stderr)
        return BROKEN
    except Exception as error:  # scipy's reader raises whatever a broken file leads it to
        print(error or type(error).__name__, file=sys.stderr)
        return BROKEN
    out = sys.stdout.buffer
    out.write(json.dumps(list(flat)).encode() + b"\n")
    for array in flat.values():
        np.lib.format.write_array(out, array, allow_pickle=False)
    out.flush()
    return 0


if __name__ == "__main__":
    limit(int(sys.argv[2]), int(sys.argv[3]))
    sys.exit(main(sys.argv[1]))
