"""`furuta studio`: a local page on which a log is looked at, fitted, tried against effects and diagnosed.

`session` holds what one tab knows, `commands` the command lines that do the same, `work` what runs off the event loop,
`charts` the pictures, `views` one module for each view, `page` the frame around them and `server` how it is served.
Everything is computed by functions that the Python API offers too. Needs the extra `studio`.
"""

from __future__ import annotations

from importlib.util import find_spec

from furuta_gym.extras import install

LARGEST_FILE = 200_000_000  # bytes of a dropped file
MOST_FILES = 8
EXTRA = f"furuta studio needs NiceGUI: {install('studio')}"


def require_extra() -> None:
    """Raises ValueError, which says what to install, where NiceGUI is not there."""
    if find_spec("nicegui") is None:
        raise ValueError(EXTRA)
