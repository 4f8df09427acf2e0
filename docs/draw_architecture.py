"""Draws docs/architecture.png from the imports: `python docs/draw_architecture.py`.

A frame is a package, a box a room in it, an arrow an import. A room stands above all that it imports; imports in a
circle are refused. Arrows that follow from others are left out.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("furuta_gym", "identification", "controllers", "experiments")
SINGLY = ("furuta_gym", "controllers")  # a module beside their rooms is a room of its own
MIDDLE = ("identification", "controllers")  # these two stand side by side
MODULES = "modules without a room"
THIN = {"arrowstyle": "-|>", "color": "0.45", "lw": 0.9, "shrinkA": 0, "shrinkB": 0}
WIDE = {"arrowstyle": "-|>,head_width=0.5,head_length=0.8", "color": "#30638e", "lw": 2.2, "shrinkA": 0, "shrinkB": 0}
OUTPUT = ROOT / "docs" / "architecture.png"

Arrows = dict[str, set[str]]
"""Room → the rooms that it imports."""


def rooms(package: str) -> dict[str, list[Path]]:
    """Rooms by name, as `identification.logs`, with their files: the packages inside a package.

    Modules beside them make one room, `experiments.*`; where they are few, one each.
    """
    folder = ROOT / package
    found = {f"{package}.{p.parent.name}": sorted(p.parent.rglob("*.py")) for p in folder.glob("*/__init__.py")}
    loose = [p for p in sorted(folder.glob("*.py")) if p.stem != "__init__"]
    if package in SINGLY:
        found |= {f"{package}.{p.stem}": [p] for p in loose}
    elif loose:
        found[f"{package}.*"] = loose
    return dict(sorted(found.items()))


def imports(package: str) -> Arrows:
    """Which room of a package imports which other, from the import statements (those for type checkers left out)."""
    own = rooms(package)
    home = {".".join(_parts(file)): room for room, files in own.items() for file in files}
    arrows: Arrows = {room: set() for room in own}
    for room, files in own.items():
        for target in (t for file in files for t in _imported(file)):
            hit = home.get(target) or home.get(target.rpartition(".")[0])
            if hit and hit != room:
                arrows[room].add(hit)
    return arrows


def packages() -> Arrows:
    """Which of the four packages imports which."""
    arrows: Arrows = {package: set() for package in PACKAGES}
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.py")):
            arrows[package] |= {t.split(".")[0] for t in _imported(file)} & set(PACKAGES) - {package}
    return arrows


def _parts(file: Path) -> tuple[str, ...]:
    parts = file.relative_to(ROOT).with_suffix("").parts
    return parts[:-1] if parts[-1] == "__init__" else parts


def _imported(file: Path) -> Iterator[str]:
    """Full names of what a file imports from our packages, `from x import y` as x.y."""
    here = file.relative_to(ROOT).with_suffix("").parts  # with __init__, so that one dot is always the folder
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in _executed(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            up = len(here) - node.level
            base = ".".join((*(here[:up] if node.level else ()), *((node.module,) if node.module else ())))
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _executed(node: ast.AST) -> Iterator[ast.AST]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            continue
        yield child
        yield from _executed(child)


def floors(arrows: Arrows) -> dict[str, int]:
    """How high each room stands: one above the highest that it imports. Raises ValueError for a circle."""
    found: dict[str, int] = {}

    def height(room: str, path: tuple[str, ...]) -> int:
        if room in path:
            raise ValueError("a circle of imports: " + " → ".join((*path[path.index(room) :], room)))
        if room not in found:
            found[room] = 1 + max((height(below, (*path, room)) for below in arrows[room]), default=-1)
        return found[room]

    for room in arrows:
        height(room, ())
    return found


def reduced(arrows: Arrows) -> Arrows:
    """Without the arrows that follow from others."""

    def below(room: str) -> set[str]:
        return arrows[room].union(*(below(other) for other in arrows[room]))

    return {
        room: {other for other in others if not any(other in below(third) for third in others - {other})}
        for room, others in arrows.items()
    }


def draw(path: Path = OUTPUT) -> None:
    """The picture: a frame for each package, its rooms in floors, arrows to what they import."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    tall = {package: max(floors(imports(package)).values()) + 1 for package in PACKAGES}
    step, gap, title = 0.95, 0.8, 0.5
    middle = max(tall["identification"], tall["controllers"])
    height = {package: (middle if package in MIDDLE else tall[package]) * step + title for package in PACKAGES}
    first = {"furuta_gym": 0.0, "identification": height["furuta_gym"] + gap}
    first |= {"controllers": first["identification"]}
    first |= {"experiments": first["identification"] + height["identification"] + gap}
    left = {
        "furuta_gym": (1.0, 10.0),
        "identification": (0.0, 7.2),
        "controllers": (7.8, 4.2),
        "experiments": (1.0, 10.0),
    }
    figure, axis = plt.subplots(figsize=(9.6, 10.4))
    for package in PACKAGES:
        (x, width), y = left[package], first[package]
        axis.add_patch(plt.Rectangle((x, y), width, height[package], facecolor="#f3f6f9", edgecolor="0.75"))
        axis.text(x + 0.15, y + height[package] - 0.2, package, fontweight="bold", fontsize=11, va="top")
        _rooms(axis, package, x, width, y + 0.5 * step, step)
    for package, others in reduced(packages()).items():
        for other in sorted(others):
            top = first[other] + height[other]
            at = left[other if left[other][1] < left[package][1] else package]
            middle_x = at[0] + 0.5 * at[1]
            axis.annotate("", (middle_x, top), (middle_x, first[package]), arrowprops=WIDE)
    axis.set_xlim(-0.1, 12.1)
    axis.set_ylim(-0.1, first["experiments"] + height["experiments"] + 0.1)
    axis.set_axis_off()
    figure.tight_layout(pad=0.3)
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)


def _rooms(axis: Any, package: str, x: float, width: float, y: float, step: float) -> None:
    arrows = imports(package)
    level, below = floors(arrows), reduced(arrows)
    place: dict[str, tuple[float, float]] = {}
    for floor in sorted(set(level.values())):
        row = [room for room in arrows if level[room] == floor]
        row.sort(key=lambda room: (sum(place[o][0] for o in below[room]) / max(len(below[room]), 1), room))
        place |= {room: (x + width * (i + 0.5) / len(row), y + step * floor) for i, room in enumerate(row)}
    for room, others in below.items():
        for other in sorted(others):
            (x0, y0), (x1, y1) = place[room], place[other]
            axis.annotate("", (x1, y1 + 0.22), (x0, y0 - 0.22), arrowprops=THIN)
    for room, (x0, y0) in place.items():
        name = room.split(".", 1)[1]
        box = {"boxstyle": "round,pad=0.4", "facecolor": "white", "edgecolor": "#30638e"}
        axis.text(x0, y0, MODULES if name == "*" else name, ha="center", va="center", fontsize=9.5, bbox=box)


if __name__ == "__main__":
    draw()
    print(OUTPUT)
