"""Cells of a recurrent policy as plain numbers: one layer of long short-term memory, played by numpy."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

Array = NDArray[np.float64]


class CellState(NamedTuple):
    """What the cells carry from one observation to the next: their output and their content, (L, cells) each."""

    output: Array
    content: Array


@dataclass(frozen=True)
class Cells:
    """One LSTM layer with forget gates (Gers, Schmidhuber & Cummins 2000).

    w: gates' weights of the input, (4 cells, inputs); r: of the cells' last output, (4 cells, cells); bias:
    (4 cells,). Blocks of rows: input gate, forget gate, new content, output gate. beside: whether the input goes on to
    the next layer beside the cells' output.
    """

    w: NDArray[np.float32]
    r: NDArray[np.float32]
    bias: NDArray[np.float32]
    beside: bool

    @property
    def size(self) -> int:
        """How many cells."""
        return self.r.shape[1]

    @property
    def outputs(self) -> int:
        """Numbers that go on to the next layer."""
        return self.size + self.beside * self.w.shape[1]

    def start(self, lanes: int) -> CellState:
        """The state before the first observation."""
        return CellState(np.zeros((lanes, self.size)), np.zeros((lanes, self.size)))

    def __call__(self, x: Array, state: CellState) -> tuple[Array, CellState]:
        """(L, outputs) for inputs (L, n), and the next state."""
        sums = x @ self.w.T.astype(float) + state.output @ self.r.T.astype(float) + self.bias
        taken, kept, new, shown = np.split(sums, 4, axis=1)
        content = expit(kept) * state.content + expit(taken) * np.tanh(new)
        output = expit(shown) * np.tanh(content)
        return (np.hstack([output, x]) if self.beside else output), CellState(output, content)


def cells_of(policy: Any, inputs: int) -> Cells | None:
    """The cells of the actor of sb3-contrib's RecurrentPPO; None of a policy without.

    Raises ValueError for cells other than one plain layer with biases."""
    lstm = getattr(policy, "lstm_actor", None)
    if lstm is None:
        return None
    if lstm.num_layers != 1 or lstm.bidirectional or lstm.proj_size or not lstm.bias:
        raise ValueError("a policy with other cells than one plain layer of LSTM cannot be exported")
    w, r, b, c = (
        getattr(lstm, name).detach().numpy().copy()
        for name in ("weight_ih_l0", "weight_hh_l0", "bias_ih_l0", "bias_hh_l0")
    )
    first = next(iter(policy.mlp_extractor.policy_net), policy.action_net)
    return Cells(w, r, b + c, beside=first.in_features == lstm.hidden_size + inputs)
