"""Where compiled code is kept between processes, and who is told when some has to be compiled.

What is kept is run when it is found, so only this user may write there.
"""

import logging
import os
import stat
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

_logger = logging.getLogger(__name__)


@lru_cache
def cache_root() -> Path | None:
    """Where compiled code is kept: `FURUTA_CACHE`, else the user's cache folder, else one of the user's own in the
    temporary folder; None, with a warning, where no folder is this user's alone."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    user = os.geteuid() if hasattr(os, "geteuid") else "user"
    wanted = Path(os.environ.get("FURUTA_CACHE") or os.path.join(home, "furuta-gym"))
    reasons = []
    for place in (lambda: wanted, lambda: Path(tempfile.gettempdir()) / f"furuta-gym-{user}"):
        try:
            folder = place()  # looking for the temporary folder writes there, which a full disk refuses
        except OSError as error:
            reasons.append(str(error))
            continue
        reason = _not_private(folder)
        if not reason:
            return folder
        reasons.append(f"{folder} {reason}")
    warnings.warn(
        f"compiled code is not kept, and every start compiles anew: {'; '.join(reasons)}. "
        "Set FURUTA_CACHE to a folder of your own",
        stacklevel=2,
    )
    return None


def _not_private(folder: Path) -> str:
    """Why code in `folder` (made if need be) could be another user's; empty if only this user can write there."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        about = folder.lstat()
        if not stat.S_ISDIR(about.st_mode):
            return "is a link or a file"
        if hasattr(os, "geteuid"):
            if about.st_uid != os.geteuid():
                return "belongs to another user"
            if about.st_mode & 0o022:
                return "can be written by other users"
            folder.chmod(0o700)
        return "" if os.access(folder, os.W_OK) else "cannot be written"
    except OSError as error:
        return f"cannot be used ({error.strerror})"


_listeners: list[Callable[[], None]] = []
_compiled = 0


@contextmanager
def when_compiling(say: Callable[[], None]) -> Iterator[None]:
    """Call `say` before the first function that is compiled inside, as none of its kind was kept."""
    _listeners.append(say)
    try:
        yield
    finally:
        if say in _listeners:
            _listeners.remove(say)


def note_compilation(ours: bool = True) -> None:
    """What the compiler calls before every function. Where nobody listens, a line of the log says why it takes long.

    ours: whether it is a function of this project; others are not counted."""
    global _compiled
    if not ours:
        return
    if not _compiled and not _listeners:
        _logger.warning(
            "compiling for this machine, once: some seconds to three minutes (`furuta warm-up` does it beforehand)"
        )
    _compiled += 1
    while _listeners:
        _listeners.pop()()


def compilations() -> int:
    """How many functions this process has compiled."""
    return _compiled
