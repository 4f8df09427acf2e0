"""The envelope where an encoder reads something else than the angle: wrapped, or standing still."""

import math
from pathlib import Path

import numpy as np
import pytest

from controllers import make_controller
from controllers.envelope import REASONS, Envelope, Guarded
from controllers.exports.c import c_header
from controllers.exports.policy_c import policy_c_header
from furuta_gym.plant import LARGE_RIG, QUBE, TABLE_3, Effect, Plant
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import LivePlant
from tests.controllers.inside import COMPILER, compiled, guarded, in_python, played

POLICIES = Path(__file__).parents[2] / "controllers" / "policies"
BALANCERS = [
    *((plant, name) for plant in (QUBE, TABLE_3, LARGE_RIG) for name in ("dlqr", "lqg", "lqi", "lqr-friction"))
]
BALANCERS += [(QUBE, "lqr"), (QUBE, "lqg-friction"), (QUBE, POLICIES / "balance-qube.zip")]


class TestAnArmWhoseAngleIsWrapped:
    """Into (−π, π], which never leaves a travel of 2π."""

    def test_a_motor_of_the_wrong_sign_does_not_turn_it_for_ever(self):
        inside = Guarded(make_controller(POLICIES / "swing-up-qube.zip", QUBE, 0.02))
        rig = LivePlant(QUBE, 0.02, x0=(0.0, math.pi, 0.0, 0.0))
        while rig.t < 5.0:
            q1, q2 = rig.read()
            rig.step(-inside((math.remainder(q1, 2 * math.pi), q2)))
        assert inside.off == "reading"

    @pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc or clang) on this machine")
    @pytest.mark.parametrize("name", ["lqg", "swing-up-qube.zip"])
    def test_c_goes_off_at_the_same_sample(self, name, tmp_path):
        policy = name.endswith(".zip")
        controller = make_controller(POLICIES / name if policy else name, QUBE, 0.02 if policy else 0.004)
        rows = [(int(k == 0), math.remainder(0.1 * k, 2 * math.pi), 0.01, 0.0) for k in range(60)]
        header = policy_c_header if policy else c_header
        u, off = played(compiled(header(controller, "c"), tmp_path, "double"), rows)
        ours, reasons = in_python(controller, Envelope.of(controller), rows)
        assert reasons == off.tolist()
        assert reasons.index(REASONS.index("reading")) == math.ceil(math.pi / 0.1) + 2
        np.testing.assert_allclose(u, ours, atol=1e-3 * controller.u_max)


