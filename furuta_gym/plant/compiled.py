"""One decorator for every compiled kernel of the project.

`numba.njit(cache=True)` reuses machine code between processes, but its cache only looks at the file of the
function itself: a kernel that calls another file's kernel keeps the old code after that file changed. Here the
cache folder is named after a hash of that file and of all that it imports, so an edit compiles anew the kernels whose
files import the edited one, directly or not, and no others.
"""

import hashlib
import re
import threading
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
_CONFIGURED = threading.RLock()  # numba's configuration is of the process, and modules are loaded by several threads


class _Listener(event.Listener):
    """Hears of functions that are compiled, not of those that are loaded."""

    def on_start(self, event: Any) -> None:
        code = event.data["dispatcher"].py_func.__code__
        note_compilation(ours=_FURUTA_GYM.parent in Path(code.co_filename).parents)

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Listener())


@lru_cache
def source_hash(file: Path) -> str:
    """A digest of numba's version and of `sources(file)`."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(sources(file)):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def sources(file: Path) -> set[Path]:
    """`file`, and what it imports from its own package and furuta_gym, also through others; nothing where there is no
    such file, as of code typed in.

    A kernel sees no other file, as long as its own names what it is given: a named tuple, whose fields are numbers in
    machine code, stands as a type in the kernel's signature.
    """
    found, waiting = set[Path](), [file] if file.is_file() else []
    while waiting:
        if (source := waiting.pop()) not in found:
            found.add(source)
            waiting += _imported(source)
    return found


_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+(\.*)([\w.]*)[ \t]+)?import[ \t]+(\([^)]*\)|.*)", re.MULTILINE)


@lru_cache
def _imported(file: Path) -> list[Path]:
    """Files of the project that `file` names in its imports, wherever these stand, or in a text that looks like one."""
    top = file.parent
    while (top.parent / "__init__.py").exists():
        top = top.parent
    homes = {package.name: package.parent for package in (_FURUTA_GYM, top)}
    named = []
    for dots, module, listed in _IMPORT.findall(file.read_text(encoding="utf-8", errors="replace")):
        names = [part.split()[0] for part in re.sub(r"#.*|[()]", "", listed).split(",") if part.strip()]
        for name in [module, *(f"{module}.{name}" for name in names)] if dots or module else names:
            parts = [part for part in name.split(".") if part]
            folder = file.joinpath(*[".."] * len(dots)).resolve()
            home = folder if dots else homes.get("".join(parts[:1]))
            if home is not None:
                place = home.joinpath(*parts)
                named += [place.parent / f"{place.name}.py", place / "__init__.py"]
    return [source for source in named if source.is_file()]


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
    with _CONFIGURED:
        before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
        root = Path(before) if before else cache_root()
        if root:
            numba.config.CACHE_DIR = str(root / source_hash(Path(function.__code__.co_filename)))  # type: ignore[attr-defined]
        try:
            settings: Any = {"error_model": "numpy", "cache": bool(root)} | options
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
