"""The report of a diagnosis: one HTML page that a person reads from top to bottom, and diagnosis.json beside it.

```python
examination = examine(diagnosis, logs, held_out)  # measures what the report shows
Path("report.html").write_text(build(examination), encoding="utf-8")
```
"""

from .advice import COMMAND_FILE, write_command
from .examination import Examination, examine
from .page import build, require_extra

__all__ = [
    "COMMAND_FILE",
    "Examination",
    "build",
    "examine",
    "require_extra",
    "write_command",
]
