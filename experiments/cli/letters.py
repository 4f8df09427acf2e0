"""Output where stdout or stderr cannot write every letter (a Latin-1 terminal, a pipe on Windows), and control
characters in it.

What the encoding lacks of the letters of equations is written out ("theta6" for θ6), so that no result is lost to the
letter it is printed with. Other letters, as in names of files, are escaped and stay what they are.
"""

from __future__ import annotations

import codecs
import io
import re
import sys
import unicodedata

_HANDLER = "furuta-plain-letters"
_SIGNS = {
    "−": "-", "–": "-", "—": "-", "·": "*", "⋅": "*", "×": "x", "±": "+-", "√": "sqrt ", "≤": "<=", "≥": ">=",
    "≠": "!=", "→": "->", "←": "<-", "≈": "~", "∂": "d", "∫": "integral ", "∞": "inf", "°": " deg",
    "“": '"', "”": '"', "’": "'", "●": "*", "•": "*", "\N{FRACTION SLASH}": "/",
    "\N{COMBINING DOT ABOVE}": "_dot", "\N{COMBINING DIAERESIS}": "_ddot", "\N{COMBINING CIRCUMFLEX ACCENT}": "_hat",
    "\N{COMBINING MACRON}": "_bar",
}  # fmt: skip
_CONTROLS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")


def print_any_letter() -> None:
    """From now on stdout and stderr write plain letters for those that their encoding lacks.

    A stream with a handler that somebody chose keeps it. Where a stream says that it is ASCII, typer writes UTF-8.
    """
    codecs.register_error(_HANDLER, _written_out)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "backslashreplace"):
            stream.reconfigure(errors=_HANDLER)


def stdout_is_utf8() -> bool:
    """Whether stdout can write every letter as it is."""
    return codecs.lookup(getattr(sys.stdout, "encoding", None) or "utf-8").name == "utf-8"


def plain(text: str) -> str:
    """The text in ASCII: θ as theta, ² as ^2, q̇ as q_dot, and \\xe9 for é, which is of no equation."""
    return re.sub(r"(?<=\^-)\^(?=\d)", "", "".join(map(_plain_letter, text)))


def without_controls(text: str) -> str:
    """The text with control characters escaped, not tabs and line ends. Names in a file from elsewhere may hold any,
    and a terminal would carry them out."""
    return _CONTROLS.sub(lambda found: f"\\x{ord(found[0]):02x}", text)


def _written_out(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return plain(error.object[error.start : error.end]), error.end


def _plain_letter(letter: str) -> str:
    if letter.isascii():
        return letter
    if letter in _SIGNS:
        return _SIGNS[letter]
    name = unicodedata.name(letter, "").split()
    if name[:1] == ["GREEK"] and name[2:3] == ["LETTER"]:
        word = name[-1].replace("LAMDA", "LAMBDA")
        return word.lower() if name[1] == "SMALL" else word.capitalize()
    kind, *parts = unicodedata.decomposition(letter).split() or [""]
    if kind.startswith("<"):  # a superscript, a fraction
        return ("^" if kind == "<super>" else "") + plain("".join(chr(int(code, 16)) for code in parts))
    if parts and (mark := chr(int(parts[0], 16))) in _SIGNS:
        base = chr(int(kind, 16))
        if mark == "\N{COMBINING DOT ABOVE}" or base.lower() not in "aeiou":  # ä and ü are letters of words
            return base + _SIGNS[mark]
    return letter.encode("ascii", "backslashreplace").decode()
