"""The name under which Gymnasium knows the environments, and how long an episode lasts."""

ENV_ID = "FurutaID-v0"
MAX_EPISODE_STEPS = 1000  # 10 s at the default 100 Hz


def register() -> None:
    """Make `FurutaID-v0` known to Gymnasium; calling it again changes nothing."""
    from gymnasium.envs.registration import register as gymnasium_register
    from gymnasium.envs.registration import registry

    if ENV_ID not in registry:
        gymnasium_register(
            id=ENV_ID,
            entry_point="furuta_gym.envs.furuta:FurutaEnv",
            vector_entry_point="furuta_gym.envs.vector:FurutaVectorEnv",
            max_episode_steps=MAX_EPISODE_STEPS,
        )
