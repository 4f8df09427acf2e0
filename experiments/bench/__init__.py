"""The bench: a virtual laboratory with rigs that hide things. It shares no code with `furuta_gym.plant`.

```python
from experiments.bench import HiddenEffect, Rig, record

rig = Rig("servo", effects=[HiddenEffect("arm_spring", strength=0.5, form="bench")])
run = record(rig, "paper", seed=1)
run.write("log.csv")        # t, q1, q2, u and nothing else
run.truth                   # what it hides
```
"""

from .declaration import BenchEffect
from .effects import catalogue
from .laboratory import Laboratory
from .named import list_rigs, rig
from .programme import EXPERIMENTS
from .recording import BenchRecord, PendulumLost, record
from .rigs import HiddenEffect, Rig
from .sets import SETS, Bodies, ParameterSet
from .size import EffectSize, effect_size, strength_for

__all__ = [
    "EXPERIMENTS",
    "SETS",
    "BenchEffect",
    "BenchRecord",
    "Bodies",
    "EffectSize",
    "HiddenEffect",
    "Laboratory",
    "ParameterSet",
    "PendulumLost",
    "Rig",
    "catalogue",
    "effect_size",
    "list_rigs",
    "record",
    "rig",
    "strength_for",
]
