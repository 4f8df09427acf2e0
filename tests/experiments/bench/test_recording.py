"""Runs: repeatable, honest about losses, silent about the truth."""

import json
import math
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from experiments.bench import EXPERIMENTS, SETS, HiddenEffect, Laboratory, PendulumLost, Rig, list_rigs, record, rig
from identification.logs.reading import read_log


@pytest.mark.parametrize("name", EXPERIMENTS)
@pytest.mark.parametrize("kind", SETS)
def test_every_experiment_runs_on_every_kind_of_rig(kind, name):
    run = record(Rig(kind, engine="lagrange"), name, seed=4, duration=10.0)
    assert len(run.t) == round(10.0 / run.sample_time) + 1
    assert np.ptp(run.u) > 0
    assert np.ptp(run.q1) > 0.01
    assert np.abs(run.u).max() <= SETS[kind].u_max
    upright = np.abs(run.state[:, 1]) < 0.5
    assert upright.all() if EXPERIMENTS[name].balances else not upright.any()


def test_equal_seeds_give_equal_logs_and_others_do_not():
    shaky = Rig(
        "servo", [HiddenEffect("input_delay", form="bench"), HiddenEffect("random_arm_torque")],
        encoder_noise=2e-4, clock_jitter=0.05, torque_noise=(1e-5, 1e-7),
    )  # fmt: skip
    a, b, c = (record(shaky, "paper", seed=s, duration=3.0) for s in (5, 5, 6))
    for key in ("t", "q1", "q2", "u", "d"):
        assert np.array_equal(getattr(a, key), getattr(b, key))
        assert not np.array_equal(getattr(a, key), getattr(c, key))


def test_two_rigs_that_differ_in_what_they_hide_meet_the_same_chance():
    kw = {"clock_jitter": 0.05, "encoder_noise": 1e-4}
    a = record(Rig("servo", **kw), "paper", seed=1, duration=2.0)
    b = record(Rig("servo", [HiddenEffect("arm_spring")], **kw), "paper", seed=1, duration=2.0)
    assert np.array_equal(a.t, b.t)
    assert a.d == pytest.approx(b.d)
    assert not np.array_equal(a.q1, b.q1)


def test_readings_are_whole_counts_and_stamps_tell_the_true_times():
    run = record(Rig("workshop", clock_jitter=0.05, engine="lagrange"), "dither", seed=3, duration=3.0)
    for q, counts in ((run.q1, 8192), (run.q2, 4096)):
        whole = q * counts / (2 * math.pi)
        assert np.abs(whole - np.round(whole)).max() < 1e-6
    spacing = np.diff(run.t)
    assert spacing.min() > 0
    assert 0.02 < spacing.std() / run.sample_time < 0.15
    # the truth at the stamps is within half a count of the readings
    assert np.abs(run.q1 - run.state[:, 0]).max() <= math.pi / 8192 + 1e-9


def test_files_hold_the_log_and_nothing_of_the_truth(tmp_path):
    hidden = Rig("servo", [HiddenEffect("arm_spring")], individual=7, scatter=0.1, name="rig-x")
    run = record(hidden, "paper", seed=1, duration=2.0)
    text = run.write(tmp_path / "log.csv").read_text()
    head, rows = text.split("t,q1,q2,u\n")
    assert head.splitlines() == [
        "# input_unit: V", "# pendulum_zero: upright", "# encoder_counts: 2048 2048", "# device: rig-x",
    ]  # fmt: skip
    assert set(rows) <= set("0123456789.,-e\n")
    log = read_log(tmp_path / "log.csv")
    assert log.q1 == pytest.approx(run.q1, abs=1e-9)
    assert log.u == pytest.approx(run.u, abs=1e-8)
    assert log.encoder_counts == (2048, 2048)
    truth = json.loads(run.write_truth(tmp_path / "truth.json").read_text())
    assert truth["effects"][0]["name"] == "arm_spring"
    assert truth["effects"][0]["parameters"]["k"]["unit"] == "V/rad"
    assert truth["theta"]["theta5"] == pytest.approx(hidden.constants.theta[4])


def test_a_lost_pendulum_is_never_written_as_a_good_run(tmp_path):
    drunk = Rig("servo", [HiddenEffect("input_delay", parameters={"d": 0.08})])
    with pytest.raises(PendulumLost, match="lost at t") as loss:
        record(drunk, "paper", seed=1, duration=5.0)
    seen = loss.value.record
    assert seen.lost_at is not None
    assert seen.t[-1] == pytest.approx(seen.lost_at)
    flagged = record(drunk, "paper", seed=1, duration=5.0, allow_lost=True)
    assert flagged.truth["lost_at"] == seen.lost_at
    with pytest.raises(ValueError, match="not written"):
        flagged.write(tmp_path / "log.csv")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", ["servo", "workshop"])
