"""Kalman filters over one log: the compiled bank, its likelihood, a linearised path, the noise intensities."""
