"""Warnings of what one thread computes, for the page; other tabs compute meanwhile."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock, get_ident
from typing import Any

reading = RLock()
"""Held where warnings are heard: their handler is of the process."""


@contextmanager
def heard(category: type[Warning] = UserWarning) -> Iterator[dict[str, None]]:
    """Texts of this thread's warnings of a category, each once, as keys in their order. What other threads warn of goes
    where it went before. A computation in another tab that catches warnings meanwhile may take some away: what must not
    be missed is returned, and not warned of."""
    remarks: dict[str, None] = {}
    mine = get_ident()

    def keep(message: Warning | str, kind: type[Warning], *where: Any, **more: Any) -> None:
        if get_ident() != mine:
            usual(message, kind, *where, **more)
        elif issubclass(kind, category):
            remarks[str(message)] = None

    with reading, warnings.catch_warnings():
        warnings.simplefilter("always", category)
        usual, warnings.showwarning = warnings.showwarning, keep
        yield remarks
