"""Plant files of strangers: a plant that can be used, or a sentence with the file's name."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st

from controllers import make_controller
from controllers.exports.c import c_header
from furuta_gym.envs.options import Options, Setup
from furuta_gym.files import in_short
from furuta_gym.plant import LARGE_RIG, PLANTS, QUBE, Covariance, Effect, Plant
from furuta_gym.plant.effects.library import CARRIED
from furuta_gym.plant.sets import with_spread
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import MOST_STEPS, open_loop, simulate

FULL = with_spread(LARGE_RIG).replace(
    friction_sharpness=(80.0, 120.0),
    sample_time=0.002,
    sensors=Sensors().to_dict(),
    provenance={"logs": [{"file": "a.csv", "sha256": "00", "read_as": "q1"}], "torque_noise": [1e-6, 0.0]},
    effects=(Effect("arm_spring", {"k": 0.3, "q1n": -0.5}, std={"k": 0.01}), Effect("input_delay", {"d": 0.01})),
    limits={"arm_travel": 3.0, "arm_speed": 50.0, "slew": 400.0, "supply": 5.0},
    randomize={"input_delay": "uniform:0,0.03", "theta": "physical:0.2"},
)


def write(path: Path, **changes: Any) -> Path:
    path.write_text(json.dumps(QUBE.to_dict() | changes), encoding="utf-8")
    return path


REFUSED = {
    "huge number": ({"u_max": 10**400}, "larger than 1e308"),
    "not finite": ({"u_max": float("nan")}, "NaN is no number of JSON"),
    "time of nothing": (
        {"sample_time": 1e-310},
        r"sample_time must be a number in \[1e-06, 1\] or null \(control period in s\), got 1e-310",
    ),
    "too sharp": (
        {"friction_sharpness": 1e9},
        r"friction_sharpness must be a number in \(0, 1e\+06\] or a list of 1 or 2, .* s/rad",
    ),
    "no list": ({"effects": 5}, "effects must be a list"),
    "no log": ({"provenance": {"logs": 3}}, "provenance.logs must be a list"),
    "limit": (
        {"limits": {"arm_travel": -1}},
        r"limits\.arm_travel must be a number in \(0, 1e\+09\] \(.* in rad\), got -1",
    ),
    "no such limit": ({"limits": {"arm": 1}}, r"limits has no 'arm'; it takes arm_travel \(.* rad\), "),
    "range": (
        {"randomize": {"input_delay": [0, 0.03]}},
        r"randomize\.input_delay must be a text or a number \(such as uniform:0,0.03\), got \[0, 0.03\]",
    ),
    "noise": ({"provenance": {"torque_noise": ["a", 1]}}, "torque_noise"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case: str, tmp_path: Path) -> None:
    changes, words = REFUSED[case]
    with pytest.raises(ValueError, match=rf"rig\.json: .*{words}"):
        Plant.load(write(tmp_path / "rig.json", **changes))


def test_a_slip_of_the_pen_is_found_by_its_line(tmp_path: Path) -> None:
    text = QUBE.to_json()
    (tmp_path / "rig.json").write_text(text.replace('"unit": "V",', '"unit": "V"'), encoding="utf-8")
    line = text.partition('"unit": "V",')[0].count("\n") + 1
    with pytest.raises(ValueError, match=rf"rig\.json is no plant file \(JSON\).*: line {line + 1}, column \d+$"):
        Plant.load(tmp_path / "rig.json")


@pytest.mark.parametrize("text", ["[" * 5000 + "]" * 5000, "[" * 100_000, '{"a":' * 100 + "1" + "}" * 100])
def test_depth_is_bounded(text: str, tmp_path: Path) -> None:
    (tmp_path / "rig.json").write_text(text)
    with pytest.raises(ValueError, match=r"rig\.json: .*deeper than 64 levels"):
        Plant.load(tmp_path / "rig.json")


@pytest.mark.parametrize(
    "sensors",
    [
        {"encoder_counts": {}},
        {"encoder_counts": [1, 2, 3]},
        {"encoder_counts": "4096"},
        {"noise_std": [[1]]},
        {"offset": 3},
        {"velocity_cutoff": "fast"},
        {"velocity_cutoff": float("nan")},
        {"velocity_cutoff": [1, 2]},
        {"noise_std": 1e300},
    ],
)
def test_sensors_of_a_wrong_type(sensors: dict[str, Any]) -> None:
    (name,) = sensors
    with pytest.raises(ValueError, match=rf"^{name}(\[0\])? must be (a number|a list of)"):
        Sensors.of_file(sensors)


def test_a_step_has_at_most_so_many_sub_steps() -> None:
    """The reason and the remedy, from the env, a batch of trials and a simulation; the largest that passes, passes."""
    sharp = QUBE.replace(friction_sharpness=1e6, sample_time=0.5)
    for use in (
        lambda: Setup(Options(plant=sharp)),
        lambda: simulate(sharp, open_loop(0.0), 1.0),
    ):
        with pytest.raises(ValueError, match=r"steps of integration, at most 10000 .*Lower friction_sharpness"):
            use()
    assert 2 <= Setup(Options(plant=sharp.replace(sample_time=1e-4))).substeps <= MOST_STEPS


def test_a_comment_in_c_stays_one() -> None:
    """Text of a plant file in the header's comment cannot end it, also not by a line that goes on."""
    plant = QUBE.replace(provenance={"logs": [{"read_as": "*\\\n/ int evil; /*"}]})
    header = c_header(make_controller("lqr", plant))
    before, _, after = header.partition("*/")
    assert "evil" in before
    assert "evil" not in after
    assert "\\\n" not in before


