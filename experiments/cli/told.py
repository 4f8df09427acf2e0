"""What is wrong with logs, as one message: which log each problem is of, and the ways out."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from identification.logs.proposal.problems import Problem
    from identification.logs.table import Table


@dataclass(frozen=True)
class Said:
    """A problem in words, and the names of the logs that have it."""

    text: str
    logs: tuple[str, ...]


def said_of(
    problems: Sequence[Problem], tables: Mapping[str, Table], alone: Callable[[Table], Sequence[Problem]]
) -> list[Said]:
    """Each problem with the logs that have it by themselves, else with all of them.

    tables: by the names of the logs. alone: what is wrong with one of them."""
    one_by_one: dict[str, set[str]] = {}
    if problems and len(tables) > 1:
        one_by_one = {name: {p.text for p in alone(table)} for name, table in tables.items()}
    said = []
    for problem in problems:
        whose = tuple(name for name, texts in one_by_one.items() if problem.text in texts)
        said.append(Said(str(problem), whose or tuple(tables)))
    return said


def in_one(said: Sequence[Said], logs: Sequence[Path], looked: bool = False, readable: bool = True) -> str:
    """Several problems as one message, with the ways out last.

    looked: `furuta init` says it. readable: the logs can be read as their mapping says."""
    from furuta_gym.files import told_apart

    files = " ".join(shlex.quote(os.fspath(log)) for log in logs)
    ways = [] if looked else [f"look at it with `furuta init {files}`"]
    ways += ["read it as it is said with --as-given"] if readable else []
    ending = [f"{way[0].upper()}{way[1:]}." for way in [", or ".join(ways)] if way]
    whose = {one.logs for one in said}
    everyone = tuple(told_apart(logs))
    heading = whose.pop() if len(whose) == 1 else everyone
    texts = [one.text if one.logs in (heading, everyone) else f"{', '.join(one.logs)}: {one.text}" for one in said]
    names = ", ".join(heading)
    if len(texts) == 1:
        return "\n".join([f"{names}: {texts[0]}", *ending])
    numbered = [f"  {i}. {text}" for i, text in enumerate(texts, 1)]
    return "\n".join([f"{names}: {len(texts)} things are wrong.", *numbered, *ending])
