"""Damaged, hostile and odd files for every reader: `python -m experiments.studies.hard_files --help`."""
