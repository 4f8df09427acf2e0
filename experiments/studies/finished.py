"""Results of many tasks as they come, with a count of those that are done."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from joblib import Parallel

from experiments.cli.output import counted


def finished(tasks: Sequence[Any], what: str) -> Iterator[Any]:
    """What joblib's `delayed` tasks give, in the order in which they end, on the `workers` around. what: they are
    called on stderr, where those that are done are counted."""
    with counted(what) as tell:
        for done, result in enumerate(Parallel(return_as="generator_unordered")(tasks), 1):
            yield result
            tell(done, len(tasks))
