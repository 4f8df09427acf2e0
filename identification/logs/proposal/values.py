"""What a proposal is: items with a confidence and a reason, and the problems of the file."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from ..rig_mapping import RigMapping


class Confidence(StrEnum):
    """How far an item can be relied upon. sure: it is not asked about. likely: ask, if there is somebody to ask.
    open: it must be said by somebody who knows the rig."""

    sure = "sure"
    likely = "likely"
    open = "open"


@dataclass(frozen=True)
class Item:
    """One part of the mapping. name: a field of `RigMapping`, "sign_q1", "sign_q2", "sign_u" or "sample_time".

    says: what it is about, in words. value: as the mapping takes it, None for its default. shown: for a table.
    reason: one sentence. alternatives: other values, as `option` takes them. option: of the command line. waits:
    whether nothing was looked at for it, as angles in counts or the clock have no scale yet.
    """

    name: str
    says: str
    value: Any
    shown: str
    confidence: Confidence
    reason: str
    alternatives: tuple[str, ...] = ()
    option: str = ""
    waits: bool = False


@dataclass(frozen=True)
class Problem:
    """Something wrong with a file. text: what, in a sentence. mend: the option or the deed that mends it.

    fatal: nothing should be computed from the file as it is. between: it is of several logs together."""

    text: str
    mend: str
    fatal: bool = True
    between: bool = False

    def __str__(self) -> str:
        return f"{self.text} {self.mend}".strip()


@dataclass(frozen=True)
class NoColumn(Problem):
    """That no column of a file is known to be one of ours."""


@dataclass(frozen=True)
class Proposal:
    """How to read some logs of one rig. sources: names of the files. given: what was said beforehand."""

    sources: tuple[str, ...]
    items: tuple[Item, ...]
    problems: tuple[Problem, ...]
    given: RigMapping

    def item(self, name: str) -> Item:
        """The item of that name. Raises KeyError."""
        for item in self.items:
            if item.name == name:
                return item
        raise KeyError(name)

    @property
    def mapping(self) -> RigMapping:
        """What the items say together; items without a value leave their field unsaid."""
        fields = set(vars(self.given))
        said = {item.name: item.value for item in self.items if item.name in fields and item.value is not None}
        flips = tuple(item.name[5:] for item in self.items if item.name.startswith("sign_") and item.value == "-")
        return RigMapping(**said, flip=flips or self.given.flip, skip=self.given.skip, cut=self.given.cut)

    @property
    def fatal(self) -> tuple[Problem, ...]:
        """The problems that stand in the way."""
        return tuple(problem for problem in self.problems if problem.fatal)

    def below(self, confidence: Confidence) -> tuple[Item, ...]:
        """Items that are less certain than `confidence`."""
        order = list(Confidence)
        return tuple(item for item in self.items if order.index(item.confidence) > order.index(confidence))

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        keys = ("name", "says", "value", "shown", "confidence", "reason", "alternatives", "option")
        items = [{key: getattr(item, key) for key in keys} for item in self.items]
        return {
            "logs": list(self.sources),
            "mapping": self.mapping.to_dict(),
            "items": [{k: list(v) if isinstance(v, tuple) else v for k, v in item.items()} for item in items],
            "problems": [vars(problem) for problem in self.problems],
        }
