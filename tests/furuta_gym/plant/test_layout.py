"""The order of the packed parameters: by name here, by position in the compiled kernels."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import EFFECTS, TABLE_3, Effect, Plant
from furuta_gym.plant.layout import FRICTION_ROWS, N_BASE, SHARPNESS_ROWS, THETA_ROWS, ParameterLayout
from furuta_gym.plant.linearization import state_derivative

# what the compiled kernels take for granted, written out once more
KERNELS = [*(f"theta{i}" for i in range(1, 10)), "r1", "r2"]


def carrying(*names: str) -> Plant:
    """Table 3 with two sharpnesses and effects, no two of its numbers alike."""
    plant = TABLE_3.replace(friction_sharpness=(90.0, 130.0))
    return plant.with_effects(*(plant.default_effect(name) for name in names))


def values_by_name(plant: Plant) -> dict[str, float]:
    """Every parameter of a plant, from its fields."""
    named = {f"theta{i + 1}": float(v) for i, v in enumerate(plant.theta)}
    named |= dict(zip(("r1", "r2"), plant.sharpness, strict=True))
    return named | {f"{e.name}.{k}": v for e in plant.effects for k, v in e.parameters.items()}


@pytest.mark.parametrize(
    "names",
    [(), ("arm_spring",), ("friction_sharpness", "arm_spring", "input_delay"), tuple(EFFECTS)],
    ids=["plain", "one", "three", "all"],
)
def test_packed_parameters_stand_in_the_rows_of_their_names(names: tuple[str, ...]) -> None:
    plant = carrying(*names)
    p, layout, named = plant.packed().p, plant.layout, values_by_name(plant)
    assert layout.size == p.size == len(named)
    assert {name: p[layout.row(name)] for name in layout.names} == named
    assert sorted(layout.row(name) for name in named) == list(range(p.size))


def test_the_first_rows_are_those_that_the_kernels_read_by_position() -> None:
    layout = carrying("arm_spring").layout
    assert [layout.row(name) for name in KERNELS] == list(range(11))
    assert len(KERNELS) == N_BASE
    assert KERNELS[THETA_ROWS] == KERNELS[:9]
    assert KERNELS[FRICTION_ROWS] == ["theta6", "theta7", "theta8", "theta9"]
    assert KERNELS[SHARPNESS_ROWS] == ["r1", "r2"]


@pytest.mark.parametrize(("axis", "velocity"), [(0, 2), (1, 3)], ids=["arm", "pendulum"])
def test_each_sharpness_blunts_the_friction_of_its_own_axis(axis: int, velocity: int) -> None:
    """Through the compiled model: an axis that turns as slowly as 1/r feels its own r and not the other one."""
    x = np.zeros(4)
    x[velocity] = 0.01
    sharp, blunt = [200.0, 200.0], [200.0, 200.0]
    blunt[axis] = 20.0
    of_axis = [TABLE_3.replace(friction_sharpness=tuple(r)) for r in (sharp, blunt)]
    blunt = [200.0, 200.0]
    blunt[1 - axis] = 20.0
    of_other = TABLE_3.replace(friction_sharpness=tuple(blunt))
    before, own, other = (state_derivative(plant, x, 0.0)[2:] for plant in (*of_axis, of_other))
    assert abs(own[axis] - before[axis]) > 0.1 * abs(before[axis])
    np.testing.assert_array_equal(other, before)


def test_rows_of_an_effect_are_where_its_code_says() -> None:
    plant = carrying("friction_sharpness", "arm_spring", "input_delay")
    for effect, (_, first, _) in zip(plant.effects, plant.packed().codes, strict=True):
        own = plant.layout.rows_of(effect.name)
        assert own.start == first
        assert [plant.layout.names[row] for row in own] == [f"{effect.name}.{p}" for p in effect.parameters]
    p = plant.packed().p
    assert plant.layout.of_effects(p) == {e.name: dict(e.parameters) for e in plant.effects}


def test_one_r_stands_for_both_rows_and_a_strange_name_for_none() -> None:
    layout = carrying("arm_spring").layout
    assert layout.rows("r") == (layout.row("r1"), layout.row("r2"))
    assert layout.rows("arm_spring.k") == (layout.row("arm_spring.k"),)
    assert layout.rows("theta10") == ()


def test_unknown_names_are_refused_with_those_there_are() -> None:
    layout = ParameterLayout.of([Effect("arm_spring")])
    with pytest.raises(KeyError, match=r"theta10.*theta1, .*arm_spring\.k"):
        layout.row("theta10")
    with pytest.raises(KeyError, match=r"input_delay.*arm_spring"):
        layout.rows_of("input_delay")
