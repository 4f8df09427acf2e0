"""One decorator for every compiled kernel of the project.

`numba.njit(cache=True)` reuses machine code between processes, but its cache only looks at the file of the
function itself: a kernel that calls another file's kernel keeps the old code after that file changed. Here the
cache folder is named after a hash of the sources that a kernel can call (furuta_gym's and its own top-level
package's), so an edit always compiles anew and an unchanged tree never does.
"""

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba
from numba.core import event
from numba.extending import intrinsic

from furuta_gym.cache_folder import cache_root, note_compilation

_FURUTA_GYM = Path(__file__).parents[1]


class _Listener(event.Listener):
    """Hears of functions that are compiled, not of those that are loaded."""

    def on_start(self, event: Any) -> None:
        note_compilation()

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Listener())


@lru_cache
def source_hash(folder: Path) -> str:
    """A digest of numba's version, furuta_gym's sources and those of the top-level package that `folder` is in."""
    while (folder.parent / "__init__.py").exists():
        folder = folder.parent
    digest = hashlib.sha256(numba.__version__.encode())
    while (folder.parent / "__init__.py").exists():  # rooms of one package call each other's kernels
        folder = folder.parent
    for root in sorted({_FURUTA_GYM, folder}):
        for file in sorted(root.rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile `function` with numba; options are numba's (`parallel`, `inline`, `fastmath`, ...).

    Division by zero gives inf as in C (the check for it would keep loops from becoming SIMD code).
    Floating-point contraction and re-association stay off unless asked for: equal input gives equal bits.
    """
    if function is None:
        return lambda f: compiled(f, **options)
    folder = Path(function.__code__.co_filename).parent
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    root = None if before else cache_root()
    if root:
        numba.config.CACHE_DIR = str(root / source_hash(folder))  # type: ignore[attr-defined]
    try:
        settings: Any = {"error_model": "numpy", "cache": bool(before or root)} | options
        return numba.njit(**settings)(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


def instruction(function: Callable[..., Any]) -> Any:
    """A processor's instruction as a function of compiled code: `function(typing_context, *types)` gives its signature
    and the generator of its LLVM code (numba's `intrinsic`)."""
    return intrinsic(function)
