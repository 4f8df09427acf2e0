"""Speed of the environments, side by side with others in one run: `make bench`.

Rates are the best of several rounds in which every environment gets its turn, so that another process on the machine
disturbs them alike. Next to the wall clock stands the processor time a step took, which such a process hardly changes.
"""

import argparse
import gc
import json
import resource
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from rich.console import Console
from rich.table import Table

from furuta_gym.envs import ENV_ID
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.files import write_whole
from furuta_gym.plant import PLANTS, TABLE_3
from furuta_gym.plant.integration import plain_steps


@dataclass(frozen=True)
class Arguments:
    """rounds and slice_s: turns for each environment and their length. num_envs: size of the batches. learning_s and
    learning_seeds: wall seconds of PPO and runs of it (0 skips it). memory_steps: env steps of the memory test."""

    rounds: int = 8
    slice_s: float = 0.25
    num_envs: int = 1024
    learning_s: float = 3.0
    learning_seeds: int = 3
    memory_steps: int = 10_000_000

    @classmethod
    def quick(cls) -> "Arguments":
        """Small enough for a test."""
        return cls(rounds=2, slice_s=0.02, num_envs=256, learning_seeds=0, memory_steps=100_000)


@dataclass
class Rate:
    """Steps a second by the wall clock, and processor nanoseconds a step; each the best of the rounds."""

    steps_per_s: float = 0.0
    cpu_ns: float = float("inf")

    def update(self, steps: int, wall: float, cpu: float) -> None:
        self.steps_per_s = max(self.steps_per_s, steps / wall)
        self.cpu_ns = min(self.cpu_ns, 1e9 * cpu / steps)


@dataclass
class Results:
    """What the benchmark found; `to_json` for machines."""

    arguments: Arguments
    integration: list[dict[str, Any]] = field(default_factory=list)
    kernel_ns: dict[str, float] = field(default_factory=dict)
    single: dict[str, Rate] = field(default_factory=dict)
    vector: dict[str, Rate] = field(default_factory=dict)
    memory_mb: dict[str, float] = field(default_factory=dict)
    learning: dict[str, dict[str, Any]] = field(default_factory=dict)

    def to_json(self) -> str:
        return json.dumps(asdict(self), indent=2)


AT_200_HZ = f"{ENV_ID} at 200 Hz"  # the default is 100 Hz
SETTINGS = {
    ENV_ID: "4 RK4 steps of 2.5 ms, sensors on",
    AT_200_HZ: "2 RK4 steps of 2.5 ms, sensors on",
    "CartPole-v1": "1 Euler step",
    "Pendulum-v1": "1 Euler step",
    "Acrobot-v1": "1 RK4 step",
    "InvertedDoublePendulum-v5": "MuJoCo, 5 RK4 steps",
}

_BATCHES = (ENV_ID, AT_200_HZ, "CartPole-v1")


def measure(turns: dict[str, Callable[[int], None]], a: Arguments, steps_a_call: int = 1) -> dict[str, Rate]:
    """Rates of `turn(n)`, which makes n calls of `steps_a_call` steps, for each turn in each round."""
    rates = {name: Rate() for name in turns}
    calls = {}
    for name, turn in turns.items():
        turn(3)  # compile, load, warm up
        start = time.perf_counter()
        turn(20)
        calls[name] = max(1, round(a.slice_s * 20 / (time.perf_counter() - start)))
    for _ in range(a.rounds):
        for name, turn in turns.items():
            wall, cpu = time.perf_counter(), time.process_time()
            turn(calls[name])
            rates[name].update(
                calls[name] * steps_a_call, time.perf_counter() - wall, max(time.process_time() - cpu, 1e-9)
            )
    return rates


def kernel_turn(lanes: int, steps: int) -> Callable[[int], None]:
    """`steps` Runge–Kutta steps a call of Table 3, `lanes` plants side by side."""
    p = TABLE_3.packed().p
    X, P = np.zeros((4, lanes)), np.repeat(p[:, None], lanes, axis=1)
    X[1] = 0.1
    h, command, W = np.full(lanes, 2.5e-3), np.zeros(lanes), np.zeros((2, lanes))

    def turn(n: int) -> None:
        for _ in range(n):
            plain_steps(X, h, steps, command, W, P)

    return turn


def kernel(a: Arguments) -> dict[str, float]:
    """Processor ns of one Runge–Kutta step: of one plant alone, and of one among 128 side by side."""
    found = {}
    for name, lanes, steps in (("alone", 1, 2000), ("in a batch of 128", 128, 16)):
        found[name] = measure({name: kernel_turn(lanes, steps)}, a, steps * lanes)[name].cpu_ns
    return found


