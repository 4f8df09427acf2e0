"""Messages of a bag or an MCAP file as columns, in a child process (see `apart_child`).

The libraries compile readers out of the definitions that the file brings, and unpack what it packs: both without bound.
It imports nothing of the project.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

_DEEPEST = 4  # levels of a message that are opened
_LONGEST = 16  # entries of a list in a message; a longer one is an image or a scan
_FEWEST = 20  # messages of a topic that can be a signal
_MOST = 20_000_000  # messages
_WIDEST = 2000  # different numbers in the messages
_SILENT = 5.0, 0.1  # of a topic's median period, and s; a longer pause is told, and what was said last holds in it


@dataclass
class _Topic:
    """Messages of one topic: stamps [ns], and numbers by field."""

    stamps: list[int] = field(default_factory=list)
    rows: list[dict[str, float]] = field(default_factory=list)


class Refused(Exception):
    """A file that can be read and is no log; says why."""


def read(path: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Facts `notes` (list of text), `silent` (a sentence by column) and columns by name; or the fact `refused`, a
    sentence, and none."""
    topics: dict[str, _Topic] = {}
    try:
        if path.lower().endswith(".mcap"):
            _read_mcap(path, topics)
        else:
            _read_bag(path, topics)
        return _joined(topics)
    except Refused as error:
        return {"refused": str(error)}, {}


def _read_bag(path: str, topics: dict[str, _Topic]) -> None:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    with AnyReader([Path(path)], default_typestore=store) as reader:
        for connection, stamp, raw in reader.messages():
            _add(topics, connection.topic, stamp, reader.deserialize(raw, connection.msgtype))


def _read_mcap(path: str, topics: dict[str, _Topic]) -> None:
    from mcap.reader import make_reader

    refused: set[str] = set()
    decoders: dict[int, Any] = {}
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.id not in decoders:
                decoders[channel.id] = _decoder(channel.message_encoding, schema)
            decode = decoders[channel.id]
            if decode is None:
                refused.add(f"{channel.topic} ({channel.message_encoding})")
                continue
            _add(topics, channel.topic, message.log_time, decode(message.data))
    if not topics and refused:
        raise Refused(f"messages of {', '.join(sorted(refused)[:5])}. Expected JSON, or CDR of ROS.")


def _decoder(encoding: str, schema: Any) -> Any:
    """A function from bytes to a message, None for an encoding that is not known."""
    if encoding == "json":
        return json.loads
    if schema is None or encoding not in ("cdr", "ros1"):
        return None
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    kind = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/")
    store = get_typestore(Stores.LATEST if encoding == "cdr" else Stores.ROS1_NOETIC)
    if kind not in store.types:
        store.register(get_types_from_msg(schema.data.decode(), kind))
    decode = store.deserialize_cdr if encoding == "cdr" else store.deserialize_ros1
    return lambda data: decode(data, kind)


def _add(topics: dict[str, _Topic], topic: str, stamp: int, message: Any) -> None:
    numbers = dict(_numbers("", message))
    if not numbers:
        return
    held = topics.setdefault(topic.strip("/").replace("/", "."), _Topic())
    if len(held.stamps) >= _MOST:
        raise Refused(f"more than {_MOST} messages in {topic[:60]}. Expected a log of some minutes; cut the bag.")
    own = _stamp(message)
    held.stamps.append(stamp if own is None else own)
    held.rows.append(numbers)


def _items(value: Any) -> Iterable[tuple[str, Any]] | None:
    if isinstance(value, Mapping):
        return value.items()
    if hasattr(value, "__dataclass_fields__"):
        return ((name, getattr(value, name)) for name in value.__dataclass_fields__)
    return None


def _numbers(prefix: str, value: Any, depth: int = 0, labels: Any = None) -> Iterator[tuple[str, float]]:
    """Every number of a message by the path to it; stamps and covariances left out."""
    if isinstance(value, bool | int | float | np.number):
        yield prefix, float(value)
        return
    if isinstance(value, str | bytes) or depth > _DEEPEST:
        return
    items = _items(value)
    if items is not None:
        found = dict(items)
        names = found.get("name")
        for key, inner in found.items():
            if key not in ("header", "stamp", "layout") and "covariance" not in key and not key.startswith("__"):
                yield from _numbers(f"{prefix}.{key}" if prefix else key, inner, depth + 1, names)
    elif isinstance(value, list | tuple | np.ndarray) and len(value) <= _LONGEST:
        named = labels if isinstance(labels, list) and len(labels) == len(value) else range(1, len(value) + 1)
        for label, inner in zip(named, value, strict=True):
            yield from _numbers(f"{prefix}.{label}", inner, depth + 1)


