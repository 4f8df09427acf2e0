"""The envelope: whatever comes in, what goes out is finite and limited, in Python and in compiled C."""

import math
import subprocess
from pathlib import Path

import numpy as np
import pytest

from controllers import make_controller
from controllers.envelope import REASONS, Envelope, Guarded
from controllers.exports.c import c_header
from controllers.exports.policy_c import policy_c_header
from controllers.learned.policy import LearnedController
from furuta_gym.plant import QUBE, TABLE_3, Effect
from furuta_gym.sensors import Sensors
from tests.controllers.chance import recurrent_network
from tests.controllers.inside import COMPILER, MAIN, compiled, guarded, in_python, played

LIMITS = {"arm_travel": 2.0, "arm_speed": 60.0, "slew": 400.0, "supply": 8.0}
RIG = QUBE.replace(limits=LIMITS)
STRANGE = (math.nan, math.inf, -math.inf, 1e308, -1e308, 1e30, math.nan, 5e-324, 9999.0, -0.0)


def hostile(n: int, seed: int) -> list[tuple[int, float, float, float]]:
    """Random walks near upright with strange numbers, jumps and resets among them."""
    rng = np.random.default_rng(seed)
    rows, q, gone = [], np.zeros(2), 0
    for _ in range(n):
        again = rng.random() < 0.02
        q = rng.uniform(-0.3, 0.3, 2) if again else q + rng.normal(0, [0.02, 0.02])
        row = [float(q[0]), float(q[1]), 0.1]
        gone = 4 if rng.random() < 0.005 else gone - 1
        if rng.random() < 0.05 or gone > 0:
            row[rng.integers(3)] = float(rng.choice(STRANGE))
        if rng.random() < 0.01:
            row[rng.integers(2)] += float(rng.choice([2.5, 10.0 ** rng.uniform(-3, 300)]))  # 2.5: out of the limits
        rows.append((int(again), *row))
    return rows


def unreadable(rows: list[tuple[int, float, float, float]], off: np.ndarray) -> np.ndarray:
    """Which rows are no numbers, beyond 10⁴ rad, or half a turn of arm or pendulum from the last good one."""
    bad, last = [], None
    for (again, *row), reason in zip(rows, off, strict=True):
        last = None if again else last
        jumped = last is not None and any(abs(row[i] - last[i]) > math.pi for i in range(2))
        bad.append(jumped or not all(abs(v) <= 1e4 for v in row))
        last = row if not bad[-1] and reason == 0 else last
    return np.array(bad)


def check(u: np.ndarray, off: np.ndarray, rows: list[tuple[int, float, float, float]], e: Envelope, T: float) -> None:
    assert np.isfinite(u).all()
    assert np.abs(u).max() <= e.u_max * (1 + 1e-6)
    assert (u[off > 0] == 0).all()
    again = np.array([row[0] for row in rows], dtype=bool)
    held = ~again[1:] & (off[:-1] > 0)
    assert (off[1:][held] == off[:-1][held]).all(), "off until reset, for the same reason"
    bad = unreadable(rows, off)
    assert (u[bad] == 0).all()
    smooth = ~again[1:] & ~bad[1:] & (off[1:] == 0)
    assert np.abs(np.diff(u))[smooth].max() <= e.slew * T * (1 + 1e-5)


