"""Policy files of strangers: nothing in them is run, and what cannot be read is a sentence."""

import base64
import io
import json
import pickle
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st

from controllers import make_controller
from controllers.comparison.evaluation import compare
from controllers.exports.onnx import export_onnx
from controllers.learned import tensors
from controllers.learned.policy_file import read_learning, read_policy, read_record, write_policy
from controllers.policies import FOLDER
from furuta_gym.plant import QUBE
from tests.controllers.chance import INPUTS, recurrent_network
from tests.experiments.test_cli import furuta, refused

SHIPPED = FOLDER / "balance-qube.zip"


class _Touch:
    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


@pytest.fixture
def hostile(tmp_path: Path) -> tuple[Path, Path]:
    """A zip in the form of stable-baselines3 and the file that is there once its pickle was read."""
    mark, path = tmp_path / "it-ran", tmp_path / "hostile.zip"
    call = base64.b64encode(pickle.dumps(_Touch(mark))).decode()
    module = "stable_baselines3.ppo.policies"
    data = {name: {":type:": "x", ":serialized:": call} for name in ("policy_kwargs", "observation_space")}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", json.dumps(data | {"policy_class": {"__module__": module, ":serialized:": call}}))
        archive.writestr("policy.pth", pickle.dumps(_Touch(mark)))
    return path, mark


def test_a_pickle_in_a_policy_is_not_read(hostile: tuple[Path, Path], tmp_path: Path) -> None:
    path, mark = hostile
    words = ("hostile.zip", "runs any code", "--trust")
    with pytest.raises(ValueError, match=r"runs any code that is in it.*trust=True"):
        make_controller(path, QUBE)
    with pytest.raises(ValueError, match="runs any code"):
        export_onnx(path, QUBE, tmp_path / "policy.onnx")
    with pytest.raises(ValueError, match="runs any code"):
        compare(QUBE, [str(path)], trials=1)
    refused(furuta("compare", "--plant", "qube", "--controllers", path, "-o", tmp_path / "c"), *words)
    refused(furuta("simulate", "--plant", "qube", "--controller", path, "-o", tmp_path / "l.csv"), *words)
    refused(furuta("export", "qube", path, "-o", tmp_path / "p.h"), *words)
    refused(furuta("export", "qube", path, "-o", tmp_path / "p.onnx"), *words)
    assert not mark.exists()


def test_resume_reads_no_pickle(hostile: tuple[Path, Path]) -> None:
    """Neither of a finished policy, nor of a checkpoint in the form of stable-baselines3."""
    pytest.importorskip("stable_baselines3", reason="training needs the extra `rl`")
    from controllers.training.train import Training

    path, mark = hostile
    record = Training(QUBE).identity | {"steps": 10, "best_return": 1.0}
    path.with_suffix(".json").write_text(json.dumps(record))
    again = ("train", "--plant", "qube", "--algo", "ppo", "-o", path, "--resume")
    refused(furuta(*again), "runs any code", "--trust")
    folder = path.with_suffix(".checkpoint")
    folder.mkdir()
    (folder / "model.zip").write_bytes(path.read_bytes())
    (folder / "replay_buffer.pkl").write_bytes(pickle.dumps(_Touch(mark)))
    (folder / "state.json").write_text(json.dumps(record))
    refused(furuta(*again), "earlier version", "run code")
    assert not mark.exists()


def test_shipped_policies_play_without_torch() -> None:
    code = (
        "import sys; sys.modules['torch'] = sys.modules['stable_baselines3'] = None\n"
        "from controllers import make_controller; from furuta_gym.plant import QUBE\n"
        f"print(make_controller({str(SHIPPED)!r}, QUBE)((0.01, 0.02)))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert answer.returncode == 0, answer.stderr
    assert 0.0 < abs(float(answer.stdout)) <= QUBE.u_max


def test_the_same_policy_gives_the_same_file(tmp_path: Path) -> None:
    network, record = read_policy(SHIPPED)
    path = write_policy(tmp_path / "again.zip", network, record, read_learning(SHIPPED))
    assert path.read_bytes() == SHIPPED.read_bytes()
    assert read_record(path)["algorithm"] == "PPO"
    assert json.loads(SHIPPED.with_suffix(".json").read_text()).items() <= read_record(path).items()


def test_tensors_are_those_of_safetensors() -> None:
    """The layout by hand: length, JSON, numbers; an oracle that shares no code."""
    raw = tensors.to_bytes({"a": np.float32([[1.0, 2.0]]), "b": np.int64(7)})
    length = int.from_bytes(raw[:8], "little")
    assert json.loads(raw[8 : 8 + length]) == {
        "a": {"dtype": "F32", "shape": [1, 2], "data_offsets": [0, 8]},
        "b": {"dtype": "I64", "shape": [], "data_offsets": [8, 16]},
    }
    assert raw[8 + length :] == np.float32([1, 2]).tobytes() + (7).to_bytes(8, "little")
    back = tensors.from_bytes(raw)
    assert back["a"].tolist() == [[1.0, 2.0]]
    assert back["b"] == 7


def _loads_or_refuses(path: Path) -> None:
    reason, command = path.name, 0.0
    try:
        command = make_controller(path, QUBE)((0.01, 0.02))
    except ValueError as error:
        reason = str(error)
    assert path.name in reason
    assert np.isfinite(command)


@seed(20)
@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=20), st.booleans())
def test_changed_bytes(tmp_path_factory, changes, cut) -> None:
    raw = bytearray(SHIPPED.read_bytes())
    for place, byte in changes:
        raw[place % len(raw)] = byte
    path = tmp_path_factory.getbasetemp() / "bytes.zip"
    path.write_bytes(raw[: changes[0][0] % len(raw)] if cut else raw)
    _loads_or_refuses(path)


