"""The films of `docs/envs`: a shipped policy at work in each environment that learners use.

python -m experiments.env_films [FOLDER]
"""

import sys
from pathlib import Path

import gymnasium as gym
import numpy as np

import furuta_gym  # noqa: F401  (registers the ids)
from controllers import make_controller
from furuta_gym.envs import TASK_IDS
from furuta_gym.plant import QUBE

ROOT = Path(__file__).parents[1]
SIZE = (360, 240)  # pixels
COLOURS = 32
EVERY = 2  # actions a picture: 25 pictures a second
LENGTH = 5.0  # s


def film(task: str, folder: Path) -> Path:
    """Write `folder`/ID.gif of one short episode, in real time."""
    from PIL import Image

    env = gym.make(TASK_IDS[task], render_mode="rgb_array", time_limit=LENGTH)
    setup = env.unwrapped.setup  # type: ignore[attr-defined]
    name = task.replace("_", "-")
    policy = make_controller(str(ROOT / "controllers" / "policies" / f"{name}-qube.zip"), QUBE, setup.action_period)
    _, info = env.reset(seed=1)
    pictures, over, count = [], False, 0
    while not over:
        u = float(policy(info["measured_state"][:2]))
        _, _, terminated, truncated, info = env.step(np.array([u / QUBE.u_max], dtype=np.float32))
        over = terminated or truncated
        count += 1
        if count % EVERY == 0:
            small = Image.fromarray(env.render()).resize(SIZE, Image.Resampling.LANCZOS)  # type: ignore[arg-type]
            pictures.append(small.quantize(COLOURS, dither=Image.Dither.NONE))
    env.close()
    path = folder / f"{TASK_IDS[task]}.gif"
    first, *others = pictures
    first.save(path, save_all=True, append_images=others, duration=1000 * EVERY * setup.action_period, loop=0)
    return path


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "envs"
    folder.mkdir(parents=True, exist_ok=True)
    for task in TASK_IDS:
        print(film(task, folder))


if __name__ == "__main__":
    main()
