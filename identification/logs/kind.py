"""What kind of experiment a log is, by where the pendulum goes."""

from __future__ import annotations

import numpy as np

from .log import Log


def kind_of(log: Log) -> str:
    """ "hanging" or "upright" where the pendulum stays on that side of the horizontal all the time, else "whole turns"
    (swing-ups among them)."""
    height = np.cos(log.q2)
    if np.all(height < 0.0):
        return "hanging"
    return "upright" if np.all(height > 0.0) else "whole turns"
