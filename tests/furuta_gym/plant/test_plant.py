"""The plant as a value and as a file: round trips, and errors for whatever else a file may hold."""

import copy
import json
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from furuta_gym.plant import EFFECTS, LARGE_RIG, PLANTS, TABLE_3, THETA_NAMES, Covariance, Effect, Plant
from tests.furuta_gym.plant.strategies import thetas

COVARIANCE = Covariance(
    ("theta1", "theta3", "arm_spring.k"), np.array([[4.0, 1.0, 0.0], [1.0, 2.0, 0.5], [0.0, 0.5, 1.0]]) * 1e-6
)
FULL = LARGE_RIG.replace(
    friction_sharpness=(80.0, 120.0),
    sample_time=0.002,
    covariance=COVARIANCE,
    sensors={"encoder_counts": [4096, 2048], "noise_std": [0.0, 1e-4]},
    provenance={"logs": [{"file": "a.csv", "sha256": "00"}], "method": "by hand"},
    checks={"identifiability": "weak: θ2"},
    effects=(
        Effect("arm_spring", {"k": 0.3, "q1n": -0.5}, std={"k": 0.01}),
        Effect("arm_presliding"),  # neutral: infinite stiffness, which JSON cannot hold
        Effect("arm_ripple", {"A": 0.05, "n": 7}),
    ),
)


def test_equal_plants_hash_alike():
    """Whatever the order of keys in their mappings, and whether a number is whole."""
    turned = FULL.replace(
        u_max=6, provenance=dict(reversed(FULL.provenance.items())), sensors=dict(reversed(FULL.sensors.items()))
    )
    assert turned == FULL.replace(u_max=6.0)
    assert hash(turned) == hash(FULL.replace(u_max=6.0))
    assert turned != FULL.replace(u_max=6.5)


@st.composite
def effects(draw) -> Effect:
    name = draw(st.sampled_from(list(EFFECTS)))
    values = {}
    for p in EFFECTS[name].parameters:
        low, high = max(p.lower, -1e3), min(p.upper, 1e3)
        values[p.name] = draw(
            st.integers(math.ceil(low), math.floor(high)).map(float) if p.integer else st.floats(low, high)
        )
    std = {p: draw(st.floats(0, 10)) for p in values if draw(st.booleans())}
    return Effect(name, values, std)


@st.composite
def plants(draw) -> Plant:
    r = draw(st.one_of(st.floats(0.1, 1e4), st.tuples(st.floats(0.1, 1e4), st.floats(0.1, 1e4))))
    chosen = draw(st.lists(effects(), max_size=4, unique_by=lambda e: e.name))
    return Plant(
        draw(thetas()),
        r,
        draw(st.sampled_from(["V", "N·m"])),
        draw(st.floats(0.1, 100)),
        draw(st.one_of(st.none(), st.floats(1e-4, 1.0))),
        tuple(chosen),
    )


@given(plants())
def test_a_plant_comes_back_from_its_file_text(plant):
    back = Plant.from_dict(json.loads(plant.to_json()))
    assert back == plant
    np.testing.assert_array_equal(back.theta, plant.theta)
    for ours, theirs in zip(back.packed(), plant.packed(), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert [dict(e.std) for e in back.effects] == [dict(e.std) for e in plant.effects]


@pytest.mark.parametrize("plant", [*PLANTS.values(), FULL], ids=[*PLANTS, "full"])
def test_a_plant_comes_back_from_its_file(plant, tmp_path):
    file = plant.save(tmp_path / "deep" / "rig.json")
    assert Plant.load(file) == plant
    assert Plant.resolve(file) == plant
    assert Plant.resolve(str(file)) == plant
    assert [p.name for p in file.parent.iterdir()] == ["rig.json"]  # no temporary left
    text = file.read_text(encoding="utf-8")
    Plant.load(file).save(file)
    assert file.read_text(encoding="utf-8") == text  # reading and writing again changes nothing


def test_the_file_says_what_the_contract_says():
    data = json.loads(FULL.to_json())
    assert data["schema"] == "furuta-plant/1"
    assert list(data["theta"]) == list(THETA_NAMES)
    assert data["friction_sharpness"] == [80.0, 120.0]
    assert data["covariance"]["names"] == list(COVARIANCE.names)
    assert data["effects"][0] == {
        "name": "arm_spring",
        "parameters": {
            "k": {"value": 0.3, "std": 0.01, "unit": "N·m/rad"},
            "q1n": {"value": -0.5, "std": None, "unit": "rad"},
        },
    }
    for key in ("sensors", "sample_time", "u_max", "provenance", "checks"):
        assert key in data
    assert data["checks"]["physically_consistent"] is True


@pytest.mark.parametrize("copied", [pickle.loads(pickle.dumps(FULL)), copy.deepcopy(FULL)], ids=["pickle", "copy"])
def test_copies_are_equal(copied):
    assert copied == FULL
    assert hash(copied) == hash(FULL)


def test_checks_follow_theta_and_are_not_carried_over():
    """A file's stored verdict must not survive a change of θ: Table 3 read back, made consistent, is consistent."""
    read = Plant.from_dict(TABLE_3.to_dict())
    assert read.to_dict()["checks"]["physically_consistent"] is False
    repaired = read.replace(theta=LARGE_RIG.theta)
    assert repaired.to_dict()["checks"]["physically_consistent"] is True
    assert repaired.to_dict()["checks"]["failures"] == []


def test_names_and_values_resolve():
    assert Plant.resolve("table3") is TABLE_3
    assert Plant.resolve(FULL) is FULL
    with pytest.raises(FileNotFoundError, match="table3"):
        Plant.resolve("no-such-rig")
    with pytest.raises(FileNotFoundError, match=r"gone\.json"):
        Plant.load("gone.json")


def test_a_folder_or_text_that_is_no_plant_is_named(tmp_path):
    (tmp_path / "bad.json").write_text("{not json")
    with pytest.raises(ValueError, match=r"bad\.json"):
        Plant.load(tmp_path / "bad.json")
    (tmp_path / "latin.json").write_bytes(b'{"schema": "\xff"}')
    with pytest.raises(ValueError, match=r"latin\.json"):
        Plant.load(tmp_path / "latin.json")
    with pytest.raises((ValueError, OSError), match=tmp_path.name):
        Plant.resolve(tmp_path)


@pytest.mark.parametrize("schema", ["furuta-plant/2", "furuta-plant/10"])
def test_a_newer_schema_is_said_to_be_newer(schema):
    with pytest.raises(ValueError, match=r"furuta-plant/1.*furuta-plant/\d+.*newer"):
        Plant.from_dict(FULL.to_dict() | {"schema": schema})


@pytest.mark.parametrize("schema", [None, "", "furuta-diagnosis/1", 1])
def test_another_schema_is_an_error_that_names_the_right_one(schema):
    with pytest.raises(ValueError, match="furuta-plant/1"):
        Plant.from_dict(FULL.to_dict() | {"schema": schema})


scalars = st.one_of(
    st.none(), st.booleans(), st.integers(-3, 3), st.floats(), st.text(max_size=5), st.just([]), st.just({})
)
junk = st.recursive(
    scalars,
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)),
    max_leaves=5,
)


