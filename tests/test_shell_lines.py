"""The shell lines that pages show: run as written where they take a minute at most, else read by the command line."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from experiments.cli import app
from experiments.cli.bench import app as bench
from identification import read_log, write_log

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

import run_pages  # noqa: E402

README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", *sorted(page for page in DOCS.rglob("*.md") if "research-log" not in page.parts)]
LOGS = ROOT / "experiments" / "demo" / "logs"
SPAN = re.compile(r"`(furuta [a-z][^`]*)`")
COMMANDS: dict[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
BENCH: dict[str, Any] = typer.main.get_command(bench).commands  # type: ignore[attr-defined]


def section(page: str, title: str) -> str:
    """What stands under a title of a page."""
    return page.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def run(lines: list[str], folder: Path) -> str:
    """Shell lines, one after the other, with this tree's `furuta`; what they print. The first that fails ends it."""
    script = f'set -e\nfuruta() {{ "{sys.executable}" "{ROOT / "furuta_command.py"}" "$@"; }}\n' + "\n".join(lines)
    done = subprocess.run(["bash", "-c", script], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def command_of(line: str) -> tuple[Any, list[str]]:
    """The command of a line that begins with `furuta`, and its arguments. Raises KeyError for one that is not there."""
    name, *arguments = shlex.split(line)[1:]
    return (BENCH[arguments[0]], arguments[1:]) if name == "bench" and arguments else (COMMANDS[name], arguments)


def unknown_options(line: str) -> list[str]:
    """Options in a line that its command does not have."""
    command, arguments = command_of(line)
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    given = [word.partition("=")[0] for word in arguments if re.match(r"--?[a-z]", word)]
    return [option for option in given if option not in known | {"--help"}]


# --- README ------------------------------------------------------------------------------------------------


@pytest.mark.timeout(1200)
def test_four_commands_take_a_strangers_logs_to_a_report(tmp_path: Path) -> None:
    """The lines under "Your own rig", on the bundled logs."""
    pytest.importorskip("jinja2", reason="the report needs the extra 'report'")
    part = section(README, "Your own rig")
    lines = run_pages.commands(part)
    assert [line.split()[1] for line in lines] == ["init", "identify", "validate", "diagnose"]
    shutil.copy(LOGS / "paper.csv", tmp_path / "log1.csv")
    shutil.copy(LOGS / "wide.csv", tmp_path / "log2.csv")
    printed = run(lines, tmp_path)
    for name in ("rig.toml", "rig.json", "found/report.html", "found/plant.json"):
        assert Path(name).name in part
        assert (tmp_path / name).is_file(), printed
    assert "NAMED: The model misses a delay of the command" in printed  # what is hidden in these logs


def test_the_page_on_an_own_rig_shows_the_same_four_commands() -> None:
    assert set(run_pages.commands(section(README, "Your own rig"))) <= set(
        run_pages.commands((DOCS / "how-to" / "own_rig.md").read_text(encoding="utf-8"))
    )


def test_the_python_lines_run_on_the_logs_that_the_line_above_them_copies(tmp_path: Path) -> None:
    import numpy as np

    from furuta_gym import Plant

    part = section(README, "In Python")
    ((copies, block),) = re.findall(r"`(cp [^`]*)`\.\n\n```python\n(.*?)```", part, re.DOTALL)
    shutil.copytree(LOGS, tmp_path / LOGS.relative_to(ROOT))
    for file in (tmp_path / LOGS.relative_to(ROOT)).glob("*.csv"):  # six of their twenty seconds run the lines as well
        write_log(file, read_log(file).slice(stop=6.0))
    block += "\nobservation, _ = env.reset(seed=1)\nprint(*observation, *estimate.plant.theta)\n"
    (tmp_path / "lines.py").write_text(block, encoding="utf-8")
    python = f'PYTHONPATH="{ROOT}" "{sys.executable}" -W ignore lines.py'
    printed = run([copies, python], tmp_path)
    numbers = [float(word) for word in printed.splitlines()[-1].split()]
    assert len(numbers) > 9
    assert np.isfinite(numbers).all()
    assert Plant.load(tmp_path / "rig.json").theta == pytest.approx(numbers[-9:])
    assert 'gymnasium.make("furuta_gym:FurutaID-v0")' in part


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", "docs/how-to/add_an_effect.md"])
def test_make_knows_every_target_that_a_page_names(page: str) -> None:
    """`make -n` says what it would do, and ends with 2 where there is no such target."""
    text = (ROOT / page).read_text(encoding="utf-8")
    targets = dict.fromkeys(re.findall(r"(?:^|`)make ([a-z]+)", text, re.MULTILINE))
    assert targets
    done = subprocess.run(["make", "-n", *targets], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert subprocess.run(["make", "-n", "lunch"], cwd=ROOT, capture_output=True).returncode == 2


# --- tutorials ---------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("name", "codes", "written"),
    [("first_log", 1, ["rig.json"]), ("design_an_experiment", 1, ["d.csv", "tried.csv"])],
)
def test_the_shell_lines_of_a_tutorial_run(name: str, codes: int, written: list[str], tmp_path: Path) -> None:
    """After as many of its Python blocks as make the files that they read."""
    page = DOCS / "tutorials" / f"{name}.md"
    run_pages.run([code for code, _ in run_pages.kept(page)][:codes], tmp_path, name)
    if name == "design_an_experiment":  # the page says nothing of rig.json: it is the reader's
        from furuta_gym import Plant

        Plant.resolve("qube").save(tmp_path / "rig.json")
    run(run_pages.commands(page.read_text(encoding="utf-8")), tmp_path)
    assert [name for name in written if not (tmp_path / name).is_file()] == []


# --- every page --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_line_is_one_that_the_command_line_reads(page: Path) -> None:
    """Commands, arguments and options; nothing is run."""
    text = page.read_text(encoding="utf-8")
    for line in (line for line in run_pages.commands(text) if line.startswith("furuta ")):
        assert unknown_options(line) == [], line
        command, arguments = command_of(line)
        command.make_context(command.name, arguments)
    for line in SPAN.findall(text):
        assert unknown_options(" ".join(line.split())) == [], line


def test_a_line_that_no_command_reads_is_found() -> None:
    assert unknown_options("furuta identify log.csv --ouput rig.json -q") == ["--ouput", "-q"]
    assert unknown_options("furuta bench record --rig rig-01 --reveal -o log.csv") == []
    with pytest.raises(KeyError):
        command_of("furuta identity log.csv")
    command, arguments = command_of("furuta identify log.csv")
    with pytest.raises(Exception, match="output"):
        command.make_context(command.name, arguments)
    text = "```\nfuruta a \\\n  -o b   # why\n```\n\n```text\nfuruta c\n```\n\n```\n# e\nmake f\n```\n"
    assert run_pages.commands(text) == ["furuta a    -o b", "make f"]