def test_every_processor_makes_the_same_run(kind):
    """Feedback makes another run of another last digit: the linear algebra of three processors, one log of 20 s."""
    code = (
        "import hashlib; from experiments.bench import Rig, record;"
        f"run = record(Rig({kind!r}, individual=3, scatter=0.1), 'wide', seed=5, duration=20.0);"
        "print(hashlib.sha256(run.q1.tobytes() + run.q2.tobytes() + run.u.tobytes()).hexdigest())"
    )
    told = []
    for name in ("Haswell", "SkylakeX", "Sandybridge"):  # other processors than x86 know none of them
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=dict(os.environ, OPENBLAS_CORETYPE=name),
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode == -signal.SIGILL:
            continue  # this processor lacks that one's instructions
        assert done.returncode == 0, done.stderr
        told.append(done.stdout)
    assert len(told) >= 2
    assert len(set(told)) == 1


@pytest.mark.parametrize("noise_free", [False, True])
def test_a_motion_that_cannot_be_followed_is_a_lost_pendulum(noise_free):
    torn = Rig("servo", [HiddenEffect("arm_spring", parameters={"k": -1e9})], engine="lagrange")
    with pytest.raises(PendulumLost, match="lost at t") as loss:
        record(torn, "paper", seed=1, duration=2.0, noise_free=noise_free)
    assert not np.isfinite(loss.value.record.state[-1]).all()
    assert np.isfinite(loss.value.record.q1[:-1]).all()
    lab = Laboratory(torn, noise_free=noise_free)
    lab.reset(q=(0.1, 0.0))
    assert np.isnan([lab.step(0.0) for _ in range(5)][-1]).all()


def test_a_policy_takes_the_place_of_the_rigs_own_controller():
    class Own:
        def __init__(self):
            from experiments.bench.control import Balance, lqr_gain

            self.balance = Balance(lqr_gain(SETS["servo"]))

        def reset(self):
            self.balance.reset()

        def __call__(self, y):
            return self.balance.command(y, 0.002)

    bench = Rig("servo", engine="lagrange")
    theirs, ours = record(bench, seed=2, duration=3.0, policy=Own()), record(bench, seed=2, duration=3.0)
    # the clocks' last bits differ, so now and then a reading differs by a count
    assert theirs.q1 == pytest.approx(ours.q1, abs=0.02)
    assert theirs.d == pytest.approx(ours.d)


def test_a_delay_of_part_of_a_sample_acts_between_the_samples():
    late = Rig("workshop", [HiddenEffect("input_delay", parameters={"d": 0.5 * 0.004})], engine="lagrange")
    now = Rig("workshop", sample_time=0.002, engine="lagrange")
    a, b = Laboratory(late, noise_free=True), Laboratory(now, noise_free=True)
    a.reset(q=(0.0, math.pi))
    b.reset(q=(0.0, math.pi))
    commands = [0.5, -0.3, 0.4, 0.0]
    for u in commands:
        a.step(u)
    for u in (0.0, *np.repeat(commands, 2)[:-1]):
        b.step(u)
    assert a.state == pytest.approx(b.state, abs=1e-9)


def test_the_bench_does_not_touch_the_plant():
    code = (
        "import sys, experiments.bench, experiments.bench.cli\n"
        "physics = ('furuta_gym.plant', 'furuta_gym.simulation', 'controllers', 'identification')\n"
        "bad = [m for m in sys.modules if m.startswith(physics)]\n"
        "assert not bad, bad"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_named_rigs_cover_the_catalogue_and_their_names_say_nothing():
    names = list_rigs()
    assert len(names) >= 40
    assert list(names) == [f"rig-{k:02d}" for k in range(1, len(names) + 1)]
    hidden = [tuple(e.name for e in rig(name).effects) for name in names]
    from experiments.bench import catalogue

    assert {h[0] for h in hidden if len(h) == 1} == set(catalogue())
    assert sum(not h for h in hidden) >= 3
    assert sum(len(h) == 2 for h in hidden) >= 5
    order = [list(catalogue()).index(h[0]) for h in hidden if len(h) == 1]
    assert order != sorted(order)
    assert abs(np.corrcoef(order, np.arange(len(order)))[0, 1]) < 0.4
    with pytest.raises(ValueError, match="rig-01"):
        rig("rig-999")


@pytest.mark.parametrize("name", list_rigs()[::4])
def test_named_rigs_stay_up(name):
    assert record(name, "paper", seed=11, duration=8.0).lost_at is None


@pytest.mark.parametrize("bad", [{"experiment": "juggling"}, {"duration": -1.0}, {"sample_time": 0.0}, {"seed": -1}])
def test_impossible_runs_are_refused(bad):
    with pytest.raises(ValueError, match=r"[Ee]xpected"):
        record(Rig("servo"), **bad)