class TestAnEncoderThatStands:
    """Of the arm, unplugged or seen to stand in a good run."""

    @staticmethod
    def play(controller, plant, duration, counts=2048, x0=(0.1, 0.05, 0.0, 0.0), stands_from=math.inf):
        """A run inside the envelope with 2π of travel: its readings, what it commanded, and when it went off [s]."""
        inside = Guarded(controller)
        rig = LivePlant(plant, inside.sample_time, Sensors(counts), x0=x0)
        readings, off = [], None
        while rig.t < duration:
            y = rig.read()
            if rig.t > stands_from:
                y = np.array([readings[-1][0], y[1]])
            readings.append(y)
            u = inside(y)
            if inside.off != "on" and off is None:
                off = rig.t
            rig.step(u)
        return readings, inside, off

    @pytest.mark.parametrize(
        ("plant", "name"), BALANCERS, ids=lambda x: Path(x).stem if not isinstance(x, Plant) else ""
    )
    @pytest.mark.parametrize("effect", [None, "arm_cable", "input_offset"])
    def test_no_good_balancer_goes_off(self, plant, name, effect):
        """Friction, a cable and an offset that the controller does not know let the arm stand for a while."""
        real = plant.with_effects(plant.default_effect(effect)) if effect else plant
        for counts in (1024, 4096):
            T = 0.02 if isinstance(name, Path) else 0.004
            controller = make_controller(name, plant, T, Sensors(counts))
            assert math.isfinite(Envelope.of(controller).held)
            _, inside, _ = self.play(controller, real, 6.0, counts)
            assert inside.off == "on" or (effect == "arm_cable" and inside.off == "tilt")  # some fall under this cable

    @pytest.mark.parametrize("name", ["swing-up", POLICIES / "swing-up-qube.zip"])
    def test_no_good_swing_up_goes_off(self, name):
        controller = make_controller(name, QUBE, 0.02 if isinstance(name, Path) else 0.004)
        _, inside, _ = self.play(controller, QUBE, 5.0, x0=(0.0, math.pi, 0.0, 0.0))
        assert inside.off == "on"

    @pytest.mark.parametrize("name", ["lqr", "dlqr", "lqg", "lqi", "lqr-friction", POLICIES / "swing-up-qube.zip"])
    def test_an_unplugged_one_switches_off(self, name):
        """The arm, which nothing holds back, turns for ever otherwise: its reading never leaves the travel."""
        real = QUBE.with_effects(Effect("input_offset", {"b": 0.1}))
        controller = make_controller(name, QUBE, 0.02 if isinstance(name, Path) else 0.004)
        _, inside, off = self.play(controller, real, 12.0, stands_from=1.0)
        assert inside.off == "held"
        assert off < 8.0

    @pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc or clang) on this machine")
    @pytest.mark.parametrize("name", ["lqg", "swing-up-qube.zip"])
    def test_c_goes_off_at_the_same_sample(self, name, tmp_path):
        policy = name.endswith(".zip")
        controller = make_controller(POLICIES / name if policy else name, QUBE, 0.02 if policy else 0.004)
        readings, _, _ = self.play(controller, QUBE, 3.0, stands_from=0.5)
        rows = [(0, float(q1), float(q2), 0.0) for q1, q2 in readings]
        rows = [(int(k == 0), *row[1:]) for k, row in enumerate(rows)]
        header = policy_c_header if policy else c_header
        u, off = played(compiled(header(controller, "c"), tmp_path, "double"), rows)
        ours, reasons = in_python(controller, Envelope.of(controller), rows)
        assert reasons == off.tolist()
        assert reasons[-1] == REASONS.index("held")
        np.testing.assert_allclose(u, ours, atol=1e-3 * controller.u_max)

    def test_an_arm_that_a_cable_holds_while_the_pendulum_rests_goes_on(self):
        inside = guarded(held=0.02)
        inside.controller._command = lambda y, r: 2.0
        for k in range(50):
            inside((0.1, 0.003 * (k % 3)))
        assert inside.off == "on"
        inside((0.1, 0.03))
        assert inside.off == "held"

    @pytest.mark.parametrize("name", ["lqr", "lqi", "swing-up", POLICIES / "swing-up-qube.zip"])
    def test_two_readings_that_stand_switch_off(self, name):
        """A driver that repeats its last answer, or one plug for both encoders."""
        policy = isinstance(name, Path)
        plant = QUBE.replace(limits={"arm_travel": 2.0, "arm_speed": 30.0, "supply": 8.0})
        controller = make_controller(name, plant, 0.02 if policy else 0.004)
        inside = Guarded(controller)
        readings = (0.2, math.pi) if "swing_up" in controller.tasks else (0.3, 0.03)
        commands = [inside(readings) for _ in range(round(3.0 / controller.sample_time))]
        assert inside.off == "held"
        assert np.count_nonzero(commands) * controller.sample_time < 1.1

    @pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc or clang) on this machine")
    def test_c_goes_off_too_where_both_stand(self, tmp_path):
        controller = make_controller("lqr", QUBE, 0.004)
        rows = [(int(k == 0), 0.3, 0.03, 0.0) for k in range(400)]
        u, off = played(compiled(c_header(controller, "c"), tmp_path, "double"), rows)
        ours, reasons = in_python(controller, Envelope.of(controller), rows)
        assert reasons == off.tolist()
        assert REASONS[reasons[-1]] == "held"
        np.testing.assert_allclose(u, ours, atol=1e-12)

    def test_without_the_rule_it_never_does(self):
        inside = guarded(held=math.inf, frozen=math.inf)
        for k in range(400):
            inside((0.1, 0.05 * math.sin(0.1 * k)))
        assert inside.off == "on"
