"""Pictures: right in kind, not blank, different where the state differs, and where the state says."""

import gymnasium as gym
import numpy as np
import pytest

from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.rendering import _BOB, _GOOD, HEIGHT, WIDTH, Viewer
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


def test_the_bar_of_the_reward_is_full_at_the_largest_reward():
    bars = []
    for scale in (1.0, 0.1, 10.0):
        env = FurutaEnv(render_mode="rgb_array", reward_scale=scale)
        env.reset(seed=0, options={"state": [0, 0, 0, 0]})
        env.step([0.0])
        bars.append(env.render()[432:450, 500:700])
    np.testing.assert_array_equal(bars[0], bars[1])
    np.testing.assert_array_equal(bars[0], bars[2])
    assert (np.abs(bars[1][9].astype(int) - _GOOD) < 12).all(axis=1).mean() > 0.95


def test_every_start_is_shown_in_the_window(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    painted = []
    paint = Viewer._paint
    monkeypatch.setattr(Viewer, "_paint", lambda self, scene: painted.append(scene.q1) or paint(self, scene))
    env = FurutaEnv(render_mode="human")
    for q1 in (0.1, 0.2):
        env.reset(seed=0, options={"state": [q1, 0, 0, 0]})
    env.close()
    assert painted == [0.1, 0.2]


def test_window_without_a_screen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gym.make("FurutaID-v0", render_mode="human")
    env.reset(seed=0)
    for _ in range(5):
        env.step(env.action_space.sample())
    assert env.render() is None
    env.close()


def test_a_frame_costs_a_fraction_of_the_first_one():
    """The ground and the words are kept. A first frame makes them, here in a viewer of its own each time."""
    import time

    env = FurutaEnv("qube", "swing_up", render_mode="rgb_array")
    env.reset(seed=0)
    env.render()

    def spent(first):
        times = []
        for _ in range(20):
            env.step(env.action_space.sample())
            if first:
                env.close()
            began = time.process_time()
            env.render()
            times.append(time.process_time() - began)
        return np.median(times)

    assert spent(first=False) < 0.6 * spent(first=True)


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
    with pytest.raises(gym.error.ResetNeeded):
        batch.render()
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
