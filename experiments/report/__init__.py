"""The report of a diagnosis: one HTML page that a person reads from top to bottom, and diagnosis.json beside it.

```python
examination = examine(diagnosis, logs, held_out)  # measures: where, gap, closed loop
Path("report.html").write_text(build(examination), encoding="utf-8")
```
"""

from identification.diagnosis.verify import GapChange, measure_gap

from .advice import COMMAND_FILE, write_command
from .examination import Examination, examine
from .page import build, require_extra

__all__ = [
    "COMMAND_FILE",
    "Examination",
    "GapChange",
    "build",
    "examine",
    "measure_gap",
    "require_extra",
    "write_command",
]
