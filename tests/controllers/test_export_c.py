"""The C header, compiled by the machine's compiler, against the Python controller."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from controllers import make_controller
from controllers.exports.c import c_header, export_c
from controllers.exports.policy_c import policy_c_header
from controllers.policies import FOLDER
from furuta_gym.plant import QUBE, TABLE_3, Effect
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import simulate
from identification import Log, write_log
from identification.design.signals import paper_signal

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")

MAIN = """\
#include <stdio.h>
#include "controller.h"
#include "controller.h" /* including it twice must not matter */
int main(void)
{
    controller_state s;
    double q1, q2, r;
    controller_reset(&s);
    while (scanf("%lf %lf %lf", &q1, &q2, &r) == 3) printf("%.17g\\n", controller_step(&s, q1, q2, r));
    return 0;
}
"""

CASES = {
    "paper-lqr": (TABLE_3, "paper-lqr"),
    "lqr": (QUBE, "lqr"),
    "lqg": (TABLE_3, "lqg"),
    "lqi": (QUBE, "lqi"),
    "lqg-friction": (QUBE, "lqg-friction"),
    "delay and lag": (
        QUBE.with_effects(Effect("input_delay", {"d": 0.009}), Effect("actuator_lag", {"T": 0.01})),
        "lqg",
    ),
    "dead zone and offset": (
        QUBE.with_effects(Effect("input_dead_zone", {"w": 0.1}), Effect("input_offset", {"b": 0.2})),
        "dlqr",
    ),
    "cubic gain and dead zone": (
        QUBE.with_effects(Effect("input_cubic_gain", {"a": -0.002}), Effect("input_dead_zone", {"w": 0.2})),
        "dlqr",
    ),
    "zeros of both encoders": (
        QUBE.replace(sensors={"offset": [0.3, -0.02]}).with_effects(Effect("pendulum_encoder_offset", {"b": 0.05})),
        "lqg",
    ),
    "tilt and encoder offset": (
        QUBE.with_effects(QUBE.default_effect("base_tilt"), Effect("pendulum_encoder_offset", {"b": 0.02})),
        "lqr-friction",
    ),
}


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc or clang) on this machine")
@pytest.mark.parametrize("case", CASES)
def test_compiled_header_gives_the_same_commands(case, tmp_path):
    plant, name = CASES[case]
    controller = make_controller(name, plant, 0.004)
    export_c(controller, tmp_path / "controller.h", prefix="controller")
    (tmp_path / "main.c").write_text(MAIN)
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic", "-ffp-contract=off"]
    program = tmp_path / "main"
    subprocess.run([str(COMPILER), *flags, "-o", program, tmp_path / "main.c", "-lm"], check=True, timeout=60)

    rng = np.random.default_rng(4)
    y = 0.02 * rng.standard_normal((400, 2)).cumsum(axis=0) * [1.0, 0.3] + [0.1, 0.05]
    reference = np.where(np.arange(400) < 200, 0.0, 0.4)
    text = "\n".join(f"{a!r} {b!r} {r!r}" for (a, b), r in zip(y.tolist(), reference.tolist(), strict=True))
    answer = subprocess.run([program], input=text, capture_output=True, text=True, check=True, timeout=60)
    from_c = np.array([float(line) for line in answer.stdout.split()])

    controller.reference = lambda t: reference[min(round(t / 0.004), 399)]
    controller.reset()
    from_python = np.array([controller(step) for step in y])
    assert 0.02 < np.mean(np.abs(from_python) >= plant.u_max - 1e-6) < 0.98  # limited at times, not always
    assert from_c == pytest.approx(from_python, abs=1e-9 * plant.u_max)


@pytest.mark.skipif(shutil.which("g++") is None, reason="no g++ on this machine")
@pytest.mark.parametrize("single", [False, True])
def test_a_header_compiles_as_cpp_too(single, tmp_path):
    export_c(make_controller("lqg", QUBE, 0.004), tmp_path / "lqg.h", single=single)
    (tmp_path / "main.cpp").write_text('#include "lqg.h"\n')
    flags = ["-std=c++11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only"]
    subprocess.run(["g++", *flags, tmp_path / "main.cpp"], check=True, timeout=60)


FIRMWARE = """
static long arm, pendulum;
static double volts;
static long arm_count(void) { return arm; }
static long pendulum_count(void) { return pendulum; }
static void motor_volts(float u) { volts = u; }
static void watchdog_kick(void) {}
static void interrupts_off(void) {}
static void interrupts_on(void) {}
"""
SESSION = """
#include <stdio.h>
int main(void)
{
    int start;
    while (scanf("%d %ld %ld", &start, &arm, &pendulum) == 3) {
        if (start) control_start();
        control_tick();
        printf("%.9g %d\\n", volts, controller.off);
    }
    return 0;
}
"""


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc or clang) on this machine")
def test_the_firmware_of_the_page_balances_and_stays_off_until_its_button(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "export.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```c\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    controller = make_controller("lqr", QUBE, 0.004)
    export_c(controller, tmp_path / "lqr.h", single=True)
    (tmp_path / "main.c").write_text(FIRMWARE + code + SESSION)
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run([str(COMPILER), *flags, "-o", tmp_path / "main", tmp_path / "main.c", "-lm"], check=True, timeout=60)
    steps = [(0, 0, 2048), (1, 10, 2058), (0, 11, 2055), (0, 0, 900), (0, 0, 2048), (1, 10, 2058), (1, 10, -2038)]
    text = "\n".join(" ".join(str(number) for number in step) for step in steps)
    said = subprocess.run([tmp_path / "main"], input=text, capture_output=True, text=True, check=True, timeout=60)
    volts, off = zip(*((float(u), int(o)) for u, o in map(str.split, said.stdout.splitlines())), strict=True)
    count = 2 * np.pi / 4096
    controller.reset()
    law = [controller(count * np.array([q1, 2048.0 - q2])) for _, q1, q2 in steps[1:3]]  # the page flips q2
    assert volts == pytest.approx([0.0, *law, 0.0, 0.0, law[0], law[0]], abs=1e-3)  # lifted to either side
    assert off == (0, 0, 0, 4, 4, 0, 0)  # 1.76 rad is farther than horizontal, and stays the reason


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc or clang) on this machine")
def test_the_check_of_a_build_on_the_page_runs(tmp_path, monkeypatch, capsys):
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "export.md").read_text(encoding="utf-8")
    (code,) = re.findall(
        r"```python\n(.*?)```", page.partition("### Check your build")[2].partition("\n## ")[0], re.DOTALL
    )
    monkeypatch.chdir(tmp_path)
    QUBE.save("final.json")
    export_c(make_controller("lqr", QUBE), "lqr.h", single=True)
    run = simulate(
        QUBE, make_controller("lqr", QUBE), 5.0, 0.004, Sensors(2048), paper_signal(), x0=(0.1, 0.05, 0.0, 0.0)
    )
    write_log("upright.csv", Log.from_run(run, "V", 2048))
    exec(compile(code.replace('"cc"', repr(str(COMPILER))), "export.md", "exec"), {})
    difference, command = (float(x) for x in re.findall(r"[\d.]+(?:e[-+]\d+)?", capsys.readouterr().out))
    assert difference < 1e-3 * command


def test_header_says_what_a_reader_needs():
    text = c_header(make_controller("lqg", TABLE_3, 0.002))
    for part in ("[rad]", "0 upright", "once every 0.002 s", "command [V]", "furuta_lqg_step", "0.19717"):
        assert part in text
    assert "math.h" not in text


LOGS = [{"source": "a.csv", "read_as": "q2 from the column 'pen */ deg'"}, {"source": "b.csv"}]
FULL = QUBE.replace(
    limits={"arm_travel": 1.2, "arm_speed": 9.0}, sensors={"offset": [0.3, -0.02]}, provenance={"logs": LOGS}
).with_effects(Effect("input_delay", {"d": 0.009}))


@pytest.mark.parametrize(("name", "header"), [("lqg", c_header), (FOLDER / "balance-qube.zip", policy_c_header)])
def test_header_says_what_its_plant_has(name, header):
    """Its parameters, effects and limits, and which columns of which logs are meant."""
    text = header(make_controller(name, FULL))
    for part in (
        " for theta = 0.05668, 0.0199692, ",
        "\n * and input_delay(d = 0.009).\n",
        " * Limits of the plant file: arm_travel 1.2, arm_speed 9. This header: up to 1.2 rad to either side, up to 9 ",
        " * The logs that the plant was fitted to were read in several ways:\n *   q2 from the column 'pen * / deg'\n",
        " *   in the columns q1, q2 and u themselves\n",
    ):
        assert part in text
    plain = header(make_controller(name, QUBE))
    assert "The plant file has no limits: " in plain
    assert "\n * and " not in plain


def test_header_says_which_zeros_it_takes_off():
    text = c_header(make_controller("lqg", FULL))
    assert "at the zeros: 0.3 rad of q1, -0.02 rad of q2.\n * Export from a plant without them if" in text
    assert "Taken off" not in c_header(make_controller("lqg", QUBE))


class TestRefusals:
    def test_not_linear(self):
        with pytest.raises(ValueError, match="not linear"):
            c_header(make_controller("swing-up", QUBE))

    def test_prefix(self):
        with pytest.raises(ValueError, match="C name"):
            c_header(make_controller("lqr", QUBE), prefix="2fast")

    def test_eccentric_encoder(self):
        plant = QUBE.with_effects(QUBE.default_effect("arm_encoder_eccentricity"))
        with pytest.raises(ValueError, match="arm_encoder_eccentricity"):
            c_header(make_controller("lqr", plant))

    def test_cancelled_ripple(self):
        plant = QUBE.with_effects(QUBE.default_effect("arm_ripple"))
        with pytest.raises(ValueError, match="export dlqr or lqg"):
            c_header(make_controller("lqr-friction", plant))
        c_header(make_controller("lqg", plant))
