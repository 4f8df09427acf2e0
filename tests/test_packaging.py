"""What is shipped: distributions, versions, workflows, and what a core install says that it lacks."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from tests.commands import some_log

ROOT = Path(__file__).resolve().parent.parent


def test_the_source_distribution_is_complete(tmp_path: Path) -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not in a git repository, which says what belongs to it")
    files = [name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]
    source = tmp_path / "source"
    for name in files:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, source / name)
    code = "import sys; from setuptools.build_meta import build_sdist; build_sdist(sys.argv[1])"
    made = subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=source, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as packed:
        inside = {name.partition("/")[2] for name in packed.getnames()}
    assert sorted(set(files) - inside) == []


def test_the_version_stands_in_one_place_and_is_cited() -> None:
    import tomllib

    import furuta_gym

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "version" in project["project"]["dynamic"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "furuta_gym.__version__"}
    assert f"\nversion: {furuta_gym.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    newest = re.search(r"^## \[(\d.*?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest
    assert newest[1] == furuta_gym.__version__


def test_exact_versions_stand_in_the_constraints_alone() -> None:
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [*project["dependencies"], *(one for extra in project["optional-dependencies"].values() for one in extra)]
    assert [one for one in needed if "==" in one] == []
    pinned = {
        line.partition("==")[0].lower().replace("_", "-")
        for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    }
    names = {re.split(r"[\[>=<; ]", one)[0].lower().replace("_", "-") for one in needed}
    assert sorted(names - pinned) == []


def test_workflows_run_what_is_there() -> None:
    """Every `run:` of a workflow is a target of the Makefile, a script of .ci that can be executed, or git."""
    yaml = pytest.importorskip("yaml")
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    workflows = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
    assert [file.stem for file in workflows] == ["docs", "tests", "wheels"]
    for file in workflows:
        jobs = yaml.safe_load(file.read_text(encoding="utf-8"))["jobs"]
        lines = [step["run"] for job in jobs.values() for step in job["steps"] if "run" in step]
        assert lines
        for line in lines:
            command, *words = line.split()
            if command == "make":
                assert set(words) <= targets, line
            elif command != "git":
                assert os.access(ROOT / command, os.X_OK), line
    matrix = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8"))
    assert matrix["jobs"]["python"]["strategy"]["matrix"]["python"] == ["3.11", "3.12", "3.13", "3.14"]


def test_what_commits_are_checked_by_and_the_image_is_made_of_is_there() -> None:
    yaml = pytest.importorskip("yaml")
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"][0]["hooks"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for hook in hooks:
        program, *words = hook["entry"].split()
        assert program.startswith(".venv/bin/")
        assert program.removeprefix(".venv/") in makefile.replace("$(BIN)", "bin"), "versions are those of make setup"
        assert all((ROOT / word).is_file() for word in words if word.endswith(".py"))
    import tomllib

    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    installed = re.search(r'"\.\[(.*?)\]"', (ROOT / "Dockerfile").read_text(encoding="utf-8"))
    everything = re.search(r"^EXTRAS := (.*)$", makefile, re.MULTILINE)
    assert installed
    assert everything
    assert set(installed[1].split(",")) <= set(extras)
    assert set(everything[1].split(",")) == set(extras)


@pytest.mark.parametrize("command", ["identify", "validate", "demo", "trials"])
def test_without_the_libraries_of_pages_a_sentence_says_what_to_install(command: str, tmp_path: Path) -> None:
    log = some_log(tmp_path / "log.csv")
    words = {
        "identify": [log, "-o", tmp_path / "rig.json", "--report", tmp_path / "page.html"],
        "validate": ["table3", log, "--report", tmp_path / "page.html"],
        "demo": ["--out", tmp_path / "demo"],
        "trials": ["-o", tmp_path / "trials"],
    }[command]
    code = (
        "import sys; sys.modules |= dict.fromkeys(['plotly', 'jinja2', 'markupsafe']); "
        "from furuta_command import main; main()"
    )
    told = subprocess.run(
        [sys.executable, "-c", code, command, *map(str, words)], cwd=ROOT, capture_output=True, text=True
    )
    assert told.returncode == 2, told.stderr
    assert ".[report]" in told.stderr
    assert "Traceback" not in told.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]