def _stamp(message: Any) -> int | None:
    """The time of measurement that a message states in its header [ns], None where it states none."""
    header = dict(_items(message) or ()).get("header")
    stamp = dict(_items(header) or ()).get("stamp") if header is not None else None
    parts = dict(_items(stamp) or ()) if stamp is not None else {}
    seconds = parts.get("sec", parts.get("secs"))
    if not isinstance(seconds, int | np.integer):
        return None
    own = int(seconds) * 10**9 + int(parts.get("nanosec", parts.get("nsec", parts.get("nsecs", 0))))
    return own or None


def _joined(topics: Mapping[str, _Topic]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """One table: the busiest topic's clock, and of each other topic the message nearest in time, or where it pauses the
    last one before."""
    used = {topic: held for topic, held in topics.items() if len(held.stamps) >= _FEWEST}
    if not used:
        raise Refused(f"no topic has {_FEWEST} messages with numbers. Expected angles and a command over time.")
    fields = {topic: list(dict.fromkeys(key for row in held.rows for key in row)) for topic, held in used.items()}
    count = sum(map(len, fields.values()))
    if count > _WIDEST:
        raise Refused(f"the messages hold {count} different numbers. Expected at most {_WIDEST}.")
    ordered = {topic: (np.array(held.stamps, dtype=np.int64), held.rows) for topic, held in used.items()}
    clock = max(ordered, key=lambda topic: len(ordered[topic][0]))
    base = np.unique(ordered[clock][0])
    columns = {"time": (base - base[0]) * 1e-9}
    furthest, silent = 0.0, {}
    for topic, (stamps, rows) in ordered.items():
        order = np.argsort(stamps, kind="stable")
        nearest = _nearest(stamps[order], base)
        pauses = [] if topic == clock else _pauses(stamps[order], base)
        for start, stop in pauses:
            held = int(np.searchsorted(stamps[order], start, side="right")) - 1
            nearest[(base > start) & (base < stop)] = max(held, 0)
        furthest = max(furthest, float(np.max(np.abs(stamps[order][nearest] - base))) * 1e-9)
        chosen = [rows[order[i]] for i in nearest]
        for key in fields[topic]:
            label = f"{topic}.{key.removesuffix('.data')}" if key != "data" else topic
            columns[label] = np.array([row.get(key, np.nan) for row in chosen])
            if pauses:
                silent[label] = _told(topic, [((a - base[0]) * 1e-9, (b - base[0]) * 1e-9) for a, b in pauses])
    several = f"topics {', '.join(ordered)} are joined by the nearest stamp, at most {1e3 * furthest:.3g} ms apart."
    return {"notes": [several] if len(ordered) > 1 else [], "silent": silent}, columns


def _pauses(stamps: np.ndarray, base: np.ndarray) -> list[tuple[int, int]]:
    """Stretches [ns] of the table in which a topic has no message: pauses, before the first, after the last."""
    least = max(_SILENT[0] * float(np.median(np.diff(stamps))), _SILENT[1] * 1e9)
    ends = np.concatenate([[min(base[0], stamps[0])], stamps, [max(base[-1], stamps[-1])]])
    return [(int(ends[k]), int(ends[k + 1])) for k in np.flatnonzero(np.diff(ends) > least)]


def _told(topic: str, pauses: list[tuple[float, float]]) -> str:
    start, stop = max(pauses, key=lambda pause: pause[1] - pause[0])
    more = len(pauses) - 1
    others = f", and in {more} other pause{'s' if more > 1 else ''}" if more else ""
    return (
        f"topic {topic} has no message from {start:.4g} to {stop:.4g} s{others}: its last value is held there (before "
        "the first message, the first). That is right for a command which is published only when it changes. If "
        f"messages were lost, leave these seconds out (--cut {start:.4g}:{stop:.4g})"
    )


def _nearest(stamps: np.ndarray, at: np.ndarray) -> np.ndarray:
    right = np.clip(np.searchsorted(stamps, at), 1, max(len(stamps) - 1, 1))
    right = np.minimum(right, len(stamps) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(at - stamps[left] <= stamps[right] - at, left, right)