LAWS = {
    "lqg": (RIG, "lqg"),
    "lqi": (RIG, "lqi"),
    "lqg-friction": (RIG, "lqg-friction"),
    "map": (RIG.with_effects(Effect("input_dead_zone", {"w": 0.1}), Effect("input_delay", {"d": 0.007})), "dlqr"),
}


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc or clang) on this machine")
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
@pytest.mark.parametrize("law", LAWS)
def test_fuzzed_linear_headers(law, single, tmp_path):
    plant, name = LAWS[law]
    controller = make_controller(name, plant, 0.004)
    envelope = Envelope.of(controller, soft_start=0.02)
    program = compiled(c_header(controller, "c", envelope, single), tmp_path, "float" if single else "double")
    rows = hostile(4000, 1)
    u, off = played(program, rows)
    check(u, off, rows, envelope, 0.004)
    assert set(off) >= {0, 1, 2}
    assert (u != 0).mean() > 0.1

    ours, reasons = in_python(controller, envelope, rows)
    if not single:
        assert reasons == off.tolist()
        np.testing.assert_allclose(u, ours, atol=1e-9 * envelope.u_max)
    else:
        same = np.array(reasons) == off
        assert same.mean() > 0.99
        assert np.median(np.abs(u - ours)[same]) < 1e-3


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc or clang) on this machine")
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
@pytest.mark.parametrize("memory", [False, True], ids=["", "recurrent"])
def test_fuzzed_policy_headers(memory, single, tmp_path):
    path = Path(__file__).parents[2] / "controllers" / "policies" / "swing-up-qube.zip"
    controller = remembering() if memory else make_controller(str(path), RIG, 0.02)
    envelope = Envelope.of(controller)
    assert envelope.tilt == math.inf
    program = compiled(policy_c_header(controller, "c", envelope, single), tmp_path, "float" if single else "double")
    rows = hostile(4000, 2)
    u, off = played(program, rows)
    check(u, off, rows, envelope, 0.02)
    assert (u != 0).mean() > 0.1
    if memory:  # it begins anew at each reset, as in Python
        ours, reasons = in_python(controller, envelope, rows)
        same = np.array(reasons) == off
        assert same.mean() > (0.99 if single else 0.9999)
        assert np.median(np.abs(u - ours)[same]) < 1e-3 * envelope.u_max
        assert np.quantile(np.abs(u - ours)[same], 0.9) < (0.05 if single else 1e-3) * envelope.u_max


def remembering() -> LearnedController:
    """A swing-up of chance, with a memory."""
    options = {"observe_command": True, "normalized": True, "tasks": ("balance", "swing_up")}
    plant = RIG.replace(limits=LIMITS | {"supply": 0.5, "slew": 10.0})  # its last command is rarely what it asked for
    return LearnedController("chance", recurrent_network(), plant, 0.02, **options)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc or clang) on this machine")
