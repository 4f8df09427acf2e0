"""The examinee: two log files in, the diagnosis as a dictionary out. May not import the bench (`make lint` checks)."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from identification.diagnosis.diagnose import diagnose
from identification.diagnosis.outcome import Diagnosis
from identification.logs.reading import read_logs

from .code import answering_code


def decide(folder: Path, diagnose: Callable[..., Diagnosis] = diagnose) -> dict[str, Any]:
    """Diagnose the log fit.csv of `folder`; held_out.csv beside it is for the gap. Anything raised is an answer too.

    diagnose(logs, held_out): the whole search by default.
    """
    began = time.monotonic()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # advice for a person
            answer = _diagnosed(folder, diagnose)
    except Exception as error:  # a crash is a wrong answer, not the end of the trials
        answer = {"error": f"{type(error).__name__}: {error}"}
    return {"runtime_s": time.monotonic() - began, "code": answering_code()} | answer


def _diagnosed(folder: Path, diagnose: Callable[..., Diagnosis]) -> dict[str, Any]:
    logs, held_out = read_logs([folder / "fit.csv"]), read_logs([folder / "held_out.csv"])
    found = diagnose(logs, held_out)
    return found.to_dict() | ({"gap_missing": found.gap_remark} if found.gap is None else {})
