"""The console script says which folder is in the way of its own packages."""

import os
import shutil
import subprocess
import sys
import types
from pathlib import Path

import pytest

import furuta_command

HOME = Path(furuta_command.__file__).parent


def start(folder: Path, *first: Path) -> subprocess.CompletedProcess[str]:
    """`furuta --help` as the script does it, with `first` before the project on the path."""
    path = os.pathsep.join(map(str, (*first, HOME)))
    code = "import sys; sys.path.pop(0); from furuta_command import main; sys.argv = ['furuta', '--help']; main()"
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.parametrize("name", furuta_command.PACKAGES)
@pytest.mark.parametrize("kind", ["package", "module"])
def test_another_package_in_the_way(name: str, kind: str, tmp_path: Path) -> None:
    if kind == "package":
        (tmp_path / name).mkdir()
        other = tmp_path / name
        (other / "__init__.py").write_text("raise SystemExit('it was run')")
    else:
        other = tmp_path / f"{name}.py"
        other.write_text("raise SystemExit('it was run')")
    answer = start(tmp_path, tmp_path)
    assert answer.returncode == 2
    assert answer.stderr.startswith(f"Error: {other} is in the way of furuta-gym's own package {name!r}")
    assert "PYTHONPATH" in answer.stderr
    assert "Traceback" not in answer.stderr


def test_nothing_in_the_way(tmp_path: Path) -> None:
    """Folders without a package in them, and one behind on the path, are in nobody's way."""
    (tmp_path / "experiments").mkdir()
    (tmp_path / "experiments" / "notes.txt").touch()
    answer = start(tmp_path, tmp_path)
    assert answer.returncode == 0, answer.stderr
    assert "identify" in answer.stdout


def test_an_installation_that_is_not_whole(tmp_path: Path) -> None:
    shutil.copy(furuta_command.__file__, tmp_path)
    (tmp_path / "furuta_gym").mkdir()
    assert furuta_command.in_the_way(tmp_path).startswith(f"{tmp_path / 'furuta_gym'} is missing")


def test_the_script_is_this_one() -> None:
    assert 'furuta = "furuta_command:main"' in (HOME / "pyproject.toml").read_text(encoding="utf-8")


def test_ctrl_c_while_the_program_loads(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    class Loading(types.ModuleType):
        def __getattr__(self, name: str) -> None:
            raise KeyboardInterrupt if name == "main" else AttributeError(name)

    monkeypatch.setitem(sys.modules, "experiments.cli", Loading("experiments.cli"))
    with pytest.raises(SystemExit) as ended:
        furuta_command.main()
    assert ended.value.code == 130
    assert capsys.readouterr().err.startswith("Interrupted. Nothing was written")
