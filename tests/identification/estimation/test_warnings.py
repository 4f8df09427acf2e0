"""What a fit says of friction that ends at zero: a wrong sign only where the motion shows one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Plant
from identification.estimation.most_likely import _warnings
from identification.kalman.noise_model import Noise
from identification.kalman.record import stretches
from identification.logs.log import Log
from tests.factories import loop_log

WITHOUT = TABLE_3.replace(theta=[*TABLE_3.theta[:7], 0.0, TABLE_3.theta[8]])


def warned(logs: list[Log], plant: Plant, at_bound: list[str], noise: Noise) -> list[str]:
    return list(_warnings(logs, plant, at_bound, noise, [stretch.record for stretch in stretches(logs)]))


def said(log: Log, plant: Plant = WITHOUT) -> str:
    return "\n".join(warned([log], plant, ["theta8"], Noise((1e-9, 1e-9))))


@pytest.mark.parametrize("size", [1.0, 10.0])
def test_friction_that_ends_at_zero_is_an_effect_that_is_missing(size: float) -> None:
    """On real rigs with right signs it ends there, as a cable takes its part."""
    told = said(loop_log("arm_spring", size, duration=6.0)[0])
    assert "θ8 ends at zero" in told
    assert "an effect is probably missing" in told
    assert "sign" not in told
    assert "flip" not in told


def test_a_sign_is_blamed_where_the_motion_shows_it() -> None:
    log, _ = loop_log(duration=6.0)
    told = said(replace(log, u=-log.u))
    assert "as a wrong sign does" in told
    assert "a positive command turns the arm towards negative q1" in told
    assert "--flip" in told
    assert "an effect is probably missing" not in told


def test_two_frictions_that_end_at_zero_are_one_sentence() -> None:
    bounds = ["theta6", "theta8"]
    told = warned([loop_log(duration=6.0)[0]], WITHOUT, bounds, Noise((1e-9, 1e-9)))
    assert [line for line in told if "zero" in line] == [
        "θ6, θ8 end at zero, their bound: this log asks for negative friction, which no rig has; so an effect is "
        "probably missing (`furuta diagnose` looks for it)"
    ]


def test_readings_without_counts_are_as_noisy_as_they_look() -> None:
    """Their variance is taken as a quarter of what the log shows at least, so a right fit has a factor of four."""
    log, _ = loop_log(duration=3.0)
    noisy = np.random.default_rng(0).normal(0.0, 1e-3, (2, len(log)))
    without = replace(log, q1=log.q1 + noisy[0], q2=log.q2 + noisy[1], encoder_counts=None)
    count = 2 * np.pi / 4096
    rounded = (count * np.round(q / count) for q in (without.q1, without.q2))
    converter = replace(without, **dict(zip(("q1", "q2"), rounded, strict=True)), encoder_counts=(4096.0, 4096.0))
    cases = ((without, 4.1, False), (without, 17.0, True), (log, 5.0, True), (converter, 4.1, False))
    for seen, factor, told in cases:
        noise = Noise((1e-9, 1e-9), (factor, factor))
        lines = warned([seen], WITHOUT, [], noise)
        assert any("twice as noisy" in line for line in lines) is told


def test_a_free_decay_says_nothing_of_the_size_of_commands() -> None:
    """Beside it, a missing torque is the same share of the command."""
    log, _ = loop_log(duration=6.0)
    still = replace(log, u=np.zeros(len(log)), source="decay.csv")
    noise = Noise((0.1 * (0.5 * float(np.sqrt(np.mean(log.u**2)))) ** 2, 1e-9))
    (alone,) = (line for line in warned([log], TABLE_3, [], noise) if "of the command" in line)
    (beside,) = (line for line in warned([log, still], TABLE_3, [], noise) if "of the command" in line)
    assert beside == alone


def test_logs_of_one_name_are_told_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """The wrong sign of the first is not lost behind a second log of the same name."""
    log, _ = loop_log(duration=6.0)
    wrong = replace(log, u=-log.u)
    told = "\n".join(warned([wrong, log], WITHOUT, ["theta8"], Noise((1e-9, 1e-9))))
    assert wrong.source == log.source
    assert "--flip" in told


def test_a_missing_torque_above_the_command_is_first_a_question_of_its_sign() -> None:
    log, _ = loop_log(duration=6.0)
    command = float(np.sqrt(np.mean(log.u**2)))

    def told(share: float) -> str:
        return "\n".join(warned([log], TABLE_3, [], Noise((0.1 * (share * command) ** 2, 1e-9))))

    assert "(300 % of the command): more than the command itself: check its sign first (--flip u)" in told(3.0)
    assert "(50 % of the command): something acts" in told(0.5)
    assert "flip" not in told(0.5)
