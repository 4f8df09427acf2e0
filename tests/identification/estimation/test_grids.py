"""Effects given by name alone: fits that arrive where a start at the truth does."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.bench import HiddenEffect, Rig
from furuta_gym.plant import TABLE_3, Effect
from identification.estimation.grids import from_grids
from identification.estimation.identify import identify
from identification.estimation.prediction_error import PredictionError, quietest
from identification.kalman.coordinates import plant_coordinates
from identification.kalman.noise_model import Noise
from identification.kalman.record import Record
from tests.factories import bench_log, loop_log, noisy_log


@pytest.mark.parametrize(("name", "short"), [("payload_step", 3.0), ("arm_hysteresis", 0.5)])
def test_a_name_alone_is_start_enough(name: str, short: float) -> None:
    """From their defaults both ended 200 to 280 nats above: the time of a step and the width of a stop have optima of
    their own around the start. The time has more of them, some hundredths of a second apart: it depends on the
    processor's rounding whether this fit ends in the best one, or in one that is 2.0 nats short."""
    log, plant = loop_log(name, T=0.004, seed=2)
    from_truth, by_name = identify(log, plant), identify(log, effects=[name])
    assert by_name.log_likelihood > from_truth.log_likelihood - short


def test_a_frequency_is_found_in_what_is_left() -> None:
    """From its default of 3.3 Hz a fit ended at an optimum next to it, thousands of nats above, and was converged."""
    log = noisy_log(1, TABLE_3.with_effects(Effect("periodic_torque", {"A": 0.05, "f": 7.13, "φ": 0.4})), T=0.004)
    found = identify(log, effects=["periodic_torque"]).plant.effects[0].parameters
    assert found["f"] == pytest.approx(7.13, abs=0.005)
    assert abs(found["A"]) == pytest.approx(0.05, rel=0.1)


def test_the_time_of_a_step_is_found_on_a_rig_of_the_bench() -> None:
    """A grid of whole seconds with six iterations each ended two seconds off, 775 nats above, on such rigs."""
    rig = Rig("servo", effects=[HiddenEffect("payload_step", 2.0, "table", 5)], individual=11, scatter=0.1)
    (effect,) = rig.truth()["effects"]
    found = identify(bench_log(rig, seed=3), effects=["payload_step"]).plant.effects[0].parameters
    assert found["t0"] == pytest.approx(effect["parameters"]["t0"]["value"], abs=0.03)
    assert found["m"] == pytest.approx(effect["parameters"]["m"]["value"], rel=0.1)


def test_a_whole_number_is_found() -> None:
    """No descent moves it."""
    log, plant = loop_log("arm_ripple", T=0.008, seed=1)
    (ripple,) = plant.effects
    elsewhere = plant.with_effects(Effect("arm_ripple", {**ripple.parameters, "n": 5}))
    records = [Record.from_log(log)]

    def make(start, records):
        return PredictionError(start, records, plant_coordinates(start), Noise(3.0 * quietest(start, records)))

    started = from_grids(make, elsewhere, records, {"arm_ripple"}, set(), None)
    assert started.effects[0].parameters["n"] == ripple.parameters["n"]


def test_what_is_known_stays() -> None:
    records = [Record.from_log(loop_log("payload_step", duration=4.0)[0])]
    plant = TABLE_3.with_effects(Effect("payload_step", {"m": 0.04, "t0": 2.0}))

    def never(*_):
        raise AssertionError("nothing is to be tried")

    assert from_grids(never, plant, records, {"payload_step"}, {"payload_step.t0"}, None) == plant
    assert from_grids(never, plant, records, set(), set(), None) == plant
    assert from_grids(never, TABLE_3, records, {"payload_step"}, set(), None) == TABLE_3


def test_values_that_are_given_are_not_left() -> None:
    """An Effect with values is a start by itself: its fit stays in the optimum next to it."""
    log, plant = loop_log("arm_ripple", T=0.008, duration=6.0, seed=1)
    given = Effect("arm_ripple", {**plant.effects[0].parameters, "n": 5})
    found = identify(log, effects=[given])
    assert found.plant.effects[0].parameters["n"] == 5
    assert np.isfinite(found.log_likelihood)


def test_a_whole_number_may_be_known() -> None:
    """Then neither the grid nor a descent moves it."""
    log, plant = loop_log("arm_ripple", T=0.008, duration=3.0, seed=1)
    assert plant.effects[0].parameters["n"] == 12
    found = identify(log, effects=["arm_ripple"], fixed={"arm_ripple.n": 3}, iterations=1, model_error=False)
    assert found.plant.effects[0].parameters["n"] == 3
    assert found.fixed == {"arm_ripple.n": 3}
    assert "arm_ripple.n" not in found.names
    assert "arm_ripple.A" in found.names
    kept = identify(log, plant, fixed={"arm_ripple.n": None}, iterations=1, model_error=False)
    assert kept.fixed == {"arm_ripple.n": 12}
    with pytest.raises(ValueError, match=r"cannot put a prior on arm_ripple\.n, which no descent moves.*Fix its value"):
        identify(log, effects=["arm_ripple"], priors={"arm_ripple.n": (3.0, 0.5)})
    with pytest.raises(ValueError, match=r"cannot fix or put a prior on arm_ripple\.m; the parameters are"):
        plant_coordinates(plant, fixed={"arm_ripple.m"})


def test_an_optional_size_may_be_known_to_be_absent() -> None:
    plant = TABLE_3.with_effects(TABLE_3.default_effect("arm_hysteresis"))
    assert plant.effects[0].parameters["κ2"] == 0.0
    free = {c.name for c in plant_coordinates(plant, fixed={"arm_hysteresis.κ2"})}
    assert free == {c.name for c in plant_coordinates(plant)}
    both = plant.with_effects(Effect("arm_hysteresis", {**plant.effects[0].parameters, "κ2": 1.0}))
    assert "arm_hysteresis.κ2" in {c.name for c in plant_coordinates(both)}
    assert "arm_hysteresis.κ2" not in {c.name for c in plant_coordinates(both, fixed={"arm_hysteresis.κ2"})}
