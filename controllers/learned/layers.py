"""A learned policy as plain numbers: the layers of its network, played by numpy."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import Cells, CellState, cells_of

Floats = NDArray[np.floating[Any]]  # observations come in single or double precision

ACTIVATIONS = {"Tanh": np.tanh, "ReLU": lambda x: np.maximum(x, 0.0)}
_STEPS, _LANES = 8, 32  # of the random observations on which a network that was read is held against the model
_TOLERANCE = 1e-4  # of the action's range, between these numbers and the model's own answer in float32


@dataclass(frozen=True)
class Layer:
    """y = activation(W x + b). weight (out, in), bias (out,); activation: "Tanh", "ReLU" or "" for none."""

    weight: NDArray[np.float32]
    bias: NDArray[np.float32]
    activation: str

    def __call__(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        y = x @ self.weight.T.astype(float) + self.bias
        return ACTIVATIONS[self.activation](y) if self.activation else y


@dataclass(frozen=True)
class Network:
    """Observation to action: times `scale` (n,), through the cells and layers, then squashed or clipped to ±`limit`.

    squashed: the action is limit · tanh(last layer); else the last layer clipped to ±limit. cells: memory of a
    recurrent policy; None without.
    """

    scale: NDArray[np.float32]
    layers: tuple[Layer, ...]
    squashed: bool
    limit: float
    cells: Cells | None = None

    @property
    def size(self) -> int:
        """Entries of an observation."""
        return self.scale.size

    def begin(self) -> Callable[[Floats], NDArray[np.float64]]:
        """Observations (L, n) to actions (L, 1), one call after the other; cells begin empty and remember."""
        return self if self.cells is None else _Playing(self, self.cells)

    def __call__(self, observations: Floats) -> NDArray[np.float64]:
        """Actions (L, 1) for observations (L, n). Raises ValueError for a network with cells, which must remember."""
        if self.cells is not None:
            raise ValueError("a network with cells is played by begin(), which remembers the episode")
        return self.act(self.scaled(observations))

    def scaled(self, observations: Floats) -> NDArray[np.float64]:
        """Observations as cells and layers take them."""
        return np.asarray(observations, dtype=float) * self.scale.astype(float)

    def act(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Actions for what the layers take: scaled observations, or the cells' answer to them."""
        for layer in self.layers:
            x = layer(x)
        return self.limit * np.tanh(x) if self.squashed else np.clip(x, -self.limit, self.limit)


class _Playing:
    """A recurrent network on its way through an episode."""

    def __init__(self, network: Network, cells: Cells) -> None:
        self.network, self.cells = network, cells
        self.state: CellState | None = None

    def __call__(self, observations: Floats) -> NDArray[np.float64]:
        scaled = self.network.scaled(observations)
        x, self.state = self.cells(scaled, self.state or self.cells.start(len(scaled)))
        return self.network.act(x)


def network_in(controller: Any) -> Network:
    """The network that a learned controller plays. Raises ValueError where it plays something else."""
    if not isinstance(controller.predict, Network):
        raise ValueError(f"{controller.name} plays no network that can be exported; expected a policy file *.zip")
    return controller.predict


def network_of(model: Any) -> Network:
    """The network of stable-baselines3's PPO, A2C, SAC, TQC, TD3 or DDPG with an `MlpPolicy` and one action, or of
    sb3-contrib's RecurrentPPO.

    Raises ValueError if the policy is of another kind: what is read is played against `model.predict` on 256 random
    observations, and any difference means that it was not understood.
    """
    policy = model.policy
    actor = getattr(policy, "actor", None) or policy
    try:
        extractor = getattr(actor, "pi_features_extractor", None) or actor.features_extractor
        if hasattr(policy, "action_net"):
            modules, squashed = [policy.mlp_extractor.policy_net, policy.action_net], bool(policy.squash_output)
        elif hasattr(actor, "latent_pi"):
            modules, squashed = [actor.latent_pi, actor.mu], True
        else:
            modules, squashed = [actor.mu], True  # TD3's network, whose last module is the tanh that squashes
        layers = _layers(modules)
        if squashed and layers[-1].activation == "Tanh":
            layers = (*layers[:-1], replace(layers[-1], activation=""))
    except AttributeError as error:
        raise ValueError(f"a policy of the class {type(policy).__name__} cannot be exported ({error})") from error
    n = int(model.observation_space.shape[0])
    scale = extractor.scale.numpy() if hasattr(extractor, "scale") else np.ones(n, dtype=np.float32)
    network = Network(scale, layers, squashed, float(model.action_space.high[0]), cells_of(policy, n))
    _check(network, model)
    return network


def _layers(modules: Iterable[Any]) -> tuple[Layer, ...]:
    found: list[Layer] = []
    for module in _flat(modules):
        kind = type(module).__name__
        if kind == "Linear":
            weight, bias = module.weight.detach().numpy(), module.bias.detach().numpy()
            found.append(Layer(weight.copy(), bias.copy(), ""))
        elif kind in ACTIVATIONS and found and not found[-1].activation:
            found[-1] = Layer(found[-1].weight, found[-1].bias, kind)
        else:
            raise ValueError(f"layer {kind} cannot be exported; there are Linear, {', '.join(ACTIVATIONS)}")
    return tuple(found)


def _flat(modules: Iterable[Any]) -> Iterable[Any]:
    for module in modules:
        if type(module).__name__ == "Sequential":
            yield from _flat(module)
        else:
            yield module


def _check(network: Network, model: Any) -> None:
    rng = np.random.default_rng(0)
    observations = (rng.standard_normal((_STEPS, _LANES, network.size)) / network.scale).astype(np.float32)
    play, state, errors = network.begin(), None, []
    for k, seen in enumerate(observations):
        expected, state = model.predict(seen, state, np.full(_LANES, k == 0), deterministic=True)
        errors.append(np.abs(play(seen.astype(float)) - expected))
    error = float(np.max(errors))  # NaN where there is one
    if not error <= _TOLERANCE * network.limit:
        raise ValueError(f"this policy's network was not understood: its actions differ by {error:.2g}")