def test_one_nan_costs_one_sample_and_three_switch_off(tmp_path):
    program = compiled(c_header(make_controller("lqg", TABLE_3, 0.002), "c"), tmp_path, "double")
    good, bad = (0, 0.05, 0.02, 0.0), (0, math.nan, 0.02, 0.0)
    u, off = played(program, [good, good, bad, good, good, bad, bad, good, bad, bad, bad, good])
    assert off.tolist() == [0] * 10 + [1, 1]
    assert [x != 0 for x in u] == [True, True, False, True, True, False, False, True] + [False] * 4


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc or clang) on this machine")
def test_a_long_soft_start_where_an_int_has_16_bits(tmp_path):
    controller = make_controller("lqr", QUBE, 0.001)
    envelope = Envelope.of(controller, soft_start=40.0)
    (tmp_path / "c.h").write_text(c_header(controller, "c", envelope))
    narrow = MAIN.replace('#include "c.h"', '#define int short\n#include "c.h"\n#undef int')
    (tmp_path / "main.c").write_text(narrow.replace("REAL", "double"))
    subprocess.run(
        [str(COMPILER), "-std=c99", "-o", tmp_path / "c", tmp_path / "main.c", "-lm"], check=True, timeout=60
    )
    u, _ = played(tmp_path / "c", [(0, 0.1 + 1e-4 * (k % 2), 0.02, 0.0) for k in range(41000)])
    assert abs(u[38000]) > abs(u[32000]) > abs(u[10000])
    assert u[40998] == pytest.approx(u[40500])


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc or clang) on this machine")
def test_an_excitation_is_limited_like_the_law(tmp_path):
    """Added within the envelope, in both languages: slewed, clamped, and gone when the controller is off."""
    controller = make_controller("lqr", QUBE.replace(limits={"supply": 3.0, "slew": 500.0, "arm_travel": 1.0}), 0.004)
    envelope = Envelope.of(controller)
    (tmp_path / "c.h").write_text(c_header(controller, "c", envelope))
    added = MAIN.replace("c_step(&s, (REAL)q1, (REAL)q2, (REAL)r)", "c_step_with(&s, (REAL)q1, (REAL)q2, 0, (REAL)r)")
    (tmp_path / "main.c").write_text(added.replace("REAL", "double"))
    flags = ["-std=c99", "-ffp-contract=off"]
    subprocess.run([str(COMPILER), *flags, "-o", tmp_path / "c", tmp_path / "main.c", "-lm"], check=True, timeout=60)
    rows = [(0, 0.1 * math.sin(0.2 * k), 0.01 * math.cos(k), 20.0 * math.sin(0.05 * k)) for k in range(100)]
    rows += [(0, 1.1, 0.0, 2.0), (0, 0.0, 0.0, 2.0)]
    u, off = played(tmp_path / "c", rows)
    inside, plain = Guarded(controller, envelope), Guarded(controller, envelope)
    with_it = [inside((q1, q2), d) for _, q1, q2, d in rows]
    without = [plain((q1, q2)) for _, q1, q2, _ in rows]
    np.testing.assert_allclose(u, with_it, atol=1e-12)
    assert np.abs(np.array(with_it) - without).max() > 1.0
    assert np.abs(u).max() == pytest.approx(3.0)
    assert np.abs(np.diff(u[:100])).max() <= 500.0 * 0.004 + 1e-9
    assert u[-2:].tolist() == [0.0, 0.0]
    assert inside.off == REASONS[off[-1]] == "arm"


