"""No module imports itself by way of others: not lazily either, and not for type checking."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("furuta_gym", "identification", "controllers", "experiments")
KNOWN: list[set[str]] = []


def modules(root: Path, packages: tuple[str, ...]) -> dict[str, Path]:
    """Files by module name; a package is its `__init__`."""
    found = {}
    for package in packages:
        for path in sorted((root / package).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(name: str, path: Path, known: dict[str, Path]) -> Iterator[str]:
    """Modules of ours that a file names in any import, wherever it stands in the file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom):
            base = name.split(".")[: None if path.name == "__init__.py" else -1]
            above = base[: len(base) - node.level + 1] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                module = f"{source}.{alias.name}"
                if module in known or source in known:
                    yield module if module in known else source


def arrows(root: Path, packages: tuple[str, ...]) -> dict[str, set[str]]:
    """What each module imports."""
    known = modules(root, packages)
    return {name: set(imported(name, path, known)) - {name} for name, path in known.items()}


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Sets of modules that all reach each other."""

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        ahead = [start]
        while ahead:
            ahead += [m for m in graph[ahead.pop()] if m not in seen and not seen.add(m)]
        return seen

    reach = {name: reached(name) for name in graph}
    found: list[set[str]] = []
    for name in graph:
        if name in reach[name] and not any(name in circle for circle in found):
            found.append({other for other in reach[name] if name in reach[other]})
    return found


def test_no_module_imports_itself_by_way_of_others() -> None:
    graph = arrows(ROOT, PACKAGES)
    assert len(graph) > 100
    assert sum(map(len, graph.values())) > 300
    assert circles(graph) == KNOWN


@pytest.mark.parametrize(
    "line",
    [
        "from .b import x",
        "from . import b",
        "from pack import b",
        "import pack.b",
        "if TYPE_CHECKING:\n    from .b import x",
        "def f():\n    from pack.b import x",
    ],
)
def test_every_kind_of_import_is_an_arrow(tmp_path: Path, line: str) -> None:
    folder = tmp_path / "pack"
    folder.mkdir()
    for name, text in {"__init__": "", "a": line, "b": "from .c import y", "c": "from .a import z", "d": ""}.items():
        (folder / f"{name}.py").write_text(text)
    assert circles(arrows(tmp_path, ("pack",))) == [{"pack.a", "pack.b", "pack.c"}]
