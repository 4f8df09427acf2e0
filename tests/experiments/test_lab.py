"""The lab session: rigs that a teacher seals, what a group gets, and the mark that its diagnosis earns."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from experiments.bench import catalogue
from experiments.lab import rigs, vault
from experiments.lab.marking import marked, read_diagnosis
from experiments.trials.seal import rig_of, seal
from experiments.trials.trial import Hidden, Trial
from tests.commands import furuta, refused

KEY = "correct horse battery"
TRIAL = Trial(
    id="lab",
    kind="library",
    rig="table3",
    hidden=(Hidden("arm_spring", "table", 1, strength=1.0),),
    experiment="paper",
    held_out="steps",
    seed=5,
    individual=5,
    scatter=0.08,
    clock_jitter=0.0,
)


@pytest.fixture(scope="module")
def spring() -> dict[str, Any]:
    return seal(TRIAL)


@pytest.fixture(scope="module")
def group(spring: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lab") / "group-01"
    rigs.hand_out(spring, folder, KEY)
    (folder.parent / "key.txt").write_text(KEY + "\n")
    return folder


def diagnosis(folder: Path, verdict: str = "named", **parameters: tuple[float, float]) -> Path:
    values = {key: {"value": value, "std": std, "unit": ""} for key, (value, std) in parameters.items()}
    effects = [{"name": "arm_spring", "parameters": values, "confused_with": []}] if verdict == "named" else []
    file = folder / "diagnosis.json"
    file.write_text(json.dumps({"schema": "furuta-diagnosis/1", "verdict": verdict, "effects": effects}))
    return file


def test_only_the_key_opens_a_sealed_file(tmp_path: Path) -> None:
    file = tmp_path / "sealed.json"
    file.write_text(vault.locked_text({"effects": ["arm_spring"]}, KEY))
    assert vault.opened(file, KEY) == {"effects": ["arm_spring"]}
    for other in (KEY + " ", KEY.upper(), ""):
        with pytest.raises(ValueError, match=r"the key does not open .*sealed\.json"):
            vault.opened(file, other)
    kept = json.loads(file.read_text())
    middle = len(kept["token"]) // 2
    other = "A" if kept["token"][middle] != "A" else "B"
    file.write_text(json.dumps(kept | {"token": kept["token"][:middle] + other + kept["token"][middle + 1 :]}))
    with pytest.raises(ValueError, match="does not open"):
        vault.opened(file, KEY)


def test_a_sealed_file_tells_nothing_by_its_text_or_its_length(spring: dict[str, Any]) -> None:
    nothing = seal(replace(TRIAL, kind="none", hidden=()))
    texts = [vault.locked_text(data, KEY) for data in (spring, nothing, nothing)]
    assert len({len(text) for text in texts}) == 1
    assert len(set(texts)) == 3
    assert all(set(json.loads(text)) == {"schema", "salt", "token"} for text in texts)


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"schema": "furuta-sealed/1"}', '{"schema": "furuta-sealed/1", "salt": 1}']
)
def test_what_is_not_sealed_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "sealed.json"
    file.write_text(text)
    with pytest.raises(ValueError, match="is not a sealed file"):
        vault.opened(file, KEY)


def test_rigs_follow_from_the_secret_and_those_that_fall_are_passed_over() -> None:
    def drawn(secret: int, fall: str = "", **more: Any) -> list[tuple[str, str]]:
        def sealed(trial: Trial) -> dict[str, Any]:
            assert all(h.ratio is None or h.ratio >= rigs.PLAIN for h in trial.hidden)
            assert trial.experiment == "paper"  # another one would tell what is hidden
            about = {"trial": trial.to_dict(), "subject": trial.subject}
            return about | ({"problem": "the pendulum is lost"} if trial.subject == fall else {})

        return [(t["trial"]["id"], t["subject"]) for t in rigs.draw(6, secret, seal=sealed, **more)]

    assert drawn(7) == drawn(7)
    assert drawn(7) != drawn(8)
    assert drawn(1 << 127) != drawn((1 << 127) + 1)
    subjects = [subject for _, subject in drawn(7)]
    assert "none" in subjects
    assert set(subjects) - {"none"} <= {name for name, e in catalogue().items() if e.kind == "library"}
    fallen = next(subject for subject in subjects if subject != "none")
    assert fallen not in [subject for _, subject in drawn(7, fallen)]
    assert any("+" in subject for _, subject in drawn(7, kinds=["two"]))
    assert len(drawn(7, kinds=list(rigs.WEIGHTS))) == 6
    cables = rigs.draw(2, 7, kinds=["library"], effects=["arm_cable"], seal=lambda trial: trial.to_dict())
    assert {trial["rig"] for trial in cables} <= {"servo", "desk"}
    with pytest.raises(ValueError, match=r"'paper', which hardly shows pendulum_quadratic_drag on rigs of table3, "):
        drawn(7, effects=["arm_spring", "pendulum_quadratic_drag"])
    with pytest.raises(ValueError, match="hardly shows arm_cable on rigs of table3;"):
        drawn(7, effects=["arm_cable"], rigs=["table3"])
    with pytest.raises(ValueError, match="unknown kinds: hard"):
        drawn(7, kinds=["hard"])
    one = {"kinds": ["library"], "effects": ["arm_spring"], "rigs": ["table3"]}
    assert len(drawn(7, **one)) == 6
    with pytest.raises(ValueError, match="only 0 rigs for 6 groups"):
        drawn(7, "arm_spring", **one)


def test_a_group_gets_logs_and_a_data_sheet_and_no_name(group: Path, spring: dict[str, Any]) -> None:
    files = sorted(path.relative_to(group).as_posix() for path in group.rglob("*") if path.is_file())
    assert files[:3] == ["data_sheet.md", "fit.csv", "held_out.csv"]
    assert {"more/wide.csv", "more/hanging-chirp.csv", "sealed.json"} <= set(files)
    sheet = (group / "data_sheet.md").read_text()
    assert all(f"| {name} |" in sheet for name in files if name.endswith(".csv"))
    assert "±10 V" in sheet
    told = [*catalogue(), "strength", "theta", "table3"]
    for name in files:
        text = (group / name).read_text()
        assert not [word for word in told if word in text], name
    _, rig = rig_of(vault.opened(group / "sealed.json", KEY))
    assert rig.truth() == spring["truth"]


def test_revealing_shows_the_truth_and_marks_the_diagnosis(group: Path, spring: dict[str, Any], tmp_path: Path) -> None:
    true = {key: p["value"] for key, p in spring["truth"]["effects"][0]["parameters"].items()}
    near = diagnosis(tmp_path, k=(true["k"] * 1.01, 0.02 * true["k"]), q1n=(true["q1n"] + 1.0, 0.1))
    command = ("bench", "reveal", group / "sealed.json", "--key-file", group.parent / "key.txt")
    shown = furuta(*command, "--diagnosis", near)
    assert shown.exit_code == 0, shown.output
    assert f"hides arm_spring: arm: −k (q1 − q1n) (k = {true['k']:.4g} V/rad" in shown.stdout
    assert "Right: what is hidden is named, and nothing else." in shown.stdout
    rows = {line.split()[1]: line.split()[-2] for line in shown.stdout.splitlines() if "│ arm_spring." in line}
    assert rows == {"arm_spring.k": "yes", "arm_spring.q1n": "no"}
    facts = json.loads(furuta(*command, "--diagnosis", diagnosis(tmp_path, "none"), "--json").stdout)
    assert facts[0]["outcome"]["result"] == "missed"
    assert facts[0]["truth"] == spring["truth"]
    assert "Wrong" not in furuta(*command).stdout


def test_all_groups_are_marked_in_one_table(group: Path, tmp_path: Path) -> None:
    """What is missing, broken or of another rig's logs is told in its row."""
    handed_in, session = tmp_path / "handed_in", tmp_path / "session"
    for name in ("group-01", "group-02", "group-03", "group-04"):
        shutil.copytree(group, session / name)
        (handed_in / name).mkdir(parents=True)
    right = diagnosis(tmp_path, "none")
    shutil.copy(right, handed_in / "group-01" / "diagnosis.json")
    answer = json.loads(right.read_text()) | {"logs": [{"source": "friend.csv", "sha256": "0" * 64}]}
    (handed_in / "group-02" / "diagnosis.json").write_text(json.dumps(answer))
    (handed_in / "group-03" / "diagnosis.json").write_text("no JSON")
    sealed = sorted(session.glob("*/sealed.json"))
    command = ("bench", "reveal", *sealed, "--key-file", group.parent / "key.txt", "--diagnoses", handed_in)
    rows = json.loads(furuta(*command, "--json").stdout)
    assert [row["group"] for row in rows] == ["group-01", "group-02", "group-03", "group-04"]
    assert all(row["hidden"] == ["arm_spring"] for row in rows)
    assert rows[0]["says"].startswith("Wrong: an effect is hidden")
    assert "files that were not handed out with this rig: friend.csv" in rows[1]["says"]
    assert "is not JSON" in rows[2]["says"]
    assert rows[3]["says"].startswith("No ")
    table = furuta(*command)
    assert table.exit_code == 0, table.output
    assert all(f"group-0{k}" in table.stdout for k in range(1, 5))
    refused(furuta(*command, "--diagnosis", right), "expected one of them")
    refused(furuta(*command[:-1], tmp_path / "nowhere"), "expected a folder with a folder for each group")


