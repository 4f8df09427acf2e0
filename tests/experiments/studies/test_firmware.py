"""What exported controllers need on microcontrollers, where the compilers and simulators are there."""

from __future__ import annotations

import shutil

import pytest

from controllers import make_controller
from controllers.exports.c import c_header
from experiments.studies.firmware import __main__ as firmware
from experiments.studies.firmware.__main__ import ARM, AVR, Need, need, row


def _header(name: str = "lqr") -> str:
    return c_header(make_controller(name, "qube"), single=True)


@pytest.mark.parametrize("processor", [AVR, ARM], ids=lambda p: p.name)
def test_a_designed_controller_runs_on_a_small_processor(processor):
    if processor.missing:
        pytest.skip(f"{', '.join(processor.missing)} not found")
    found = need(processor, _header())
    assert isinstance(found, Need)
    assert found.flash < 32_000
    assert found.ram < 1_800
    period = 0.004 * 16e6  # cycles of the Arduino
    assert 35 < found.counts[0] < period  # there are 35 products
    assert found.counts == need(processor, _header()).counts


def test_what_does_not_fit_is_said():
    if AVR.missing:
        pytest.skip(f"{', '.join(AVR.missing)} not found")
    too_large = _header() + "\nstatic volatile const float filler[2000] = {1.0f};\n"
    assert need(AVR, too_large + "static float (*volatile use) = (float *)filler;\n") == "does not fit"
    assert "does not fit" in row("lqr", AVR, "does not fit")


def test_a_processor_without_tools_is_left_out(monkeypatch, capsys):
    monkeypatch.setattr(shutil, "which", lambda tool: None)
    with pytest.raises(ValueError, match="no compiler and simulator"):
        firmware.main()
    assert "ATmega328P is left out: avr-gcc, avr-size, simavr not found" in capsys.readouterr().err
