"""Pictures: right in kind, not blank, different where the state differs, and where the state says."""

import gymnasium as gym
import numpy as np
import pytest

from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.rendering import _BOB, HEIGHT, WIDTH, Viewer
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import PLANTS

pytest.importorskip("pygame")


def frame_of(state, **options) -> np.ndarray:
    env = FurutaEnv(render_mode="rgb_array", **options)
    env.reset(seed=0, options={"state": state})
    return env.render()


def bob(frame) -> np.ndarray:
    """Mean pixel (x, y) of the pendulum's end in the perspective view."""
    rows, columns = np.nonzero((np.abs(frame[:, :480].astype(int) - _BOB) < 12).all(axis=2))
    return np.array([columns.mean(), rows.mean()])


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("task", ["balance", "swing_up"])
def test_frames_are_pictures(plant, task):
    env = gym.make("FurutaID-v0", plant=plant, task=task, render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    assert first.shape == (HEIGHT, WIDTH, 3)
    assert first.dtype == np.uint8
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 50
    kept = first.copy()
    for _ in range(10):
        env.step(env.action_space.high)
    second = env.render()
    assert (first != second).any(axis=2).mean() > 0.002
    np.testing.assert_array_equal(first, kept)
    env.close()
    env.close()


def test_upright_is_up_and_the_arm_turns():
    upright, hanging = bob(frame_of([0, 0, 0, 0])), bob(frame_of([0, np.pi, 0, 0]))
    assert hanging[1] - upright[1] > 150
    assert abs(hanging[0] - upright[0]) < 40
    right, left = bob(frame_of([0.6, 0, 0, 0])), bob(frame_of([0.6 + np.pi, 0, 0, 0]))
    assert right[0] - left[0] > 100


def test_command_and_time_are_shown():
    env = FurutaEnv(render_mode="rgb_array", task="swing_up")
    env.reset(seed=0, options={"state": [0, np.pi, 0, 0]})
    panels = []
    for u in (9.0, -9.0):
        env.reset(seed=0, options={"state": [0, np.pi, 0, 0]})
        env.step([u])
        panels.append(env.render()[290:312, 500:700].astype(int))
    right_minus_left = [panel[:, 110:].sum() - panel[:, :90].sum() for panel in panels]
    assert right_minus_left[0] < 0 < right_minus_left[1]  # the bar is darker than its ground
    clock = [frame_of([0, 0, 0, 0])[15:50, 620:], env.render()[15:50, 620:]]
    assert (clock[0] != clock[1]).any()


def test_window_without_a_screen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gym.make("FurutaID-v0", render_mode="human")
    env.reset(seed=0)
    for _ in range(5):
        env.step(env.action_space.sample())
    assert env.render() is None
    env.close()


def test_a_frame_takes_a_few_milliseconds_of_cpu():
    """Bound: 5 ms; twice that for slow machines. It took 36 ms before the ground and the words were kept."""
    import time

    env = FurutaEnv("qube", "swing_up", render_mode="rgb_array")
    env.reset(seed=0)
    spent = []
    for _ in range(60):
        env.step(env.action_space.sample())
        began = time.process_time()
        env.render()
        spent.append(time.process_time() - began)
    assert np.median(spent[10:]) < 0.010


def test_a_window_shows_time_as_it_passes(monkeypatch):
    import time

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = FurutaEnv("qube", "swing_up", render_mode="human")
    env.reset(seed=0)
    began = time.perf_counter()
    for _ in range(100):  # 0.4 s at 250 Hz
        env.step([0.0])
    passed = time.perf_counter() - began
    assert passed > 0.35
    env.close()


def test_batch_renders_each_env():
    batch = FurutaVectorEnv(3, render_mode="rgb_array")
    assert batch.render() is None
    batch.reset(options={"state": [[0, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]]})
    a, b, c = batch.render()
    assert (a != b).any()
    np.testing.assert_array_equal(a, c)
    np.testing.assert_array_equal(a, frame_of([0, 0, 0, 0]))
    batch.close()


def test_missing_pygame_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pygame", None)
    with pytest.raises(gym.error.DependencyNotInstalled, match="pip install"):
        Viewer()


def test_no_render_mode_warns():
    env = FurutaEnv()
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None
