"""Where machine code is kept."""

from __future__ import annotations

from pathlib import Path
from types import FunctionType

import numba
import pytest

from furuta_gym.plant import dynamics
from furuta_gym.plant.compiled import compiled, source_hash


def another(function: FunctionType, name: str) -> FunctionType:
    return FunctionType(function.__code__, function.__globals__, name, function.__defaults__, function.__closure__)


def test_a_folder_of_numba_s_own_is_split_by_source_too(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Else a kernel would keep the code of another file's kernel that was edited since."""
    source = Path(dynamics.__file__)
    kernel = dynamics.mass_matrix.py_func
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    made = compiled(another(kernel, "mass_matrix"))
    assert source_hash(source) in str(made._cache.cache_path)
    assert str(made._cache.cache_path).startswith(str(tmp_path))
    assert str(tmp_path) == numba.config.CACHE_DIR