def integration(n: int = 128) -> list[dict[str, Any]]:
    """Error of the default step against steps of 20 µs over 1 s of random commands, each held for a sample.

    Episodes count until they end. In encoder counts (2π/4096) of the worse angle: rms, and the 95th percentile over
    episodes of its largest value.
    """
    rows = []
    for name in PLANTS:
        for task in ("swing_up", "balance"):
            for share in (0.1, 1.0):
                coarse, fine = (
                    FurutaVectorEnv(n, name, task, max_episode_steps=None, longest_step=h) for h in (2.5e-3, 2e-5)
                )
                coarse.reset(seed=0)
                fine.reset(seed=0)
                rng = np.random.default_rng(0)
                alive, errors = np.ones(n, dtype=bool), []
                for _ in range(round(1.0 / coarse.setup.sample_time)):
                    u = (rng.uniform(-1, 1, (n, 1)) * share * coarse.setup.plant.u_max).astype(np.float32)
                    ours, reference = coarse.step(u), fine.step(u)
                    alive &= ~(ours[2] | reference[2])
                    error = np.abs(ours[4]["state"] - reference[4]["state"])[:, :2].max(axis=1)
                    errors.append(np.where(alive, error * 4096 / (2 * np.pi), 0.0))
                counts = np.array(errors)
                rows.append(
                    {
                        "plant": name, "task": task, "command": share, "step_ms": 1e3 * coarse.setup.sample_time
                        / coarse.setup.substeps, "substeps": coarse.setup.substeps,
                        "rms_counts": float(np.sqrt((counts**2).sum() / max((counts > 0).sum(), 1))),
                        "p95_counts": float(np.percentile(counts.max(axis=0), 95)),
                    }
                )  # fmt: skip
    return rows


def single_turn(name: str) -> Callable[[int], None]:
    """Steps through `gymnasium.make` with its default wrappers, random actions drawn beforehand, resets included."""
    env = gym.make(ENV_ID, sample_time=0.005) if name == AT_200_HZ else gym.make(name)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(997)]
    env.reset(seed=0)

    def turn(n: int) -> None:
        step, reset = env.step, env.reset
        for i in range(n):
            _, _, terminated, truncated, _ = step(actions[i % 997])
            if terminated or truncated:
                reset()

    return turn


def vector_turn(name: str, a: Arguments) -> Callable[[int], None]:
    """Steps of a batch under random actions drawn beforehand, autoreset included."""
    more: dict[str, Any] = {"sample_time": 0.005} if name == AT_200_HZ else {}
    own = ENV_ID if name == AT_200_HZ else name
    env = gym.make_vec(own, a.num_envs, "vector_entry_point", **more)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(31)]
    env.reset(seed=0)

    def turn(n: int) -> None:
        for i in range(n):
            env.step(actions[i % 31])

    return turn


