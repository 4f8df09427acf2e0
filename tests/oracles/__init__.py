"""Slow, obvious reference code. Nothing here may import the package under test."""
