"""Uses every compiled kernel once, on tiny cases, so that numba compiles and keeps it."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

from furuta_gym.cache_folder import compilations

Say = Callable[[str], None]


def warm_up(say: Say = lambda step: None) -> int:
    """Run every step; say(step) is called before each. Returns how many functions had to be compiled."""
    before = compilations()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the cases are too small to say anything
        for step, work in STEPS.items():
            say(step)
            work()
    return compilations() - before


def _environments() -> None:
    import gymnasium as gym

    import furuta_gym
    from furuta_gym.plant import QUBE

    plant = QUBE.with_effects(*(QUBE.default_effect(name) for name in ("arm_spring", "input_delay")))
    for rig in (QUBE, plant):
        env = gym.make("FurutaBalance-v0", plant=rig)
        env.reset(seed=0)
        env.step(env.action_space.sample())
        env.close()
        envs = furuta_gym.FurutaVectorEnv(4, plant=rig)
        envs.reset(seed=0)
        envs.step(envs.action_space.sample())
        envs.close()


def _logs() -> None:
    from experiments.bench import Rig, record
    from experiments.demo.story import FITTED, HELD_OUT
    from identification import diagnose, identify, read_log, validate
    from identification.estimation.methods import METHODS

    record(Rig("table3"), "paper", seed=1, duration=1.0)
    fitted, held_out = (read_log(path).slice(stop=4.0) for path in (FITTED, HELD_OUT))
    for method in METHODS:
        estimate = identify(fitted, method=method)
    estimate = identify(fitted, effects=["arm_spring"])
    validate(estimate.plant, [held_out])
    diagnose([fitted], [held_out], most=1, only=["arm_spring", "input_delay"])


def _experiments() -> None:
    from furuta_gym.plant import QUBE
    from identification import excite

    excite(QUBE, duration=2.0)
    excite(QUBE, "arm_spring,input_delay", duration=2.0)


def _controllers() -> None:
    from controllers import compare
    from furuta_gym.plant import QUBE
    from furuta_gym.simulation import open_loop, simulate

    simulate(QUBE.with_effects(QUBE.default_effect("arm_spring")), open_loop(0.1), 0.1)
    result = compare(QUBE, ["lqr", "lqg"], trials=2, duration=0.2)
    with tempfile.TemporaryDirectory() as folder:
        result.save(Path(folder))


STEPS: dict[str, Callable[[], None]] = {
    "environments": _environments,
    "identification, validation and diagnosis": _logs,
    "experiments": _experiments,
    "controllers": _controllers,
}
