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
from numba.core import cgutils, event, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
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


class _Apart(CompilerBase):
    """numba's usual passes, for functions whose arrays share no memory."""

    def define_pipelines(self) -> list[Any]:
        self.state.flags.noalias = True
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


def compiled(
    function: Callable[..., Any] | None = None, *, apart: bool = False, borrows: bool = False, **options: Any
) -> Any:
    """Compile `function` with numba; options are numba's (`parallel`, `inline`, `fastmath`, ...).

    apart: what is written through one argument is read through no other. The compiler need not ask whether arrays
    overlap, and a loop over many of them becomes SIMD code; where they do overlap, results are undefined.
    borrows: the function makes no array, only parts of those it is given; numba then counts no references to them.

    Division by zero gives inf as in C (the check for it would keep loops from becoming SIMD code).
    Floating-point contraction and re-association stay off unless asked for: equal input gives equal bits.
    """
    if function is None:
        return lambda f: compiled(f, apart=apart, borrows=borrows, **options)
    folder = Path(function.__code__.co_filename).parent
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    root = None if before else cache_root()
    if root:
        numba.config.CACHE_DIR = str(root / source_hash(folder))  # type: ignore[attr-defined]
    try:
        settings: Any = {"error_model": "numpy", "cache": bool(before or root)} | options
        settings |= ({"pipeline_class": _Apart} if apart else {}) | ({"_nrt": False} if borrows else {})
        return numba.njit(**settings)(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


def instruction(function: Callable[..., Any]) -> Any:
    """A processor's instruction as a function of compiled code: `function(typing_context, *types)` gives its signature
    and the generator of its LLVM code (numba's `intrinsic`)."""
    return intrinsic(function)


@instruction
def lanes_of(typing_context: Any, array: Any, row: Any) -> Any:
    """Where the lanes of a row begin: a pointer to element `row` of all axes but the last of a contiguous array.

    A kernel compiled `apart` that takes rows so knows that they do not overlap, which it could not of one array's.
    """
    if not (isinstance(array, types.Array) and array.layout == "C" and array.dtype == types.float64):
        return None
    pointer = types.CPointer(types.float64)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = context.make_array(signature.args[0])(context, builder, arguments[0])
        lanes = cgutils.unpack_tuple(builder, view.shape)[-1]
        return builder.gep(view.data, [builder.mul(arguments[1], lanes)])

    return pointer(array, types.intp), code