@pytest.mark.parametrize(
    ("kind", "hidden", "verdict", "says"),
    [
        ("none", (), "none", "Right: nothing is hidden"),
        ("none", (), "named", "Wrong: nothing is hidden"),
        ("none", (), "unknown", "Not named"),
        ("outside", (Hidden("flexible_arm", "bench", 1, strength=1.0),), "unknown", "Right: what is hidden is outside"),
        ("library", (Hidden("input_offset", "table", 1, strength=1.0),), "named", "Wrong: another effect"),
        ("library", TRIAL.hidden, "insufficient_excitation", "the motion does not suffice"),
    ],
)
def test_marks_in_words(kind: str, hidden: tuple[Hidden, ...], verdict: str, says: str) -> None:
    truth: dict[str, Any] = {"effects": []}
    sealed = {"trial": replace(TRIAL, kind=kind, hidden=hidden).to_dict(), "subject": "", "ratios": [], "truth": truth}
    effects = [{"name": "arm_spring", "parameters": {}, "confused_with": []}] if verdict == "named" else []
    assert says in marked(sealed, {"verdict": verdict, "effects": effects})[1]


def test_a_name_on_a_rig_that_the_library_does_not_have_is_no_right_answer() -> None:
    hidden = (Hidden("flexible_arm", "bench", 1, strength=1.0),)
    trial = replace(TRIAL, kind="outside", hidden=hidden).to_dict()
    sealed = {"trial": trial, "subject": "", "ratios": [], "truth": {"effects": []}}
    effects = [{"name": "periodic_torque", "parameters": {}, "confused_with": []}]
    said = marked(sealed, {"verdict": "named", "effects": effects, "leftover": True})[1]
    assert said.startswith("Partly right: what is hidden is outside the library")
    assert "What it names is not there" in said


