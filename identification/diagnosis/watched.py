"""What a search has tried so far, told fit by fit to somebody who watches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from furuta_gym.plant import Plant

from .naming.fits import Fit, FitRequest, Fitter


@dataclass(frozen=True)
class Tried:
    """One fit of a search: the plant that was fitted, and its log-likelihood [nats] with the priors.

    rough: whether the fit was stopped early; a later one of the same effects is better then."""

    plant: Plant
    log_likelihood: float
    rough: bool

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects in the plant, in its order."""
        return tuple(effect.name for effect in self.plant.effects)


class Watched:
    """A `Fitter` that tells of each fit to the records of the first. Fits to thinned ones are not told, as their
    likelihoods compare with no others. watch: called from the threads that fit; what it raises ends the search."""

    def __init__(self, fitter: Fitter, watch: Callable[[Tried], None]) -> None:
        self._fitter, self._watch = fitter, watch
        self._samples: int | None = None

    def __call__(self, request: FitRequest) -> Fit:
        found = self._fitter(request)
        samples = sum(len(r.t) for r in request.records)
        if self._samples is None:
            self._samples = samples
        if samples == self._samples:
            self._watch(Tried(found.plant, -found.value, request.rough))
        return found