def memory(a: Arguments) -> dict[str, float]:
    """Resident memory [MB] before and after many env steps of a batch with delay, noise and randomised effects."""
    env = FurutaVectorEnv(
        a.num_envs, noise_std=1e-3, delay=0.012, effect_probabilities={"arm_spring": 0.5},
        autoreset_mode=AutoresetMode.SAME_STEP,
    )  # fmt: skip
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(31)]
    calls = max(a.memory_steps // a.num_envs, 20)

    def resident() -> float:
        gc.collect()
        try:
            return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6
        except OSError:
            return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3

    for i in range(calls // 10):
        env.step(actions[i % 31])
    before = resident()
    for i in range(calls):
        env.step(actions[i % 31])
    return {"before": before, "after": resident(), "steps": float(calls * a.num_envs)}


def learning(a: Arguments) -> dict[str, dict[str, Any]]:
    """PPO on `balance` for a few wall seconds: the compiled batch against 8 subprocesses, the median over seeds.

    Each way has the rollout that suited it best in a small search; the rest is equal. Torch gets one thread: on
    networks this small a second one waits more than it works.
    """
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import SubprocVecEnv

    from furuta_gym.envs.sb3 import FurutaVecEnv

    class WallClock(BaseCallback):
        def _on_training_start(self) -> None:
            self.end = time.perf_counter() + a.learning_s

        def _on_step(self) -> bool:
            return time.perf_counter() < self.end

    ways: dict[str, tuple[Callable[[], Any], dict[str, Any]]] = {
        "compiled batch, 64 envs": (
            lambda: FurutaVecEnv(64, normalize_action=True),
            {"n_steps": 32, "batch_size": 512},
        ),
        "8 subprocesses": (
            lambda: SubprocVecEnv([lambda: gym.make(ENV_ID, normalize_action=True)] * 8),
            {"n_steps": 64, "batch_size": 128},
        ),
    }
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    found: dict[str, dict[str, Any]] = {name: {"returns": [], "steps": []} for name in ways}
    for seed in range(a.learning_seeds):
        for name, (make, rollout) in ways.items():
            env = make()
            env.seed(seed)
            env.reset()
            env.step(np.zeros((env.num_envs, 1), dtype=np.float32))  # load the compiled code before the clock starts
            model = PPO("MlpPolicy", env, seed=seed, device="cpu", n_epochs=4, learning_rate=1e-3, **rollout)
            model.learn(10**9, callback=WallClock())
            env.close()
            found[name]["steps"].append(model.num_timesteps)
            found[name]["returns"].append(_mean_return(model, FurutaVecEnv(64, normalize_action=True)))
    for way in found.values():
        way["median_return"] = float(np.median(way["returns"]))
        way["steps_per_s"] = float(np.median(way["steps"]) / a.learning_s)
    found["untrained"] = {
        "median_return": _mean_return(
            PPO("MlpPolicy", FurutaVecEnv(2, normalize_action=True), seed=0), FurutaVecEnv(64, normalize_action=True)
        )
    }
    torch.set_num_threads(threads)
    return found


def _mean_return(model: Any, env: Any) -> float:
    """Mean return of one deterministic episode in each env of a batch."""
    env.seed(1000)
    observations = env.reset()
    total, alive = np.zeros(env.num_envs), np.ones(env.num_envs, dtype=bool)
    while alive.any():
        actions, _ = model.predict(observations, deterministic=True)
        observations, rewards, dones, _ = env.step(actions)
        total += rewards * alive
        alive &= ~dones
    return float(total.mean())


def run(a: Arguments) -> Results:
    results = Results(a)
    warnings.filterwarnings("ignore", category=DeprecationWarning)
    results.integration = integration(32 if a.rounds < 4 else 128)
    results.kernel_ns = kernel(a)
    results.single = measure({name: single_turn(name) for name in SETTINGS}, a)
    results.vector = measure({name: vector_turn(name, a) for name in _BATCHES}, a, a.num_envs)
    results.memory_mb = memory(a)
    if a.learning_seeds > 0:
        results.learning = learning(a)
    return results


def show(results: Results, console: Console) -> None:
    a = results.arguments
    table = Table(title="Error of the default integration step, 1 s of random commands held for a sample")
    for column in ("plant", "task", "commands", "Runge–Kutta steps", "rms [counts]", "95 % of episodes below [counts]"):
        table.add_column(column)
    for row in results.integration:
        table.add_row(
            row["plant"], row["task"], f"±{row['command']:g} u_max", f"{row['substeps']} × {row['step_ms']:.2f} ms",
            f"{row['rms_counts']:.2g}", f"{row['p95_counts']:.2g}",
        )  # fmt: skip
    console.print(table)
    ns = ", ".join(f"{value:.0f} ns {name}" for name, value in results.kernel_ns.items())
    console.print(f"One compiled Runge–Kutta step of model (5): {ns}\n")
    _show_rates("One environment, gymnasium.make with its default wrappers", results.single, SETTINGS, console)
    settings = SETTINGS | {"CartPole-v1": "Gymnasium's own batch, " + SETTINGS["CartPole-v1"]}
    _show_rates(f"Batch of {a.num_envs}, vector_entry_point", results.vector, settings, console)
    m = results.memory_mb
    console.print(
        f"Resident memory over {m['steps']:.2g} env steps: {m['before']:.1f} MB → {m['after']:.1f} MB "
        f"({m['after'] - m['before']:+.1f} MB)\n"
    )
    if results.learning:
        table = Table(title=f"PPO on balance, {a.learning_s:g} s by the wall clock, {a.learning_seeds} seeds (of 1000)")
        for column in ("on", "median return", "returns", "env steps/s"):
            table.add_column(column)
        for name, way in results.learning.items():
            returns = ", ".join(f"{value:.0f}" for value in way.get("returns", []))
            table.add_row(name, f"{way['median_return']:.0f}", returns, f"{way.get('steps_per_s', 0):,.0f}")
        console.print(table)


def _show_rates(title: str, rates: dict[str, Rate], settings: dict[str, str], console: Console) -> None:
    table = Table(title=title)
    for column in ("environment", "steps/s", "ours/its", "CPU ns a step", "its/ours", "integration"):
        table.add_column(column, justify="left" if column in ("environment", "integration") else "right")
    ours = rates[ENV_ID]
    for name, rate in rates.items():
        table.add_row(
            name, f"{rate.steps_per_s:,.0f}", f"{ours.steps_per_s / rate.steps_per_s:.2f} ×", f"{rate.cpu_ns:,.0f}",
            f"{rate.cpu_ns / ours.cpu_ns:.2f} ×", settings[name],
        )  # fmt: skip
    console.print(table)


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m experiments.studies.speed", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--quick", action="store_true", help="a few seconds: shows that it runs, not how fast")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the results there")
    options = parser.parse_args()
    results = run(Arguments.quick() if options.quick else Arguments())
    console = Console()
    show(results, Console(width=max(console.width, 112)))
    if options.json:
        write_whole(options.json, results.to_json() + "\n")


if __name__ == "__main__":
    main()
