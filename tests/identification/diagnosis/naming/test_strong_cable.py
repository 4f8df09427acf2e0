"""A strong cable, on rigs of two simulators that share no code with the plant, is named alone and with its size."""

from __future__ import annotations

import pytest

from experiments.bench import HiddenEffect, Rig
from experiments.bench.plain_lab import PlainRig, a_log
from identification import Log, diagnose
from tests.factories import bench_log

LIKE_A_CABLE = ("arm_spring", "arm_ripple", "base_tilt", "input_offset", "actuator_lag")
K = 0.5  # V/rad


def of_the_bench() -> tuple[Log, float]:
    rig = Rig("table3", [HiddenEffect("arm_spring", 3.0)], individual=3, scatter=0.08, sample_time=4e-3)
    return bench_log(rig, "wide", seed=1, duration=12.0), rig.truth()["effects"][0]["parameters"]["k"]["value"]


def of_the_plain_laboratory() -> tuple[Log, float]:
    """A rig of the size of a QUBE, readings rounded and no other noise."""
    theta = (0.058, 0.019, 0.026, 0.0255, 3.1, 0.06, 5e-4, 0.1, 2e-3)
    columns = a_log(PlainRig(theta, 10.0, 4096, (K, -0.3)), "hanging", seed=4, duration=12.0)
    return Log(**columns, input_unit="V", encoder_counts=(4096, 4096)), K


@pytest.mark.parametrize("recorded", [of_the_bench, of_the_plain_laboratory])
def test_a_strong_cable_is_named_alone_and_sized_to_a_hundredth(recorded) -> None:
    log, k = recorded()
    found = diagnose(log, only=LIKE_A_CABLE, most=2)
    assert found.verdict == "named", str(found)
    assert [s.name for s in found.found] == ["arm_spring"]
    assert found.gap is not None
    assert found.gap.over_floor(found.gap.before) > 10.0
    assert found.plant is not None
    spring = found.plant.effect("arm_spring")
    assert spring is not None
    assert spring.parameters["k"] == pytest.approx(k, rel=0.01)
    assert not found.leftover
