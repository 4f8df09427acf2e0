"""`furuta …` whose server listens a while after its start-up has ended."""

from __future__ import annotations

import asyncio
import sys
from typing import Any

from uvicorn.lifespan.on import LifespanOn

from furuta_command import main

_startup = LifespanOn.startup


async def startup(self: Any) -> None:
    """The same, and then a pause before the port is bound."""
    await _startup(self)
    await asyncio.sleep(1.0)


if __name__ == "__main__":
    LifespanOn.startup = startup
    sys.exit(main())
