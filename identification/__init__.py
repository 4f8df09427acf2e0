"""From measured logs to a plant, the gap it leaves, the effect that is missing, and the next experiment.

Each name below is loaded when it is used, so that reading a log does not pay for compiling an estimator.
"""

from typing import TYPE_CHECKING

__all__ = [
    "Diagnosis",
    "Estimate",
    "Gap",
    "Log",
    "LogError",
    "LogWarning",
    "NotIdentifiable",
    "PredictionWindow",
    "RigMapping",
    "diagnose",
    "excite",
    "identify",
    "load_mapping",
    "propose",
    "read_log",
    "read_logs",
    "read_table",
    "save_mapping",
    "validate",
    "write_log",
]

# A name here must differ from every submodule's, which takes its place in the package once it is imported.
_WHERE = {
    "Diagnosis": ".diagnosis.diagnose",
    "Estimate": ".estimation.estimate",
    "Gap": ".validation.gap",
    "Log": ".logs.log",
    "LogError": ".logs.log",
    "LogWarning": ".logs.log",
    "NotIdentifiable": ".estimation.identifiability",
    "PredictionWindow": ".validation.window",
    "diagnose": ".diagnosis.diagnose",
    "excite": ".design.next_experiment",
    "RigMapping": ".logs.rig_mapping",
    "identify": ".estimation.identify",
    "load_mapping": ".logs.rig_file",
    "propose": ".logs.proposal.propose",
    "read_log": ".logs.reading",
    "read_logs": ".logs.reading",
    "read_table": ".logs.formats",
    "save_mapping": ".logs.rig_file",
    "validate": ".validation.gap",
    "write_log": ".logs.log",
}

if TYPE_CHECKING:
    from .design.next_experiment import excite
    from .diagnosis.diagnose import Diagnosis, diagnose
    from .estimation.estimate import Estimate
    from .estimation.identifiability import NotIdentifiable
    from .estimation.identify import identify
    from .logs.formats import read_table
    from .logs.log import Log, LogError, LogWarning, write_log
    from .logs.proposal.propose import propose
    from .logs.reading import read_log, read_logs
    from .logs.rig_file import load_mapping, save_mapping
    from .logs.rig_mapping import RigMapping
    from .validation.gap import Gap, validate
    from .validation.window import PredictionWindow
else:
    from importlib import import_module

    def __getattr__(name: str) -> object:
        if name not in _WHERE:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
        globals()[name] = value = getattr(import_module(_WHERE[name], __name__), name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
