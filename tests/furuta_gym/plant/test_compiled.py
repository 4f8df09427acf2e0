"""Compiled code is kept where only its user can write, and under the hash of all that it can call."""

import ast
import inspect
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numba.core import types
from numba.core.dispatcher import Dispatcher
from numba.core.errors import TypingError

from furuta_gym.cache_folder import _not_private, cache_root
from furuta_gym.plant.compiled import _imported, compiled, lanes_of, source_hash, sources
from identification import identify
from tests.factories import noisy_log

ROOT = Path(__file__).resolve().parents[3]

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="owners of files are POSIX's")


def test_a_folder_is_made_private(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    assert _not_private(folder) == ""
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o755)
    assert _not_private(folder) == ""
    assert folder.stat().st_mode & 0o777 == 0o700


def test_where_others_can_write_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    assert "other users" in _not_private(tmp_path / "open")
    (tmp_path / "mine").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "mine")
    assert "link" in _not_private(tmp_path / "link")
    monkeypatch.setattr(os, "geteuid", lambda: 54_321)
    assert "another user" in _not_private(tmp_path / "mine")


@pytest.fixture
def shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A temporary folder of all users and a home that cannot be written."""
    (tmp_path / "home").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.delenv("FURUTA_CACHE", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    cache_root.cache_clear()
    yield tmp_path
    cache_root.cache_clear()


def test_the_temporary_folder_holds_one_for_each_user(shared: Path) -> None:
    (shared / "furuta-gym").mkdir()  # whoever made it
    assert cache_root() == shared / f"furuta-gym-{os.geteuid()}"


def test_what_another_user_prepared_is_not_taken(shared: Path) -> None:
    (shared / f"furuta-gym-{os.geteuid()}").symlink_to(shared / "furuta-gym", target_is_directory=True)
    (shared / "furuta-gym").mkdir()
    with pytest.warns(UserWarning, match=r"every start compiles anew: .*cannot be used.*is a link.*FURUTA_CACHE"):
        assert cache_root() is None


def test_without_a_cache_kernels_run(shared: Path) -> None:
    """In a process of its own: numba decides at the decorator where code is kept."""
    code = (
        "import warnings; warnings.simplefilter('ignore')\n"
        "from furuta_gym.plant.compiled import compiled\n"
        "def double(x):\n    return 2 * x\n"
        "import experiments.bench.kernels.compiled as bench\n"
        "print(compiled(double)(21), compiled(double).stats.cache_path, bench.compiled(double).stats.cache_path)"
    )
    (shared / f"furuta-gym-{os.geteuid()}").write_text("in the way")
    environment = os.environ | {"TMPDIR": str(shared)}
    command = [sys.executable, "-c", code]
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=100)
    assert answer.stdout.split() == ["42", "None", "None"], answer.stderr


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package of modules that import each other in every way there is."""
    for folder in ("top", "top/a", "top/b", "other"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").write_text("")
    (tmp_path / "top/a/kernel.py").write_text(
        "import numpy, top.plain\nfrom .near import x\n"
        "from ..b import (\n    first,  # a comment\n    second as other,\n)\n"
    )
    (tmp_path / "top/a/near.py").write_text("def late():\n    from top.b.third import x\n")
    for name in ("top/plain", "top/b/first", "top/b/second", "top/b/third", "top/b/unused", "other/kernel", "numpy"):
        (tmp_path / f"{name}.py").write_text("")
    return tmp_path


def _changed(package: Path, edited: str) -> bool:
    """Whether an edit of one file is another hash for the kernel."""
    hashes = []
    for _ in range(2):
        source_hash.cache_clear()
        _imported.cache_clear()
        hashes.append(source_hash(package / "top/a/kernel.py"))
        with (package / edited).open("a") as file:
            file.write("y = 1\n")
    return hashes[0] != hashes[1]


@pytest.mark.parametrize("edited", ["a/kernel", "a/near", "plain", "b/__init__", "b/first", "b/second", "b/third"])
def test_an_edit_of_what_a_kernel_imports_compiles_it_anew(package: Path, edited: str) -> None:
    assert _changed(package, f"top/{edited}.py")


@pytest.mark.parametrize("edited", ["top/b/unused", "other/kernel", "numpy"])
def test_other_edits_do_not(package: Path, edited: str) -> None:
    assert not _changed(package, f"{edited}.py")


def test_prose_that_looks_like_an_import_names_nothing(package: Path) -> None:
    (package / "top/a/near.py").write_text('"""Who would\n\nimport ..., or import (\nfrom that import\nimport ,\n"""\n')
    _imported.cache_clear()
    assert _imported(package / "top/a/near.py") == []


def test_an_odd_file_is_read_as_it_is(tmp_path: Path) -> None:
    """Not of UTF-8, with more dots than folders, or not there at all."""
    odd = tmp_path / "odd.py"
    odd.write_bytes(b"# \xe4\nfrom " + 200 * b"." + b" import x\n")
    assert sources(odd) == {odd}
    assert sources(Path("<stdin>")) == set()


PROJECT = [p for room in ("furuta_gym", "identification", "controllers") for p in sorted((ROOT / room).rglob("*.py"))]


def test_no_import_of_the_project_is_overlooked() -> None:
    """Against Python's own parser."""
    for file in PROJECT:
        top = file.relative_to(ROOT).parts[0]
        for module in _modules_imported(file):
            if module.split(".")[0] in ("furuta_gym", top):
                place = ROOT.joinpath(*module.split("."))
                for source in (place.with_suffix(".py"), place / "__init__.py"):
                    assert not source.is_file() or source in _imported(file), (file, module)


def _modules_imported(file: Path) -> Iterator[str]:
    """All that may be modules among what a file imports."""
    package = file.relative_to(ROOT).parts[:-1]
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join([*base, *([node.module] if node.module else [])])
            yield from (module, *(f"{module}.{alias.name}" for alias in node.names))


def test_a_kernel_depends_on_the_kernels_it_calls_and_on_the_named_tuples_it_is_given() -> None:
    """Whatever is compiled in a simulation and a fit. A field of a named tuple is a number in machine code."""
    identify(noisy_log(1, duration=2.0))
    kernels = {
        kernel
        for name, module in list(sys.modules.items())
        if name.split(".")[0] in ("furuta_gym", "identification") and module is not None
        for kernel in vars(module).values()
        if isinstance(kernel, Dispatcher)
    }
    given = called = 0
    for kernel in kernels:
        own = sources(_file(kernel))
        inner = [k for k in kernel.py_func.__globals__.values() if isinstance(k, Dispatcher)]
        assert {_file(k) for k in inner} <= own, kernel
        classes = [t.instance_class for s in kernel.signatures for t in s if isinstance(t, types.BaseNamedTuple)]
        assert {Path(inspect.getfile(c)) for c in classes} <= own, kernel
        called, given = called + len(inner), given + len(classes)
    assert called > 50
    assert given > 5


def _file(kernel: Dispatcher) -> Path:
    return Path(kernel.py_func.__code__.co_filename)


@compiled(apart=True)
def _twice_into(out, values, lanes):
    for k in range(lanes):
        out[k] = 2.0 * values[k]


@compiled
def _rows_twice(array, other):
    for row in range(array.shape[0] * array.shape[1]):
        _twice_into(lanes_of(other, row), lanes_of(array, row), array.shape[2])


@pytest.mark.parametrize("lanes", [1, 4, 7, 8, 19])
def test_rows_of_lanes_are_those_of_the_array(lanes: int) -> None:
    array = np.arange(6.0 * lanes).reshape(2, 3, lanes)
    other = np.zeros_like(array)
    _rows_twice(array, other)
    np.testing.assert_array_equal(other, 2.0 * array)
    part = np.zeros((4, 3, lanes))  # rows of a part begin where the part does
    _rows_twice(array, part[2:])
    np.testing.assert_array_equal(part[2:], other)
    assert not part[:2].any()


def test_rows_of_an_array_with_gaps_are_refused() -> None:
    with pytest.raises(TypingError):
        _rows_twice(np.zeros((2, 3, 8))[:, :, ::2], np.zeros((2, 3, 4)))


@compiled(borrows=True)
def _total(array):
    first, second = array[0], array[1:]
    return first[0] + second[0, 0]


def test_what_only_looks_at_parts_counts_no_references() -> None:
    array = np.arange(6.0).reshape(3, 2)
    before = sys.getrefcount(array)
    for _ in range(100):
        assert _total(array) == 2.0
    assert sys.getrefcount(array) == before
