"""Results taken elsewhere: C for firmware, ONNX for a network runtime, MJCF for MuJoCo."""
