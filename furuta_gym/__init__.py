"""A Furuta pendulum that is identified from measurements: plant, simulation and Gymnasium environment.

Importing this package registers `FurutaID-v0`, `FurutaBalance-v0` and `FurutaSwingUp-v0`, and needs Gymnasium only;
each name below is loaded when it is used.
"""

from typing import TYPE_CHECKING

from .envs import register

__version__ = "0.2.0"

__all__ = [
    "EFFECTS",
    "Effect",
    "FurutaEnv",
    "FurutaVectorEnv",
    "LivePlant",
    "Plant",
    "Sensors",
    "Simulation",
    "open_loop",
    "register",
    "simulate",
]

# A name here must differ from every submodule's, which takes its place in the package once it is imported.
_WHERE = {
    "EFFECTS": ".plant.effects",
    "Effect": ".plant.effects",
    "FurutaEnv": ".envs.furuta",
    "FurutaVectorEnv": ".envs.vector",
    "LivePlant": ".simulation",
    "Plant": ".plant.plant",
    "Sensors": ".sensors",
    "Simulation": ".simulation",
    "open_loop": ".simulation",
    "simulate": ".simulation",
}

if TYPE_CHECKING:
    from .envs.furuta import FurutaEnv
    from .envs.vector import FurutaVectorEnv
    from .plant.effects import EFFECTS, Effect
    from .plant.plant import Plant
    from .sensors import Sensors
    from .simulation import LivePlant, Simulation, open_loop, simulate
else:
    from importlib import import_module

    def __getattr__(name: str) -> object:
        if name not in _WHERE:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
        globals()[name] = value = getattr(import_module(_WHERE[name], __name__), name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})


register()
