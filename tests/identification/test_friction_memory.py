"""Memories of friction along a way: what they are bounded by, and where they end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from identification.friction_memory import bristle, stop

ways = arrays(np.float64, st.integers(2, 60), elements=st.floats(-1.0, 1.0)).map(np.cumsum)


@pytest.mark.parametrize("memory", [stop, bristle])
@given(way=ways, travel=st.floats(1e-3, 10.0))
@settings(max_examples=60, deadline=None)
def test_a_memory_is_bounded_and_odd_and_knows_no_zero(memory, way, travel):
    z = memory(way, travel)
    assert np.abs(z).max() <= 1.0
    np.testing.assert_allclose(memory(-way, travel), -z, atol=1e-12)
    np.testing.assert_allclose(memory(way + 1.0, travel), z, atol=1e-9 / travel)
    np.testing.assert_allclose(memory(3.0 * way, 3.0 * travel), z, atol=1e-9)


def test_one_way_is_exact_whatever_the_samples():
    for n in (2, 5, 500):
        way = np.linspace(0.0, 0.3, n)
        assert stop(way, 0.5)[-1] == pytest.approx(0.6)
        assert stop(way, 0.2)[-1] == 1.0
        assert bristle(way, 0.2)[-1] == pytest.approx(1.0 - np.exp(-1.5))


def test_a_reversal_takes_twice_the_travel():
    way = np.concatenate([np.linspace(0.0, 1.0, 101), np.linspace(1.0, 0.8, 21)[1:], np.linspace(0.8, 0.0, 81)[1:]])
    z = stop(way, 0.1)
    assert z[100] == 1.0
    assert z[110] == pytest.approx(0.0, abs=1e-9)
    assert z[120] == pytest.approx(-1.0)
    assert z[-1] == -1.0
