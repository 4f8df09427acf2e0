"""What the encoders of an env read: noise that was drawn, and a zero that is elsewhere."""

from functools import partial

import numpy as np
import pytest

from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import QUBE


def test_drawn_noise_acts_on_readings_too():
    env = FurutaEnv(randomize="noise_std=0.01", encoder_counts=0, task="swing_up")
    env.reset(seed=0, options={"state": [0.1, np.pi, 0, 0]})
    infos = [env.step([0.0])[4] for _ in range(2000)]
    errors = np.array([info["measured_state"][:2] - info["state"][:2] for info in infos])
    assert errors.std(axis=0) == pytest.approx([0.01, 0.01], rel=0.06)


@pytest.mark.parametrize(
    ("plant", "options"),
    [
        (QUBE, {"encoder_offset": (0.1, -0.2)}),
        (QUBE.replace(sensors={"offset": [0.1, -0.2]}), {}),
        (QUBE.replace(sensors={"offset": [0.5, 0.5]}), {"encoder_offset": (0.1, -0.2)}),
        (QUBE, {"randomize": "encoder_offset=uniform:-0.3,0.3"}),
        (QUBE.replace(sensors={"offset": [0.5, 0.5]}), {"randomize": "encoder_offset=uniform:-0.3,0.3"}),
    ],
    ids=["option", "plant file", "option beats plant file", "drawn", "drawn beats plant file"],
)
def test_encoders_read_their_offset_at_zero(plant, options):
    """From the first reading on, alone and in a batch."""
    env, batch = (make(plant=plant, encoder_counts=0, **options) for make in (FurutaEnv, partial(FurutaVectorEnv, 3)))
    for one, still in ((env, [0.0]), (batch, np.zeros((3, 1), np.float32))):
        info = one.reset(seed=0)[1]
        offset = info["rig"]["encoder_offset"] if "randomize" in options else np.array([0.1, -0.2])
        assert np.abs(offset).max() <= 0.3
        for now in (info, one.step(still)[4]):
            read = now["measured_state"][..., :2] - now["state"][..., :2]
            np.testing.assert_allclose(read, np.broadcast_to(offset, read.shape), rtol=0.0, atol=1e-12)
