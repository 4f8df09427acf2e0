"""A controller at work as an animated GIF, drawn by the environment."""

import copy
import os
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from furuta_gym.extras import install
from furuta_gym.plant import Plant
from furuta_gym.sensors import Sensors

from .trials import start_angle

PICTURES = 20  # per second
SIZE = (480, 320)  # pixels
LEAN = 0.1  # rad; of the pendulum where a balancing film starts


def require_film() -> None:
    """Raises ValueError without the libraries that a film is made with, to be called before long work."""
    if lacking := [name for name in ("imageio", "pygame", "PIL") if find_spec(name) is None]:
        raise ValueError(f"a film needs {' and '.join(lacking)}: {install('report')}")


def film(
    plant: Plant,
    policy: Any,
    sample_time: float,
    sensors: Sensors,
    path: str | os.PathLike[str],
    *,
    task: str = "balance",
    seconds: float = 6.0,
    seed: int = 0,
) -> Path:
    """Play `policy` (readings in, command out) on `plant` and write a GIF, in real time.

    task: "balance" starts leaning, "swing_up" hanging. The film ends early if the pendulum falls or the arm winds up.
    Raises ValueError without imageio and pygame.
    """
    require_film()
    import imageio.v3 as imageio
    from PIL import Image

    from furuta_gym.envs import FurutaEnv

    env = FurutaEnv(
        plant,
        task,
        render_mode="rgb_array",
        sample_time=sample_time,
        encoder_counts=sensors.encoder_counts,
        noise_std=sensors.noise_std,
        encoder_offset=sensors.offset,
    )
    player = copy.deepcopy(policy)
    if hasattr(player, "reset"):
        player.reset()
    lean = (start_angle(env.setup.arm_limit), LEAN, 0.0, 0.0)
    _, info = env.reset(seed=seed, options={"state": lean} if task == "balance" else None)
    pictures = []
    for k in range(round(seconds / sample_time) + 1):
        if k * sample_time * PICTURES >= len(pictures):
            picture = env.render()
            assert picture is not None
            small = np.asarray(Image.fromarray(picture).resize(SIZE, Image.Resampling.LANCZOS))
            while k * sample_time * PICTURES >= len(pictures):
                pictures.append(small)
        u = float(player(info["measured_state"][:2]))
        _, _, over, _, info = env.step(np.array([u], dtype=np.float32))
        if over:
            break
    env.close()
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    imageio.imwrite(path, np.stack(pictures), duration=1000 / PICTURES, loop=0)
    return path
