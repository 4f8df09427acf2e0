"""Measures the sentences of README, of the site's pages, of their tables and of the program's messages, and finds words
that a stranger cannot know.

    python docs/readability.py            # prints the figures; exit code 1 beyond the limits
    python docs/readability.py --longest  # also the twenty longest sentences of each

Code, headings and pictures are left out. The research log and generated pages are, too. Messages are all strings of the
packages that are sentences: errors, warnings, help, reports. Docstrings and templates of code are no messages.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("furuta_gym", "identification", "controllers", "experiments")
MEAN, LONG, SHARE = 17.0, 30, 0.06  # words a sentence; a long one; the share of long ones
FEWEST = 5  # words of a string that is a message and not a name or a key
WORKSHOP = (
    r"\btold apart\b|\bpasses for noise\b|\bbrings? nothing\b|\bchased?\b|\bin a race\b|\bthe likeness\b"
    r"|\bswallow\w* most\b|\b(?:first|second|third|fourth|fifth|sixth|this|the) draw\b|\bdraws? another\b"
    r"|\bno miracle\b|\bis no praise\b|\btold as\b|\b(?:is|was|were|are) not told\b"
    r"|\b(?:an|the) earlier (?:code|search)\b"
)


def pages(root: Path = ROOT) -> list[Path]:
    """README and the pages that people wrote for users."""
    left_out = ("research-log", "reference")
    written = [
        path for path in sorted((root / "docs").rglob("*.md")) if path.relative_to(root).parts[1] not in left_out
    ]
    return [root / "README.md", *written]


def sentences(text: str) -> list[str]:
    """The sentences of a Markdown page, its tables aside."""
    lines = [line for line in _words_alone(text).splitlines() if not line.lstrip().startswith("|")]
    paragraphs = re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )|\n(?=#)", "\n".join(lines))
    return [one for paragraph in paragraphs for one in _split(paragraph) if not paragraph.lstrip().startswith("#")]


def cells(text: str) -> list[str]:
    """The sentences in the cells of a Markdown page's tables."""
    rows = [line.strip() for line in _words_alone(text).splitlines() if line.lstrip().startswith("|")]
    return [one for row in rows for cell in re.split(r"(?<!\\)\|", row) for one in _split(cell)]


def messages(code: str) -> list[str]:
    """The sentences among the strings of a program; a word stands for what an f-string puts in."""
    tree = ast.parse(code)
    left_out: set[ast.AST] = {node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)}  # docstrings
    left_out |= {part for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    texts = [text for node in ast.walk(tree) if node not in left_out and (text := _string(node))]
    paragraphs = [part for text in texts if "{" not in text and "</" not in text for part in text.split("\n")]
    return [one for paragraph in paragraphs for one in _split(paragraph) if words(one) >= FEWEST]


def _string(node: ast.AST) -> str:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else "X" for part in node.values)
    return ""


def _words_alone(text: str) -> str:
    """A page without code and pictures, and of links only what is read."""
    text = re.sub(r"```.*?```|<!--.*?-->|!\[[^\]]*\]\([^)]*\)", "", text, flags=re.DOTALL)
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)


def _split(paragraph: str) -> Iterator[str]:
    found = re.split(r"(?<=[.!?])[*]*\s+(?=[A-Z`*0-9θ])", " ".join(paragraph.split()))
    return (sentence for sentence in found if words(sentence) > 2)


def words(sentence: str) -> int:
    return len(re.findall(r"[A-Za-zθ0-9][\w.'’%-]*", sentence))


def figures(said: list[str]) -> tuple[int, float, float]:
    """How many sentences, their mean length in words, and the share of long ones."""
    lengths = [words(sentence) for sentence in said]
    return len(lengths), sum(lengths) / max(len(lengths), 1), sum(n > LONG for n in lengths) / max(len(lengths), 1)


def workshop_words(text: str) -> list[str]:
    """Phrases that only those know who made the project."""
    return re.findall(WORKSHOP, " ".join(text.split()), re.IGNORECASE)


def main(arguments: list[str], root: Path = ROOT) -> int:
    texts = {path: path.read_text(encoding="utf-8") for path in pages(root)}
    codes = {p: p.read_text(encoding="utf-8") for package in PACKAGES for p in sorted((root / package).rglob("*.py"))}
    said = {
        "prose": [(path.name, one) for path, text in texts.items() for one in sentences(text)],
        "tables": [(path.name, one) for path, text in texts.items() for one in cells(text)],
        "messages": [(path.name, one) for path, code in codes.items() for one in messages(code)],
    }
    failed = False
    for kind, found in said.items():
        count, mean, share = figures([one for _, one in found])
        beyond = f": beyond the limits, {MEAN:g} and {100 * SHARE:g} %" if mean > MEAN or share > SHARE else ""
        failed |= bool(beyond)
        measured = f"{mean:4.1f} words on average, {100 * share:3.1f} % of more than {LONG} words"
        print(f"{kind:<9}{count:>5} sentences, {measured}{beyond}")
        if "--longest" in arguments:
            for n, name, one in sorted(((words(one), name, one) for name, one in found), reverse=True)[:20]:
                print(n, name, one)
    odd = {str(path.relative_to(root)): found for path, text in texts.items() if (found := workshop_words(text))}
    for name, found in odd.items():
        print(f"{name}: {', '.join(found)}")
    return 1 if odd or failed else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
