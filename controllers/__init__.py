"""Controllers that see encoders only, each designed from a plant, and their comparison on equal trials."""

from .base import Controller, DesignError
from .registry import CONTROLLERS, make_controller, usual_controller

__all__ = ["CONTROLLERS", "Controller", "DesignError", "make_controller", "usual_controller"]
