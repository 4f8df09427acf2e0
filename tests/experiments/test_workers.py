"""Where trials run."""

from __future__ import annotations

import warnings

import pytest

from experiments.workers import workers


def test_a_worker_that_is_replaced_is_nothing_to_warn_of() -> None:
    with workers("loky", 1):
        warnings.warn(
            "A worker stopped while some jobs were given to the executor. This can be caused by a too short worker "
            "timeout or by a memory leak.",
            UserWarning,
            stacklevel=1,
        )
        with pytest.warns(UserWarning, match="another"):
            warnings.warn("another", UserWarning, stacklevel=1)
