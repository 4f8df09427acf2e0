"""What kind of experiment a log is, by where the pendulum goes."""

from __future__ import annotations

import numpy as np

from .log import Log

_NEAR_THE_TOP = np.cos(np.pi / 4)


def kind_of(log: Log) -> str:
    """The kind: hanging where the pendulum never comes within an eighth of a turn of the top, upright where it stays
    above the horizontal, else whole turns (swing-ups among them)."""
    height = np.cos(log.q2)
    if np.all(height < _NEAR_THE_TOP):
        return "hanging"
    return "upright" if np.all(height > 0.0) else "whole turns"
