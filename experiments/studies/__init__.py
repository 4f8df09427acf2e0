"""The studies that produced the figures in docs: each is a module to be run with `python -m`."""
