"""The regression net: what the whole program makes of stored logs, by its commands and its environment alone.

    python -m tests.golden.results --out FOLDER       # run every case
    python -m tests.golden.results --renew            # … and keep the results as the expected ones
    python -m tests.golden.results --compare A B      # two commits, number for number; prints what differs

On one machine a change that moves code changes no bit. CPUs round differently, so `test_golden.py` holds the verdicts
and names, and numbers within a hundredth of their standard deviation. Renew the expected results when numbers are
meant to change, and say in the commit which and why.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
LOGS, EXPECTED = HERE / "logs", HERE / "expected"
FURUTA = (sys.executable, "-c", "from experiments.cli import main; main()")
ENV_STEPS, BATCH, BATCH_STEPS = 500, 1024, 50
SETTLED_LATER = ("runtime_s", "date", "versions", "version", "python", "platform", "sha256", "policy")
"""Keys whose values may differ between two runs of one code."""

_QUBE = ("--pendulum-zero", "hanging", "--flip", "q2", "--encoder-counts", "2048", "--input-unit", "V")
_MEASURED: dict[str, tuple[Sequence[str], Sequence[str], Sequence[str]]] = {
    "measured-darmstadt": (
        ["qube_darmstadt/chirp_p1V5_250Hz_00.csv"],
        ["qube_darmstadt/chirp_m1V5_250Hz_01.csv"],
        _QUBE,
    ),
    "measured-mcgill": (
        ["qube_mcgill/balance_prbs_20230828T161301.csv"],
        ["qube_mcgill/balance_prbs_20230828T161334.csv"],
        (*_QUBE, "--skip", "10"),
    ),
}


def names() -> list[str]:
    """The cases: stored logs, and the measured ones where their folder is there."""
    stored = sorted(path.name.removesuffix(".fit.parquet") for path in LOGS.glob("*.fit.parquet"))
    return stored + (list(_MEASURED) if _data() else [])


def _data() -> Path | None:
    folder = Path(os.environ.get("FURUTA_DATA", ROOT.parent / "shared" / "data"))
    return folder if any(folder.glob("*/*.csv")) else None


def run_case(name: str, out: Path, code: Path = ROOT) -> dict[str, Any]:
    """Diagnose and identify the logs of a case with the code in a folder; returns what is compared."""
    fitted, _, options = _arguments(name)
    folder = out / name
    diagnosed = _call(code, *diagnose_arguments(name, folder))
    identified = _call(code, "identify", *fitted, *options, "-o", str(folder / "rig.json"))
    return {"diagnose": diagnosed, "identify": identified} | written(folder)


def diagnose_arguments(name: str, folder: Path) -> list[str]:
    """The command line that diagnoses the logs of a case, its held-out log with it, into a folder."""
    fitted, held_out, options = _arguments(name)
    return ["diagnose", *fitted, *(["--held-out", *held_out] if held_out else []), *options, "-o", str(folder)]


def written(folder: Path) -> dict[str, Any]:
    """What is compared of the files in a folder that the commands wrote, by file name."""
    files = [folder / name for name in ("diagnosis.json", "plant.json", "rig.json")]
    return {f.name: _comparable(json.loads(f.read_text(encoding="utf-8"))) for f in files if f.exists()}


def _arguments(name: str) -> tuple[list[str], list[str], list[str]]:
    if name in _MEASURED:
        data = _data()
        assert data is not None
        fitted, held_out, options = _MEASURED[name]
        return [str(data / f) for f in fitted], [str(data / f) for f in held_out], list(options)
    held = LOGS / f"{name}.held_out.parquet"
    return [str(LOGS / f"{name}.fit.parquet")], [str(held)] if held.exists() else [], []


def _call(code: Path, *arguments: str) -> dict[str, Any]:
    """Exit code of a command, and what it said where it failed."""
    run = subprocess.run([*FURUTA, *arguments], env=_environment(code), cwd=code, capture_output=True, text=True)
    if run.returncode not in (0, 2):
        raise RuntimeError(f"furuta {' '.join(arguments)} ended with {run.returncode}:\n{run.stderr}")
    return {"exit": run.returncode}


def _environment(code: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(code), "PYTHONDONTWRITEBYTECODE": "1"}


def run_envs() -> dict[str, Any]:
    """Roll-outs of the environment and of its batch under random commands."""
    import gymnasium as gym
    import numpy as np

    import furuta_gym  # noqa: F401  (registers FurutaID-v0)

    rng = np.random.default_rng(0)
    single: dict[str, Any] = {}
    for task, plant in (("balance", "table3"), ("swing_up", "qube")):
        env = gym.make("FurutaID-v0", plant=plant, task=task)
        observed, _ = env.reset(seed=1)
        rows = [observed]
        total = 0.0
        for _ in range(ENV_STEPS):
            action = rng.uniform(env.action_space.low, env.action_space.high)  # type: ignore[attr-defined]
            observed, reward, terminated, truncated, _ = env.step(action.astype(np.float32))
            rows.append(observed)
            total += float(reward)
            if terminated or truncated:
                observed, _ = env.reset()
        env.close()
        single[task] = {"observations": np.array(rows, dtype=float)[::25].tolist(), "return": total}
    envs = gym.make_vec("FurutaID-v0", num_envs=BATCH, vectorization_mode="vector_entry_point", plant="qube")
    envs.reset(seed=2)
    space = envs.single_action_space
    for _ in range(BATCH_STEPS):
        commands = rng.uniform(space.low, space.high, (BATCH, 1)).astype(np.float32)  # type: ignore[attr-defined]
        observed, rewards, *_ = envs.step(commands)
    envs.close()
    single["batch"] = {"observations": np.asarray(observed, dtype=float)[::64].tolist(), "reward": float(rewards.sum())}
    return single


def run_all(out: Path, code: Path = ROOT, jobs: int = 2) -> dict[str, Any]:
    """Every case with the code in a folder, and the environments; one JSON file each in `out`."""
    out.mkdir(parents=True, exist_ok=True)
    script = "import json; from tests.golden.results import run_envs; print(json.dumps(run_envs()))"
    with tempfile.TemporaryDirectory() as work, ThreadPoolExecutor(jobs) as pool:
        # this script's own cases, the other code's program
        path = f"{code}{os.pathsep}{ROOT}"
        envs = subprocess.run(
            [sys.executable, "-c", _WITH.format(root=str(ROOT), code=str(code)) + script],
            env=os.environ | {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"},
            cwd=work,
            capture_output=True,
            text=True,
        )
        if envs.returncode:
            raise RuntimeError(envs.stderr)
        results = dict(zip(names(), pool.map(lambda n: run_case(n, Path(work), code), names()), strict=True))
    results["envs"] = json.loads(envs.stdout)
    for name, found in results.items():
        (out / f"{name}.json").write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return results


_WITH = """
import sys, importlib.util
sys.path.insert(0, {code!r})
import types
for name, folder in (("tests", {root!r} + "/tests"), ("tests.golden", {root!r} + "/tests/golden")):
    module = types.ModuleType(name); module.__path__ = [folder]; sys.modules[name] = module
