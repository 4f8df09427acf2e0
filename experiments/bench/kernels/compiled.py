"""The bench's own numba decorator: machine code is kept between processes, and made anew when a kernel changes.

Numba's cache looks only at the file of the function itself. Here the cache folder is named after a hash of all
kernels, because they call each other across files.
"""

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba

from furuta_gym.cache_folder import cache_root


@lru_cache
def _cache_folder(given: str) -> str:
    """given: numba's own setting, "" for none."""
    digest = hashlib.sha256(numba.__version__.encode())
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    root = Path(given) if given else cache_root()
    return str(root / f"bench-{digest.hexdigest()[:16]}") if root else ""


def compiled(function: Any) -> Any:
    """`numba.njit` with a cache on disk; no fast-math, so equal input gives equal bits. x/0 is inf, as in NumPy."""
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    kept = _cache_folder(before)
    numba.config.CACHE_DIR = kept  # type: ignore[attr-defined]
    try:
        return numba.njit(cache=bool(kept), error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]
