"""What free functions of the motion explain of a log that a plant does not."""
