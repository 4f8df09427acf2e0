"""Plant files and policy files that nobody would write on purpose, and what reading one may do."""

from __future__ import annotations

import base64
import io
import json
import os
import pickle
import random
import warnings
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from controllers.learned.policy_file import LEARNING, RECORD, WEIGHTS, read_learning, read_policy, read_record
from controllers.policies import FOLDER
from furuta_gym.plant import LARGE_RIG, QUBE, TABLE_3, Effect, Plant
from furuta_gym.plant.effects import EFFECTS
from furuta_gym.plant.sets import with_spread
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate

from .damage import damaged_bytes, damaged_tree


@cache
def _plants() -> list[dict[str, Any]]:
    """Plants to start from: every key of the format, every effect of the library."""
    full = with_spread(LARGE_RIG).replace(
        friction_sharpness=(80.0, 120.0),
        sample_time=0.002,
        sensors=Sensors().to_dict(),
        provenance={"logs": [{"file": "a.csv", "sha256": "00", "read_as": "q1"}], "torque_noise": [1e-6, 0.0]},
        effects=(Effect("arm_spring", {"k": 0.3, "q1n": -0.5}, std={"k": 0.01}), Effect("input_delay", {"d": 0.01})),
        limits={"arm_travel": 3.0, "arm_speed": 50.0, "slew": 400.0, "supply": 5.0},
        randomize={"input_delay": "uniform:0,0.03", "theta": "physical:0.2"},
    )
    one_each = [TABLE_3.with_effects(TABLE_3.default_effect(name)) for name in EFFECTS]
    return [plant.to_dict() for plant in (QUBE, full, full, full, *one_each)]


def plant_case(draw: random.Random) -> bytes:
    """The content of a plant file."""
    tree = draw.choice(_plants())
    if draw.random() < 0.93:
        tree = damaged_tree(draw, tree)
    text = json.dumps(tree, ensure_ascii=draw.random() < 0.9)
    raw = text.encode("utf-8", "surrogatepass")
    return damaged_bytes(draw, raw) if draw.random() < 0.25 else raw


def try_plant(raw: bytes, folder: Path, play: bool = True) -> str:
    """ "read" or "refused". play: also simulate a few samples of a plant that was read."""
    path = folder / "case.json"
    path.write_bytes(raw)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", '.* has no "(unit|u_max)"')  # such a file is read, and it is said
        warnings.filterwarnings("ignore", ".* is not known and is left out")
        try:
            plant = Plant.load(path)
        except ValueError as error:
            _sentence(error, path)
            return "refused"
        str(plant)
        if Plant.from_dict(json.loads(plant.to_json())) != plant:
            raise AssertionError("a plant that was read is another one when it is written and read again")
        if play:
            try:
                simulate(plant, open_loop(0.1 * plant.u_max), 5 * (plant.sample_time or 0.002), x0=(0.0, 3.0, 0.0, 0.0))
            except (ValueError, FloatingPointError) as error:  # too many steps, or a motion without bounds
                if len(str(error)) < 20:
                    raise
                return "refused"
    return "read"


@cache
def _policies() -> list[dict[str, bytes]]:
    found = []
    for path in sorted(FOLDER.glob("*.zip")):
        with zipfile.ZipFile(path) as archive:
            found.append({name: archive.read(name) for name in archive.namelist()})
    return found


class _Touch:
    """Makes the file `it-ran` in the working folder when it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.open, ("it-ran", os.O_CREAT | os.O_WRONLY)


def policy_case(draw: random.Random) -> bytes:
    """The content of a policy file; some are in the form of stable-baselines3 and hold a call."""
    members = dict(draw.choice(_policies()))
    if draw.random() < 0.15:
        call = pickle.dumps(_Touch())
        data = {"policy_class": {":type:": "x", ":serialized:": base64.b64encode(call).decode()}}
        hostile = {"data": json.dumps(data).encode(), "policy.pth": call, "pytorch_variables.pth": call}
        members = hostile if draw.random() < 0.5 else {**members, **hostile, WEIGHTS: call}
    for name in list(members):
        chance = draw.random()
        if chance < 0.25 and name == RECORD:
            members[name] = json.dumps(damaged_tree(draw, json.loads(members[name]))).encode("utf-8", "surrogatepass")
        elif chance < 0.25 and name == WEIGHTS:
            members[name] = _damaged_arrays(draw, members[name])
        elif chance < 0.35:
            members[name] = damaged_bytes(draw, members[name])
        elif chance < 0.38:
            del members[name]
    if draw.random() < 0.1:
        members[draw.choice((LEARNING, "data", "../up", "a/b", RECORD + " "))] = draw.choice((b"", b"\0" * 100, b"{}"))
    raw = io.BytesIO()
    method = draw.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with zipfile.ZipFile(raw, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return damaged_bytes(draw, raw.getvalue()) if draw.random() < 0.4 else raw.getvalue()


def _damaged_arrays(draw: random.Random, raw: bytes) -> bytes:
    """Another header above the same numbers."""
    length = int.from_bytes(raw[:8], "little")
    if not raw[8:].startswith(b"{"):
        return damaged_bytes(draw, raw)
    header = damaged_tree(draw, json.loads(raw[8 : 8 + length]))
    text = json.dumps(header).encode("utf-8", "surrogatepass")
    said = len(text) if draw.random() < 0.9 else draw.choice((0, 1, 2**40, 2**64 - 1))
    return said.to_bytes(8, "little") + text + raw[8 + length :]


def try_policy(raw: bytes, folder: Path) -> str:
    """ "read" or "refused"."""
    path = folder / "case.zip"
    path.write_bytes(raw)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            network, _ = read_policy(path)
            play = network.begin()
            for _ in range(2):
                play(np.zeros((1, network.size)))
        except ValueError as error:
            _sentence(error, path)
            answer = "refused"
        else:
            answer = "read"
        for read in (read_record, read_learning):
            try:
                read(path)
            except ValueError as error:
                _sentence(error, path)
    return answer


def _sentence(error: ValueError, path: Path) -> None:
    if path.stem not in str(error) or len(str(error)) > 3000:
        raise AssertionError(f"no file name, or too long: {type(error).__name__} {str(error)[:300]}") from error
