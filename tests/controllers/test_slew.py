"""A policy whose commands the rig's slew limits: at once in C and in the env, in steps in a faster loop of Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controllers import make_controller
from controllers.envelope import Envelope, Guarded
from controllers.exports.c import c_header
from controllers.exports.policy_c import policy_c_header
from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.plant import QUBE
from tests.controllers.inside import COMPILER, compiled, played

POLICY = Path(__file__).parents[2] / "controllers" / "policies" / "swing-up-qube.zip"
SLEW, PERIOD, N = 120.0, 0.02, 5
RIG = QUBE.replace(limits={"arm_travel": 6.0, "slew": SLEW})


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc or clang) on this machine")
def test_c_and_a_faster_loop_arrive_at_the_same_command(tmp_path: Path) -> None:
    """The fast loop reads the same where the policy acts; there it begins its steps, and C has made its only one."""
    angles = np.cumsum(np.random.default_rng(0).normal(0.0, [0.05, 0.3], (60, 2)), axis=0)
    slow = make_controller(POLICY, RIG, PERIOD)
    header = policy_c_header(slow, "c", Envelope.of(slow))
    in_c, off = played(compiled(header, tmp_path, "double"), [(0, float(a), float(b), 0.0) for a, b in angles])
    assert not off.any()
    own, fast = Guarded(make_controller(POLICY, RIG, PERIOD)), Guarded(make_controller(POLICY, RIG, PERIOD / N))
    np.testing.assert_allclose([own(y) for y in angles], in_c, atol=1e-3)
    steps = np.array([[fast(y) for _ in range(N)] for y in angles])
    assert fast.off == "on"
    np.testing.assert_allclose(steps[:, -1], in_c, atol=1e-3)
    changes = np.abs(np.diff(steps.ravel(), prepend=0.0))
    assert changes.max() == pytest.approx(SLEW * PERIOD / N)
    assert np.abs(np.diff(in_c)).max() == pytest.approx(SLEW * PERIOD)
    assert np.abs(steps[:, 0] - in_c).max() == pytest.approx(SLEW * PERIOD * (N - 1) / N)


def test_the_env_changes_the_command_at_once() -> None:
    env = FurutaEnv(plant=RIG, task="swing_up", sample_time=PERIOD, observe_command=True)
    env.reset(seed=0)
    for k in range(1, 4):
        seen = env.step(np.array([RIG.u_max], dtype=np.float32))[0]
        assert seen[-1] == pytest.approx(min(k * SLEW * PERIOD / RIG.u_max, 1.0), rel=1e-5)


@pytest.mark.parametrize("name", ["lqr", POLICY])
def test_a_header_says_by_how_much_its_command_may_change(name: str | Path) -> None:
    header = policy_c_header if name == POLICY else c_header
    controller = make_controller(name, RIG, PERIOD if name == POLICY else 0.004)
    most = SLEW * controller.sample_time
    assert f"changes by at most {most:.4g} V from one call to the next" in header(controller)
    free = make_controller(name, QUBE, controller.sample_time)
    assert "from one call to the next" not in header(free)
