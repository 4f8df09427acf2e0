"""Two simulators that share no code, on the same rigs: the bench's table forms against the plant's library.

Neither imports the other; this file imports both.
"""

import numpy as np
import pytest

from experiments.bench import SETS, HiddenEffect, Laboratory, Rig, catalogue
from furuta_gym.plant import EFFECTS, Effect, Plant
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate

LIBRARY = [name for name, e in catalogue().items() if e.kind == "library"]
DURATION, STEP = 1.0, 0.002


def _commands(s):
    t = np.arange(round(DURATION / STEP)) * STEP
    # at rest for the first samples: what a delayed rig did before t = 0 is nobody's business
    return (
        np.where(t < 0.02, 0.0, 1.0)
        * s.drive
        * (1.5 * np.sin(2 * np.pi * 2.3 * t) + np.sign(np.sin(2 * np.pi * 1.1 * t + 0.4)))
    )


def _bench(s, effects, start, commands, engine="lagrange"):
    lab = Laboratory(Rig(s, effects, engine=engine), noise_free=True, sample_time=STEP)
    readings = [lab.reset(q=start)]
    states = [lab.state]
    for u in commands:
        readings.append(lab.step(u))
        states.append(lab.state)
    return np.array(states[:-1]), np.array(readings[:-1])


def _plant(s, effects, start, commands):
    plant = Plant(theta=s.theta, friction_sharpness=s.sharpness, unit=s.unit, u_max=s.u_max).with_effects(*effects)
    exact = Sensors(encoder_counts=None)
    run = simulate(plant, open_loop(commands), DURATION, STEP, sensors=exact, x0=(*start, 0.0, 0.0), longest_step=1e-4)
    return run.state, run.measured


@pytest.mark.parametrize("start", [(0.0, 0.1), (0.5, 3.0)], ids=["upright", "hanging"])
@pytest.mark.parametrize("engine", ["lagrange", "mujoco"])
@pytest.mark.parametrize("kind", SETS)
def test_nothing_hidden(kind, engine, start):
    s = SETS[kind]
    if engine == "mujoco":
        pytest.importorskip("mujoco")
        if s.bodies is None:
            pytest.skip("Table 3 is no rigid body")
    commands = _commands(s)
    ours, _ = _bench(s, (), start, commands, engine)
    theirs, _ = _plant(s, (), start, commands)
    assert np.ptp(theirs[:, :2], axis=0).min() > 0.05
    assert np.abs(ours[:, :2] - theirs[:, :2]).max() < 1e-4


@pytest.mark.parametrize("name", LIBRARY)
def test_parameters_have_the_plants_names_and_units(name):
    """But for the round knee, which the bench has as another form (the plant's default is the table's sharp one), and
    what is zero unless asked for."""
    knee = ("input_saturation", "knee")
    theirs = {p.name: p.unit for p in EFFECTS[name].parameters if (name, p.name) != knee and not p.optional}
    assert catalogue()[name].units == theirs


@pytest.mark.parametrize("name", LIBRARY)
def test_the_table_form_of_each_effect(name):
    s = SETS["servo"]
    places = {"q1n": -0.4, "t0": 0.45, "φ": 0.8}
    units = catalogue()[name].units
    hidden = HiddenEffect(name, 2.0, parameters={k: v for k, v in places.items() if k in units})
    values = hidden.values(s)
    start, commands = (0.5, 3.0), _commands(s)
    state, reading = _bench(s, (hidden,), start, commands)
    plant_state, plant_reading = _plant(s, (Effect(name, values),), start, commands)
    plain, plain_reading = _plant(s, (), start, commands)
    shown = max(np.abs(plant_state - plain)[:, :2].max(), np.abs(plant_reading - plain_reading).max())
    assert shown > 3e-4, "the effect must do something here, or the comparison says nothing"
    assert np.abs(state[:, :2] - plant_state[:, :2]).max() < 1e-4
    assert np.abs(reading - plant_reading).max() < 1e-4


def test_the_benchs_spring_is_the_plants_cable():
    """Why trials take either name for it (`experiments.trials.scoring.SAME_LAW`)."""
    s = SETS["servo"]
    hidden = HiddenEffect("arm_spring", 8.0, form="bench", parameters={"q1n": -0.4})
    k = hidden.values(s)["k"]
    start, commands = (0.5, 3.0), _commands(s)
    state, _ = _bench(s, (hidden,), start, commands)
    cable = Effect("arm_cable", {"k": k, "q1n": -0.4, "k3": 0.15 * k, "q1s": -0.4})
    as_cable, _ = _plant(s, (cable,), start, commands)
    as_spring, _ = _plant(s, (Effect("arm_spring", {"k": k, "q1n": -0.4}),), start, commands)
    assert np.abs(as_spring - as_cable)[:, :2].max() > 1e-3, "it must stiffen here, or this says nothing"
    assert np.abs(state[:, :2] - as_cable[:, :2]).max() < 1e-4