_STRANGE = st.sampled_from(
    [None, True, -1, 0, 1e-310, 1e308, 10**400, "x", "", [], [1], {}, {"a": []}, [[[]]], float("nan"), 2**63]
)


def _places(data, at=()):
    yield at
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield from _places(value, (*at, key))


@pytest.fixture(scope="module")
def recurrent(tmp_path_factory) -> Path:
    """A policy with a memory."""
    _, record = read_policy(SHIPPED)
    env = {**record["env"], "observe_command": True, "history": 1}
    return write_policy(tmp_path_factory.mktemp("own") / "recurrent.zip", recurrent_network(), record | {"env": env})


def test_a_policy_with_a_memory_is_kept_as_it_is(recurrent: Path) -> None:
    seen = np.random.default_rng(0).standard_normal((20, 3, INPUTS))
    network = read_policy(recurrent)[0]
    kept, own = network.begin(), recurrent_network().begin()
    answers = [own(x) for x in seen]
    assert all((kept(x) == y).all() for x, y in zip(seen, answers, strict=True))
    assert (network.begin()(seen[5]) != answers[5]).any()  # a first observation has no past
    with pytest.raises(ValueError, match=r"played by begin\(\)"):
        network(seen[5])


def test_a_controller_with_a_memory_plays_what_its_network_plays(recurrent: Path) -> None:
    """Observation by observation, also after a reset; the observations are those that the controller makes."""
    controller = make_controller(recurrent, QUBE)
    made: list[np.ndarray] = []
    play = controller._act
    controller._act = lambda seen: made.append(seen) or play(seen)
    y = 0.1 * np.random.default_rng(1).standard_normal((40, 2)).cumsum(axis=0)
    first = [controller(row) for row in y]
    own = read_policy(recurrent)[0].begin()
    answers = [QUBE.u_max * float(own(seen)[0, 0]) for seen in made]
    assert first[:: controller.every] == pytest.approx(answers, abs=1e-12)
    assert len({round(u, 6) for u in answers}) > 5
    controller.reset()
    assert [controller(row) for row in y] == first


def test_what_could_not_be_read_is_not_written(tmp_path: Path) -> None:
    network = recurrent_network()
    broken = replace(network, layers=(replace(network.layers[0], bias=np.float32([np.nan])),))
    with pytest.raises(ValueError, match="bias0 has numbers that are not finite"):
        write_policy(tmp_path / "p.zip", broken, {})
    assert not (tmp_path / "p.zip").exists()


@seed(20)
@settings(max_examples=300, deadline=None)
@given(st.booleans(), st.data())
def test_changed_values(recurrent, tmp_path_factory, remembers, data) -> None:
    """Any value of the record, or of the header of the weights, turned into something strange."""
    with zipfile.ZipFile(recurrent if remembers else SHIPPED) as archive:
        record, weights = json.loads(archive.read("policy.json")), archive.read("weights.safetensors")
    length = int.from_bytes(weights[:8], "little")
    header = json.loads(weights[8 : 8 + length])
    record.pop("evaluation", None)
    inner = data.draw(st.sampled_from([record, record["env"], record["network"], header]))
    at = data.draw(st.sampled_from([p for p in _places(inner) if p]))
    for key in at[:-1]:
        inner = inner[key]
    inner[at[-1]] = data.draw(_STRANGE)
    text = json.dumps(header).encode()
    path = tmp_path_factory.getbasetemp() / "values.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("policy.json", json.dumps(record))
        archive.writestr("weights.safetensors", len(text).to_bytes(8, "little") + text + weights[8 + length :])
    _loads_or_refuses(path)


def test_bombs(tmp_path: Path) -> None:
    """More bytes than a policy has, and deeper than it is."""
    path = tmp_path / "bomb.zip"
    for content in (b"[" * 5000, b" " * (1 << 27), b"9" * 5000, b'{"a":' * 500 + b"1" + b"}" * 500):
        raw = io.BytesIO()
        with zipfile.ZipFile(raw, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("policy.json", content)
            archive.writestr("weights.safetensors", b"")
        path.write_bytes(raw.getvalue())
        with pytest.raises(ValueError, match=r"bomb\.zip"):
            make_controller(path, QUBE)
