"""Output where stdout or stderr cannot write every letter: a terminal of Latin-1, a pipe on Windows.

Letters that the encoding lacks are written out ("theta6" for θ6), so that no result is lost to the letter it is
printed with.
"""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata

_HANDLER = "furuta-plain-letters"
_SIGNS = {
    "−": "-", "–": "-", "—": "-", "·": "*", "⋅": "*", "×": "x", "±": "+-", "√": "sqrt ", "≤": "<=", "≥": ">=",
    "→": "->", "←": "<-", "≈": "~", "∂": "d", "∫": "integral ", "∞": "inf", "°": " deg", "“": '"', "”": '"', "’": "'",
    "●": "*", "•": "*", "\N{FRACTION SLASH}": "/", "ß": "ss", "ø": "o",
}  # fmt: skip


def print_any_letter() -> None:
    """From now on stdout and stderr write plain letters for those that their encoding lacks."""
    codecs.register_error(_HANDLER, _written_out)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_HANDLER)


def stdout_is_utf8() -> bool:
    """Whether stdout can write every letter as it is."""
    return codecs.lookup(getattr(sys.stdout, "encoding", None) or "utf-8").name == "utf-8"


def plain(text: str) -> str:
    """The text in ASCII: θ as theta, ² as ^2, é as e; a question mark for what has no plain form."""
    return "".join(map(_plain_letter, text))


def _written_out(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return plain(error.object[error.start : error.end]), error.end


def _plain_letter(letter: str) -> str:
    if letter.isascii():
        return letter
    if letter in _SIGNS:
        return _SIGNS[letter]
    if unicodedata.combining(letter):  # the accent of the letter before it
        return ""
    kind, *parts = unicodedata.decomposition(letter).split() or [""]
    if parts or kind:
        codes = parts if kind.startswith("<") else [kind, *parts]
        raised = "^" if kind == "<super>" else ""
        return raised + plain("".join(chr(int(code, 16)) for code in codes))
    name = unicodedata.name(letter, "").split()
    if name[:1] == ["GREEK"] and name[2:3] == ["LETTER"]:
        return name[3].lower() if name[1] == "SMALL" else name[3].capitalize()
    return "?"
