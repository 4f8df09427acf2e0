"""Controllers by name, each designed from a plant."""

import difflib
import os
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from furuta_gym.plant import Plant
from furuta_gym.sensors import Sensors

from .base import Controller, DesignError


@dataclass(frozen=True)
class Design:
    """Where a controller's design function is (a module here, as `.linear.lqr`, or a full path), and what it does."""

    module: str
    function: str
    summary: str

    @property
    def build(self) -> Callable[..., Controller]:
        return getattr(import_module(self.module, __package__), self.function)


CONTROLLERS: dict[str, Design] = {
    "paper-lqr": Design(
        ".linear.paper_lqr", "design_paper_lqr", "the paper's gain (24), u = −K x; for the paper's rig only"
    ),
    "lqr": Design(".linear.lqr", "design_lqr", "continuous LQR, velocities by a filtered difference"),
    "dlqr": Design(".linear.lqr", "design_dlqr", "LQR of the sampled plant, its delay and lag included"),
    "lqg": Design(".linear.lqg", "design_lqg", "dlqr on the state of a Kalman filter that knows the encoders"),
    "lqr-friction": Design(".linear.lqr_friction", "design_lqr_friction", "dlqr that cancels the arm's friction"),
    "lqg-friction": Design(".linear.lqr_friction", "design_lqg_friction", "lqg that cancels the arm's friction"),
    "lqi": Design(".linear.lqi", "design_lqi", "dlqr with integral action on the arm angle"),
    "swing-up": Design(
        ".swing_up.energy", "design_swing_up", "energy swing-up that knows delay, lag and supply, then dlqr"
    ),
    "planned": Design(
        ".swing_up.planned", "design_planned", "the fastest swing-up, by direct collocation (extra `plan`)"
    ),
}


def make_controller(
    name: str | os.PathLike[str],
    plant: Plant | str | os.PathLike[str],
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    *,
    trust: bool = False,
    **options: Any,
) -> Controller:
    """The controller called `name`, designed for `plant`; or a learned policy, when `name` is a file `*.zip`.

    sample_time [s]: default is the plant's, else 2 ms. sensors: default is what the plant file says, else 4096-count
    encoders. trust: also read a policy of stable-baselines3, which runs the code in it. options go to the design
    function (`weights`, `reference`, …). Raises ValueError for an unknown name
    (the message lists the names), DesignError if the plant cannot be controlled so, FileNotFoundError for a missing
    policy.
    """
    plant = Plant.resolve(plant)
    text = os.fspath(name)
    if text.endswith(".zip"):
        from .learned.policy import load_policy

        return load_policy(text, plant, sample_time, sensors, trust=trust, **options)
    if text not in CONTROLLERS:
        near = difflib.get_close_matches(text.lower().replace("_", "-"), CONTROLLERS, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise ValueError(f"no controller {text!r}; {hint}there are {', '.join(CONTROLLERS)}, or a policy file *.zip")
    return CONTROLLERS[text].build(plant, sample_time, sensors, **options)


def usual_controller(plant: Plant | str | os.PathLike[str], sample_time: float | None = None) -> Controller:
    """The paper's LQR where it holds the plant, else the first of lqr, dlqr and lqg that does.

    "Holds" means that the closed loop is stable, linear about upright, with the delay and the lag that the plant
    carries. sample_time [s]: default is the plant's, else 2 ms. Raises DesignError if none holds the plant.
    """
    plant = Plant.resolve(plant)
    try:
        return make_controller("paper-lqr", plant, sample_time)  # which is refused where it does not hold
    except DesignError:
        pass
    return designed(plant, sample_time)


def designed(plant: Plant, sample_time: float | None = None) -> Controller:
    """The first of lqr, dlqr and lqg that holds the plant, as `usual_controller` has it. Raises DesignError."""
    names = ("lqr", "dlqr", "lqg")
    for name in names:
        controller = make_controller(name, plant, sample_time)
        if _slowest(controller) < 1:
            return controller
    raise DesignError(
        f"none of {', '.join(names)} holds this plant: each closed loop is unstable, linear about upright; check the "
        "plant's delay and lag and the sample time, or name a controller"
    )


def held(controller: Controller) -> Controller:
    """A controller that holds the plant that it is made for, as far as a linear one says; else DesignError.

    Python may play and export one that does not, to see it fall; `furuta export` does not write it."""
    if (slowest := _slowest(controller)) >= 1:
        raise DesignError(
            f"{controller.name} does not hold this plant at {1e3 * controller.sample_time:g} ms a sample: the closed "
            f"loop is unstable, linear about upright (largest |z| = {slowest:.4f}). lqr leaves delay, lag and sample "
            "time out of account; dlqr and lqg do not. Take one of these, or a shorter --sample-time"
        )
    return controller


def _slowest(controller: Controller) -> float:
    """Largest |z| of the closed loop near upright; 0 where the controller does not say."""
    poles = getattr(controller, "closed_loop_poles", None)
    return 0.0 if poles is None else float(np.abs(poles()).max())