"""


def _comparable(found: Any) -> Any:
    """Without what may differ between two runs of one code."""
    if isinstance(found, dict):
        return {k: _comparable(v) for k, v in found.items() if k not in SETTLED_LATER}
    if isinstance(found, list):
        return [_comparable(v) for v in found]
    return found


def differences(a: Any, b: Any, place: str = "") -> Iterator[str]:
    """Places at which two results are not equal."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in sorted({*a, *b}):
            if key not in a or key not in b:
                yield f"{place}/{key}: only in the {'second' if key not in a else 'first'}"
            else:
                yield from differences(a[key], b[key], f"{place}/{key}")
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            yield from differences(x, y, f"{place}/{i}")
    elif a != b and not (isinstance(a, float) and isinstance(b, float) and math.isnan(a) and math.isnan(b)):
        yield f"{place}: {_short(a)} and {_short(b)}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) < 90 else text[:87] + "…"


def compare_commits(first: str, second: str, jobs: int = 2) -> list[str]:
    """What two commits ("." for the working tree) make differently of the cases, a line each."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for commit in (first, second):
            code = ROOT
            if commit != ".":
                code = Path(folder) / commit.replace("/", "-")
                subprocess.run(["git", "worktree", "add", "--detach", str(code), commit], cwd=ROOT, check=True)
            try:
                found.append(run_all(Path(folder) / f"results-{len(found)}", code, jobs))
            finally:
                if commit != ".":
                    subprocess.run(["git", "worktree", "remove", "--force", str(code)], cwd=ROOT, check=True)
    return list(differences(*found))


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="write the results there")
    parser.add_argument("--renew", action="store_true", help="keep the results as the expected ones")
    parser.add_argument("--against", type=Path, help="compare with results written by --out before")
    parser.add_argument("--compare", nargs=2, metavar=("A", "B"), help='two commits ("." is the working tree)')
    parser.add_argument("--code", type=Path, default=ROOT, help="folder of the code to run; default: this one")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    if given.compare:
        found = compare_commits(*given.compare, jobs=given.jobs)
    else:
        with tempfile.TemporaryDirectory() as folder:
            out = EXPECTED if given.renew else given.out or Path(folder)
            results = run_all(out, given.code.resolve(), given.jobs)
        found = []
        if given.against:
            stored = {p.stem: json.loads(p.read_text(encoding="utf-8")) for p in given.against.glob("*.json")}
            found = list(differences(stored, json.loads(json.dumps(results))))
    print("\n".join(found[:200]) or "no difference")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
