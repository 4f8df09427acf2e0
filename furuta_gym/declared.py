"""Files that are declared: data read as their declaration, and in plain words what does not fit.

A declaration is a type, mostly a `msgspec.Struct`; its bounds and descriptions are `msgspec.Meta`. The published JSON
Schema follows from the same declaration (`docs/generate.py`).
"""

import copy
import re
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

import msgspec

T = TypeVar("T")

_PLACE = re.compile(r" - at (`key` in )?`\$((?:\.\w+|\[\d+\]|\[\.\.\.\])*)`\Z")  # a key of a stranger may look like it
_STEP = re.compile(r"\.(\w+)|\[(\d+)\]|\[(\.\.\.)\]")
_ATOMS = frozenset((str, int, float, bool, type(None)))
_KINDS = {"StrType": "a text", "BoolType": "true or false", "NoneType": "null", "VarTupleType": "a list"}


def checked(data: Any, declared: type[T], name: str = "") -> T:
    """`data` (mappings, lists, numbers; NumPy's too) as declared. Texts and truth values are no numbers.

    name: of the whole in messages; "" for a file, whose keys then stand alone. Raises ValueError that says where,
    what was expected and what it means, and what was got.
    """
    try:
        return msgspec.convert(data, declared)
    except (msgspec.ValidationError, UnicodeEncodeError):
        data = plain(data)  # msgspec does not know NumPy's numbers; they are rare, and this takes time
    try:
        return msgspec.convert(data, declared)
    except msgspec.ValidationError as error:
        said = _in_words(str(error), data, declared, name)
    except UnicodeEncodeError as error:  # half of a pair of UTF-16, such as "\ud800"
        said = f"{name or 'the file'} must have texts as keys, got {error.object!r:.80}"
    raise ValueError(said)


def plain(value: Any) -> Any:
    """The same in mappings, lists and numbers of Python alone."""
    if type(value) in _ATOMS:
        return value
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, Mapping):
        return {key: plain(inner) for key, inner in value.items()}
    return value.tolist() if hasattr(value, "tolist") else value


def written(structure: msgspec.Struct) -> dict[str, Any]:
    """A structure as mappings, lists and numbers for JSON, in the order of its declaration; `UNSET` is left out."""
    return msgspec.to_builtins(structure, enc_hook=plain)


def _in_words(said: str, data: Any, declared: Any, name: str) -> str:
    """What msgspec says, with the bounds and the meaning that are declared there, and with the value."""
    from msgspec import inspect  # needed for messages only

    found = _PLACE.search(said)
    reason, at = (said[: found.start()], found[2]) if found else (said, "")
    place, value, nodes = name, data, [inspect.type_info(declared)]
    for field, index, any_key in _STEP.findall(at):
        if field and field not in value:  # it was no place, but what the unknown key looks like
            return f"{place or 'the file'} has no {field!r}; it takes {', '.join(_fields(nodes))}"
        key = _wrong_key(data, value, declared, said) if any_key else int(index) if index else field
        value, nodes = value[key], [below for node in nodes for below in _below(node, field)]
        named = value.get("name") if index and isinstance(value, dict) else None
        place = f"{place}[{_shown(named or key)}]" if index else f"{place}.{_shown(key)}".removeprefix(".")
    place = place or "the file"
    if found and found[1]:
        return f"{place} must have texts as keys, got {value!r:.80}"
    if unknown := re.fullmatch(r"Object contains unknown field `(.*)`", reason, re.DOTALL):
        return f"{place} has no {unknown[1]!r:.80}; it takes {', '.join(_fields(nodes))}"
    if missing := re.fullmatch(r"Object missing required field `(.*)`", reason):
        return f'{place} needs "{missing[1]}", and has {", ".join(map(_shown, value)) or "nothing"}'
    alternatives = dict.fromkeys(text for node in nodes for text in _wanted(node))
    wanted = " or ".join(sorted(alternatives, key=lambda text: (text == "null", text.startswith("a list"))))
    meaning = "".join(f" ({text})" for text in _meanings(nodes))
    return f"{place} must be {wanted}{meaning}, got {value!r:.80}"


def _shown(key: Any) -> str:
    text = str(key)[:40]
    return text if text.isprintable() else ascii(text)


def _wrong_key(data: Any, value: Mapping[Any, Any], declared: Any, said: str) -> Any:
    """msgspec does not say at which key of a mapping: the first that gives the same complaint, by halving."""

    def complains(keys: list[Any]) -> bool:
        try:
            msgspec.convert(copy.deepcopy(data, {id(value): {key: value[key] for key in keys}}), declared)
        except msgspec.ValidationError as error:
            return str(error) == said
        return False

    keys = list(value)
    while len(keys) > 1:
        half = len(keys) // 2
        keys = keys[:half] if complains(keys[:half]) else keys[half:]
    return keys[0]


def _options(node: Any) -> Iterator[Any]:
    """The alternatives of a type, without what is said about it."""
    for one in getattr(node, "types", [node]):
        yield from _options(one.type) if hasattr(one, "extra_json_schema") else [one]


def _below(node: Any, field: str) -> Iterator[Any]:
    """What is declared for a field of a structure, or for the items of a list or mapping."""
    for one in _options(node):
        if field:
            yield from (f.type for f in getattr(one, "fields", ()) if f.encode_name == field)
        else:
            yield from (getattr(one, kind) for kind in ("item_type", "value_type") if hasattr(one, kind))


def _fields(nodes: list[Any]) -> Iterator[str]:
    for field in (field for node in nodes for one in _options(node) for field in getattr(one, "fields", ())):
        yield field.encode_name + "".join(f" ({said})" for said in _meanings([field.type]))


def _meanings(nodes: list[Any]) -> Iterator[str]:
    """The first sentences of what is declared to be meant."""
    for node in nodes:
        if said := (getattr(node, "extra_json_schema", None) or {}).get("description"):
            yield said[0].lower() + said[1:].partition(". ")[0]


def _wanted(node: Any) -> Iterator[str]:
    """The alternatives in words."""
    for one in _options(node):
        if hasattr(one, "multiple_of"):
            yield ("a whole number" if type(one).__name__ == "IntType" else "a number") + _interval(one)
        elif hasattr(one, "item_type") and one.max_length is not None:
            low, high = one.min_length or 0, one.max_length
            size = f"{low}" if low == high else f"{low} or {high}" if high == low + 1 else f"{low} to {high}"
            yield f"a list of {size}, each " + " or ".join(_wanted(one.item_type))
        elif hasattr(one, "values"):
            yield " or ".join(f'"{value}"' for value in one.values)
        else:
            yield "a list" if hasattr(one, "item_type") else _KINDS.get(type(one).__name__, "a mapping")


def _interval(node: Any) -> str:
    low, high = (node.gt if node.ge is None else node.ge), (node.lt if node.le is None else node.le)
    if low is None and high is None:
        return ""
    left = "(-∞" if low is None else f"{'(' if node.ge is None else '['}{low:g}"
    right = "∞)" if high is None else f"{high:g}{')' if node.le is None else ']'}"
    return f" in {left}, {right}"
