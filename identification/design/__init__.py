"""The next experiment: signals, their limits on the rig, and which signal is most informative."""
