"""What the sliders of the what-if view move."""

from __future__ import annotations

import math

from experiments.studio.what_if import moved_by_hand
from furuta_gym.plant import TABLE_3, Effect


def test_what_was_learned_can_be_switched_and_not_moved() -> None:
    learned, spring = Effect("arm_learned", {"c33": 0.1}), TABLE_3.default_effect("arm_spring")
    assert moved_by_hand(learned.type, learned.parameters) == []
    assert [p.name for p in moved_by_hand(spring.type, spring.parameters)] == ["k", "q1n"]
    assert moved_by_hand(spring.type, {"k": math.inf, "q1n": 0.0})[0].name == "q1n"
