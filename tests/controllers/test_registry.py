"""A controller is its design function and one line in the registry."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from controllers import CONTROLLERS, Controller, DesignError, compare, make_controller, usual_controller
from controllers.linear.law import LinearController
from controllers.registry import Design
from experiments.cli.app import app
from furuta_gym import Plant, Sensors
from furuta_gym.plant import QUBE, TABLE_3, Effect
from furuta_gym.simulation import simulate
from identification import read_log


def design_toy(
    plant: Plant, sample_time: float | None = None, sensors: Sensors | None = None, **options: Any
) -> Controller:
    """A toy: the LQR under another name."""
    controller = make_controller("lqr", plant, sample_time, sensors, **options)
    controller.name = "toy"
    return controller


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CONTROLLERS, "toy", Design(__name__, "design_toy", "the LQR under another name"))


@pytest.mark.usefixtures("toy")
def test_a_registered_controller_is_known_in_python_and_to_the_commands(tmp_path: Path) -> None:
    comparison = compare("table3", ["toy"], trials=4, duration=2.0, groups=["balance"])
    assert "toy" in comparison.scores
    path = tmp_path / "log.csv"
    arguments = ["simulate", "--plant", "table3", "--controller", "toy", "--excitation", "paper", "--duration", "3"]
    result = CliRunner().invoke(app, [*arguments, "-o", str(path)])
    assert result.exit_code == 0, result.output
    gain = read_log(path).controller_gain
    assert gain == pytest.approx(make_controller("lqr", TABLE_3).feedback_gain)


@pytest.mark.parametrize(
    ("name", "effects", "plain"),
    [
        ("paper-lqr", (), True),
        ("lqr", (), True),
        ("dlqr", (), True),
        ("dlqr", (Effect("input_delay", {"d": 0.004}),), False),
        ("lqg", (), False),
        ("lqr-friction", (), False),
        ("lqi", (), False),
    ],
)
def test_only_plain_state_feedback_says_a_gain(name: str, effects: tuple[Effect, ...], plain: bool) -> None:
    controller = make_controller(name, TABLE_3.with_effects(*effects), 0.002)
    assert (controller.feedback_gain is not None) == plain
    if plain:
        assert isinstance(controller, LinearController)
        k1, _, k2, _ = controller.feedback_gain or (0, 0, 0, 0)
        y = np.array([0.02, -0.01])
        controller.reset()
        assert controller(y) == pytest.approx(-(k1 * y[0] + k2 * y[1]))  # at rest, from the first sample


@pytest.mark.parametrize(
    ("plant", "name"),
    [
        (TABLE_3, "paper-lqr"),
        (QUBE, "lqr"),
        (QUBE.with_effects(Effect("input_delay", {"d": 0.002})), "lqr"),
        (QUBE.with_effects(Effect("input_delay", {"d": 0.03})), "dlqr"),
    ],
)
def test_the_usual_controller_holds_the_plant_that_it_is_for(plant: Plant, name: str) -> None:
    controller = usual_controller(plant)
    assert controller.name == name
    run = simulate(plant, controller, 6.0, x0=(0.0, 0.02, 0.0, 0.0))
    assert np.abs(run.state[:, 1]).max() < 0.5


def test_no_usual_controller_for_what_none_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CONTROLLERS, "dlqr", CONTROLLERS["lqr"])
    monkeypatch.setitem(CONTROLLERS, "lqg", CONTROLLERS["lqr"])
    with pytest.raises(DesignError, match="none of lqr, dlqr, lqg holds this plant"):
        usual_controller(QUBE.with_effects(Effect("input_delay", {"d": 0.03})))
