"""Runs the Python blocks of the tutorials, and keeps what they print in the ```text block that follows each.

`commands` gives the shell lines of any page, which `tests/test_shell_lines.py` runs.

    python docs/run_pages.py              # runs every tutorial and renews its output
    python docs/run_pages.py first_log    # only this one

`tests/test_docs.py` runs them too, and compares.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
import tempfile
import warnings
from pathlib import Path

TUTORIALS = Path(__file__).resolve().parent / "tutorials"
BLOCK = re.compile(r"(```python\n)(.*?)(```\n)(\n```text\n(.*?)```\n)?", re.DOTALL)


def kept(page: Path) -> list[tuple[str, str]]:
    """The code blocks of a page, each with the output that the page shows (empty: none)."""
    text = page.read_text(encoding="utf-8")
    return [(match[2], match[5] or "") for match in BLOCK.finditer(text)]


def commands(text: str) -> list[str]:
    """The shell lines of a page, or of a part of one: comments off, lines that end in \\ joined with the next."""
    fences = re.findall(r"^```([^\n]*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    lines = "".join(block for language, block in fences if not language).replace("\\\n", " ").splitlines()
    return [line for raw in lines if (line := re.sub(r"(?:^|\s+)# .*", "", raw).rstrip())]


def run(codes: list[str], folder: Path, name: str) -> list[str]:
    """Run blocks one after the other in `folder`, as one program, and return what each prints."""
    scope: dict[str, object] = {"__name__": name}
    printed = []
    with contextlib.chdir(folder):
        for code in codes:
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                exec(compile(code, name, "exec"), scope)
            printed.append(re.sub(r"[ \t]+$", "", said.getvalue(), flags=re.MULTILINE))
    return printed


def renew(page: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        printed = iter(run([code for code, _ in kept(page)], Path(folder), page.name))

    def replaced(match: re.Match[str]) -> str:
        said = next(printed)
        return f"{match[1]}{match[2]}{match[3]}" + (f"\n```text\n{said}```\n" if said else "")

    page.write_text(BLOCK.sub(replaced, page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    sys.path.insert(0, os.fspath(TUTORIALS.parent.parent))
    warnings.simplefilter("ignore")
    for one in sorted(TUTORIALS.glob("*.md")):
        if not sys.argv[1:] or one.stem in sys.argv[1:]:
            renew(one)
            print(one.name)
