"""The documentation against the program: generated pages, schemas, tutorials as they stand, the site."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from furuta_gym.declared import checked
from identification.diagnosis.diagnosis_file import DiagnosisFile

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

import generate  # noqa: E402
import readability  # noqa: E402
import run_pages  # noqa: E402

TUTORIALS = sorted(page.stem for page in (DOCS / "tutorials").glob("*.md"))
LONG = ("design_an_experiment", "missing_effect", "train_a_policy", "reidentify_and_retrain")
NUMBER = re.compile(r"(?<![\wθ])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@pytest.mark.parametrize("page", list(generate.pages()))
def test_a_generated_page_is_what_the_program_says(page: str) -> None:
    """Fails where a command, an effect, a schema or a public name changed and nobody ran `python docs/generate.py`."""
    assert (DOCS / page).read_text(encoding="utf-8") == generate.pages()[page]


def test_every_effect_has_its_entry_and_its_picture() -> None:
    from furuta_gym import EFFECTS

    page = (DOCS / "reference" / "effects.md").read_text(encoding="utf-8")
    assert re.findall(r"^### (\w+)$", page, re.MULTILINE) == sorted(
        EFFECTS, key=lambda name: (list(generate.PLACES).index(EFFECTS[name].place), list(EFFECTS).index(name))
    )
    assert {path.stem for path in (DOCS / "reference" / "effects").glob("*.png")} == set(EFFECTS)


def test_the_equation_on_the_page_is_the_plants() -> None:
    """Both rows of README and docs/explanation/model.md, evaluated at random states, against the compiled model."""
    import numpy as np

    from furuta_gym import Plant
    from furuta_gym.plant.dynamics import acceleration

    plant = Plant.resolve("qube")
    for page in ("README.md", "docs/explanation/model.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        rows = [line for line in text.splitlines() if re.search(r"θ[89] tanh\(r q̇[12]\) = ", line)]
        assert len(rows) == 2
        random = np.random.default_rng(0)
        for q2, v1, v2, u in random.normal(size=(5, 4)):
            a1, a2 = acceleration(q2, v1, v2, u, 0.0, *plant.theta, 30.0, 30.0)
            known = {"q2": q2, "v1": v1, "v2": v2, "a1": a1, "a2": a2, "r": 30.0, "tanh": np.tanh, "τ": u}
            known |= {"sin": np.sin, "cos": np.cos} | {f"θ{i + 1}": value for i, value in enumerate(plant.theta)}
            for row in rows:
                left, right = (eval(_python(side), {}, known) for side in row.split(" = "))
                assert left == pytest.approx(right, abs=1e-9)


def _python(formula: str) -> str:
    for sign, code in (("q̈", "a"), ("q̇", "v"), ("−", "-"), ("·", "*"), ("½", "0.5 *"), ("sin² q2", "sin(q2)**2")):
        formula = formula.replace(sign, code)
    formula = re.sub(r"(v\d)²", r"\1**2", formula)
    formula = re.sub(r"sin 2q2", "sin(2*q2)", formula)
    formula = re.sub(r"(sin|cos) q2", r"\1(q2)", formula)
    return re.sub(r"(?<=[\w)]) +(?=[\wθ(])", " * ", formula).replace("tanh * (", "tanh(").replace("r * v", "r*v")


@pytest.mark.parametrize("kept", sorted((ROOT / "tests" / "golden" / "expected").glob("*.json")), ids=lambda p: p.stem)
def test_a_diagnosis_file_follows_its_schema(kept: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((DOCS / "schema" / "furuta-diagnosis-1.schema.json").read_text(encoding="utf-8"))
    diagnosis = json.loads(kept.read_text(encoding="utf-8")).get("diagnosis.json")
    if diagnosis is None:
        pytest.skip("no diagnosis is kept of this log")
    diagnosis["logs"] = [log | {"sha256": 64 * "0"} for log in diagnosis["logs"]]  # no hash is kept
    jsonschema.Draft202012Validator(schema).validate(diagnosis)
    assert set(diagnosis) <= set(schema["properties"])
    read = checked(diagnosis, DiagnosisFile)
    assert read.where is None or set(diagnosis["where"]) <= set(schema["$defs"]["WhereEntry"]["properties"])
    for spoilt in ({"verdict": "perhaps"}, {"effects": [{"name": "arm_spring"}]}, {"leftover": "yes"}):
        assert not jsonschema.Draft202012Validator(schema).is_valid(diagnosis | spoilt)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.thorough if name in LONG else []) for name in TUTORIALS]
)
def test_a_tutorial_runs_as_it_stands_and_prints_what_it_shows(name: str, tmp_path: Path) -> None:
    """Same words, and numbers within 5 %, as processors round differently. A trained policy succeeds."""
    blocks = run_pages.kept(DOCS / "tutorials" / f"{name}.md")
    assert blocks
    trains = any("train(" in code for code, _ in blocks)
    if trains:
        pytest.importorskip("stable_baselines3")
    printed = run_pages.run([code for code, _ in blocks], tmp_path, name)
    for (_, shown), said in zip(blocks, printed, strict=True):
        assert NUMBER.sub("#", said) == NUMBER.sub("#", shown)
        numbers, kept = ([float(number) for number in NUMBER.findall(text)] for text in (said, shown))
        if name == "design_an_experiment":
            # A controller reads encoder counts: another processor's last bits give another motion. The page says so.
            assert numbers[::2] == pytest.approx(kept[::2], rel=0.3)
            if "error" in said:
                assert all(abs(error) < 4.0 * stated for stated, error in zip(numbers[::2], numbers[1::2], strict=True))
            else:
                assert numbers[1::2] == pytest.approx(kept[1::2], rel=0.3)
        elif trains:
            _check_beside_training(said, shown, single_runs=name == "reidentify_and_retrain")
        else:
            assert numbers == pytest.approx(kept, rel=0.05, abs=0.02)


def _check_beside_training(said: str, shown: str, single_runs: bool) -> None:
    """Every success that is said, and numbers without a policy. single_runs: encoder counts turn by last bits."""
    for printed, kept in zip(said.splitlines(), shown.splitlines(), strict=True):
        assert all(int(success) >= 90 for success in re.findall(r"held (\d+) %", printed))
        if "policy" in printed or "trials" in printed:
            continue
        numbers, expected = ([float(number) for number in NUMBER.findall(text)] for text in (printed, kept))
        rel, least = (0.2, 8.0 if "against" in printed else 0.0) if single_runs else (0.05, 0.0)
        assert numbers == pytest.approx(expected, rel=rel, abs=least)


def test_masses_and_lengths_have_the_error_bars_that_the_page_shows(tmp_path: Path) -> None:
    """docs/explanation/model.md, on the plant file that the first tutorial writes."""
    tutorial = [code for code, _ in run_pages.kept(DOCS / "tutorials" / "first_log.md")]
    (saves,) = [i for i, code in enumerate(tutorial) if ".save(" in code]
    blocks = run_pages.kept(DOCS / "explanation" / "model.md")
    printed = run_pages.run([*tutorial[: saves + 1], *(code for code, _ in blocks)], tmp_path, "model")
    for (_, shown), said in zip(blocks, printed[saves + 1 :], strict=True):
        assert NUMBER.sub("#", said) == NUMBER.sub("#", shown)
        numbers, kept = ([float(number) for number in NUMBER.findall(text)] for text in (said, shown))
        assert numbers == pytest.approx(kept, rel=0.1, abs=0.002)


def test_the_loop_of_the_page_on_controllers_runs(tmp_path: Path) -> None:
    """docs/how-to/controller.md: it ends on, upright."""
    blocks = run_pages.kept(DOCS / "how-to" / "controller.md")
    (said,) = run_pages.run([code for code, _ in blocks], tmp_path, "controller")
    (shown,) = (text for _, text in blocks)
    assert NUMBER.sub("#", said) == NUMBER.sub("#", shown)
    (_, leans), (_, kept) = ([float(number) for number in NUMBER.findall(text)] for text in (said, shown))
    assert leans == pytest.approx(kept, abs=0.01)


def test_a_controller_of_ones_own_is_compared_and_guarded(tmp_path: Path) -> None:
    """docs/how-to/own_controller.md, then its controller in the loop of docs/how-to/controller.md."""
    blocks = run_pages.kept(DOCS / "how-to" / "own_controller.md")
    ((loop, _),) = run_pages.kept(DOCS / "how-to" / "controller.md")
    guarded = re.sub(r"^(plant|controller) = .*\n", "", loop, flags=re.MULTILINE).replace("(controller)", "(mine)")
    *printed, on = run_pages.run([*(code for code, _ in blocks), guarded], tmp_path, "own_controller")
    for (_, shown), said in zip(blocks, printed, strict=True):
        assert NUMBER.sub("#", said) == NUMBER.sub("#", shown)
        numbers, kept = ([float(number) for number in NUMBER.findall(text)] for text in (said, shown))
        # a run between two encoder counts is another one where a processor rounds otherwise: 1.65 or 1.77, 98 or 105
        assert numbers == pytest.approx(kept, rel=0.1, abs=0.01)
    assert on.startswith("on after 5.0 s")


def test_the_loop_that_plays_a_command_file_writes_a_log(tmp_path: Path) -> None:
    """docs/how-to/excite.md: its log holds the commands of the file, and a plant can be fitted to it."""
    import numpy as np

    from identification import read_log

    t = 0.004 * np.arange(500)
    u = 0.5 * np.sign(np.sin(6.0 * t))
    rows = "".join(f"{now:.3f},{command:g}\n" for now, command in zip(t, u, strict=True))
    (tmp_path / "u.csv").write_text(f"# plant: qube\nt,u\n{rows}", encoding="utf-8")
    loop, _ = run_pages.kept(DOCS / "how-to" / "excite.md")
    (said,) = run_pages.run([loop[0]], tmp_path, "loop")
    assert said.startswith("500 samples, the arm within")
    log = read_log(tmp_path / "log1.csv", input_unit="V")
    assert log.u == pytest.approx(u)
    assert np.ptp(log.q1) > 0.05


BOARD = """
#include <cstdint>
#include <cstdio>
#define PROGMEM
struct Port {
    void begin(long) {}
    void print(long n) { std::printf("%ld", n); }
    void print(unsigned long n) { std::printf("%lu", n); }
    void print(char c) { std::putchar(c); }
    void println(const char *text) { std::puts(text); }
    void println(int n) { std::printf("%d\\n", n); }
} Serial;
static unsigned long clock_us = 0;
static int driven = 0;
static unsigned long micros() { return clock_us += 7; }
static int pgm_read_word(const std::int16_t *at) { return *at; }
static long arm_count() { return driven; }
static long pendulum_count() { return -driven; }
static void motor(int duty) { driven = duty; }
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="no g++ on this machine")
def test_the_sketch_that_plays_a_command_file_prints_a_log(tmp_path: Path) -> None:
    """docs/how-to/excite.md, on a stand-in for the board: every row in time, and the motor off at the end."""
    import numpy as np

    page = DOCS / "how-to" / "excite.md"
    u = 2.0 * np.sin(0.05 * np.arange(300))
    rows = "".join(f"{0.005 * k:.3f},{command:.6g}\n" for k, command in enumerate(u))
    (tmp_path / "u.csv").write_text(f"# plant: qube\nt,u\n{rows}", encoding="utf-8")
    _, table = run_pages.kept(page)
    run_pages.run([table[0]], tmp_path, "table")
    (sketch,) = re.findall(r"^```cpp\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    ends = "int main() { setup(); return driven; }\n"
    (tmp_path / "sketch.cpp").write_text(BOARD + sketch + ends, encoding="utf-8")
    subprocess.run(["g++", "-std=c++11", "-o", tmp_path / "sketch", tmp_path / "sketch.cpp"], check=True, timeout=60)
    said = subprocess.run([tmp_path / "sketch"], capture_output=True, text=True, check=True, timeout=60).stdout
    assert said.startswith("t,q1,q2,u\n")
    t, arm, pendulum, duty = np.loadtxt(said.splitlines()[1:], delimiter=",", unpack=True)
    assert duty == pytest.approx(np.round(u * 255 / 12))
    assert np.abs(t - 5000 * np.arange(300)).max() < 50
    assert arm == pytest.approx(np.append(0, duty[:-1]))
    assert pendulum == pytest.approx(-arm)


TITLED = re.compile(r'^```python title="([^"]*)"\n(.*?)^```', re.DOTALL | re.MULTILINE)


def test_the_effect_of_the_page_is_a_declaration_and_equals_its_oracle() -> None:
    import math
    import textwrap

    import numpy as np

    from furuta_gym.plant import EFFECTS

    page = (DOCS / "how-to" / "add_an_effect.md").read_text(encoding="utf-8")
    (_, module), (_, library), (_, branch) = TITLED.findall(page)
    scope: dict[str, object] = {"__package__": "furuta_gym.plant.effects", "__name__": "furuta_gym.plant.effects.mine"}
    exec(compile(module, __file__, "exec"), scope)
    (effect,) = scope["MY_EFFECTS"]  # type: ignore[misc]
    assert effect.name not in EFFECTS
    assert set(effect.mistaken_for) <= set(EFFECTS)
    assert effect.sentence({"μ": 0.15}, "V") == "The gear loses 15 % of the motor's torque to friction"
    source = (ROOT / "furuta_gym" / "plant" / "effects" / "library.py").read_text(encoding="utf-8")
    assert library.splitlines()[1].replace(", *MY_EFFECTS", "") in source.splitlines()
    for v1, r1, tau, μ in np.random.default_rng(0).uniform(0.0, 1.0, (5, 4)) * [2.0, 90.0, 3.0, 0.5] - [1, 0, 1.5, 0]:
        oracle = {"name": effect.name, "arm": 0.0, "p": {"μ": μ}, "tau": tau, "r1": r1, "v1": v1, "tanh": math.tanh}
        exec(textwrap.dedent(branch).removeprefix("el"), oracle)
        assert effect.kernels["torque"].py_func(v1, r1, tau, μ) == (pytest.approx(oracle["arm"]), 0.0)


@pytest.mark.thorough
@pytest.mark.timeout(1800)
def test_the_effect_of_the_page_is_simulated_estimated_and_named(tmp_path: Path) -> None:
    """The page, step by step, on a copy of the packages."""
    page = DOCS / "how-to" / "add_an_effect.md"
    (_, module), (_, library), _ = TITLED.findall(page.read_text(encoding="utf-8"))
    for package in ("furuta_gym", "identification", "controllers"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    effects = tmp_path / "furuta_gym" / "plant" / "effects"
    (effects / "mine.py").write_text(module, encoding="utf-8")
    imported, listed = library.splitlines()
    text = (effects / "library.py").read_text(encoding="utf-8").replace("\n\nEFFECTS", f"\n{imported}\n\nEFFECTS", 1)
    text = text.replace(listed.replace(", *MY_EFFECTS", ""), listed)
    assert text.count("MY_EFFECTS") == 2
    (effects / "library.py").write_text(text, encoding="utf-8")
    blocks = run_pages.kept(page)
    (tmp_path / "use.py").write_text("\n".join(code for code, _ in blocks), encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "FURUTA_CACHE": str(tmp_path / "cache")}
    used = subprocess.run([sys.executable, "use.py"], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert used.returncode == 0, used.stderr
    shown = "".join(text for _, text in blocks)
    assert NUMBER.sub("#", used.stdout) == NUMBER.sub("#", shown)
    numbers, kept = ([float(number) for number in NUMBER.findall(text)] for text in (used.stdout, shown))
    assert numbers == pytest.approx(kept, rel=0.05, abs=0.001)


def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    """Every link and anchor is checked; a page outside of the navigation is an error as well."""
    if not all(importlib.util.find_spec(name) for name in ("mkdocs", "material", "mkdocstrings")):
        pytest.skip("needs the extra docs")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert built.returncode == 0, built.stdout + built.stderr
    page = (tmp_path / "site" / "reference" / "identification.html").read_text(encoding="utf-8")
    assert "Estimate θ (and r, and effect parameters)" in page
    sources = "\n".join(path.read_text(encoding="utf-8") for path in (tmp_path / "site").rglob("*.html"))
    assert not re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="https?://[^"]*\.(?:js|css|png|woff2?)"', sources)


def test_a_broken_link_is_an_error(tmp_path: Path) -> None:
    if not all(importlib.util.find_spec(name) for name in ("mkdocs", "material", "mkdocstrings")):
        pytest.skip("needs the extra docs")
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    (tmp_path / "docs").mkdir()
    shutil.copy(DOCS / "site.css", tmp_path / "docs")
    (tmp_path / "docs" / "index.md").write_text("# A\n\n[gone](nowhere.md), [no anchor](#none)\n", encoding="utf-8")
    (tmp_path / "mkdocs.yml").write_text(text.partition("\nnav:")[0] + "\nnav:\n  - index.md\n", encoding="utf-8")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict"]
    built = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert built.returncode != 0
    assert "nowhere.md" in built.stderr
    assert "#none" in built.stderr


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_what_a_page_beside_the_site_links_to_is_there(page: str) -> None:
    linked = re.findall(r"\]\((?!http)([^)#]+)", (ROOT / page).read_text(encoding="utf-8"))
    assert linked
    assert [link for link in linked if not (ROOT / link).is_file()] == []


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


def test_the_pages_are_short_sentences_in_the_fields_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert readability.main([]) == 0, capsys.readouterr().out
    found = readability.sentences("One two three four. Then " + "word " * 30 + "end.")
    assert readability.figures(found)[1:] == (18.0, 0.5)
    assert readability.workshop_words("Torque that passes\nfor noise, and a name that brings nothing.")
    assert readability.sentences("# A title\n\n| a | table |\n\n```\ncode is left out\n```\n") == []


LONG_ONE = "The plant file that was " + "very " * 40 + "carefully written is not there."
GOOD = {
    "README.md": "# A title\n\nA short sentence.\n\n| what | means |\n|---|---|\n| a cell | a cell of words |\n",
    "docs/page.md": "Another short sentence of words.\n",
    "controllers/code.py": '"""A docstring: no message."""\nraise ValueError(f"expected one number or two, got {2}")\n',
}


@pytest.mark.parametrize(
    ("kind", "file", "text"),
    [
        ("prose", "README.md", f"{LONG_ONE}\n"),
        ("tables", "docs/page.md", f"| what | means |\n|---|---|\n| a file | {LONG_ONE} |\n"),
        ("messages", "controllers/code.py", f'raise ValueError(f"{{1}}: {LONG_ONE}")\n'),
        ("messages", "controllers/code.py", f'print("Done."\n    " {LONG_ONE}")\n'),
    ],
)
def test_a_long_sentence_is_found_wherever_it_stands(
    kind: str, file: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, good in GOOD.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(good, encoding="utf-8")
    assert readability.main([], tmp_path) == 0
    assert "beyond" not in capsys.readouterr().out
    (tmp_path / file).write_text(text, encoding="utf-8")
    assert readability.main([], tmp_path) == 1
    assert [row.split()[0] for row in capsys.readouterr().out.splitlines() if "beyond" in row] == [kind]


def test_what_is_no_message_is_not_measured() -> None:
    code = f'''"""{LONG_ONE}"""\nTEMPLATE = "static inline {{real}} of many words that are code"\nNAME = "theta1"\n'''
    assert readability.messages(code) == []
    assert readability.messages('warn(f"{a} of {b} rows are empty. Delete the rows that are empty.")') == [
        "X of X rows are empty.",
        "Delete the rows that are empty.",
    ]
    assert readability.cells("| a | one \\| two three |\n|---|---|\n\nNo cell of a table.\n") == ["one \\| two three"]


SHELL = re.compile(r"^```\n(.*?)^```\n\n```text\n(.*?)^```", re.DOTALL | re.MULTILINE)


@pytest.mark.thorough
@pytest.mark.timeout(3600)
@pytest.mark.filterwarnings("ignore")
def test_the_solutions_of_the_lab_are_what_the_commands_print(tmp_path: Path) -> None:
    """Each line that the page shows is printed by the commands above it, with numbers within 5 %."""
    blocks = SHELL.findall((DOCS / "lab" / "solutions.md").read_text(encoding="utf-8"))
    assert len(blocks) >= 6
    pytest.importorskip("cryptography")
    script = f'set -e\nfuruta() {{ "{sys.executable}" "{ROOT / "furuta_command.py"}" "$@"; }}\n'
    script += "\n".join(f"{commands}echo 'end of block'" for commands, _ in blocks)
    done = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for (commands, shown), said in zip(blocks, done.stdout.split("end of block\n"), strict=False):
        lines = iter(said.splitlines())
        for line in shown.splitlines():
            assert any(_same(line, printed) for printed in lines), f"{commands}\ndoes not print\n{line}"


def _same(shown: str, printed: str) -> bool:
    """Whether two lines differ in rounding only."""
    if NUMBER.sub("#", " ".join(shown.split())) != NUMBER.sub("#", " ".join(printed.split())):
        return False
    kept, said = ([float(number) for number in NUMBER.findall(line)] for line in (shown, printed))
    return said == pytest.approx(kept, rel=0.05, abs=1e-5)
