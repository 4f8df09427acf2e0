"""The bench's compiled code: the body in motion, the torques on it, and the integrator. Nothing of the plant's."""
