"""What samples say about their encoder."""

import numpy as np
import pytest

from identification.logs.encoders import encoder_step, noise_std
from tests.factories import paper_log


@pytest.mark.parametrize("counts", [500, 2048, 4096, 10_000])
@pytest.mark.parametrize("offset", [0.0, 0.123])
def test_encoder_step_is_found(counts, offset):
    log, _ = paper_log(counts=None)
    step = 2 * np.pi / counts
    q = np.round(log.q2 / step) * step + offset
    assert encoder_step(q) == pytest.approx(step, rel=1e-6)
    assert encoder_step(np.round(q, 6)) == pytest.approx(step, rel=1e-3)  # as a file with 6 decimals has it


def test_no_encoder_step_where_there_is_none():
    log, _ = paper_log(counts=None)
    assert encoder_step(log.q2) is None
    assert encoder_step(np.zeros(100)) is None
    noisy = np.round(log.q2 * 1000) / 1000 + np.random.default_rng(0).normal(0, 3e-4, len(log))
    assert encoder_step(noisy) is None


@pytest.mark.parametrize("T", [0.001, 0.002, 0.005])
@pytest.mark.parametrize("std", [1e-4, 1e-3])
def test_noise_is_estimated_without_a_model(T, std):
    log, _ = paper_log(T, counts=None)
    rng = np.random.default_rng(1)
    for q in (log.q1, log.q2):
        assert noise_std(q + rng.normal(0, std, len(q)), T) == pytest.approx(std, rel=0.1)


@pytest.mark.parametrize("counts", [1000, 4096])
def test_noise_of_an_encoder_is_its_quantisation(counts):
    log, _ = paper_log(counts=counts)
    expected = 2 * np.pi / counts / np.sqrt(12)
    for found in log.noise_std:
        assert 0.99 * expected < found < 1.1 * expected
