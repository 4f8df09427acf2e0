"""Before a run nothing is commanded: a late command acts late, also the first."""

import numpy as np
import pytest

from controllers.comparison.trials import Starts, run_trials
from furuta_gym.envs import FurutaEnv
from furuta_gym.plant import QUBE, Effect
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate

LATE = QUBE.with_effects(Effect("input_delay", {"d": 0.04}))


def test_the_first_command_is_late_too_as_in_the_env():
    run = simulate(LATE, open_loop(3.0), 0.2, 0.004, Sensors(None), x0=(0, np.pi, 0, 0), longest_step=2e-4)
    env = FurutaEnv(LATE, "swing_up", sample_time=0.004, longest_step=2e-4)
    env.reset(seed=0, options={"state": [0, np.pi, 0, 0]})
    states = [env.step([3.0])[4]["state"] for _ in range(49)]
    assert np.abs(run.state[:11, 0]).max() < 1e-15  # sin π is not quite zero
    assert run.state[11:, 0].min() > 1e-6
    assert run.state[1:] == pytest.approx(np.array(states), abs=1e-6)
    assert np.all(run.command == 3.0)


def test_trials_begin_as_a_run_does():
    class Push:
        sample_time, name = 0.004, "push"

        def reset(self) -> None: ...

        def __call__(self, y):
            return 3.0 + 0.0 * y[0]

    starts = Starts(np.array([[0.0], [0.0], [0.0], [0.0]]), np.zeros(1), np.full(1, 9.0))
    late, prompt = (run_trials(plant, Push(), starts, 2.0, 0.004, Sensors(None)).failed_at[0] for plant in (LATE, QUBE))
    assert late - prompt == pytest.approx(0.04, abs=0.0041)
