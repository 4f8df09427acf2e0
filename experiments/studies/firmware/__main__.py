"""What exported controllers need on two microcontrollers: `python -m experiments.studies.firmware`.

Each is exported in single precision, compiled with -Os, and run in a simulator: an ATmega328P (Arduino Uno) in simavr,
which counts cycles, and a Cortex-M4F in QEMU, which counts instructions. Needs the compilers and simulators of Debian's
packages gcc-avr, avr-libc, simavr, gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm; a processor whose
tools are missing is left out, which is said.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from controllers import make_controller
from controllers.exports.c import c_header
from controllers.exports.policy_c import policy_c_header
from controllers.learned.policy import LearnedController
from controllers.policies import FOLDER
from experiments.cli.errors import explained
from furuta_gym.plant import Plant

HERE = Path(__file__).parent
TICK = 40  # instructions of QEMU's `-icount shift=0`, 1 ns each, in one tick of the board's 25 MHz
ARM_STEPS = 1000
_TOO_LARGE = re.compile(r"overflowed|will not fit|not within region")


@dataclass(frozen=True)
class Processor:
    """How a program is built and run for a processor. built, run: commands, without the source and the program."""

    name: str
    source: str
    build: tuple[str, ...]
    link: tuple[str, ...]
    size: str
    run: tuple[str, ...]

    @property
    def missing(self) -> list[str]:
        """Tools that this machine lacks."""
        return [tool for tool in (self.build[0], self.size, self.run[0]) if shutil.which(tool) is None]


AVR = Processor(
    "ATmega328P",
    "avr.c",
    ("avr-gcc", "-mmcu=atmega328p", "-std=c99"),
    ("-lm",),
    "avr-size",
    ("simavr", "-m", "atmega328p", "-f", "16000000"),
)
ARM = Processor(
    "Cortex-M4F",
    "arm.c",
    ("arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-std=gnu99"),
    ("-nostartfiles", "-T", str(HERE / "arm.ld"), "-lm", "-lc", "-lnosys"),
    "arm-none-eabi-size",
    (
        *("qemu-system-arm", "-M", "mps2-an386", "-icount", "shift=0", "-display", "none", "-monitor", "none"),
        *("-serial", "none", "-semihosting-config", "enable=on,target=native", "-kernel"),
    ),
)


@dataclass(frozen=True)
class Need:
    """Bytes of a whole program with constants (flash) and of its static data (RAM); counts of one step."""

    flash: int
    ram: int
    counts: tuple[int, ...]


def need(processor: Processor, header: str) -> Need | str:
    """What a header needs on a processor, or why it cannot run there. header: of `c_header` or `policy_c_header`."""
    found = re.search(r"\b(\w+)_reset\(&s\)", header)
    assert found is not None, "the header's comment shows how it is called"
    prefix = found[1]
    with tempfile.TemporaryDirectory(prefix="firmware-") as room:
        Path(room, "law.h").write_text(header, encoding="utf-8")
        names = {"HEADER": '"law.h"', "STATE": f"{prefix}_state", "RESET": f"{prefix}_reset", "STEP": f"{prefix}_step"}
        source = (*(f"-D{name}={value}" for name, value in names.items()), f"-I{room}", str(HERE / processor.source))
        program = str(Path(room, "law.elf"))
        built = _call(*processor.build, "-Os", "-Wall", "-Wextra", *source, "-o", program, *processor.link)
        if built.returncode:
            return "does not fit" if _TOO_LARGE.search(built.stderr) else built.stderr
        text, data, bss = (int(n) for n in _call(processor.size, program).stdout.splitlines()[1].split()[:3])
        if processor is AVR and data + bss > 1800:  # of 2048 bytes; the stack takes the rest
            return "does not fit"
        ran = _call(*processor.run, program)
        return Need(text + data, data + bss, tuple(int(n) for n in re.findall(r"(?m)\b(\d+)\.?$", _plain(ran))))


def _call(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def _plain(ran: subprocess.CompletedProcess[str]) -> str:
    """What the program printed: simavr colours it, and adds lines of its own."""
    lines = re.sub(r"\x1b\[[0-9;]*m", "", ran.stdout + ran.stderr).splitlines()
    return "\n".join(line for line in lines if re.fullmatch(r"\d+\.?", line.strip()))


def headers(plant: Plant) -> dict[str, str]:
    """The C of each controller: two designed ones, and a policy that comes with the project."""
    designed = {name: c_header(make_controller(name, plant), single=True) for name in ("lqr", "lqg")}
    policy = make_controller(str(FOLDER / "balance-qube.zip"), plant)
    assert isinstance(policy, LearnedController)
    return designed | {"balance-qube.zip": policy_c_header(policy, single=True)}


def row(name: str, processor: Processor, found: Need | str) -> str:
    """A row of the table."""
    if isinstance(found, str):
        return f"| `{name}` | {processor.name} | {found.strip().splitlines()[-1]} | | |"
    if processor is AVR:
        step = f"{found.counts[0]} cycles at most: {found.counts[0] / 16e3:.2f} ms at 16 MHz"
    else:
        step = f"{found.counts[0] * TICK // ARM_STEPS} instructions"
    return f"| `{name}` | {processor.name} | {found.flash} | {found.ram} | {step} |"


def main() -> None:
    """Print what each controller needs on each processor."""
    processors = []
    for processor in (AVR, ARM):
        if processor.missing:
            print(f"{processor.name} is left out: {', '.join(processor.missing)} not found", file=sys.stderr)
        else:
            processors.append(processor)
    if not processors:
        raise ValueError("no compiler and simulator of a microcontroller found; the module's text names the packages")
    print("| controller | processor | flash [bytes] | static RAM [bytes] | a step |")
    print("|---|---|---|---|---|")
    for name, header in headers(Plant.resolve("qube")).items():
        for processor in processors:
            print(row(name, processor, need(processor, header)))


if __name__ == "__main__":
    with explained():
        main()
