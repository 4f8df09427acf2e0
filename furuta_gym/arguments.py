"""An argument that cannot be, as an error with parts: in Python it goes by its own name, elsewhere by an option's."""

from __future__ import annotations

from typing import Self


class ArgumentError(ValueError):
    """An argument that cannot be.

    argument: its name. got: what of it is wrong, as it was written. fault: what is expected instead. hint: how to mend
    it in Python, with the punctuation before it.
    """

    def __init__(self, argument: str, got: str, fault: str, hint: str = "") -> None:
        super().__init__(argument, got, fault, hint)  # all of them, so that it can be pickled
        self.argument, self.got, self.fault, self.hint = argument, got, fault, hint

    def __str__(self) -> str:
        return f"{self.argument} {self.got}: {self.fault}{self.hint}"

    def renamed(self, argument: str, hint: str | None = None) -> Self:
        """The same where the argument goes by another name, and perhaps with a hint that fits there."""
        return type(self)(argument, self.got, self.fault, self.hint if hint is None else hint)
