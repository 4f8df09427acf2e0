"""One decorator for every compiled kernel of the project.

`numba.njit(cache=True)` reuses machine code between processes, but its cache only looks at the file of the
function itself: a kernel that calls another file's kernel keeps the old code after that file changed. Here the
cache folder is named after a hash of the sources that a kernel can call (furuta_gym's and its own package's),
so an edit always compiles anew and an unchanged tree never does.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba
from numba.extending import intrinsic

_FURUTA_GYM = Path(__file__).parents[1]


@lru_cache
def _source_hash(folder: Path) -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    while (folder.parent / "__init__.py").exists():  # rooms of one package call each other's kernels
        folder = folder.parent
    for root in sorted({_FURUTA_GYM, folder}):
        for file in sorted(root.rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


@lru_cache
def _cache_root() -> Path:
    """Where compiled code is kept: `FURUTA_CACHE`, else the user's cache folder, else a temporary one."""
    wanted = os.environ.get("FURUTA_CACHE") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "furuta-gym"
    )
    try:
        Path(wanted).mkdir(parents=True, exist_ok=True)
        if os.access(wanted, os.W_OK):
            return Path(wanted)
    except OSError:
        pass
    return Path(tempfile.gettempdir()) / "furuta-gym"


def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile `function` with numba; options are numba's (`parallel`, `inline`, `fastmath`, ...).

    Division by zero gives inf as in C (the check for it would keep loops from becoming SIMD code).
    Floating-point contraction and re-association stay off unless asked for: equal input gives equal bits.
    """
    if function is None:
        return lambda f: compiled(f, **options)
    folder = Path(function.__code__.co_filename).parent
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    if not before:
        numba.config.CACHE_DIR = str(_cache_root() / _source_hash(folder))  # type: ignore[attr-defined]
    try:
        settings: Any = {"error_model": "numpy"} | options
        return numba.njit(cache=True, **settings)(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


def instruction(function: Callable[..., Any]) -> Any:
    """A processor's instruction as a function of compiled code: `function(typing_context, *types)` gives its signature
    and the generator of its LLVM code (numba's `intrinsic`)."""
    return intrinsic(function)
