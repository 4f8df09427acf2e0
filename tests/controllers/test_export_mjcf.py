"""The MuJoCo model moves as the plant does, and says where it cannot."""

import numpy as np
import pytest

from controllers.exports.mjcf import export_mjcf, mjcf
from furuta_gym.plant import LARGE_RIG, QUBE, TABLE_3, Effect, Plant
from furuta_gym.plant.covariance import Covariance
from furuta_gym.plant.linearization import state_derivative
from furuta_gym.simulation import open_loop, simulate

mujoco = pytest.importorskip("mujoco", reason="MJCF is tried out in MuJoCo, the extra `mujoco`")

SMOOTH = {
    "qube": QUBE,
    "large": LARGE_RIG,
    "left-handed": LARGE_RIG.replace(theta=LARGE_RIG.theta * [1, 1, -1, 1, 1, 1, 1, 1, 1]),
    "spring": QUBE.with_effects(QUBE.default_effect("arm_spring")),
    "tilt": QUBE.with_effects(Effect("base_tilt", {"αx": 0.03, "αy": -0.02, "G1": 9.0})),
    "tilt and counterweight": LARGE_RIG.with_effects(Effect("base_tilt", {"αx": -0.1, "αy": 0.05, "G1": 0.0})),
    "offset": QUBE.with_effects(Effect("input_offset", {"b": 0.7})),
    "saturation": QUBE.with_effects(Effect("input_saturation", {"m": 2.0})),
}


def without_coulomb(plant: Plant) -> Plant:
    return plant.replace(theta=plant.theta * [1, 1, 1, 1, 1, 1, 1, 0, 0])


def accelerations(plant: Plant, x: np.ndarray, u: float) -> tuple[np.ndarray, np.ndarray]:
    """MuJoCo's and the plant's (2,) [rad/s²]."""
    model = mujoco.MjModel.from_xml_string(mjcf(plant))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = x[:2], x[2:], u
    mujoco.mj_forward(model, data)
    saturation = plant.effect("input_saturation")
    offset = plant.effect("input_offset")
    m = saturation.parameters["m"] if saturation else np.inf
    torque = np.clip(u, -m, m) + (offset.parameters["b"] if offset else 0.0)
    return data.qacc.copy(), state_derivative(plant, x, torque)[2:4]


@pytest.mark.parametrize("name", SMOOTH)
def test_acceleration_is_the_plants(name):
    """M, C, g, viscous friction and the carried effects: to the share of the inertia that MuJoCo insists on."""
    plant = without_coulomb(SMOOTH[name])
    rng = np.random.default_rng(2)
    for _ in range(20):
        x = rng.standard_normal(4) * [1.0, 2.0, 8.0, 8.0]
        theirs, ours = accelerations(plant, x, rng.uniform(-1, 1) * plant.u_max)
        assert theirs == pytest.approx(ours, rel=1e-6, abs=1e-5)


