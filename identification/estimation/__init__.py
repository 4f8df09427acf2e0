"""Logs become an Estimate: maximum likelihood through the filter, and the classical methods beside it."""
