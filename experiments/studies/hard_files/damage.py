"""Damage to bytes, to numbers in a table and to trees of JSON, drawn from a seeded generator."""

from __future__ import annotations

import copy
import random
from typing import Any

ODD_CELLS = (
    "", " ", "nan", "NaN", "inf", "-inf", "1e400", "1e308", "-1e308", "1e-320", "5e-324", "0", "-0.0", "1_0", "0x1F",
    "１２", "٣", "1,5", "1.5.2", "--1", "+", "e5", "1e", "TRUE", "#N/A", "null", "None", "1;2", "\"", "'", "\\", "\t",
    "2024-01-01 00:00:00", "00:00:01.5", "=1+1", "9" * 400, "0." + "0" * 400 + "1", "\u200b1", "1\u00a0000", "i", "1j",
)  # fmt: skip

ODD_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**31, 2**63, 2**64, -(2**70), 10**400, 0.0, -0.0, 1e-310, 5e-324, 1e308, 1e300,
    float("nan"), float("inf"), float("-inf"), "", "nan", "1e999", "é", "\ud800", "\0", "a" * 5000, [], {}, [[]], [{}],
    [None], [1], [1, 2], [1, 2, 3], ["a", 1], {"a": 1}, {"": {}}, {"__class__": "x"}, [[1.0] * 9] * 9,
)  # fmt: skip

WORDS = (
    b"\0", b"\xff" * 8, b"\0" * 16, b"\x7f\xff\xff\xff", b"\xff\xff\xff\xff", b"\x80", b"[" * 3000, b"{\"a\":" * 200,
    b"1e400", b"\r", b"\n\n", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\"", b"#", b",", b";", b"\t", b"nan", b"PK\x03\x04",
    b"PAR1", b"\x93NUMPY", b"cos\nsystem\n(S'touch it-ran'\ntR.",
)  # fmt: skip


def damaged_bytes(draw: random.Random, raw: bytes, most: int = 6) -> bytes:
    """Flips, cuts, repeats, swaps and insertions, at least one."""
    data = bytearray(raw)
    for _ in range(draw.randint(1, most)):
        size = len(data)
        at = draw.randrange(size) if size else 0
        kind = draw.randrange(8)
        if kind <= 2 and size:
            data[at] ^= 1 << draw.randrange(8)
        elif kind == 3 and size:
            data[at] = draw.choice((0, 1, 0x7F, 0x80, 0xFF, draw.randrange(256)))
        elif kind == 4:
            data[at:at] = draw.choice(WORDS)
        elif kind == 5:
            del data[at : at + draw.choice((1, 2, 4, 8, 64, 1024, size))]
        elif kind == 6:
            length = draw.choice((1, 8, 100))
            data[at:at] = data[at : at + length] * draw.randint(1, 3)
        elif size:
            length, other = draw.choice((1, 4, 8)), draw.randrange(size)
            data[at : at + length], data[other : other + length] = data[other : other + length], data[at : at + length]
    return bytes(data)


def damaged_tree(draw: random.Random, tree: Any, most: int = 3) -> Any:
    """A tree of JSON with nodes replaced, removed, renamed, doubled or buried."""
    tree = copy.deepcopy(tree)
    for _ in range(draw.randint(1, most)):
        tree = _damaged_node(draw, tree)
    return tree


def _damaged_node(draw: random.Random, tree: Any) -> Any:
    parent: Any = None
    key: Any = None
    node = tree
    while isinstance(node, dict | list) and node and (parent is None or draw.random() < 0.75):
        parent, key = node, draw.choice(list(node)) if isinstance(node, dict) else draw.randrange(len(node))
        node = node[key]
    value = _other(draw, node)
    if parent is None:
        return value
    kind = draw.randrange(8)
    if kind == 0:
        del parent[key]
    elif kind == 1 and isinstance(parent, dict):
        parent[draw.choice(("", "theta1", "name", "schema", str(key) + " ", "é"))] = parent.pop(key)
    elif kind == 2 and isinstance(parent, list):
        parent.insert(draw.randrange(len(parent) + 1), copy.deepcopy(node))
    else:
        parent[key] = value
    return tree


def _other(draw: random.Random, node: Any) -> Any:
    kind = draw.randrange(4)
    if isinstance(node, int | float) and not isinstance(node, bool) and kind < 2:
        factor = draw.choice((-1.0, 0.0, 1e-30, 1e-6, 0.5, 2.0, 1e6, 1e30, 1e200))
        try:
            return node * factor
        except OverflowError:
            return factor
    if kind == 2:
        return [node] if draw.random() < 0.5 else {"value": node}
    if kind == 3 and draw.random() < 0.1:
        for _ in range(draw.choice((10, 70, 300))):
            node = [node]
        return node
    return copy.deepcopy(draw.choice(ODD_VALUES))
