"""What a search looks at of logs that are too long for it: its fits and predictions grow with every sample."""

from __future__ import annotations

from collections.abc import Sequence

from ..estimation.informative import Chosen, informative
from ..logs.log import Log
from .policy import DecisionPolicy


def searched_part(logs: Sequence[Log], policy: DecisionPolicy) -> Chosen:
    """The logs; of more than `policy.samples` together, stretches of 20 s: some all along the logs, and those that say
    most about θ. `spans` is empty where every sample is taken."""
    return informative(logs, policy.samples, policy.along) or Chosen(tuple(logs), ())
