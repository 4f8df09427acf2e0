"""Folders of one study, commands that run in them, and what may be found there afterwards."""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
import sys
import uuid
import zipfile
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from furuta_gym.files import read_json

from .cases import Case

ROOT = Path(__file__).resolve().parents[3]
_MARK = "FURUTA_HARD_USE"


@dataclass
class Outcome:
    """What came of a command: counts by what was found, and sentences on what should not be."""

    counts: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        return {"counts": dict(self.counts), "faults": self.faults}


class Laboratory:
    """Folders of one study: inputs, outputs, a temporary folder of its own, and the environment of the commands."""

    def __init__(self, room: Path) -> None:
        self.room, self.inputs, self.outputs, self.temporary = room, room / "in", room / "out", room / "tmp"
        for folder in (self.inputs, self.outputs, self.temporary):
            folder.mkdir(parents=True)
        self.mark = uuid.uuid4().hex
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        self.environment = os.environ | {"TMPDIR": str(self.temporary), _MARK: self.mark, "PYTHONPATH": path}
        from controllers.policies import FOLDER
        from experiments.demo.story import FITTED, HELD_OUT
        from identification.logs.log import write_log
        from identification.logs.reading import read_log

        for source, name in ((FITTED, "log.csv"), (HELD_OUT, "other.csv")):
            write_log(self.inputs / name, read_log(source).slice(stop=4.0))
        shutil.copy(FOLDER / "balance-qube.zip", self.inputs / "policy.zip")
        (self.inputs / "key").write_text("a key for nothing but this study\n")

    def start(self, case: Case, more: str = "", size: int | None = None) -> subprocess.Popen[bytes]:
        """The command in a session of its own; size: the largest file [bytes] that it may write."""
        words = f"{case.arguments} {more}".split()
        words = [w.replace("{in}", str(self.inputs)).replace("{out}", str(self.outputs)) for w in words]
        limit = [] if size is None else [f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({size},) * 2)"]
        code = "; ".join([*limit, "from furuta_command import main", "main()"])
        return subprocess.Popen(
            [sys.executable, "-c", code, *words],
            env=self.environment,
            cwd=self.room,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )

    def finish(self, case: Case, more: str = "", size: int | None = None) -> tuple[int, str]:
        """Exit code and what was said on stderr."""
        process = self.start(case, more, size)
        said = process.communicate()[1].decode(errors="replace")
        return process.returncode, said

    def prepare(self, case: Case) -> str:
        """Make room for a run whose result is not made anew; its further arguments where there is something to go on
        from."""
        if case.last is not None and (self.outputs / case.last).exists():
            self.empty()
        return case.again[0] if case.again and any(self.outputs.glob(case.again[1])) else ""

    def empty(self) -> None:
        """Remove all that commands wrote."""
        for file in self.outputs.iterdir():
            shutil.rmtree(file, ignore_errors=True) if file.is_dir() else file.unlink()

    def running(self) -> list[int]:
        """Processes that the commands started and that still run."""
        found = []
        for entry in Path("/proc").iterdir() if Path("/proc").is_dir() else ():
            with suppress(OSError):
                if entry.name.isdecimal() and f"{_MARK}={self.mark}".encode() in (entry / "environ").read_bytes():
                    state = (entry / "stat").read_text().rpartition(")")[2].split()[0]
                    found += [int(entry.name)] if state != "Z" else []
        return found

    def state(self, case: Case) -> dict[str, tuple[bytes, float]]:
        """Content and time of every file that the command writes."""
        found = {}
        for name in case.writes:
            place = self.outputs / name
            for file in sorted(place.rglob("*")) if place.is_dir() else [place]:
                if file.is_file():
                    found[str(file.relative_to(self.outputs))] = file.read_bytes(), file.stat().st_mtime
        return found

    def strays(self) -> list[str]:
        """Hidden files beside the results, what only a stopped run needs, and anything in the temporary folder."""
        left = [p for pattern in (".*", "*.search.jsonl", "*.checkpoint") for p in self.outputs.rglob(pattern)]
        hidden = [str(p.relative_to(self.outputs)) for p in left if not p.name.endswith(".lock")]
        return hidden + [p.name for p in self.temporary.iterdir() if p.name.startswith("furuta")]


def whole(name: str, data: bytes) -> bool:
    """Whether a file is complete, as far as its format tells."""
    ending = Path(name).suffix
    try:
        if ending == ".json":
            read_json(data)
        elif ending == ".jsonl":
            return all(isinstance(json.loads(line), dict) for line in data.splitlines()[:-1])
        elif ending in (".zip", ".npz"):
            return zipfile.ZipFile(io.BytesIO(data)).testzip() is None
        elif ending == ".png":
            return data.startswith(b"\x89PNG") and data.endswith(b"IEND\xaeB`\x82")
        elif ending == ".csv":
            rows = [line for line in data.decode().splitlines() if not line.startswith("#")]
            return data.endswith(b"\n") and len({row.count(",") for row in rows}) == 1
        elif ending in (".html", ".xml"):
            return data.rstrip().endswith((b"</html>", b"</mujoco>"))
        elif ending == ".h":
            return data.rstrip().endswith((b"#endif", b"*/", b"}"))
    except (ValueError, OSError, zipfile.BadZipFile):
        return False
    return True
