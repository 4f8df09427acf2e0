"""Are the innovations noise? Their own correlation, and theirs with what was commanded before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant.covariance import NORMAL_95

from .likelihood import whiten
from .path import FilterPath
from .taken import FEWEST

Array = NDArray[np.float64]

LAGS = 25


@dataclass(frozen=True)
class Innovations:
    """Tests of whitened innovations, for q1 and q2. Lags 1 … L, in readings that the filter used.

    correlation (L, 2): of each innovation with its own past. command_correlation (L, 2): with the changes of the
    command before it (their future is not looked at: under feedback it correlates for the right model too).
    p_white (2,): Ljung–Box. p_command (2,): that no past change of the command tells anything. band: a single
    correlation lies within ± this in 95 % of white innovations.
    """

    correlation: Array
    command_correlation: Array
    p_white: Array
    p_command: Array
    band: float
    lag_s: float

    def to_dict(self) -> dict[str, Any]:
        return {
            "largest_correlation": np.abs(self.correlation).max(axis=0).tolist(),
            "largest_command_correlation": np.abs(self.command_correlation).max(axis=0).tolist(),
            "p_white": self.p_white.tolist(),
            "p_command": self.p_command.tolist(),
        }


@dataclass(frozen=True)
class Whitened:
    """What a filter made of the readings that it used: times t (n,) [s], whitened innovations w (n, 2), and the command
    u (n,) from each on."""

    t: Array
    w: Array
    u: Array

    @classmethod
    def of(cls, path: FilterPath, since: float = -np.inf) -> Whitened:
        """Of a path, from a time on [s], on its record's clock."""
        used = path.read & (path.record.t >= since)
        return cls(path.record.t[used], whiten(path.e[used], path.S[used]), path.record.u[used, 0])

    @classmethod
    def joined(cls, parts: Sequence[Whitened]) -> Whitened:
        """One after the other."""
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("t", "w", "u")))


def innovations(seen: Whitened, lags: int = LAGS) -> Innovations:
    """Test whitened innovations, at fewer lags where there are fewer than ten readings a lag.

    Raises ValueError below FEWEST readings."""
    from scipy.stats import chi2

    w = seen.w - seen.w.mean(axis=0) if len(seen.w) else seen.w
    n = len(w)
    if n < FEWEST:
        raise ValueError(f"{n} readings are too few to test the innovations; expected at least {FEWEST}")
    lags = min(lags, n // 10)
    scale = np.sum(w * w, axis=0)
    own = np.array([np.sum(w[j:] * w[:-j], axis=0) / scale for j in range(1, lags + 1)])
    ljung_box = n * (n + 2) * np.sum(own**2 / (n - np.arange(1, lags + 1))[:, None], axis=0)
    # what was commanded during the intervals before each used reading
    changes = np.diff(seen.u, prepend=seen.u[0])
    past = np.column_stack([np.concatenate([np.zeros(j), changes[:-j]]) for j in range(1, lags + 1)])[lags:]
    past = past - past.mean(axis=0)
    v = w[lags:]
    norm = np.sqrt(np.sum(past**2, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        command = np.nan_to_num((past.T @ v) / norm[:, None] / np.sqrt(np.sum(v * v, axis=0)))
    explained = np.array([v[:, a] @ past @ np.linalg.pinv(past.T @ past) @ past.T @ v[:, a] for a in range(2)])
    free = max(int(np.linalg.matrix_rank(past)), 1)
    return Innovations(
        correlation=own,
        command_correlation=command,
        p_white=np.asarray(chi2.sf(ljung_box, lags)),
        p_command=np.asarray(chi2.sf(explained / np.var(v, axis=0), free)),
        band=NORMAL_95 / float(np.sqrt(n)),
        lag_s=float(np.median(np.diff(seen.t))),
    )
