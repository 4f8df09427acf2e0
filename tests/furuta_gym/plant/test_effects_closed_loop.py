"""Every effect at its default size is worth noticing: it changes 20 s of the paper's closed loop beyond a count."""

import numpy as np
import pytest

from furuta_gym.plant import EFFECTS, PAPER_GAIN, TABLE_3
from furuta_gym.plant.advance import advance
from furuta_gym.plant.effects.dispatch import read_sensors
from tests.furuta_gym.plant.helpers import neutral

COUNT = 2 * np.pi / 4096
SAMPLE, DURATION = 0.002, 20.0


def paper_excitation(t: float) -> float:
    """d1 + d2 + d3 below Eq. (24)."""
    return sum(a * (-1.0 if t % period <= period / 2 else 1.0) for a, period in ((1, 2), (0.5, 0.5), (0.25, 0.3333)))


def closed_loops() -> np.ndarray:
    """Readings (samples, 2, lanes): lane 0 is Table 3, lane i + 1 has the i-th effect of the library.

    All lanes carry every effect, each at neutral but one: a batch as a randomised env would run it.
    """
    plants = [TABLE_3.with_effects(*(neutral(name) for name in EFFECTS))]
    plants += [plants[0].with_effects(TABLE_3.default_effect(name)) for name in EFFECTS]
    P, (_, codes, rows) = np.column_stack([plant.packed().p for plant in plants]), plants[0].packed()
    lanes, t_u = len(plants), np.arange(round(DURATION / SAMPLE)) * SAMPLE
    X, Y, U, W = np.zeros((rows, lanes)), np.zeros((2, lanes)), np.zeros((t_u.size, lanes)), np.zeros((2, lanes))
    readings = np.empty((t_u.size, 2, lanes))
    for j, t in enumerate(t_u):
        Y[:] = X[:2]
        read_sensors(X, P, codes, Y)
        readings[j] = Y
        U[j] = paper_excitation(t) - PAPER_GAIN @ [Y[0], X[2], Y[1], X[3]]
        advance(X, t, t + SAMPLE, t_u, U, j, W, P, codes, 1e-3)
    return readings


@pytest.fixture(scope="module")
def changes() -> dict[str, np.ndarray]:
    readings = closed_loops()
    assert np.abs(readings[:, 1, 0]).max() < 0.2  # the paper's loop stands
    differences = np.abs(readings[:, :, 1:] - readings[:, :, :1]).max(axis=0) / COUNT
    table = dict(zip(EFFECTS, differences.T, strict=True))
    print(f"\nlargest change over {DURATION:.0f} s, in counts of 2π/4096{'q1':>14}{'q2':>10}")
    for name, (q1, q2) in table.items():
        print(f"{name:45}{q1:>13.1f}{q2:>10.1f}")
    return table


@pytest.mark.parametrize("name", EFFECTS)
def test_default_size_shows_in_the_closed_loop(changes, name):
    assert np.isfinite(changes[name]).all()
    assert changes[name].max() > 1.0
