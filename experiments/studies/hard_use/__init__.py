"""Kills and full disks, for every command that writes: `python -m experiments.studies.hard_use --help`."""