_STRANGE = st.sampled_from(
    [None, True, -1, 0, 1e-310, 1e308, -1e308, 10**400, "x", "\ud800", "", [], [1], [[1]], {}, {"a": []}, float("nan")]
)


def _places(data: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [at] * bool(at) + [place for key, value in items for place in _places(value, (*at, key))]


PLACES = [p for p in _places(FULL.to_dict()) if p[:2] != ("covariance", "matrix") or len(p) < 4]


def changed(draws: list[tuple[tuple[Any, ...], Any]]) -> dict[str, Any]:
    data = json.loads(FULL.to_json())
    for place, value in draws:
        inner = data
        try:
            for key in place[:-1]:
                inner = inner[key]
            inner[place[-1]] = value
        except (KeyError, IndexError, TypeError):
            continue
    return data


def used(path: Path) -> None:
    """What every command does with a plant file before it does anything else."""
    plant = Plant.load(path)
    plant.to_json()
    str(plant)
    Sensors.of_file(plant.sensors)
    Setup(Options(plant=plant, randomize=True))
    c_header(make_controller("lqr", plant))


@pytest.mark.filterwarnings("ignore:.* is left out")
@seed(20)
@settings(max_examples=250, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(PLACES), _STRANGE), min_size=1, max_size=3))
def test_changed_values(tmp_path_factory: pytest.TempPathFactory, draws: list[tuple[tuple[Any, ...], Any]]) -> None:
    path = tmp_path_factory.getbasetemp() / "values.json"
    path.write_text(json.dumps(changed(draws)), encoding="utf-8")
    try:
        with np.errstate(all="ignore"):
            used(path)
    except ValueError as error:
        reason = str(error)
        assert reason


@pytest.mark.filterwarnings("ignore:.* is left out")
@seed(20)
@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 10**5), st.integers(0, 255)), min_size=1, max_size=10))
def test_changed_bytes(tmp_path_factory: pytest.TempPathFactory, changes: list[tuple[int, int]]) -> None:
    raw = bytearray(FULL.to_json().encode())
    for place, byte in changes:
        raw[place % len(raw)] = byte
    path = tmp_path_factory.getbasetemp() / "bytes.json"
    path.write_bytes(raw)
    try:
        used(path)
    except ValueError as error:
        assert str(error)  # noqa: PT017


