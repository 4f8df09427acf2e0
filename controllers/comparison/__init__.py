"""Trials of many rigs side by side, the conditions they differ in, and what a comparison says of controllers."""
