"""Films show the controller at work, for as long as it holds."""

import numpy as np
import pytest

from controllers import make_controller
from controllers.comparison.film import PICTURES, SIZE, film
from furuta_gym.plant import QUBE
from furuta_gym.sensors import Sensors

imageio = pytest.importorskip("imageio.v3", reason="films need the extra `report`")
pytest.importorskip("pygame", reason="films need the extra `report`")


def pictures(path):
    return imageio.imread(path, index=None)


def test_a_film_shows_the_pendulum_come_upright(tmp_path):
    path = film(QUBE, make_controller("lqg", QUBE), 0.004, Sensors(), tmp_path / "lqg.gif", seconds=1.0)
    frames = pictures(path)
    assert frames.shape[0] == pytest.approx(PICTURES + 1, abs=1)
    assert frames.shape[1:3] == SIZE[::-1]
    moved = np.abs(frames[0].astype(int) - frames[-1].astype(int)).sum(axis=-1) > 60
    assert moved.any()
    assert imageio.immeta(path)["duration"] == 1000 / PICTURES


def test_it_ends_when_the_pendulum_falls(tmp_path):
    path = film(QUBE, lambda y: 0.0, 0.004, Sensors(), tmp_path / "fallen.gif", seconds=3.0)
    assert len(pictures(path)) < 1.0 * PICTURES  # leaning by 0.1 rad, it falls past 0.5 within half a second


def test_hanging_starts_and_seeds(tmp_path):
    up = make_controller("swing-up", QUBE)
    one, again, other = (
        pictures(film(QUBE, up, 0.004, Sensors(), tmp_path / "up.gif", task="swing_up", seconds=0.2, seed=seed))
        for seed in (1, 1, 2)
    )
    assert (one == again).all()
    assert (one[0] != other[0]).any()
