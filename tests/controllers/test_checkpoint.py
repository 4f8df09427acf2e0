"""Checkpoints: two are kept, a broken one falls back to the other, and all of the learning comes back."""

from pathlib import Path

import numpy as np
import pytest

from controllers.training.checkpoint import (
    has_checkpoint,
    only_remains,
    read_checkpoint,
    remove_checkpoints,
    write_checkpoint,
)
from controllers.training.recipes import ALGORITHMS


def arrays(value: float) -> dict[str, dict[str, np.ndarray]]:
    return {"model": {"w": np.full(3, value)}}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for n in (1, 2, 3):
        write_checkpoint(tmp_path, {"steps": n}, arrays(n))
    return tmp_path


def test_the_last_two_are_kept(folder: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == ["000002", "000003"]
    state, found = read_checkpoint(folder)
    assert state == {"steps": 3}
    assert found["model"]["w"].tolist() == [3.0, 3.0, 3.0]


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-5])


def other_byte(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-1] + b"!")


@pytest.mark.parametrize("name", ["state.json", "model.safetensors"])
@pytest.mark.parametrize("damage", [cut, other_byte, Path.unlink])
def test_a_broken_one_falls_back(folder: Path, name: str, damage) -> None:
    damage(folder / "000003" / name)
    with pytest.warns(UserWarning, match=r"000003 is broken.*going on from .*000002"):
        state, _ = read_checkpoint(folder)
    assert state == {"steps": 2}
    write_checkpoint(folder, {"steps": 3}, arrays(3))
    assert read_checkpoint(folder)[0] == {"steps": 3}


def test_without_any_it_says_why(folder: Path) -> None:
    for name in ("000002", "000003"):
        cut(folder / name / "state.json")
    with pytest.raises(ValueError, match=r"no checkpoint is whole.*train anew"):
        read_checkpoint(folder)
    assert read_checkpoint(folder / "none") is None
    assert not has_checkpoint(folder / "none")


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_all_of_the_learning_comes_back(algorithm: str) -> None:
    """A model with the parameters and the memory of another goes on as that one does."""
    pytest.importorskip("stable_baselines3", reason="training needs the extra `rl`")
    import torch
    from stable_baselines3.common.logger import configure

    from controllers.learned import tensors
    from controllers.training.learning_state import memory_of, parameters_of, put_memory, put_parameters
    from controllers.training.model import make_model
    from controllers.training.setup import Training
    from furuta_gym.plant import QUBE

    torch.set_num_threads(1)
    training = Training(QUBE, algorithm=algorithm, steps=10_000)
    first = make_model(training)
    first.learn(900 if training.recipe.off_policy else 8192)
    other = make_model(Training(QUBE, algorithm=algorithm, steps=10_000, seed=7))
    kept = tensors.from_bytes(tensors.to_bytes(parameters_of(first)))
    put_parameters(other, kept)
    assert {name: value.tobytes() for name, value in parameters_of(other).items()} == {
        name: value.tobytes() for name, value in kept.items()
    }
    if training.recipe.off_policy:
        put_memory(other, memory_of(first))
        for model in (first, other):
            model.set_logger(configure(format_strings=[]))
            model.set_random_seed(3)
            model.train(gradient_steps=2, batch_size=16)
        again = parameters_of(other)
        assert all(np.array_equal(value, again[name]) for name, value in parameters_of(first).items())
        with pytest.raises(ValueError, match="memory"):
            put_memory(other, memory_of(first) | {"position": np.array([5])})
    with pytest.raises(ValueError, match="of shape"):
        put_parameters(other, kept | {next(iter(kept)): np.zeros((2, 2), dtype=np.float32)})
    with pytest.raises(ValueError, match="nothing that this algorithm learns"):
        put_parameters(other, kept | {"strange": np.zeros(2)})


def test_what_a_killed_run_was_writing_is_no_checkpoint(tmp_path: Path) -> None:
    folder = tmp_path / "policy.checkpoint"
    assert not only_remains(folder, "policy.zip")
    (folder / "new").mkdir(parents=True)
    (folder / "policy.zip").write_bytes(b"")
    assert only_remains(folder, "policy.zip")
    (folder / "notes.txt").write_bytes(b"")
    assert not only_remains(folder, "policy.zip")
    write_checkpoint(folder, {"steps": 1}, arrays(1.0))
    assert not only_remains(folder, "policy.zip")


def test_a_removal_that_was_killed_is_ended_by_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "policy.checkpoint"
    write_checkpoint(folder, {"steps": 1}, arrays(1.0))
    with monkeypatch.context() as patch:
        patch.setattr("controllers.training.checkpoint.shutil.rmtree", lambda *_, **__: None)
        remove_checkpoints(folder)
    assert not folder.exists()
    assert len(list(tmp_path.iterdir())) == 1
    with monkeypatch.context() as patch:
        patch.setattr("furuta_gym.files._alive", lambda process: False)
        remove_checkpoints(folder)
    assert not list(tmp_path.iterdir())
