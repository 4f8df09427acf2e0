"""A recurrent network of chance, whose cells saturate."""

import numpy as np

from controllers.learned.cells import Cells
from controllers.learned.layers import Layer, Network

COUNT, INPUTS = 8, 6  # cells; q1, sin q2, cos q2, both speeds and the last command


def recurrent_network() -> Network:
    rng = np.random.default_rng(5)

    def numbers(*shape: int) -> np.ndarray:
        return (2.0 * rng.standard_normal(shape)).astype(np.float32)

    cells = Cells(numbers(4 * COUNT, INPUTS), numbers(4 * COUNT, COUNT), numbers(4 * COUNT), beside=True)
    layer = Layer(0.03 * numbers(1, COUNT + INPUTS), 0.03 * numbers(1), "")
    return Network(np.abs(numbers(INPUTS)), (layer,), False, 1.0, cells)
