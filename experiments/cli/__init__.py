"""The command line `furuta`: one module for each command, heavy imports inside them so that help is quick."""

from .app import app, main

__all__ = ["app", "main"]