class TestEachRule:
    def test_without_limits_it_changes_nothing(self):
        inside, plain = guarded(), make_controller("dlqr", QUBE, 0.004)
        y = 0.01 * np.random.default_rng(0).standard_normal((200, 2)).cumsum(axis=0)
        assert [inside(row) for row in y] == [plain(row) for row in y]

    @pytest.mark.parametrize(
        ("changes", "readings", "reason"),
        [
            ({}, [(7.0, 0.0)], "arm"),
            ({"arm_travel": 0.5}, [(0.6, 0.0)], "arm"),
            ({"arm_speed": 5.0}, [(0.0, 0.0), (0.03, 0.0)], "speed"),
            ({}, [(0.0, 1.7)], "tilt"),
            ({"arm_speed": 5.0, "resolution": 0.006}, [(0.0, 0.0), (0.03, 0.0)], "speed"),
            ({"arm_speed": 5.0}, [(0.0, 0.0), (math.nan, 0.0), (0.05, 0.0)], "speed"),
            ({"bad_readings": 2}, [(math.nan, 0.0), (0.0, math.inf)], "reading"),
            ({"tilt": math.inf}, [(0.0, 3.1), (0.0, -3.1), (0.0, -3.0), (0.0, -2.9)], "reading"),  # wrapped
            ({}, [(3.1, 0.0), (-3.1, 0.0), (-3.0, 0.0), (-2.9, 0.0)], "reading"),  # so is the arm, with 2π of travel
        ],
    )
    def test_it_goes_off_with_a_reason_until_reset(self, changes, readings, reason):
        inside = guarded(**changes)
        for y in readings:
            u = inside(y)
        assert (u, inside.off) == (0.0, reason)
        assert inside((0.1, 0.1)) == 0.0
        inside.reset()
        assert inside((0.1, 0.1)) != 0.0

    def test_one_count_of_the_encoder_is_no_speed(self):
        """1024 counts at 1 ms: a count is 6 rad/s, and a healthy arm turns at 0.5 rad/s."""
        count = 2 * math.pi / 1024
        plant = QUBE.replace(limits={"arm_speed": 5.0}, sensors={"encoder_counts": 1024})
        inside = Guarded(make_controller("dlqr", plant, 0.001))
        for k in range(200):
            inside((count * round(0.5e-3 * k / count), 0.0))
        assert inside.off == "on"
        for _ in range(5):
            inside((inside._last[0] + 2 * count, 0.0))
        assert inside.off == "speed"

    @pytest.mark.parametrize("sample_time", [0.004, 0.001, 0.0005])
    def test_the_speed_that_surely_stops_hardly_depends_on_the_sample_time(self, sample_time):
        """A count of 2048 in 5 ms is 0.6 rad/s; in half a millisecond it would be 6."""
        plant = QUBE.replace(limits={"arm_speed": 8.0}, sensors={"encoder_counts": 2048})
        count, off = 2 * math.pi / 2048, {}
        for speed in (7.9, 8.9):
            inside = Guarded(make_controller("dlqr", plant, sample_time))
            for k in range(round(0.05 / sample_time)):
                inside((count * math.floor(speed * k * sample_time / count), 0.0))
            off[speed] = inside.off
        assert off == {7.9: "on", 8.9: "speed"}

    def test_the_encoders_that_a_controller_is_made_for_count(self):
        plant = QUBE.replace(limits={"arm_speed": 5.0}, sensors={"encoder_counts": 1024})
        controller = make_controller("dlqr", plant, 0.001, Sensors(512))
        assert Envelope.of(controller).resolution == pytest.approx(2 * math.pi / 512)
        assert (
            "arm faster than 5 rad/s, by more than a count (512 a turn) in 0.005 s, so surely off from 7.45"
            in c_header(controller)
        )
        path = Path(__file__).parents[2] / "controllers" / "policies" / "swing-up-qube.zip"
        assert Envelope.of(make_controller(path, QUBE, sensors=Sensors(512))).resolution == pytest.approx(math.pi / 256)

    def test_missed_samples_span_their_time(self):
        inside = guarded(arm_speed=5.0)
        for q1 in (0.0, math.nan, math.nan, 0.055):  # in 12 ms
            inside((q1, 0.0))
        assert inside.off == "on"

    @pytest.mark.parametrize("name", ["lqr", "lqg", "lqi"])
    @pytest.mark.parametrize("missed", [1, 2])
    def test_a_dropped_reading_makes_no_kick(self, name, missed):
        """The arm turns steadily: the command is that of a law that saw every sample, not of one that saw a jump."""
        whole, broken = (Guarded(make_controller(name, QUBE, 0.004)) for _ in range(2))
        for k in range(40):
            y = 0.004 * k, 0.0008 * k
            expected = whole(y)
            found = broken((math.nan, math.nan) if 20 <= k < 20 + missed else y)
            assert found == (0.0 if 20 <= k < 20 + missed else pytest.approx(expected, abs=1e-9))

    @pytest.mark.parametrize("bad", [math.nan, math.inf, 2e4])
    def test_a_bad_reference_is_a_bad_reading(self, bad):
        inside, plain = guarded(), guarded()
        inside.controller.reference = lambda t: bad if 0.0115 < t < 0.0185 else 0.1  # two samples
        plain.controller.reference = 0.1
        told = [(inside((0.01 * k, 0.02)), plain((0.01 * k, 0.02))) for k in range(10)]
        assert [ours for ours, _ in told[3:5]] == [0.0, 0.0]
        assert [ours for ours, _ in told[5:]] == pytest.approx([other for _, other in told[5:]])
        inside.controller.reference = bad
        assert [inside((0.1, 0.02)) for _ in range(3)] == [0.0] * 3
        assert inside.off == "reading"

    def test_both_may_turn_by_nearly_half_a_turn_in_a_sample(self):
        inside = guarded(tilt=math.inf, arm_travel=100.0)
        for k in range(20):
            inside((3.1 * k, 3.1 * k))
        assert inside.off == "on"

    def test_one_jump_of_the_arm_costs_one_sample(self):
        inside, plain = guarded(), guarded()
        told = [inside((0.01 * k + (5.0 if k == 5 else 0.0), 0.0)) for k in range(10)]
        expected = [plain((0.01 * k, 0.0)) for k in range(10)]
        assert told == pytest.approx([0.0 if k == 5 else u for k, u in enumerate(expected)], abs=1e-9)

    def test_soft_start_and_slew(self):
        full, soft = guarded()((0.0, 0.1)), guarded(soft_start=0.04)
        first = [soft((0.0, 0.1)) for _ in range(3)]
        assert abs(first[0]) == pytest.approx(abs(full) / 11, rel=1e-6)
        slow = guarded(slew=25.0)
        assert np.abs(np.diff([0.0] + [slow((0.0, 0.3)) for _ in range(20)])) == pytest.approx(0.1)

    def test_a_loop_that_is_late_sees_no_speed_that_is_not_there(self):
        """40 ms of a stall: with the time, the arm's speed is the true one, and the filters step through it."""
        turn = lambda t: (0.5 * t, 0.02)  # noqa: E731
        times = [0.004 * k for k in range(50)]
        late = [t for t in times if not 0.1 < t < 0.14]
        commands = {}
        for name, clock in (("all", times), ("stamped", late)):
            inside = guarded(arm_speed=1.0)
            commands[name] = {t: inside(turn(t), t=t) for t in clock}
            assert inside.off == "on"
        assert commands["stamped"][late[-1]] == pytest.approx(commands["all"][late[-1]], abs=1e-9)
        blind = guarded(arm_speed=1.0)
        for t in late:
            blind(turn(t))
        assert blind.off == "speed"

    def test_a_loop_that_stalls_goes_off(self):
        inside = guarded()
        inside((0.0, 0.01), t=0.0)
        assert inside((0.0, 0.01), t=0.3) == 0.0
        assert inside.off == "late"

    @pytest.mark.parametrize("pace", [1.4, 0.7])
    def test_the_arms_speed_is_that_of_the_clock(self, pace):
        """In a loop that is always slower or faster than its controller."""
        for speed, off in ((0.9, "on"), (1.1, "speed")):
            inside = guarded(arm_speed=1.0, resolution=0.0)
            for k in range(60):
                inside((speed * pace * 0.004 * k - 0.1, 0.001 * (k % 2)), t=pace * 0.004 * k)
            assert inside.off == off

    def test_a_slow_loop_is_made_up_for(self):
        """Its filters see as many samples as went by."""
        inside, seen = guarded(), []
        follow = inside.controller.follow
        inside.controller.follow = lambda y, r: seen.append(1) or follow(y, r)
        for k in range(100):
            inside((0.0, 1e-3), t=0.0056 * k)
        assert len(seen) == pytest.approx(1.4 * 99 + 1, abs=1)

    @pytest.mark.parametrize("stamps", [[0.0, 0.0, 0.0, 0.0156, 0.0156], [5.0, 5.004, 1.0, 1.004], [0.0, math.nan]])
    def test_a_clock_that_is_coarse_or_was_set_says_nothing(self, stamps):
        inside = guarded()
        for t in stamps:
            inside((0.0, 0.01), t=t)
        assert inside.off == "on"

    def test_a_law_that_gives_no_number(self):
        inside = guarded()
        inside.controller._command = lambda y, r: math.nan
        assert (inside((0.0, 0.1)), inside.off) == (0.0, "law")

    def test_bad_numbers_are_refused(self):
        for change in (
            *({"slew": 0.0}, {"tilt": -1}, {"arm_travel": math.nan}, {"soft_start": math.inf}),
            *({"bad_readings": math.inf}, {"bad_readings": 2.5}, {"resolution": math.inf}),
        ):
            with pytest.raises(ValueError, match="envelope"):
                guarded(**change)
