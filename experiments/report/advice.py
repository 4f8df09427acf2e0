"""The experiment that would decide between effects that these logs cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from controllers import usual_controller
from furuta_gym.plant import Effect
from identification.design.discriminate import Separation, between
from identification.diagnosis.outcome import Diagnosis
from identification.logs.formats import write_table
from identification.logs.log import Log

COMMAND_FILE = "next_experiment.csv"
_MOST = 3  # suspects
_UPRIGHT = 0.7  # rad


def design_next(diagnosis: Diagnosis, logs: Sequence[Log]) -> Separation | None:
    """What `furuta excite --between` designs for the first set of equals that differ, at the sizes fitted to these
    logs; None where nothing is ambiguous or the plant has no effect left out.

    The loop's own controller is not known: for logs of an upright pendulum the usual one stands in for it.
    Raises ValueError where no experiment can be run.
    """
    equals = _equals(diagnosis)
    if not equals or diagnosis.after is None:
        return None
    plant = diagnosis.after.plant  # `between` takes the equals off; the one before has θ bent to imitate them
    upright = any(np.median(np.abs(np.remainder(log.q2 + np.pi, 2 * np.pi) - np.pi)) < _UPRIGHT for log in logs)
    sample_time = max(float(np.median(np.diff(log.t))) for log in logs)
    policy = usual_controller(plant, sample_time) if upright else None
    return between(plant, equals, policy, sample_time=sample_time)


def write_command(design: Separation, folder: Path) -> None:
    """Write the designed command, as `furuta excite` does, to `COMMAND_FILE`."""
    t, command = design.samples()
    write_table(folder / COMMAND_FILE, {"t": t, "u" if design.whole_command else "d": command}, design.facts)


def _equals(diagnosis: Diagnosis) -> list[Effect]:
    """The first named effect that has equals which predict something else, and they, as fitted."""
    if diagnosis.naming is None:
        return []
    for effect in diagnosis.naming.found:
        fits = {s.name: s.fit.plant for s in effect.ranking}
        chosen = [effect.name, *(n for n in effect.apart if n in fits)][:_MOST]
        if len(chosen) > 1:
            return [fitted for n in chosen if n in fits and (fitted := fits[n].effect(n)) is not None]
    return []
