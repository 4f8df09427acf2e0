"""Output through an encoding that lacks letters."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from experiments.cli.letters import plain, without_controls


def _furuta(encoding: str, *arguments: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "furuta_command", *arguments]
    return subprocess.run(command, capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding})


@pytest.mark.parametrize("encoding", ["latin-1", "cp1252"])
def test_a_page_with_greek_letters_is_printed(encoding: str) -> None:
    whole, poor = _furuta("utf-8", "effects", "arm_presliding"), _furuta(encoding, "effects", "arm_presliding")
    assert (whole.returncode, poor.returncode, poor.stderr) == (0, 0, b"")
    assert "σ0" in whole.stdout.decode()
    assert "sigma0" in poor.stdout.decode(encoding)
    assert poor.stdout.count(b"\n") == whole.stdout.count(b"\n")


def test_json_is_the_same_in_every_encoding() -> None:
    whole, poor = (_furuta(encoding, "effects", "arm_presliding", "--json") for encoding in ("utf-8", "latin-1"))
    assert json.loads(poor.stdout) == json.loads(whole.stdout)
    assert "σ0" in whole.stdout.decode()


def test_a_name_that_no_encoding_has_is_escaped(tmp_path) -> None:
    (tmp_path / "rig").mkdir()
    name = os.fsdecode(bytes(tmp_path) + b"/rig/\xfcber.csv")
    found = _furuta("utf-8:strict", "bench", "record", "--rig", "rig-01", "--duration", "1", "-o", name)
    assert (found.returncode, found.stderr) == (0, b"")
    assert rb"\udcfcber.csv" in found.stdout


def test_a_handler_that_somebody_chose_is_kept() -> None:
    assert b"?0" in _furuta("latin-1:replace", "effects", "arm_presliding").stdout


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("θ6 ± 0.1 V·s²/rad", "theta6 +- 0.1 V*s^2/rad"),
        ("ΔF −1 ≤ x̂ … ½ ≠ λ", "DeltaF -1 <= x_hat ... 1/2 != lambda"),
        ("ż = q̇1 − q̈2, 10⁻³", "z_dot = q_dot1 - q_ddot2, 10^-3"),
        ("é Å ü ß", r"\xe9 \xc5 \xfc \xdf"),
        ("日 \udcfc", r"\u65e5 \udcfc"),
        ("plain text\t{}", "plain text\t{}"),
    ],
)
def test_letters_are_written_out(text: str, expected: str) -> None:
    assert plain(text) == expected


def test_control_characters_in_a_file_do_not_reach_the_terminal(tmp_path) -> None:
    (tmp_path / "log.csv").write_bytes(b"t,q1,q2,\x1b]0;pwned\x07\x1b[2J\n0,0,0,0\n")
    found = _furuta("utf-8", "identify", str(tmp_path / "log.csv"), "-o", str(tmp_path / "rig.json"))
    assert found.returncode == 2
    assert rb"\x1b" in found.stderr
    assert b"\x1b" not in found.stderr + found.stdout
    assert without_controls("one\ttwo\nthree") == "one\ttwo\nthree"