def _places(value, path=()):
    """Paths to every node of a JSON value."""
    yield path
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _places(inner, (*path, key))
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from _places(inner, (*path, index))


WHOLE = json.loads(FULL.to_json())
FREE = ("provenance", "checks", "sensors")  # what these hold is not the plant's to judge
PLACES = [path for path in _places(WHOLE) if path and path[0] not in FREE] + [("sensors",)]


@settings(max_examples=400)
@given(st.sampled_from(PLACES), junk)
def test_any_damage_to_a_file_is_a_value_error_or_a_plant_that_round_trips(place, value):
    data = copy.deepcopy(WHOLE)
    node = data
    for key in place[:-1]:
        node = node[key]
    node[place[-1]] = value
    try:
        plant = Plant.from_dict(data)
    except ValueError:
        return
    assert Plant.from_dict(json.loads(plant.to_json())) == plant


@given(st.sampled_from([path for path in PLACES if len(path) > 1 or path in (("theta",), ("schema",))]))
def test_anything_missing_is_a_value_error_or_a_default(place):
    data = copy.deepcopy(WHOLE)
    node = data
    for key in place[:-1]:
        node = node[key]
    del node[place[-1]]
    try:
        plant = Plant.from_dict(data)
    except ValueError:
        return
    assert place[0] != "theta"  # nine numbers are needed; none may be made up
    assert Plant.from_dict(json.loads(plant.to_json())) == plant


BAD_FIELDS = {
    "friction_sharpness": [0.0, -1.0, math.nan, math.inf, (1.0, 2.0, 3.0), (100.0, 0.0), "sharp", None],
    "unit": ["mV", "", None, 3],
    "u_max": [0.0, -1.0, math.nan, math.inf, "ten", None],
    "sample_time": [0.0, -0.01, math.nan, math.inf, 2.0, "fast"],
    "theta": [[1.0] * 8, None, "theta"],
}


@pytest.mark.parametrize(("field", "value"), [(f, v) for f, values in BAD_FIELDS.items() for v in values])
def test_a_bad_field_is_an_error_that_names_it(field, value):
    with pytest.raises(ValueError, match=field):
        LARGE_RIG.replace(**{field: value})


def test_one_effect_acts_once_and_is_replaced_by_name():
    spring = Effect("arm_spring", {"k": 0.3})
    with pytest.raises(ValueError, match="arm_spring"):
        LARGE_RIG.replace(effects=(spring, spring))
    plant = LARGE_RIG.with_effects(spring, Effect("arm_ripple")).with_effects(Effect("arm_spring", {"k": 0.5}))
    assert plant.effect("arm_spring").parameters["k"] == 0.5
    assert len(plant.effects) == 2
    assert plant.effect("payload_step") is None
    assert LARGE_RIG.effects == ()  # the original is untouched


def test_effects_given_in_another_order_are_the_same_plant():
    a, b = Effect("input_offset", {"b": 0.1}), Effect("input_dead_zone", {"w": 0.2})
    assert LARGE_RIG.with_effects(a, b) == LARGE_RIG.with_effects(b, a)


def test_packed_arrays_are_fresh_and_cannot_change_the_plant():
    plant = LARGE_RIG.with_effects(Effect("arm_spring", {"k": 0.3}))
    first = plant.packed()
    first.p[:] = 0
    first.codes[:] = 0
    np.testing.assert_array_equal(plant.packed().p[:9], LARGE_RIG.theta)
    assert plant.packed().p[11] == 0.3


def test_text_shows_parameters_and_effects():
    text = str(FULL)
    assert "theta3 = " in text
    assert "±" in text
    assert "arm_spring(k = 0.3 ± 0.01" in text
