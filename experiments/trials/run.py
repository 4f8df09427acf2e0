"""Run the trials of a plan: seal, decide, and keep every line as it comes, so that a stopped run goes on where it was.

The folder holds `sealed.jsonl` (the truth of each trial) and `answers.jsonl` (what the diagnosis said). Logs exist only
while they are looked at, in a temporary folder of random name; workers that decide are given that folder and no more.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from joblib import Parallel, delayed

from experiments.workers import workers
from furuta_gym.files import locked
from furuta_gym.processes import temporary_folder

from . import seal as laboratory
from .decide import decide
from .trial import Trial

SEALED, ANSWERS = "sealed.jsonl", "answers.jsonl"

Decide = Callable[[Path], dict[str, Any]]
Seal = Callable[[Trial], dict[str, Any]]
Progress = Callable[[str, int, int], None]


def run_trials(
    plan: Sequence[Trial],
    folder: Path,
    backend: str = "loky",
    jobs: int = 1,
    progress: Progress = lambda stage, done, of: None,
    decide: Decide = decide,
) -> None:
    """Seal and decide what `folder` does not hold yet. Interrupt it when you like: what is written stays valid.

    backend: loky (processes of this machine) or dask (the cluster at DASK_SCHEDULER_ADDRESS, which must see the same
    temporary folder, else one on this machine). jobs: processes. progress(stage, done, of) is told of every trial.
    Raises ValueError for another backend, and while another process runs trials in `folder`.
    """
    with locked(folder), workers(backend, jobs):
        folder.mkdir(parents=True, exist_ok=True)
        sealed = _lines(folder / SEALED)
        to_seal = [trial for trial in plan if trial.id not in sealed]
        tasks = (delayed(_named)(trial.id, laboratory.seal, trial) for trial in to_seal)
        _collect(tasks, folder / SEALED, lambda done: progress("sealing", done, len(to_seal)))
        sealed = _lines(folder / SEALED)
        answered = _lines(folder / ANSWERS)
        open_ = [sealed[t.id] for t in plan if t.id not in answered and "problem" not in sealed[t.id]]
        with temporary_folder("trials") as room:
            tasks = _posted(open_, room, decide)
            _collect(tasks, folder / ANSWERS, lambda done: progress("deciding", done, len(open_)))


def read_results(plan: Iterable[Trial], folder: Path) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """(sealed truth, answer) of every trial of the plan that has been answered."""
    sealed, answers = _lines(folder / SEALED), _lines(folder / ANSWERS)
    return [(sealed[t.id], answers[t.id]) for t in plan if t.id in sealed and t.id in answers]


def read_unanswerable(plan: Iterable[Trial], folder: Path) -> list[dict[str, Any]]:
    """The trials that could not be recorded, with their `problem`."""
    sealed = _lines(folder / SEALED)
    return [sealed[t.id] for t in plan if "problem" in sealed.get(t.id, {})]


def _posted(sealed: Sequence[dict[str, Any]], room: Path, decide: Decide) -> Iterator[Any]:
    """Tasks for the workers: a fresh folder of random name with two logs, recorded when a worker has time for them."""
    for truth in sealed:
        desk = Path(tempfile.mkdtemp(dir=room))
        laboratory.write_logs(truth, desk)
        yield delayed(_answered)(truth["trial"]["id"], decide, desk)


def _answered(id_: str, decide: Decide, desk: Path) -> dict[str, Any]:
    answer = _named(id_, decide, desk)
    for file in desk.iterdir():
        file.unlink()
    desk.rmdir()
    return answer


def _named(id_: str, do: Callable[[Any], dict[str, Any]], what: Any) -> dict[str, Any]:
    return {"id": id_} | do(what)


def _collect(tasks: Iterable[Any], file: Path, progress: Callable[[int], None]) -> None:
    """Append results as they come, each to the disk before the next: what is there is never written again."""
    results = Parallel(return_as="generator_unordered", pre_dispatch="2*n_jobs")(tasks)
    progress(0)
    with _appended(file) as out:
        for done, result in enumerate(results, 1):
            out.write(json.dumps(result, ensure_ascii=False).encode() + b"\n")
            out.flush()
            os.fsync(out.fileno())
            progress(done)


@contextmanager
def _appended(file: Path) -> Iterator[BinaryIO]:
    """The file to append lines to; a last line that was cut off is ended, and `_lines` passes over it."""
    try:
        with open(file, "ab+") as out:
            if out.tell():
                out.seek(-1, os.SEEK_END)
                if out.read(1) != b"\n":
                    out.write(b"\n")
            yield out
    except OSError as error:
        if error.filename is None and error.errno is not None:
            raise type(error)(error.errno, error.strerror, str(file)) from None
        raise


def _lines(file: Path) -> dict[str, dict[str, Any]]:
    """Records of a file of JSON lines by id; lines that were cut off are none."""
    found = {}
    for line in file.read_bytes().split(b"\n") if file.exists() else ():
        try:
            record = json.loads(line)
            found[record["id"]] = record
        except (ValueError, TypeError, KeyError):
            continue
    return found
