"""Output through an encoding that lacks letters."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from experiments.cli.letters import plain


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


def test_an_error_about_a_file_whose_name_no_encoding_has_is_a_sentence(tmp_path) -> None:
    name = os.fsdecode(bytes(tmp_path) + b"/\xfcber.csv")
    found = _furuta("utf-8", "identify", name, "-o", str(tmp_path / "rig.json"))
    assert found.returncode == 2
    assert b"ber.csv" in found.stderr
    assert b"Traceback" not in found.stderr
    assert b"codec" not in found.stderr


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("θ6 ± 0.1 V·s²/rad", "theta6 +- 0.1 V*s^2/rad"),
        ("ΔF −1 ≤ x̂ … ½", "DeltaF -1 <= x ... 1/2"),
        ("é Å ü ß", "e A u ss"),
        ("日 \udcfc", "? ?"),
        ("plain text\t{}", "plain text\t{}"),
    ],
)
def test_letters_are_written_out(text: str, expected: str) -> None:
    assert plain(text) == expected
