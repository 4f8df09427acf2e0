"""A Furuta pendulum that is identified from measurements: plant, simulation and Gymnasium environment."""

from .envs import register

__version__ = "0.1.0"

register()
