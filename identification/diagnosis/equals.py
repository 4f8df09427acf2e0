"""Names that logs cannot tell apart, and whether it matters: two forms that predict the same need no experiment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..estimation.zeros import moved
from ..logs.log import Log
from ..validation.gap import Gap, validate
from .naming.fits import Fit
from .naming.found import FoundEffect
from .policy import DecisionPolicy


def interchangeable(effect: FoundEffect, logs: Sequence[Log], policy: DecisionPolicy) -> tuple[str, ...]:
    """Of the equals of an effect found, those that predict the same as it does 0.3 s ahead, but for so little
    that nobody would miss it: less than rounding hides (`DecisionPolicy.negligible`, in counts of the encoders), or
    than a small share of what predictions are off anyway (`DecisionPolicy.unnoticed`)."""
    own = _predicted(effect.suspect.fit, logs) if effect.equals else None
    if own is None:
        return ()
    fits = {s.name: s.fit for s in effect.ranking}
    return tuple(n for n in effect.equals if _as_well(own, _predicted(fits[n], logs), policy))


def _predicted(fitted: Fit, logs: Sequence[Log]) -> Gap | None:
    try:
        return validate(fitted.plant, moved(logs, fitted.zeros), own_zeros=False)
    except ValueError:  # too short
        return None


def _as_well(own: Gap, other: Gap | None, policy: DecisionPolicy) -> bool:
    """Whether two predictions lie so near to each other on both axes. Where an encoder's counts are not known, only the
    share of what predictions are off counts."""
    if other is None:
        return False
    apart = np.sqrt(np.mean((own.errors - other.errors) ** 2, axis=0))
    return bool(np.all(apart < np.maximum(policy.negligible * own.least_counts, policy.unnoticed * own.rms)))
