"""Policies taken elsewhere: ONNX and C say what stable-baselines3 says."""

import json
import shutil
import subprocess

import numpy as np
import pytest

from controllers import make_controller
from controllers.exports.onnx import export_onnx
from controllers.exports.policy_c import export_policy_c
from controllers.learned.layers import network_of
from controllers.learned.policy_file import write_policy
from furuta_gym.plant import QUBE
from furuta_gym.sensors import FilteredDifference

pytest.importorskip("stable_baselines3", reason="learned policies need the extra `rl`")

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")

MAIN = """\
#include <stdio.h>
#include "policy.h"
int main(void)
{
    policy_state s;
    double q1, q2, r;
    policy_reset(&s);
    while (scanf("%lf %lf %lf", &q1, &q2, &r) == 3) printf("%.17g\\n", policy_step(&s, q1, q2, r));
    return 0;
}
"""

CASES = {
    "ppo": ("PPO", {"history": 1, "observe_command": False}),
    "ppo, past and command": ("PPO", {"history": 3, "observe_command": True}),
    "sac": ("SAC", {"history": 1, "observe_command": True}),
    "tqc": ("TQC", {"history": 2, "observe_command": False}),
    "recurrent": ("RecurrentPPO", {"history": 1, "observe_command": True}),
    "recurrent, sb3-contrib's own": ("MlpLstmPolicy", {"history": 1, "observe_command": False}),
}


@pytest.fixture(scope="module", params=CASES)
def policy(request, tmp_path_factory):
    """An untrained policy with its record; the weights of its last layer are large, so that the limits act at times."""
    import torch

    from controllers.learned.sb3_files import algorithm_class
    from controllers.training.recipes import observation_scale
    from controllers.training.remembering import RememberingPolicy
    from controllers.training.sb3 import ScaledObservation
    from furuta_gym.envs.sb3 import FurutaVecEnv

    algorithm, seen = CASES[request.param]
    kind = {"RecurrentPPO": RememberingPolicy, "MlpLstmPolicy": "MlpLstmPolicy"}.get(algorithm, "MlpPolicy")
    algorithm = "RecurrentPPO" if kind != "MlpPolicy" else algorithm
    options = {"task": "swing_up", "sample_time": 0.02, "normalize_action": True, **seen}
    kwargs = {
        "features_extractor_class": ScaledObservation,
        "features_extractor_kwargs": {"scale": observation_scale(QUBE, **seen)},
        "net_arch": [16, 8],
    }
    if kind != "MlpPolicy":
        kwargs["lstm_hidden_size"] = 6
    env = FurutaVecEnv(1, plant=QUBE, **options)
    model = algorithm_class(algorithm)(kind, env, policy_kwargs=kwargs, seed=1, device="cpu")
    actor = getattr(model.policy, "actor", None)
    last = actor.mu if actor is not None else model.policy.action_net
    with torch.no_grad():
        last.weight.mul_(20.0 if actor is not None else 300.0)
        last.bias.fill_(0.1)
        if kind != "MlpPolicy":  # cells that remember and that saturate
            for weight in model.policy.lstm_actor.parameters():
                weight.mul_(3.0)
    path = tmp_path_factory.mktemp("policy") / "policy.zip"
    plant = {"u_max": QUBE.u_max, "unit": "V"}
    write_policy(path, network_of(model), {"algorithm": algorithm, "env": options, "plant": plant})
    return path, model


def recurrent(session):
    return "memory" in session.get_modelmeta().custom_metadata_map


def empty(session):
    """Cells as the metadata say: zeros at first."""
    assert "zeros at the first step" in session.get_modelmeta().custom_metadata_map["memory"]
    return {i.name: np.zeros((1, i.shape[1]), np.float32) for i in session.get_inputs() if i.name != "observation"}


def next_names(cells):
    return [f"next_{name}" for name in cells]


def observations(model, n=500):
    rng = np.random.default_rng(3)
    angle = rng.uniform(-np.pi, np.pi, n)
    size = model.observation_space.shape[0]
    seen = rng.standard_normal((n, size)) * 3.0
    seen[:, 1], seen[:, 2], seen[:, 3:5] = np.sin(angle), np.cos(angle), rng.standard_normal((n, 2)) * 15.0
    return seen.astype(np.float32)


