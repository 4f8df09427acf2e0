"""Which code answered: what changes an answer changes the digest, and words about the code do not."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.trials.code import answering_code, digest

SOURCE = '''"""A module."""

import math


def root(x):
    """Of x."""
    return math.sqrt(x)  # not negative
'''


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("Of x.", "The square root.", True),
        ("A module.", "Roots.", True),
        ("  # not negative", "", True),
        ("\n\n\ndef", "\n\n# a comment\n\n\ndef", True),
        ("math.sqrt(x)", "math.sqrt(x + 1)", False),
        ("def root(x)", "def root(x, y=0)", False),
        ("import math", "import math, os", False),
    ],
)
def test_only_what_may_change_an_answer_counts(old: str, new: str, same: bool, tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(SOURCE)
    before = digest((tmp_path,))
    (tmp_path / "a.py").write_text(SOURCE.replace(old, new))
    assert (digest((tmp_path,)) == before) is same


def test_where_a_module_stands_counts(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(SOURCE)
    before = digest((tmp_path,))
    (tmp_path / "a.py").rename(tmp_path / "b.py")
    assert digest((tmp_path,)) != before


def test_the_model_and_the_identification_answer() -> None:
    assert len(answering_code()) == 12
    assert int(answering_code(), 16) >= 0
