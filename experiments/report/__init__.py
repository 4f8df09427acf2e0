"""Reports: one HTML page that a person reads from top to bottom, for `diagnose`, `identify` and `validate`.

```python
from experiments.report.diagnosis_page import diagnosis_page  # pages need the extra "report", this package does not

examination = examine(diagnosis, logs, held_out)  # measures what the page shows
Path("report.html").write_text(render(diagnosis_page(examination)), encoding="utf-8")
```
"""

from .advice import COMMAND_FILE, write_command
from .examination import Examination, examine
from .page import extra_lacking, render, require_extra

__all__ = [
    "COMMAND_FILE",
    "Examination",
    "examine",
    "extra_lacking",
    "render",
    "require_extra",
    "write_command",
]
