"""Numbers of a file that end at some decimal: that step is of the file, and says nothing of an encoder or a unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.logs.encoders import counted_in_turns, encoder_step, is_decimal
from identification.logs.log import Log
from identification.logs.proposal import propose
from identification.logs.rig_mapping import RigMapping
from identification.logs.table import Table
from tests.factories import paper_log

from .test_proposal import hanging, table


def smooth(log: Log) -> Log:
    """With the noise of a continuous sensor, and no encoder's steps."""
    rng = np.random.default_rng(0)
    noise = 5e-4 * rng.normal(size=(2, len(log)))
    return replace(log, q1=log.q1 + noise[0], q2=log.q2 + noise[1], encoder_counts=None)


LOGS = {
    "upright": lambda: smooth(paper_log(0.004, 8.0, None)[0]),
    "hanging": lambda: smooth(hanging()),
}


def rounded(source: Table, places: int) -> Table:
    """The same with angles of so many decimals."""
    angles = {name: np.round(source.columns[name], places) for name in ("q1", "q2")}
    return replace(source, columns=source.columns | angles)


@pytest.mark.parametrize("places", [3, 4])
@pytest.mark.parametrize("kind", LOGS)
def test_radians_with_few_decimals_are_radians(kind: str, places: int) -> None:
    log = LOGS[kind]()
    source = rounded(table(log), places)
    found = propose([source], RigMapping())
    said = {item.name: item.value for item in found.items}
    assert not found.fatal
    assert "turns" not in (said.get("unit_q1"), said.get("unit_q2"))
    held = propose([source], RigMapping(unit_q1="rad", unit_q2="rad"), assumed=True)
    assert not held.fatal


@pytest.mark.parametrize("kind", LOGS)
def test_degrees_with_two_decimals_are_degrees(kind: str) -> None:
    log = LOGS[kind]()
    held = propose([rounded(table(log, angle="deg"), 2)], RigMapping(unit_q1="deg", unit_q2="deg"), assumed=True)
    assert not held.fatal


@pytest.mark.parametrize(("step", "decimal"), [(1e-3, True), (1e-4, True), (0.1, True), (2e-4, False), (1.0, False)])
def test_a_digit_behind_the_point(step: float, decimal: bool) -> None:
    assert is_decimal(step) is decimal
    assert not is_decimal(2.0 * np.pi / 4096)
    assert not is_decimal(None)


def test_a_thousand_counts_in_turns_are_not_told_from_three_decimals() -> None:
    assert counted_in_turns(1e-3) is None
    assert counted_in_turns(1.0 / 4096) == 4096
    assert encoder_step(np.round(np.linspace(0.0, 1.0, 400) ** 2, 3)) == pytest.approx(1e-3, rel=1e-3)
