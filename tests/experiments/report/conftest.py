"""One diagnosis for all tests of its report, and its pages."""

from __future__ import annotations

import pytest

pytest.importorskip("plotly", reason="the report needs the extra 'report'")
pytest.importorskip("jinja2", reason="the report needs the extra 'report'")

from experiments.report import Examination, examine, render
from experiments.report.estimate_page import estimate_page
from experiments.report.validation_page import validation_page
from furuta_gym.plant import TABLE_3
from identification.diagnosis.diagnose import diagnose
from identification.logs.log import Log
from tests.factories import loop_log

from .asking import build


@pytest.fixture(scope="session")
def logs() -> tuple[Log, Log]:
    """A log of a rig with a spring at the arm, and another run of it."""
    return loop_log("arm_spring", duration=8.0)[0], loop_log("arm_spring", duration=6.0, seed=1)[0]


@pytest.fixture(scope="session")
def examined(logs) -> Examination:
    found = diagnose([logs[0]], [logs[1]], TABLE_3, most=1, only=["arm_spring", "arm_viscous_drift"])
    return examine(found, [logs[0]], [logs[1]])


@pytest.fixture(scope="session")
def page(examined) -> str:
    return build(examined)


@pytest.fixture(scope="session")
def checked(examined, logs) -> tuple[str, str]:
    """The pages of `identify` and of `validate` for the plant without the effect."""
    before = examined.diagnosis.before
    gap = examined.gap.before
    return (
        render(estimate_page(before, [logs[0]], gap, "", "rig.json")),
        render(validation_page(gap, before.plant, [logs[1]], "rig.json", "furuta diagnose LOG -o diagnosis")),
    )
