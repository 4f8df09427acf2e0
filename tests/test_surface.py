"""The public names: quick to import, and documented."""

from __future__ import annotations

import inspect
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import pytest

import controllers
import furuta_gym
import identification

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = (furuta_gym, identification, controllers)
NAMES = [(package.__name__, name) for package in PACKAGES for name in package.__all__]
HEAVY = ("torch", "stable_baselines3", "matplotlib", "plotly", "mujoco", "numba", "pandas", "control", "scipy")
CONSTANTS = ("EFFECTS", "CONTROLLERS")
PROMISED = {
    "furuta_gym": "Plant Effect simulate",
    "identification": "read_log read_logs write_log Log identify Estimate validate Gap diagnose Diagnosis excite",
    "controllers": "make_controller compare train export_c export_onnx export_mjcf",
}


def public(package: str, name: str) -> object:
    return getattr(sys.modules[package], name)


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_importing_the_packages_loads_nothing_heavy() -> None:
    loaded = run(
        "import gymnasium, sys; before = set(sys.modules)\n"
        "import furuta_gym, identification, controllers\n"
        "print(*{name.split('.')[0] for name in set(sys.modules) - before})"
    ).split()
    assert "furuta_gym" in loaded
    assert not set(HEAVY) & set(loaded)


def test_furuta_gym_takes_at_most_half_a_second_beyond_gymnasium() -> None:
    code = "import time, gymnasium; began = time.process_time()\nimport furuta_gym; print(time.process_time() - began)"
    assert min(float(run(code)) for _ in range(2)) <= 0.5


@pytest.mark.parametrize("package", PROMISED)
def test_the_names_that_others_rely_on_are_public(package: str) -> None:
    module = sys.modules[package]
    assert set(PROMISED[package].split()) <= set(module.__all__)
    assert set(module.__all__) <= set(dir(module))
    with pytest.raises(AttributeError, match="gremlin"):
        _ = module.gremlin


def test_no_public_name_is_taken_by_a_submodule() -> None:
    """`import furuta_gym.simulate` would put the module in the function's place."""
    for package in PACKAGES:
        (folder,) = package.__path__
        inside = {p.stem for p in Path(folder).iterdir() if p.suffix == ".py" or p.is_dir()}
        assert not inside & set(package.__all__)


@pytest.mark.parametrize("package", ["furuta_gym", "identification", "controllers"])
def test_types_are_shipped(package: str) -> None:
    assert (ROOT / package / "py.typed").is_file()


@pytest.mark.parametrize(("package", "name"), NAMES)
def test_every_public_name_is_documented(package: str, name: str) -> None:
    thing = public(package, name)
    if name in CONSTANTS:
        return
    text = inspect.getdoc(thing) or ""
    assert len(text) > 20
    assert name in pydoc.render_doc(thing)
    if isinstance(thing, type):
        fields = " ".join(map(str, inspect.get_annotations(thing).values()))
        if re.search(r"NDArray|ndarray|Array\b", fields):
            assert re.search(r"\(\w+,|length n", text), "an array without its shape"
            assert re.search(r"\[\w+|unit", text), "an array without its unit"
        if "__post_init__" in thing.__dict__:
            assert "Raises" in text
        return
    assert callable(thing)
    signature = inspect.signature(thing)
    for parameter in signature.parameters.values():
        assert parameter.annotation is not inspect.Parameter.empty
    if any(word in _source(thing) for word in ("raise ", "Plant.resolve")):
        assert re.search(r"Raises|refused", text)
    if name not in ("open_loop", "register") and re.search(r"duration|sample_time|horizon", str(signature)):
        assert re.search(r"\[s\]|seconds", text)
    if re.search(r"NDArray|ArrayLike|Simulation", str(signature)):
        assert re.search(r"\[|\(", text)


def _source(thing: object) -> str:
    return inspect.getsource(thing)


@pytest.mark.parametrize("package", ["furuta_gym", "identification", "controllers"])
def test_help_shows_the_public_names(package: str) -> None:
    text = pydoc.render_doc(sys.modules[package], renderer=pydoc.plaintext)
    shown = [name for name in sys.modules[package].__all__ if re.search(rf"\b{name}\b", text)]
    assert shown == list(sys.modules[package].__all__)
