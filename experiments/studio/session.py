"""What one tab of the studio knows: its logs, how they are read, what was fitted and tried. No page in here."""

from __future__ import annotations

import shutil
import warnings
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from threading import Lock
from typing import TYPE_CHECKING, Any

from experiments.report.contents import Verdict
from furuta_gym.plant import Plant
from furuta_gym.processes import new_temporary_folder
from identification import Log, LogError, RigMapping, load_mapping, propose, read_logs, read_table
from identification.logs.rig_file import find_mapping

from . import LARGEST_FILE, MOST_FILES

if TYPE_CHECKING:
    from experiments.report.examination import Examination
    from identification import Estimate, Gap
    from identification.logs.proposal import Item, Proposal
    from identification.logs.table import Table

_reading = Lock()  # warnings are caught for the whole process, so one reader at a time


@dataclass(frozen=True)
class Found:
    """A diagnosis as the page shows it. state: of its light. ranking: title and net gain [nats] of each effect alone.
    plant: with the effects found."""

    verdict: Verdict
    state: str
    ranking: tuple[tuple[str, float], ...]
    plant: Plant | None


@dataclass
class Session:
    """folder: the working folder, the only place where files are written. given: what was said of how logs are read.

    estimate, gap: of model (5) on the logs. kept: the plant of the what-if view that was kept. examination: the
    diagnosis and what its report measures; found: what the page shows of it, which a saved session keeps. policy: a
    dropped policy file; trusted: whether somebody said that code in it may run."""

    folder: Path
    paths: list[Path] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    given: RigMapping = field(default_factory=RigMapping)
    proposal: Proposal | None = None
    accepted: bool = False
    logs: tuple[Log, ...] = ()
    remarks: tuple[str, ...] = ()
    trouble: str = ""
    estimate: Estimate | None = None
    gap: Gap | None = None
    gap_remark: str = ""
    kept: Plant | None = None
    examination: Examination | None = None
    found: Found | None = None
    policy: Path | None = None
    trusted: bool = False
    _dropped: Path | None = None

    @property
    def private(self) -> Path:
        """A folder of this tab alone, which goes with it."""
        if self._dropped is None:
            self._dropped = new_temporary_folder("studio")
            weakref.finalize(self, shutil.rmtree, self._dropped, ignore_errors=True)  # a page or a test may forget it
        return self._dropped

    def was_dropped(self, path: Path) -> bool:
        """Whether a file came into the page and lies in no folder of the user."""
        return self._dropped is not None and path.parent == self._dropped / "logs"

    @property
    def journal(self) -> Path:
        """Where the search keeps its fits, from which it goes on."""
        return self.private / "fits.jsonl"

    def drop(self, name: str, content: bytes) -> None:
        """Take in a dropped file. Raises LogError for one that no reader knows, or that is too large; one of the same
        name that was there before then stays."""
        path = self.private / "logs" / bare_name(name)
        before = path.read_bytes() if path.exists() else None
        self._kept(path, content)
        try:
            self.add(path)
        except LogError:
            path.unlink()
            if before is not None:
                path.write_bytes(before)
            raise

    def take_policy(self, name: str, content: bytes) -> None:
        """Take in a dropped policy file, which is not read yet. Raises LogError for one that is too large."""
        path = self.private / "policies" / bare_name(name)
        self._kept(path, content)
        self.policy, self.trusted = path, False

    def _kept(self, path: Path, content: bytes) -> None:
        """A dropped file in a folder of its kind, so that none takes the place of another kind."""
        if len(content) > LARGEST_FILE:
            raise LogError(
                f"{path.name}: {len(content)} bytes. Expected at most {LARGEST_FILE}; cut it, or use the shell."
            )
        path.parent.mkdir(mode=0o700, exist_ok=True)
        path.write_bytes(content)

    def add(self, path: Path) -> None:
        """Take in a file, or read it again. Raises LogError."""
        table = read_table(path)
        others = [(p, t) for p, t in zip(self.paths, self.tables, strict=True) if p.name != path.name]
        if len(others) >= MOST_FILES:
            raise LogError(f"{path.name}: there are {MOST_FILES} logs already. Remove one first.")
        if not self.paths and (known := find_mapping(path)) is not None and not self.was_dropped(path):
            self.given = load_mapping(known)
        kept = [*others, (path, table)]
        before = self.paths, self.tables
        self.paths, self.tables = [p for p, _ in kept], [t for _, t in kept]
        try:
            self.look()
        except LogError:
            self.paths, self.tables = before
            raise

    def remove(self, name: str) -> None:
        """Leave out a log."""
        kept = [(p, t) for p, t in zip(self.paths, self.tables, strict=True) if p.name != name]
        self.paths, self.tables = [p for p, _ in kept], [t for _, t in kept]
        self.look()

    def look(self) -> None:
        """Propose how to read the logs, and read them so. What is wrong goes to `trouble`."""
        self.accepted = False
        self.forget()
        self.logs, self.remarks, self.trouble, self.proposal = (), (), "", None
        if not self.tables:
            self.given = RigMapping()
            return
        self.proposal = propose(self.tables, self.given)
        try:
            self.logs, self.remarks = quietly_read(self.paths, self.tables, self.proposal.mapping)
        except LogError as error:
            self.trouble = str(error)

    def forget(self) -> None:
        """What was computed from logs that are read otherwise now."""
        self.estimate = self.gap = self.kept = self.examination = self.found = None
        self.gap_remark = ""
        if self._dropped is not None:
            self.journal.unlink(missing_ok=True)

    def say(self, item: Item, answer: str) -> None:
        """Say one part of the mapping; an empty answer takes it back. Raises LogError, and then changes nothing."""
        name = "flip" if item.name.startswith("sign_") else item.name
        value = None if answer == "" else ("" if name == "flip" and answer == "none" else answer)
        given = replace(self.given, **{name: value})
        propose(self.tables, given)
        self.given = given
        self.look()

    def turn(self, axis: str) -> None:
        """Turn the sign of q1, q2 or u against what is proposed."""
        assert self.proposal is not None
        now = {i.name[5:] for i in self.proposal.items if i.name.startswith("sign_") and i.value == "-"}
        turned = [a for a in ("q1", "q2", "u") if (a in now) != (a == axis)]
        self.given = replace(self.given, flip=",".join(turned))  # type: ignore[arg-type]  # parsed by RigMapping
        self.look()

    def shown_by_motion(self) -> RigMapping | None:
        """What was said, with zero and signs as the motion shows them; None where it shows nothing wrong."""
        if self.proposal is None or not self.proposal.fatal:
            return None
        free = propose(self.tables, self.given.without("flip", "pendulum_zero"))
        zero = free.item("pendulum_zero")
        flips = tuple(i.name[5:] for i in free.items if i.name.startswith("sign_") and i.value == "-")
        better = replace(self.given, pendulum_zero=zero.value, flip=flips)
        return better if len(propose(self.tables, better).fatal) < len(self.proposal.fatal) else None

    def mend(self, mapping: RigMapping) -> None:
        """Read the logs as `mapping` says."""
        self.given = mapping
        self.look()

    def accept(self) -> None:
        """Take the proposal as it is. Raises LogError where something stands in the way."""
        if self.proposal is None or not self.logs or self.proposal.fatal or self.open_items:
            raise LogError("The logs cannot be used yet: settle what is red above first.")
        self.given, self.accepted = self.proposal.mapping, True

    @property
    def open_items(self) -> tuple[Item, ...]:
        """What must be said by somebody who knows the rig."""
        from identification.logs.proposal import Confidence

        return self.proposal.below(Confidence.likely) if self.proposal else ()

    def target(self, name: str) -> Path:
        """A file to write in the working folder. Raises ValueError for a name with a path in it."""
        if not name.strip() or name != bare_name(name):
            raise ValueError(f"{name!r}: expected the bare name of a file; it is written to {self.folder}")
        return self.folder / name

    def close(self) -> None:
        """Delete what was dropped."""
        if self._dropped is not None:
            shutil.rmtree(self._dropped, ignore_errors=True)


def bare_name(name: str) -> str:
    """The last part of a path of any system, without what could lead elsewhere. Raises LogError for none."""
    last = PureWindowsPath(PurePosixPath(name).name).name.replace("\0", "").strip()
    if last in ("", ".", ".."):
        raise LogError(f"{name!r}: expected a file with a name")
    return last


def quietly_read(
    paths: Sequence[Path], tables: Sequence[Any], mapping: RigMapping
) -> tuple[tuple[Log, ...], tuple[str, ...]]:
    """The logs as the mapping says, and what reading them warns of. Raises LogError."""
    with _reading, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        logs = read_logs(paths, mappings=[mapping] * len(paths), tables=tables)
    return tuple(logs), tuple(dict.fromkeys(str(w.message) for w in caught if issubclass(w.category, UserWarning)))
