"""A recurrent policy of sb3-contrib beside whose cells the observation passes."""

from typing import Any

import torch
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor


class RememberingPolicy(RecurrentActorCriticPolicy):
    """An `MlpLstmPolicy` whose layers take the scaled observation beside the output of the LSTM.

    What a policy without memory needs is there from the first update on; the cells add what the past says of the rig.
    Without it the same training needs more than twice the steps (docs/decisions/022-recurrent-policies.md). Actor and
    critic must have cells of their own.
    """

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = MlpExtractor(
            self.lstm_output_dim + self.features_dim, self.net_arch, self.activation_fn, self.device
        )

    @staticmethod
    def _process_sequence(features: Any, lstm_states: Any, episode_starts: Any, lstm: Any) -> tuple[Any, Any]:
        seen, states = RecurrentActorCriticPolicy._process_sequence(features, lstm_states, episode_starts, lstm)
        return torch.cat([seen, features], dim=1), states