def test_onnx_agrees_with_predict(policy, tmp_path):
    """`action` is stable-baselines3's deterministic action, the scaling of observations included."""
    onnxruntime = pytest.importorskip("onnxruntime")
    path, model = policy
    session = onnxruntime.InferenceSession(export_onnx(path, QUBE, tmp_path / "policy.onnx"))
    seen = observations(model)
    if recurrent(session):
        found, state, answers, cells = [], None, [], empty(session)
        for k, one in enumerate(seen[:, None]):
            answer, state = model.predict(one, state, np.array([k == 0]), deterministic=True)
            answers.append(answer)
            found.append(session.run(["action", "command", *next_names(cells)], {"observation": one, **cells}))
            cells = dict(zip(cells, found[-1][2:], strict=True))
        expected, action, command = np.concatenate(answers), *(np.concatenate([f[i] for f in found]) for i in (0, 1))
    else:
        action, command = session.run(["action", "command"], {"observation": seen})
        expected = model.predict(seen, deterministic=True)[0]
    assert 0.02 < np.mean(np.abs(expected) > 0.99) < 0.98
    assert action == pytest.approx(expected, abs=2e-5)
    assert command == pytest.approx(QUBE.u_max * expected, abs=2e-4)
    about = session.get_modelmeta().custom_metadata_map
    assert float(about["sample_time"]) == 0.02
    assert about["task"] == "swing_up"


def test_onnx_for_a_weaker_amplifier_is_driven_by_its_own_metadata(policy, tmp_path):
    """As firmware would: frames from readings and the last command, by what the file says of scales and limits."""
    onnxruntime = pytest.importorskip("onnxruntime")
    path, _ = policy
    controller = make_controller(path, WEAKER, 0.02)
    session = onnxruntime.InferenceSession(export_onnx(path, WEAKER, tmp_path / "policy.onnx"))
    about = session.get_modelmeta().custom_metadata_map
    size = session.get_inputs()[0].shape[1]
    velocity = FilteredDifference(float(about["velocity_cutoff"]))
    frames, last = [], 0.0
    cells = empty(session) if recurrent(session) else {}
    for y in wandering(100):
        v = velocity.update(*y, float(about["sample_time"]))
        frame = [y[0], np.sin(y[1]), np.cos(y[1]), *v]
        if "the last command that reached the motor / trained_u_max" in about["observation"]:
            frame.append(last / float(about["trained_u_max"]))
        frames = [*frames[1:], frame] if frames else [frame] * (size // len(frame))
        seen = {"observation": np.float32(np.concatenate(frames))[None]}
        command, *state = session.run(["command", *next_names(cells)], seen | cells)
        cells = dict(zip(cells, state, strict=True))
        last = float(command[0, 0])
        assert last == pytest.approx(controller(y), abs=1e-3)
    assert float(about["u_max"]) == WEAKER.u_max
    assert json.loads(about["limits"]) == dict(WEAKER.limits or {})
    many = controller.history > 1
    assert ("oldest first; at the first step all are the first one" in about["observation"]) == many


WEAKER = QUBE.replace(u_max=0.4 * QUBE.u_max, limits={"arm_travel": 6.0})


def wandering(n: int) -> np.ndarray:
    return 0.1 * np.random.default_rng(4).standard_normal((n, 2)).cumsum(axis=0) + [0.1, np.pi]


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc or clang) on this machine")
@pytest.mark.parametrize("plant", [QUBE, WEAKER], ids=["qube", "weaker"])
def test_compiled_header_gives_the_same_commands(policy, plant, tmp_path):
    path, _ = policy
    controller = make_controller(path, plant, 0.02)
    export_policy_c(controller, tmp_path / "policy.h", prefix="policy")
    (tmp_path / "main.c").write_text(MAIN)
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic"]
    program = tmp_path / "main"
    subprocess.run([str(COMPILER), *flags, "-o", program, tmp_path / "main.c", "-lm"], check=True, timeout=60)
    y = wandering(300)
    reference = np.where(np.arange(300) < 150, 0.0, 0.4)
    text = "\n".join(f"{a!r} {b!r} {r!r}" for (a, b), r in zip(y.tolist(), reference.tolist(), strict=True))
    answer = subprocess.run([program], input=text, capture_output=True, text=True, check=True, timeout=60)
    from_c = np.array([float(line) for line in answer.stdout.split()])
    controller.reference = lambda t: reference[min(round(t / 0.02), 299)]
    controller.reset()
    from_python = np.array([controller(step) for step in y])
    assert np.ptp(from_python) > 0.2 * plant.u_max
    assert from_c == pytest.approx(from_python, abs=1e-4 * QUBE.u_max)


def test_an_unknown_network_is_refused():
    from stable_baselines3 import PPO
    from torch import nn

    from furuta_gym.envs.sb3 import FurutaVecEnv

    env = FurutaVecEnv(1, plant=QUBE, normalize_action=True)
    with pytest.raises(ValueError, match="ELU cannot be exported"):
        network_of(PPO("MlpPolicy", env, policy_kwargs={"activation_fn": nn.ELU}, device="cpu"))

    class Doubled(PPO):
        def predict(self, *args, **kwargs):
            action, state = super().predict(*args, **kwargs)
            return 2 * action, state

    with pytest.raises(ValueError, match="not understood"):
        network_of(Doubled("MlpPolicy", env, device="cpu"))
