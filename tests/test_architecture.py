"""The page and the picture of the rooms against the packages as they are."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "docs"))

import draw_architecture  # noqa: E402


def test_the_page_lists_the_rooms_there_are() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `(\w+\.[\w*]+)` \|", page, re.MULTILINE)
    there = [room for package in draw_architecture.PACKAGES for room in draw_architecture.rooms(package)]
    assert sorted(listed) == sorted(there)


@pytest.mark.parametrize("page", ["docs/architecture.md", "docs/glossary.md", "CONTRIBUTING.md"])
def test_files_that_a_page_names_are_there(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    beside = (ROOT, ROOT / "identification", ROOT / "identification" / "diagnosis", ROOT / "experiments" / "report")
    named = set(re.findall(r"`([\w/]+/[\w/]+\.(?:py|html))`", text))
    missing = [name for name in named if not any((folder / name).is_file() for folder in beside)]
    linked = re.findall(r"\]\(([\w/.-]+)\)", text)
    missing += [link for link in linked if not ((ROOT / page).parent / link).is_file()]
    assert not missing


@pytest.mark.parametrize("package", draw_architecture.PACKAGES)
def test_rooms_do_not_import_in_a_circle(package: str) -> None:
    arrows = draw_architecture.imports(package)
    level = draw_architecture.floors(arrows)
    assert all(level[room] > level[other] for room, others in arrows.items() for other in others)


def test_a_circle_is_refused() -> None:
    with pytest.raises(ValueError, match="a → b → a"):
        draw_architecture.floors({"a": {"b"}, "b": {"a"}})


def test_the_picture_is_of_these_imports(tmp_path: Path) -> None:
    """Fails where the rooms changed and nobody ran `python docs/draw_architecture.py`."""
    import matplotlib.image

    draw_architecture.draw(tmp_path / "new.png")
    new, kept = (matplotlib.image.imread(path) for path in (tmp_path / "new.png", draw_architecture.OUTPUT))
    assert new.shape == kept.shape
    assert (
        abs(new - kept).mean() < 0.002
    )  # fonts may differ by a shade; an arrow more or less is at least ten times that