def test_errors_that_were_not_measured_are_no_hindrance(spring: dict[str, Any], tmp_path: Path) -> None:
    file = diagnosis(tmp_path, "none")
    plain = json.loads(file.read_text())
    for gap in (None, {"after": {"rms_q1": None, "rms_q2": 1e-3}, "noise_floor": {"rms_q1": 1e-3, "rms_q2": None}}):
        file.write_text(json.dumps(plain | {"gap": gap}))
        outcome, said, _ = marked(spring, read_diagnosis(file))
        assert said.startswith("Wrong: an effect is hidden")
        assert outcome.after_over_floor is None
    measured = {"rms_q1": 2e-3, "rms_q2": 2e-3}
    file.write_text(json.dumps(plain | {"gap": {"after": measured, "noise_floor": {"rms_q1": 1e-3, "rms_q2": 1e-3}}}))
    assert marked(spring, read_diagnosis(file))[0].after_over_floor == pytest.approx(2.0)


def test_another_key_is_one_sentence(group: Path, tmp_path: Path) -> None:
    key = tmp_path / "other.txt"
    key.write_text("another key\n")
    result = furuta("bench", "reveal", group / "sealed.json", "--key-file", key)
    refused(result, "the key does not open", "sealed.json")
    assert len(result.stderr.strip().splitlines()) == 1
    assert "arm_spring" not in result.output


