"""The report of a diagnosis: one HTML page that a person reads from top to bottom, and diagnosis.json beside it.

```python
examination = examine(diagnosis, logs, held_out)  # measures: where, gap, closed loop
Path("report.html").write_text(build(examination), encoding="utf-8")
```
"""

from .build import build
from .examine import Examination, examine
from .gap import GapChange, measure_gap

__all__ = ["Examination", "GapChange", "build", "examine", "measure_gap"]
