"""Measures the sentences of README and of the site's pages, and finds words that a stranger cannot know.

    python docs/readability.py            # prints the figures; exit code 1 beyond the limits
    python docs/readability.py --longest  # also the twenty longest sentences

Code, tables, headings and pictures are left out. The research log and generated pages are, too.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MEAN, LONG, SHARE = 17.0, 30, 0.06  # words a sentence; a long one; the share of long ones
WORKSHOP = (
    r"\btold apart\b|\bpasses for noise\b|\bbrings? nothing\b|\bchased?\b|\bin a race\b|\bthe likeness\b"
    r"|\bswallow\w* most\b|\b(?:first|second|third|fourth|fifth|sixth|this|the) draw\b|\bdraws? another\b"
    r"|\bno miracle\b|\bis no praise\b|\btold as\b|\b(?:is|was|were|are) not told\b"
    r"|\b(?:an|the) earlier (?:code|search)\b"
)


def pages() -> list[Path]:
    """README and the pages that people wrote for users."""
    left_out = ("research-log", "reference")
    written = [
        path for path in sorted((ROOT / "docs").rglob("*.md")) if path.relative_to(ROOT).parts[1] not in left_out
    ]
    return [ROOT / "README.md", *written]


def sentences(text: str) -> list[str]:
    """The sentences of a Markdown page."""
    text = re.sub(r"```.*?```|<!--.*?-->|!\[[^\]]*\]\([^)]*\)", "", text, flags=re.DOTALL)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("|")]
    paragraphs = re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )|\n(?=#)", "\n".join(lines))
    found = []
    for paragraph in (" ".join(p.split()) for p in paragraphs):
        if paragraph and not paragraph.startswith("#"):
            found += re.split(r"(?<=[.!?])[*]*\s+(?=[A-Z`*0-9θ])", paragraph)
    return [sentence for sentence in found if words(sentence) > 2]


def words(sentence: str) -> int:
    return len(re.findall(r"[A-Za-zθ0-9][\w.'’%-]*", sentence))


def figures(texts: list[str]) -> tuple[int, float, float]:
    """How many sentences, their mean length in words, and the share of long ones."""
    lengths = [words(sentence) for text in texts for sentence in sentences(text)]
    return len(lengths), sum(lengths) / len(lengths), sum(n > LONG for n in lengths) / len(lengths)


def workshop_words(text: str) -> list[str]:
    """Phrases that only those know who made the project."""
    return re.findall(WORKSHOP, " ".join(text.split()), re.IGNORECASE)


def main(arguments: list[str]) -> int:
    texts = {path: path.read_text(encoding="utf-8") for path in pages()}
    count, mean, share = figures(list(texts.values()))
    print(f"{count} sentences, {mean:.1f} words on average, {100 * share:.1f} % of more than {LONG} words")
    if "--longest" in arguments:
        every = [(words(s), path.name, s) for path, text in texts.items() for s in sentences(text)]
        for n, name, sentence in sorted(every, reverse=True)[:20]:
            print(n, name, sentence)
    odd = {str(path.relative_to(ROOT)): found for path, text in texts.items() if (found := workshop_words(text))}
    for name, found in odd.items():
        print(f"{name}: {', '.join(found)}")
    return 1 if odd or mean > MEAN or share > SHARE else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
