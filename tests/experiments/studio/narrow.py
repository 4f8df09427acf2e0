"""`furuta …` whose diagnosis looks at a few effects only, so that a browser need not wait for the whole library."""

from __future__ import annotations

import os
import sys
from typing import Any

from experiments.studio.views import diagnose as view
from furuta_command import main
from identification import diagnose


def narrow(logs: Any, **asked: Any) -> Any:
    """The same search among the effects that NARROW names."""
    return diagnose(logs, most=1, only=os.environ["NARROW"].split(","), **asked)


if __name__ == "__main__":
    view.diagnose = narrow
    sys.exit(main())
