"""Plants and option sets that the env's tests run over."""

from typing import Any

import numpy as np

from furuta_gym.plant import QUBE, TABLE_3, THETA_NAMES, Covariance, Effect, Plant


def uncertain(plant: Plant = QUBE, share: float = 0.1, *names: str) -> Plant:
    """The plant with a covariance: every θ (and what `names` adds, with its own scale) known to `share` of itself."""
    std = [share * abs(v) for v in plant.theta]
    for name in names:
        effect, _, parameter = name.partition(".")
        std.append(share * plant.effect(effect).parameters[parameter] if parameter else share * plant.sharpness[0])
    all_names = (*THETA_NAMES, *names)
    mix = np.eye(len(std)) + 0.3 * np.random.default_rng(7).uniform(-1, 1, (len(std), len(std)))
    root = np.array(std)[:, None] * mix
    return plant.replace(covariance=Covariance(all_names, root @ root.T))


SPRING = Effect("arm_spring", {"k": 0.3, "q1n": -0.5})

# Every option once, and combinations that share state: delay × jitter × memory, randomisation × effects.
OPTION_SETS: dict[str, dict[str, Any]] = {
    "default": {},
    "swing_up": {"task": "swing_up"},
    "qube": {"plant": "qube", "task": "swing_up"},
    "exact_sensors": {"encoder_counts": 0.0, "sample_time": 0.02},
    "noise_and_jitter": {"noise_std": (1e-3, 2e-3), "jitter": 0.2, "encoder_offset": (0.01, -0.02)},
    "frames": {"history": 3, "observe_command": True, "normalize_action": True},
    "reward": {"reward_weights": {"gentle": 0.4, "calm": 0.1}, "arm_margin": 2.0, "reward_scale": 0.5, "delay": 0.01},
    "delay": {"delay": 0.013, "history": 2},
    "delay_and_jitter": {"delay": 0.031, "jitter": 0.3, "noise_std": 1e-3},
    "memory": {
        "plant": TABLE_3.with_effects(
            Effect("actuator_lag", {"T": 0.02}),
            TABLE_3.default_effect("arm_presliding"),
            Effect("arm_backlash", {"b": 0.01}),
        )
    },
    "stops": {"plant": TABLE_3.with_effects(Effect("arm_hysteresis", {"κ": 2.0, "d": 0.03, "κ2": 0.4, "d2": 0.2}))},
    "randomized": {"plant": uncertain(), "task": "swing_up", "randomize": True},
    "randomized_effects": {
        "plant": uncertain(TABLE_3.with_effects(SPRING), 0.05, "arm_spring.k"),
        "randomize": True,
        "effect_probabilities": {
            "arm_spring": 0.5,
            "input_delay": 0.5,
            "actuator_lag": 0.4,
            "input_saturation": 0.5,
            "arm_backlash": 0.3,
            "periodic_torque": 0.5,
            "friction_sharpness": 0.5,
            "pendulum_encoder_offset": 0.5,
        },
        "noise_std": 5e-4,
    },
}
