"""A sealed file: data that only a passphrase opens. scrypt (RFC 7914) makes the key, Fernet encrypts and signs."""

from __future__ import annotations

import base64
import json
import os
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from furuta_gym.extras import install
from furuta_gym.files import read_json

SCHEMA = "furuta-sealed/1"
SHORTEST = 8
"""Characters of a passphrase."""

_COST = {"n": 2**15, "r": 8, "p": 1}  # 32 MB and about 0.1 s; fixed by the schema, so that no file can ask for more
_SALT = 16  # bytes
_BLOCK = 1 << 14  # the text is filled up to a multiple: its length would tell how much is hidden
_LARGEST = 1 << 22  # bytes of a sealed file that is read


def require_extra() -> None:
    """Raises ValueError, which says what to install, where the library that encrypts is not there."""
    if find_spec("cryptography") is None:
        raise ValueError(f"sealed rigs need cryptography: {install('lab')}")


def passphrase_in(file: Path) -> str:
    """The text of a key file, without white space around it. Raises ValueError if it is too short, OSError."""
    try:
        text = file.read_text(encoding="utf-8").strip()
    except UnicodeDecodeError:
        raise ValueError(f"{file}: expected a key file of text in UTF-8") from None
    return checked(text, str(file))


def checked(passphrase: str, source: str) -> str:
    """The passphrase itself. Raises ValueError if it is too short to protect anything."""
    if len(passphrase) < SHORTEST:
        raise ValueError(f"{source}: a key of {len(passphrase)} characters given, expected {SHORTEST} or more")
    return passphrase


def locked_text(data: Any, passphrase: str) -> str:
    """`data` (JSON) as the text of a sealed file. Equal data give other texts, as the salt is new each time."""
    salt = os.urandom(_SALT)
    text = json.dumps(data, ensure_ascii=False, allow_nan=False).encode()
    text += b" " * (-len(text) % _BLOCK)
    token = _fernet(passphrase, salt).encrypt(text).decode()
    return json.dumps({"schema": SCHEMA, "salt": base64.b64encode(salt).decode(), "token": token}, indent=1) + "\n"


def opened(file: Path, passphrase: str) -> Any:
    """What a sealed file holds. Raises ValueError for another key, a changed file, or one that is not sealed."""
    from cryptography.fernet import InvalidToken

    if file.is_dir():
        raise ValueError(f"{file} is a folder; expected a file that `furuta bench seal` wrote, such as sealed.json")
    if file.stat().st_size > _LARGEST:
        raise ValueError(f"{file} is larger than {_LARGEST} bytes; expected a file that `furuta bench seal` wrote")
    try:
        sealed = read_json(file.read_bytes())
        if sealed["schema"] != SCHEMA:
            raise ValueError
        salt, token = base64.b64decode(sealed["salt"], validate=True), sealed["token"].encode()
    except (ValueError, KeyError, TypeError, AttributeError):
        raise ValueError(f"{file} is not a sealed file; expected one that `furuta bench seal` wrote") from None
    try:
        return read_json(_fernet(passphrase, salt).decrypt(token))
    except InvalidToken:
        raise ValueError(f"the key does not open {file}: take the key that it was sealed with") from None


def _fernet(passphrase: str, salt: bytes) -> Any:
    from cryptography.fernet import Fernet
    from cryptography.hazmat.primitives.kdf.scrypt import Scrypt

    secret = Scrypt(salt=salt, length=32, **_COST).derive(passphrase.encode())
    return Fernet(base64.urlsafe_b64encode(secret))
