"""docs/reference/json.md against what the commands print: no key missing, none invented."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from identification.logs.log import write_log
from identification.logs.reading import read_log

from .commands import furuta
from .factories import loop_log

ROOT = Path(__file__).resolve().parent.parent
LOGS = ROOT / "experiments" / "demo" / "logs"
PAGE = (ROOT / "docs" / "reference" / "json.md").read_text(encoding="utf-8")


def documented(command: str) -> list[str]:
    """The keys in the table of a command, as the page has them."""
    section = PAGE.split(f"## furuta {command}\n", 1)[1].split("\n## ", 1)[0]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    return [key for row in rows for key in re.findall(r"`([^`]+)`", row)]


def paths(found: Any, at: str = "") -> Iterator[str]:
    """Every path of an answer, of objects and lists as well as of what they hold."""
    if at:
        yield at
    if isinstance(found, dict):
        for key, value in found.items():
            yield from paths(value, f"{at}.{key}" if at else key)
    elif isinstance(found, list):
        for value in found:
            if isinstance(value, dict):
                yield from paths(value, f"{at}[]")


def pattern(key: str) -> re.Pattern[str]:
    return re.compile(re.escape(key).replace("NAME", r"[^.]+"))


def compared(command: str, answer: dict[str, Any], *without: str) -> None:
    """without: beginnings of keys that the command prints at other times only."""
    keys, there = documented(command), set(paths(answer))
    assert len(keys) == len(set(keys)) > 3
    assert all(any(key.startswith(begins) for key in keys) for begins in without)
    wanted = [key for key in keys if not key.startswith(without)]
    missing = [key for key in wanted if not any(pattern(key).fullmatch(path) for path in there)]
    assert not missing, f"furuta {command} --json prints no {missing}"

    def told(path: str) -> bool:
        return any(
            (m := pattern(key).match(path)) is not None and path[m.end() : m.end() + 1] in ("", ".", "[")
            for key in keys
        )

    leaves = [
        path
        for path in there
        if not any(other != path and other.startswith((f"{path}.", f"{path}[")) for other in there)
    ]
    assert not [path for path in leaves if not told(path)], f"not in docs/reference/json.md of furuta {command}"


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two runs of the demo's rig, of which six seconds have every key that twenty have."""
    folder = tmp_path_factory.mktemp("logs")
    files = folder / "paper.csv", folder / "wide.csv"
    for file in files:
        write_log(file, read_log(LOGS / file.name).slice(stop=6.0))
    return files


@pytest.fixture(scope="module")
def plant_file(logs: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    file = tmp_path_factory.mktemp("json") / "rig.json"
    result = furuta("identify", logs[0], "-o", file, "--json")
    assert result.exit_code == 0, result.output
    return file, json.loads(result.stdout)


def test_identify(plant_file: tuple[Path, dict[str, Any]]) -> None:
    compared("identify", plant_file[1], "gap_remark", "profiles", "one_by_one.", "gain_changes[")


def test_identify_with_a_profile_and_without_a_gap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiments.cli.identify._adequacy", lambda *_: (None, "no log is long enough"))
    write_log(tmp_path / "log.csv", loop_log(duration=5.0, T=0.004)[0])
    result = furuta("identify", tmp_path / "log.csv", "-o", tmp_path / "rig.json", "--profile", "theta2", "--json")
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["gap"] is None
    compared("identify", answer, "stretches_s", "one_by_one.", "gain_changes[")


def test_changes(plant_file: tuple[Path, dict[str, Any]]) -> None:
    result = furuta("changes", plant_file[0], plant_file[0], "--json")
    assert result.exit_code == 0, result.output
    compared("changes", json.loads(result.stdout))


def test_validate(plant_file: tuple[Path, dict[str, Any]], logs: tuple[Path, Path], tmp_path: Path) -> None:
    fitted, other = logs
    result = furuta("validate", plant_file[0], other, "--json", tmp_path / "gap.json")
    assert result.exit_code == 0, result.output
    answer = json.loads((tmp_path / "gap.json").read_text())
    compared("validate", answer, "by_", "check.")
    result = furuta("validate", plant_file[0], other, fitted, "--limit", "2", "--json", "-")
    assert result.exit_code in (0, 10, 11), result.output
    answer = json.loads(result.stdout)
    assert len(answer["by_log"]) == 2
    compared("validate", answer)


def test_residuals(plant_file: tuple[Path, dict[str, Any]], logs: tuple[Path, Path], tmp_path: Path) -> None:
    result = furuta("residuals", logs[0], "--plant", plant_file[0], "-o", tmp_path / "res", "--json")
    assert result.exit_code == 0, result.output
    compared("residuals", json.loads(result.stdout))


def test_compare(tmp_path: Path) -> None:
    result = furuta(
        *("compare", "--plant", "qube", "-o", tmp_path / "out", "--controllers", "lqr"),
        *("--groups", "balance", "--trials", 2, "--duration", 2, "--json"),
    )
    assert result.exit_code == 0, result.output
    compared("compare", json.loads(result.stdout))


def test_score() -> None:
    result = furuta("score", LOGS / "paper.csv", "--json")
    assert result.exit_code == 0, result.output
    compared("score", json.loads(result.stdout))


def test_an_invented_key_and_a_missing_one_are_seen() -> None:
    with pytest.raises(AssertionError, match="prints no"):
        compared("residuals", {"unit": "V"})
    whole = {key: 0 for key in documented("residuals") if "[" not in key}
    nested = whole | {"missing_torque_rms": {"arm": 0.0, "pendulum": 0.0}}
    nested |= {"maps": [dict.fromkeys(("row", "variable", "edges", "mean", "std"), 0)], "more": 1}
    with pytest.raises(AssertionError, match="not in docs"):
        compared("residuals", nested)
