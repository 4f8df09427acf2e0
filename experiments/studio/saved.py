"""A session as one file: a zip of its logs, of the fits of its search, and of `session.json`, whose types are checked.

session.json   what was said and found, as `Saved` declares it
logs/NAME      the logs as they were opened
fits.jsonl     the journal of the search, from which it goes on; may be missing

Nothing in the file is executed: the logs are read by the readers of `read_log`, the rest is text and numbers.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import re
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args, get_origin

import cattrs
import numpy as np
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

from experiments.report.contents import Verdict
from furuta_gym.files import in_short, read_json, write_whole
from furuta_gym.plant import Plant
from identification import Estimate, Gap, LogError, RigMapping
from identification.estimation.identifiability import Level

from . import LARGEST_FILE, MOST_FILES
from .session import Found, Session, bare_name, numbered

SCHEMA = "furuta-session/1"
ENDING = ".furuta"
_RECORD, _FITS, _LOGS = "session.json", "fits.jsonl", "logs/"
_BESIDE = 1 << 26  # bytes of record and fits beside the logs
_BROKEN = (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError, zlib.error)


@dataclass(frozen=True)
class SavedLog:
    """A log in the file: its name, and the digest of its bytes."""

    name: str
    sha256: str


@dataclass(frozen=True)
class Saved:
    """What session.json holds. The meanings are those of `Session`."""

    schema: str
    logs: tuple[SavedLog, ...]
    given: RigMapping
    accepted: bool
    estimate: Estimate | None
    gap: Gap | None
    gap_remark: str
    kept: Plant | None
    found: Found | None


def save_session(session: Session, path: Path) -> Path:
    """Write a session, whole or not at all. Raises ValueError where its logs are larger than can be opened again."""
    contents: dict[str, bytes] = {}
    for log, name, table in zip(session.paths, session.names, session.tables, strict=True):
        data = log.read_bytes()
        if table.sha256 not in (None, hashlib.sha256(data).hexdigest()):
            raise ValueError(f"{log} has changed since it was opened here. Remove it and open it again, then save")
        contents[numbered(bare_name(name.replace("/", "-")), contents)] = data
    if sum(map(len, contents.values())) > LARGEST_FILE:
        raise ValueError(f"the logs of this session are larger than {LARGEST_FILE} bytes together; save fewer")
    saved = Saved(
        SCHEMA,
        tuple(SavedLog(name, hashlib.sha256(data).hexdigest()) for name, data in contents.items()),
        session.given,
        session.accepted,
        session.estimate,
        session.gap,
        session.gap_remark,
        session.kept,
        session.found,
    )
    text = json.dumps(_converter().unstructure(saved), ensure_ascii=False, allow_nan=False)
    members = {_RECORD: text.encode()} | {_LOGS + name: data for name, data in contents.items()}
    if session.journal.exists():
        members[_FITS] = session.journal.read_bytes()
    raw = io.BytesIO()
    with zipfile.ZipFile(raw, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    if len(raw.getvalue()) > LARGEST_FILE:
        raise ValueError(f"this session is larger than {LARGEST_FILE} bytes; save one with fewer logs")
    if sum(map(len, members.values())) > LARGEST_FILE + _BESIDE:
        raise ValueError(f"what was fitted in this session is larger than {_BESIDE} bytes; save it before the search")
    return write_whole(path, raw.getvalue())


def open_session(name: str, content: bytes, folder: Path) -> Session:
    """The session that a file holds, to work in a folder. Raises LogError with the reason where it holds none."""
    try:
        members = _members(content)
        saved = _structured(members.pop(_RECORD))
        session = Session(folder)
        try:
            _fill(session, saved, members)
        except BaseException:
            session.close()
            raise
    except (ValueError, *_BROKEN) as error:
        raise LogError(f"{name}: cannot be read as a session of the studio: {in_short(error)}") from None
    return session


def _fill(session: Session, saved: Saved, members: dict[str, bytes]) -> None:
    for log in saved.logs:
        data = members.pop(_LOGS + bare_name(log.name), None)
        if data is None or hashlib.sha256(data).hexdigest() != log.sha256:
            raise ValueError(f"the log {log.name} is missing or changed")
        session.drop(log.name, data)
    fits = members.pop(_FITS, None)
    if members:
        raise ValueError(f"it holds {', '.join(sorted(members))}, which belongs to no session")
    session.mend(saved.given)
    if saved.accepted:
        session.accept()
        session.estimate, session.gap, session.gap_remark = saved.estimate, saved.gap, saved.gap_remark
        session.kept, session.found = saved.kept, saved.found
        if fits is not None:
            session.journal.write_bytes(fits)


def _members(content: bytes) -> dict[str, bytes]:
    """The members by name, no more of them and no larger than a session has."""
    if len(content) > LARGEST_FILE:
        raise ValueError(f"{len(content)} bytes, expected at most {LARGEST_FILE}")
    found: dict[str, bytes] = {}
    left = LARGEST_FILE + _BESIDE
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = [info.filename for info in archive.infolist()]
        if len(names) > MOST_FILES + 2 or len(set(names)) < len(names):
            raise ValueError(f"expected at most {MOST_FILES} logs, each once")
        for info in archive.infolist():
            with archive.open(info) as member:
                data = member.read(left + 1)  # the size in the zip is only what the file says of itself
            left -= len(data)
            if left < 0:
                raise ValueError(f"unpacked it is larger than {LARGEST_FILE + _BESIDE} bytes")
            found[info.filename] = data
    if _RECORD not in found:
        raise ValueError(f"it holds no {_RECORD}")
    return found


def _structured(raw: bytes) -> Saved:
    data = read_json(raw)
    schema = data.get("schema") if isinstance(data, dict) else None
    if schema != SCHEMA:
        raise ValueError(f'expected "schema": "{SCHEMA}", got {schema!r}')
    try:
        saved = _converter().structure(data, Saved)
    except Exception as error:
        told = cattrs.transform_error(error, format_exception=lambda leaf, _: str(leaf) or type(leaf).__name__)
        raise ValueError("; ".join(told)) from None
    if saved.estimate is not None:
        e, n = saved.estimate, len(saved.estimate.names)
        square = [e.covariance, *(c for c in (e.classical, e.sandwich) if c is not None)]
        if e.values.shape != (n,) or any(c.shape != (n, n) for c in square):
            raise ValueError(f"the estimate has {n} names, and values or covariances of another size")
    if saved.gap is not None:
        g = saved.gap
        if {a.shape for a in (g.rms, g.floor, g.reading_floor, g.fit_percent, g.counts)} != {(2,)}:
            raise ValueError("the numbers of the gap must be pairs")
        if not len(g.errors) == len(g.times) == len(g.log) or g.errors.shape[1:] != (2,):
            raise ValueError("the errors of the gap must be pairs, one at each time")
    return saved


def _converter() -> cattrs.Converter:
    """Dataclasses to plain values and back, strict about types; a number that is not finite goes as its name."""
    c = cattrs.Converter(forbid_extra_keys=True)
    for kind in (bool, str):
        c.register_structure_hook(kind, _exactly)
    c.register_structure_hook(Level, lambda value, _: Level(_exactly(value, str)))
    c.register_structure_hook(int, _whole)
    c.register_structure_hook(float, _number)
    c.register_unstructure_hook(float, _told)
    c.register_structure_hook(Plant, lambda value, _: Plant.from_dict(value))
    c.register_unstructure_hook(Plant, lambda plant: plant.to_dict())
    c.register_structure_hook_func(_is_array, _array)
    c.register_unstructure_hook_func(_is_array, lambda a: _each(_told, a.tolist()))
    c.register_structure_hook_func(lambda t: get_origin(t) is Mapping, lambda value, t: _mapping(c, value, t))
    fit = {"problem": override(omit=True), "optimum": override(omit=True)}
    for kind, left_out in ((Estimate, fit), (Verdict, {"blocks": override(omit=True)})):
        c.register_structure_hook(kind, make_dict_structure_fn(kind, c, _cattrs_forbid_extra_keys=True, **left_out))  # type: ignore[arg-type]
        c.register_unstructure_hook(kind, make_dict_unstructure_fn(kind, c, **left_out))  # type: ignore[arg-type]
    return c


def _exactly(value: Any, kind: type) -> Any:
    if type(value) is not kind:
        raise ValueError(f"expected {kind.__name__}, got {value!r:.60}")
    return value


def _whole(value: Any, _: type) -> int:
    if isinstance(value, str) and re.fullmatch(r"\d{1,6}", value):  # a key of a mapping
        return int(value)
    return _exactly(value, int)


def _number(value: Any, _: type) -> float:
    if value in ("nan", "inf", "-inf"):
        return float(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"expected a number, got {value!r:.60}")
    return float(value)


def _told(value: Any) -> Any:
    value = value.item() if isinstance(value, np.generic) else value
    return value if not isinstance(value, float) or math.isfinite(value) else str(value)


def _each(function: Any, value: Any) -> Any:
    return [_each(function, v) for v in value] if isinstance(value, list) else function(value)


def _is_array(kind: Any) -> bool:
    return get_origin(kind) is np.ndarray


def _array(value: Any, kind: Any) -> np.ndarray:
    holds = str(get_args(kind)[-1])
    if "bool" in holds:
        return np.array(_each(lambda v: _exactly(v, bool), value), dtype=np.bool_)
    whole = "int" in holds
    numbers = _each(lambda v: _whole(v, int) if whole else _number(v, float), value)
    return np.array(numbers, dtype=np.int64 if whole else np.float64)  # raises ValueError where it is ragged


def _mapping(converter: cattrs.Converter, value: Any, kind: Any) -> Any:
    """`Mapping`s of numbers and names; None where none was said."""
    if value is None:
        return None
    if not isinstance(value, dict):
        raise ValueError(f"expected a mapping, got {value!r:.60}")
    key, entry = get_args(kind)
    return {converter.structure(k, key): converter.structure(v, entry) for k, v in value.items()}
