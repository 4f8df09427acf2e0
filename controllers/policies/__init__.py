"""Policies that come with the project, each with its record beside it.

`python -m controllers.policies FOLDER` learns them all anew (about two minutes of CPU).
"""

from collections.abc import Mapping
from pathlib import Path

from ..training.train import Training, train

FOLDER = Path(__file__).parent

SHIPPED: Mapping[str, tuple[str, str, int]] = {
    "swing-up-qube": ("qube", "swing_up", 2_000_000),
    "balance-table3": ("table3", "balance", 500_000),
    "balance-qube": ("qube", "balance", 500_000),
    "balance-large": ("large", "balance", 500_000),
}
"""name: (plant, task, steps), by PPO from seed 0."""


def rebuild(folder: Path) -> list[Path]:
    """Learn every shipped policy into `folder`, which must not hold them yet (ValueError); the files."""
    from furuta_gym.plant import PLANTS

    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for name, (plant, task, steps) in SHIPPED.items():
        path = folder / f"{name}.zip"
        command = f"furuta train --plant {plant} --task {task} --steps {steps} -o {path.name}"
        train(Training(PLANTS[plant], task, steps=steps), path, command=command)
        made.append(path)
    return made
