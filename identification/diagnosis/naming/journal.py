"""A journal of fits: none is made twice, and a search that was stopped goes on from its journal and ends the same.

Each fit is a line of JSON with a digest of everything that it depends on, so that a line is used for the very same fit
of the very same code and logs, or not at all. A line that was cut off, or that does not fit its problem, is ignored.
"""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from furuta_gym.plant import Plant
from furuta_gym.plant.compiled import source_hash

from ...estimation.optimise import Expansion, Optimum
from ...kalman.record import Record
from .fits import Fit, FitRequest, Fitter, fit, known_fit

_LONGEST = 64 * 2**20  # bytes that a journal may have
_CODE = source_hash(Path(__file__))  # as it was loaded, whatever is edited while it runs


class FitJournal:
    """A `Fitter` that keeps its fits, in a file if there is a path, and takes known ones from there.

    Fits go on without the file where it cannot be read or written.
    """

    def __init__(self, path: Path | None = None, fitter: Fitter = fit) -> None:
        self.path, self.fitter = path, fitter
        self.used = 0
        """Fits that were known."""
        self._known, self._torn = ({}, False) if path is None else _read(path)
        self._lock = threading.Lock()
        self._running: dict[str, threading.Lock] = {}
        self._fits: dict[str, Fit] = {}
        self._digests: dict[tuple[int, ...], tuple[Sequence[Record], str]] = {}

    def __len__(self) -> int:
        return len(self._known)

    def __call__(self, request: FitRequest) -> Fit:
        key = self._key(request)
        with self._lock:
            one_at_a_time = self._running.setdefault(key, threading.Lock())
        with one_at_a_time:  # two starts of a search may be the same
            optimum, fitted = self._known.get(key), self._fits.get(key)
            if fitted is None and optimum is not None:
                fitted = known_fit(optimum, request)
            if fitted is not None:
                with self._lock:
                    self.used += 1
            else:
                fitted = self.fitter(request)
                self._keep(key, fitted.optimum)
            self._fits[key] = fitted  # the same one again: what was found out about it is kept under it
        return fitted

    def _key(self, request: FitRequest) -> str:
        anchor = request.anchor
        told = [
            _CODE,
            _plain(request.plant),
            request.noise.packed().tolist(),
            self._digest(request.records),
            None if anchor is None else _plain(anchor),
            request.policy.to_dict(),
            request.effort,
            request.iterations,
            sorted((log, *map(float, zero)) for log, zero in request.zeros.items()),
        ]
        return hashlib.sha256(json.dumps(told).encode()).hexdigest()

    def _digest(self, records: Sequence[Record]) -> str:
        same = tuple(map(id, records))  # each fit has a tuple of its own, of the same records
        with self._lock:
            if same not in self._digests:
                digest = hashlib.sha256()
                for r in records:
                    for array in (r.t, r.y, r.u, r.quantum, r.variance, r.velocity, [r.velocity_std, r.log]):
                        digest.update(np.ascontiguousarray(array, dtype=float).tobytes())
                self._digests[same] = records, digest.hexdigest()
            return self._digests[same][1]

    def _keep(self, key: str, optimum: Optimum) -> None:
        self._known[key] = optimum
        if self.path is None:
            return
        line = json.dumps(
            {
                "fit": key,
                "z": optimum.z.tolist(),
                "value": optimum.value,
                "iterations": optimum.iterations,
                "converged": bool(optimum.converged),
                "message": optimum.message,
                "gradient": optimum.expansion.gradient.tolist(),
                "information": optimum.expansion.information.tolist(),
            }
        )
        with self._lock:
            try:
                with open(self.path, "a", encoding="utf-8") as file:
                    file.write(("\n" if self._torn else "") + line + "\n")
                    self._torn = False
            except OSError:  # a full disk stops no search
                pass


def _plain(plant: Plant) -> dict[str, Any]:
    """What a fit depends on of a plant."""
    return plant.without_fit().to_dict()


def _read(path: Path) -> tuple[dict[str, Optimum], bool]:
    """What a journal holds, and whether its last line was cut off."""
    try:
        if path.stat().st_size > _LONGEST:
            return {}, False
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return {}, False
    known = {key: optimum for key, optimum in map(_parsed, text.splitlines()) if optimum is not None}
    return known, bool(text) and not text.endswith("\n")


def _parsed(line: str) -> tuple[str, Optimum | None]:
    try:
        told = json.loads(line)
        z, gradient, information = (np.array(told[name], dtype=float) for name in ("z", "gradient", "information"))
        expansion = Expansion(float(told["value"]), gradient, information)
        ended = int(told["iterations"]), bool(told["converged"]), str(told["message"])
        optimum = Optimum(z, expansion.value, expansion, *ended)
        shapes = gradient.shape == z.shape and information.shape == (*z.shape, *z.shape)
        whole = z.ndim == 1 and shapes and np.isfinite(z).all()
        return str(told["fit"]), optimum if whole else None
    except (ValueError, TypeError, KeyError, RecursionError):
        return "", None
