"""What one tab of the studio knows: its logs, how they are read, what was fitted and tried. No page in here."""

from __future__ import annotations

import shutil
import weakref
from collections.abc import Container, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, count
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, Any

from experiments.report.contents import Verdict
from furuta_gym.files import told_apart
from furuta_gym.plant import Plant
from furuta_gym.processes import new_temporary_folder
from identification import Log, LogError, LogWarning, RigMapping, load_mapping, propose, read_logs, read_table
from identification.logs.rig_file import find_mapping

from . import LARGEST_FILE, MOST_FILES
from .remarks import heard, reading

if TYPE_CHECKING:
    from experiments.report.examination import Examination
    from identification import Estimate, Gap
    from identification.logs.proposal import Item, Proposal
    from identification.logs.table import Table


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
    """folder: the working folder, the only place where files are written. stated: how logs are read by the command
    line, in place of any rig.toml. given: what was said of how these logs are read.

    estimate, gap: of model (5) on the logs. kept: the plant of the what-if view that was kept. examination: the
    diagnosis and what its report measures; found: what the page shows of it, which a saved session keeps. policy: a
    dropped policy file; trusted: whether somebody said that code in it may run."""

    folder: Path
    stated: RigMapping | None = None
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
    _better: RigMapping | None = None
    _dropped: Path | None = None

    @property
    def private(self) -> Path:
        """A folder of this tab alone, which goes with it."""
        if self._dropped is None:
            self._dropped = new_temporary_folder("studio").resolve()
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
        """Take in a dropped file; of a name that is open already it gets a number. Raises LogError for one that no
        reader knows, that is too large, or whose content is open already."""
        for path, known in zip(self.paths, self.names, strict=True):
            if path.is_file() and path.stat().st_size == len(content) and path.read_bytes() == content:
                raise LogError(f"{bare_name(name)}: this log is open already, as {known}. Expected each log once.")
        path = self.private / "logs" / numbered(bare_name(name), {p.name for p in self.paths})
        self._kept(path, content)
        try:
            self.add(path)
        except LogError:
            path.unlink()
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

    def add(self, path: Path, by_rig_file: bool = True) -> None:
        """Take in a file, or read it again. by_rig_file: read it as the command line or the user's rig.toml says.
        Raises LogError."""
        table = read_table(path)
        others = self._without(path)
        if len(others) >= MOST_FILES:
            raise LogError(f"{path.name}: there are {MOST_FILES} logs already. Remove one first.")
        before = self.paths, self.tables, self.given
        if by_rig_file and not self.paths:
            self.given = self._said_of(path)
        self._open([*others, (path, table)])
        try:
            self.look()
        except LogError:
            self.paths, self.tables, self.given = before
            raise

    def _said_of(self, path: Path) -> RigMapping:
        """How the command line, or else a rig.toml of the user, says that a file is read."""
        if self.stated is not None:
            return self.stated
        known = None if self.was_dropped(path) else find_mapping(path)
        return RigMapping() if known is None else load_mapping(known)

    def remove(self, path: Path) -> None:
        """Leave out a log."""
        self._open(self._without(path))
        self.look()

    @property
    def names(self) -> list[str]:
        """The logs as the page calls them: by file name, and by folders too where two have one name."""
        return told_apart(self.paths)

    def _without(self, path: Path) -> list[tuple[Path, Table]]:
        return [(p, t) for p, t in zip(self.paths, self.tables, strict=True) if p.resolve() != path.resolve()]

    def _open(self, logs: Sequence[tuple[Path, Table]]) -> None:
        """These files and their tables, each under the name by which the page calls it."""
        self.paths = [path for path, _ in logs]
        self.tables = [replace(table, name=name) for (_, table), name in zip(logs, self.names, strict=True)]

    def look(self) -> None:
        """Propose how to read the logs, and read them so. What is wrong goes to `trouble`."""
        self.accepted = False
        self.forget()
        self.logs, self.remarks, self.trouble, self.proposal, self._better = (), (), "", None, None
        if not self.tables:
            self.given = RigMapping()
            return
        self.proposal = self._proposed(self.given)
        self._better = self._shown_by_motion(self.proposal)  # here, as it takes seconds and views ask for it often
        try:
            self.logs, self.remarks = quietly_read(self.paths, self.tables, self.proposal.mapping)
        except LogError as error:
            self.trouble = str(error)

    def _proposed(self, given: RigMapping) -> Proposal:
        with reading:  # warnings are caught for the whole process, so one tab at a time reads or proposes
            return propose(self.tables, given)

    @property
    def computed(self) -> list[str]:
        """What `forget` would take, in words."""
        there = {"the fit": self.estimate, "the kept plant": self.kept, "the diagnosis": self.found}
        return [what for what, value in there.items() if value is not None]

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
        said: dict[str, Any] = {name: value}
        given = replace(self.given, **said)
        self._proposed(given)
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
        return self._better

    def _shown_by_motion(self, proposal: Proposal) -> RigMapping | None:
        if not proposal.fatal:
            return None
        free = self._proposed(self.given.without("flip", "pendulum_zero"))
        zero = free.item("pendulum_zero")
        flips = tuple(i.name[5:] for i in free.items if i.name.startswith("sign_") and i.value == "-")
        better = replace(self.given, pendulum_zero=zero.value, flip=flips)
        return better if len(self._proposed(better).fatal) < len(proposal.fatal) else None

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


def numbered(name: str, taken: Container[str]) -> str:
    """A file name that is not taken: this one, or this one with a number."""
    path = PurePosixPath(name)
    return next(n for n in chain([name], (f"{path.stem}-{i}{path.suffix}" for i in count(2))) if n not in taken)


def quietly_read(
    paths: Sequence[Path], tables: Sequence[Any], mapping: RigMapping
) -> tuple[tuple[Log, ...], tuple[str, ...]]:
    """The logs as the mapping says, and what reading them warns of. Raises LogError."""
    with heard(LogWarning) as remarks:
        logs = read_logs(paths, mappings=[mapping] * len(paths), tables=tables)
    return tuple(logs), tuple(remarks)
