"""A rig in three dimensions, as the view Play shows it."""

from __future__ import annotations

import math
from typing import Any

ARM, PENDULUM, POST = 1.2, 1.6, 1.0  # lengths in the picture


def rig(scene: Any, x: float, colour: str) -> tuple[Any, Any]:
    """A post, an arm that turns about it, and a pendulum that turns about the arm."""
    scene.cylinder(0.08, 0.08, POST).material("#8c959f").move(x, 0, POST / 2).rotate(math.pi / 2, 0, 0)
    with scene.group().move(x, 0, POST) as arm:
        scene.cylinder(0.05, 0.05, ARM).material("#8c959f").move(0, -ARM / 2, 0)
        with scene.group().move(0, -ARM, 0) as pendulum:
            scene.cylinder(0.04, 0.04, PENDULUM).material(colour).move(0, 0, PENDULUM / 2).rotate(math.pi / 2, 0, 0)
            scene.sphere(0.1).material(colour).move(0, 0, PENDULUM)
    return arm, pendulum


def turn(parts: tuple[Any, Any], q1: float, q2: float) -> None:
    """Angles [rad] of a rig; q2 = 0 stands."""
    arm, pendulum = parts
    arm.rotate(0.0, 0.0, q1)
    pendulum.rotate(0.0, q2, 0.0)
