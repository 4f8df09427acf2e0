"""Controllers that see encoders only, each designed from a plant, and their comparison on equal trials.

Each name below is loaded when it is used; learned policies need the extra `rl`.
"""

from typing import TYPE_CHECKING

__all__ = [
    "CONTROLLERS",
    "Comparison",
    "Controller",
    "DesignError",
    "Training",
    "compare",
    "export_c",
    "export_mjcf",
    "export_onnx",
    "export_policy_c",
    "make_controller",
    "run_figures",
    "train",
    "usual_controller",
]

# A name here must differ from every submodule's, which takes its place in the package once it is imported.
_WHERE = {
    "CONTROLLERS": ".registry",
    "Comparison": ".comparison.result",
    "Controller": ".base",
    "DesignError": ".base",
    "Training": ".training.setup",
    "compare": ".comparison.evaluation",
    "export_c": ".exports.c",
    "export_mjcf": ".exports.mjcf",
    "export_onnx": ".exports.onnx",
    "export_policy_c": ".exports.policy_c",
    "make_controller": ".registry",
    "run_figures": ".comparison.measured_run",
    "train": ".training.train",
    "usual_controller": ".registry",
}

if TYPE_CHECKING:
    from .base import Controller, DesignError
    from .comparison.evaluation import compare
    from .comparison.measured_run import run_figures
    from .comparison.result import Comparison
    from .exports.c import export_c
    from .exports.mjcf import export_mjcf
    from .exports.onnx import export_onnx
    from .exports.policy_c import export_policy_c
    from .registry import CONTROLLERS, make_controller, usual_controller
    from .training.setup import Training
    from .training.train import train
else:
    from importlib import import_module

    def __getattr__(name: str) -> object:
        if name not in _WHERE:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
        globals()[name] = value = getattr(import_module(_WHERE[name], __name__), name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
