"""A Furuta pendulum that is identified from measurements: plant, simulation and Gymnasium environment."""

__version__ = "0.1.0"
