"""The bench's own numba decorator: machine code is kept between processes, and made anew when a kernel changes.

Numba's cache looks only at the file of the function itself. Here the cache folder is named after a hash of all
kernels, because they call each other across files.
"""

import hashlib
import os
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba


@lru_cache
def _cache_folder() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    root = os.environ.get("FURUTA_CACHE") or os.path.join(os.path.expanduser("~"), ".cache", "furuta-gym")
    folder = Path(root) / f"bench-{digest.hexdigest()[:16]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        folder = Path(tempfile.gettempdir()) / folder.name
    return str(folder)


def compiled(function: Any) -> Any:
    """`numba.njit` with a cache on disk; no fast-math, so equal input gives equal bits. x/0 is inf, as in NumPy."""
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    if not before:
        numba.config.CACHE_DIR = _cache_folder()  # type: ignore[attr-defined]
    try:
        return numba.njit(cache=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]
