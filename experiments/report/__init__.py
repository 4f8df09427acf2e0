"""Reports: one HTML page that a person reads from top to bottom, for `diagnose`, `identify` and `validate`.

```python
examination = examine(diagnosis, logs, held_out)  # measures what the page shows
Path("report.html").write_text(render(diagnosis_page(examination)), encoding="utf-8")
```
"""

from .advice import COMMAND_FILE, write_command
from .diagnosis_page import diagnosis_page
from .estimate_page import estimate_page
from .examination import Examination, examine
from .page import render, require_extra
from .validation_page import validation_page

__all__ = [
    "COMMAND_FILE",
    "Examination",
    "diagnosis_page",
    "estimate_page",
    "examine",
    "render",
    "require_extra",
    "validation_page",
    "write_command",
]