def test_what_cannot_be_marked_is_refused(group: Path, tmp_path: Path) -> None:
    command = ("bench", "reveal", group / "sealed.json", "--key-file", group.parent / "key.txt", "--diagnosis")
    wrong = tmp_path / "wrong.json"
    sound = {"schema": "furuta-diagnosis/1", "verdict": "named", "effects": []}
    ripple = {"name": "arm_ripple", "parameters": {"φ": {"value": 0.1}}}
    for text, words in (
        ("no json", "is not JSON"),
        ('{"verdict": "named"}', "expected a diagnosis.json"),
        ('{"schema": "furuta-diagnosis/1", "verdict": "spring"}', "verdict 'spring' given"),
        ('{"schema": "furuta-diagnosis/1", "verdict": "named", "effects": [{"name": 1}]}', "every entry of effects"),
        ('{"schema": "furuta-diagnosis/1", "verdict": "named"}', "every entry of effects"),
        (json.dumps(sound | {"effects": [ripple]}), "and A beside φ"),
        (json.dumps(sound | {"effects": [{"name": "banana"}]}), "the library has no effect banana"),
        (json.dumps(sound | {"gap": [1]}), "gap must be null"),
        (json.dumps(sound | {"gap": {"after": {"rms_q1": "small"}}}), "gap must be null"),
        (json.dumps(sound | {"absorbed": 1}), "absorbed 1 given"),
    ):
        wrong.write_text(text)
        refused(furuta(*command, wrong), "wrong.json", words)
    good = diagnosis(tmp_path, "none")
    refused(furuta(*command[:3], *command[2:], good), "one diagnosis and 2 sealed files")
    refused(furuta("bench", "reveal", group, *command[3:5]), "is a folder")
    refused(furuta("bench", "reveal", group / "fit.csv", *command[3:5]), "is not a sealed file")


def test_sealing_refuses_before_any_work(group: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    key, short = group.parent / "key.txt", tmp_path / "short.txt"
    short.write_text("1234567\n")
    new = tmp_path / "new"
    refused(furuta("bench", "seal", "-o", group, "--key-file", key), "is not empty")
    refused(furuta("bench", "seal", "-o", new, "--key-file", short), "a key of 7 characters given")
    refused(furuta("bench", "seal", "-o", new), "--key-file FILE")
    refused(furuta("bench", "seal", "-o", new, "--key-file", key, "--groups", "99"), "99 groups given")
    refused(furuta("bench", "seal", "-o", new, "--key-file", key, "--effects", "cable"), "unknown effects: cable")
    monkeypatch.setitem(sys.modules, "cryptography", None)
    monkeypatch.setattr("experiments.lab.vault.find_spec", lambda name: None)
    refused(furuta("bench", "seal", "-o", new, "--key-file", key), "pip install '.[lab]'")
    assert not new.exists()


def test_a_session_from_the_seal_to_the_mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything that docs/lab asks a teacher and a group to type, on the last 4 s of their logs."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "key.txt").write_text(KEY)
    only = ("--kinds", "library", "--effects", "arm_spring", "--rigs", "workshop")
    sealed = furuta(
        "bench", "seal", "-o", "lab", "--groups", 1, "--key-file", "key.txt", "--seed", 1, *only
    )  # a spring of the library's own law
    assert sealed.exit_code == 0, sealed.output
    assert not list(Path("lab").glob("*.json"))
    monkeypatch.chdir("lab/group-01")
    skip = ("--skip", 16)
    for command in (
        ("identify", "fit.csv", "-o", "rig.json"),
        ("validate", "rig.json", "held_out.csv"),
        ("residuals", "fit.csv", "-o", "residuals"),
        ("diagnose", "fit.csv", "--held-out", "held_out.csv", "-o", "found"),
    ):
        result = furuta(*command, *skip)
        assert result.exit_code == 0, result.output
        if command[0] != "diagnose":
            assert "arm_spring" not in result.output
    marks = furuta(
        "bench", "reveal", "sealed.json", "--key-file", "../../key.txt", "--diagnosis", "found/diagnosis.json", "--json"
    )
    (facts,) = json.loads(marks.stdout)
    assert facts["subject"] == "arm_spring"
    assert facts["says"].startswith("Right")
    assert {row["parameter"] for row in facts["parameters"]} == {"arm_spring.k", "arm_spring.q1n"}


def test_the_next_command_can_be_pasted(
    spring: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rigs, "draw", lambda *arguments: [spring])
    key, folder = tmp_path / "the key.txt", tmp_path / "Tag 1 Übung"
    key.write_text(KEY + "\n")
    told = furuta("bench", "seal", "-o", folder, "--key-file", key, "--groups", "1").stdout
    command = shlex.split(told.split("Afterwards: ")[1])
    assert command[:3] == ["furuta", "bench", "reveal"]
    result = furuta(*command[1:-1], diagnosis(tmp_path, "none"))
    assert result.exit_code == 0, result.output