@pytest.mark.parametrize("plant", [QUBE, LARGE_RIG], ids=["qube", "large"])
def test_coulomb_friction_agrees_where_its_tanh_has_turned_over(plant):
    """At 0.1 rad/s and more, ten times 1/r: to 3 % of what Coulomb friction does."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        x = np.array([*rng.standard_normal(2), *(rng.choice([-1.0, 1.0], 2) * rng.uniform(0.1, 5.0, 2))])
        u = rng.uniform(-0.5, 0.5) * plant.u_max
        theirs, ours = accelerations(plant, x, u)
        share = np.abs(ours - state_derivative(without_coulomb(plant), x, u)[2:4]).max()
        assert np.abs(theirs - ours).max() < 0.03 * share


def test_at_rest_it_sticks_where_the_plant_creeps():
    """The difference that the file announces: half the dry friction on the arm, and the pendulum hanging."""
    model = mujoco.MjModel.from_xml_string(mjcf(QUBE))
    data = mujoco.MjData(model)
    u = 0.5 * QUBE.theta[7]
    data.qpos[:], data.ctrl[:] = (0.0, np.pi), u
    while data.time < 1.0:
        mujoco.mj_step(model, data)
    creep = simulate(QUBE, open_loop(u), 1.0, x0=(0.0, np.pi, 0.0, 0.0)).state[-1, 0]
    assert 2e-3 < creep < 2e-2  # r = 100: about 0.0055 rad/s
    assert abs(data.qpos[0]) < 0.2 * creep


def test_a_lag_is_the_actuators_filter():
    lag = 0.05
    plant = without_coulomb(QUBE).with_effects(Effect("actuator_lag", {"T": lag}))
    model = mujoco.MjModel.from_xml_string(mjcf(plant))
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[:] = (0.0, np.pi), 1.0
    states = []
    for _ in range(600):
        mujoco.mj_step(model, data)
        states.append([*data.qpos, *data.qvel])
    ours = simulate(plant, open_loop(1.0), 0.301, sample_time=0.0005, x0=(0.0, np.pi, 0.0, 0.0)).state[1:601]
    assert np.abs(np.array(states) - ours).max() < 2e-3 * np.abs(ours).max()


def test_refusals(tmp_path):
    with pytest.raises(ValueError, match=r"θ4 ≥ θ2 is violated.*set table3.*Export qube, large"):
        export_mjcf(TABLE_3, tmp_path / "no.xml")
    with pytest.raises(ValueError, match=r"θ4 ≥ θ2 is violated.*--physical"):  # of a fit, which can be made anew
        export_mjcf(TABLE_3.replace(theta=1.01 * TABLE_3.theta), tmp_path / "no.xml")
    late = QUBE.with_effects(Effect("input_delay", {"d": 0.01}))
    with pytest.raises(ValueError, match="cannot carry input_delay"):
        export_mjcf(late, tmp_path / "no.xml")
    learned = QUBE.with_effects(Effect("arm_learned", {"c00": 0.1}))
    with pytest.raises(ValueError, match="cannot carry arm_learned"):
        export_mjcf(learned, tmp_path / "no.xml")
    soft = QUBE.with_effects(Effect("input_saturation", {"m": 2.0, "knee": 0.3}))
    with pytest.raises(ValueError, match=r"no round knee.*has 0.3"):
        export_mjcf(soft, tmp_path / "no.xml")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("index", [1, 0], ids=["θ2 above θ4", "θ1 below θ3²/θ2"])
def test_an_estimate_that_is_a_rigid_body_within_its_error_bar_is_exported(index):
    """As of a thin rod, which has θ4 = θ2: the nearest rigid body moves as the plant does, to a thousandth."""
    theta = without_coulomb(LARGE_RIG).theta.copy()
    theta[index] = (theta[3], theta[2] ** 2 / theta[1])[index - 1] * (1.00002 if index else 0.99998)
    std = 3e-5 * theta[index]
    estimated = LARGE_RIG.replace(theta=theta, covariance=Covariance((f"theta{index + 1}",), np.array([[std**2]])))
    assert "to the nearest rigid body" in mjcf(estimated)
    theirs, ours = accelerations(estimated, np.array([0.3, 1.0, 2.0, -3.0]), 1.0)
    assert theirs == pytest.approx(ours, rel=1e-3)
    with pytest.raises(ValueError, match="no rigid body"):
        mjcf(estimated.replace(covariance=None))


def test_the_limits_of_the_rig_are_carried_or_named():
    rig = QUBE.replace(limits={"supply": 5.0, "slew": 300.0})
    assert 'ctrlrange="-5.0 5.0"' in mjcf(rig)
    assert "the largest slew of the command" in mjcf(rig)
    assert "slew" not in mjcf(QUBE)


def test_limits_that_switch_off_are_no_stops_and_named():
    text = mjcf(QUBE.replace(limits={"arm_travel": 2.0, "arm_speed": 20.0}))
    assert "Not carried: encoders, the rig's arm_travel of 2 rad, the rig's arm_speed of 20 rad/s, and the" in text
    assert not mujoco.MjModel.from_xml_string(text).jnt_limited.any()
    assert "the rig's" not in mjcf(QUBE)


def test_a_lag_too_short_for_the_time_step_is_left_out_and_named():
    for lag, carried in ((1e-4, False), (2.4e-4, False), (2.6e-4, True), (0.0, False)):
        text = mjcf(QUBE.with_effects(Effect("actuator_lag", {"T": lag})))
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        data.qpos[:], data.ctrl[:] = (0.0, np.pi), 1.0
        for _ in range(200):
            mujoco.mj_step(model, data)
        plain = simulate(QUBE, open_loop(1.0), 0.101, sample_time=0.0005, x0=(0.0, np.pi, 0.0, 0.0)).state[200]
        assert data.qpos == pytest.approx(plain[:2], abs=0.02)
        assert (model.na == 1) is carried
        assert (f"lag of {lag:g} s, too short" in text) is (0.0 < lag < 2.5e-4)
        assert ("friction, actuator_lag" in text) is carried