def validator() -> Any:
    jsonschema = pytest.importorskip("jsonschema")
    schema = Path(__file__).parents[3] / "docs" / "schema" / "furuta-plant-1.schema.json"
    data = json.loads(schema.read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(data)
    return jsonschema.Draft202012Validator(data)


def test_files_agree_with_the_published_schema() -> None:
    check = validator()
    for plant in (FULL, *PLANTS.values(), *map(with_spread, PLANTS.values())):
        check.validate(json.loads(plant.to_json()))


@seed(20)
@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(PLACES), _STRANGE), min_size=1, max_size=1))
def test_what_loads_agrees_with_the_published_schema(draws: list[tuple[tuple[Any, ...], Any]]) -> None:
    """The schema refuses nothing that the program takes, sensors included; true is a number to neither."""
    check = validator()
    data = changed(draws)
    try:
        Sensors.of_file(Plant.from_dict(data).sensors)
    except ValueError:
        return
    text = json.dumps(data)
    if "NaN" not in text and "Infinity" not in text:
        check.validate(json.loads(text))


def test_a_long_message_is_cut_between_names() -> None:
    said = in_short("expected one of: " + ", ".join(CARRIED)).partition("one of: ")[2]
    assert " … " in said
    assert {name.strip(",") for name in said.split() if name != "…"} <= set(CARRIED)


@pytest.mark.parametrize(
    ("key", "meant"), [("limit", "did you mean 'limits'?"), ("umax", "did you mean 'u_max'?"), ("x", "left out.")]
)
def test_a_key_that_nobody_reads_is_said(key: str, meant: str, tmp_path: Path) -> None:
    """A misspelt limit would leave the rig without one."""
    told = QUBE.to_dict() | {key: {"supply": 1.0}}
    (tmp_path / "rig.json").write_text(json.dumps(told))
    with pytest.warns(UserWarning, match=f"{key!r}.*not known.*{re.escape(meant)}"):
        assert Plant.load(tmp_path / "rig.json").theta == pytest.approx(QUBE.theta)


def test_a_slip_in_an_effects_parameter_is_refused(tmp_path: Path) -> None:
    """Read as its default, it would switch the effect off."""
    effect = {"name": "arm_spring", "parameters": {"k": {"vaule": 0.3, "unit": "V/rad"}}}
    with pytest.raises(ValueError, match=r"effects\[arm_spring\]\.parameters\.k has no 'vaule'; it takes value"):
        Plant.load(write(tmp_path / "rig.json", effects=[effect]))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sensors": {"encoder_count": 2048}}, "'encoder_count' in its sensors.*did you mean 'encoder_counts'?"),
        (
            {"effects": [{"name": "arm_spring", "parameters": {"k": 0.3}, "sdt": 0.1}]},
            r"the key 'sdt' in effects\[arm_spring\], which is not known",
        ),
        (
            {"covariance": {"names": ["thta1", "theta2"], "matrix": [[1e-8, 0], [0, 1e-10]]}},
            "covariance of 'thta1', which is no parameter.*did you mean 'theta1'?",
        ),
        (
            {
                "effects": [{"name": "arm_stribeck", "parameters": {"ΔF": 0.05}}],
                "covariance": {"names": ["arm_stribeck.dF"], "matrix": [[1e-4]]},
            },
            "covariance of 'arm_stribeck.dF'.*did you mean 'arm_stribeck.ΔF'?",
        ),
    ],
)
def test_what_is_left_out_is_said(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=words):
        Plant.load(write(tmp_path / "rig.json", **changes))


@pytest.mark.filterwarnings("error")
def test_a_file_that_is_used_whole_says_nothing(tmp_path: Path) -> None:
    """A note about the sensors is the user's own, and their covariance may name r1."""
    plant = FULL.replace(
        covariance=Covariance(("theta1", "r1", "arm_spring.k"), 1e-8 * np.eye(3)),
        sensors=Sensors().to_dict() | {"made_by": "a shop"},
    )
    assert Plant.load(plant.save(tmp_path / "rig.json")) == plant
