"""The commands that write, each with what it writes and how a stopped one goes on."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Case:
    """A command: its arguments with `{in}` and `{out}` for folders, and what it writes in `{out}`.

    together: they are of one run, all of them. again: further arguments with which a stopped run goes on, and the
    pattern of the files that it goes on from. last: what is there when a run has ended whose result is not made anew,
    so that the next one starts from nothing.
    """

    arguments: str
    writes: tuple[str, ...]
    together: bool = True
    again: tuple[str, str] | None = None
    last: str | None = None


CASES = {
    "simulate": Case("simulate --plant qube --controller lqr --duration 2 -o {out}/log.csv", ("log.csv",)),
    "simulate-npz": Case("simulate --plant qube --controller lqr --duration 2 -o {out}/log.npz", ("log.npz",)),
    "bench": Case(
        "bench record --rig rig-01 --duration 2 --reveal -o {out}/b.csv", ("b.csv", "b.truth.json"), together=False
    ),
    "seal": Case("bench seal --groups 1 --kinds none --key-file {in}/key --seed 1 -o {out}/s", ("s",), last="s"),
    "init": Case("init {in}/log.csv --yes -o {out}/rig.toml", ("rig.toml",)),
    "identify": Case("identify {in}/log.csv -o {out}/rig.json", ("rig.json",)),
    "identify-page": Case(
        "identify {in}/log.csv -o {out}/rig.json --plot {out}/fit.png --report {out}/page.html",
        ("rig.json", "fit.png", "page.html"),
        together=False,
    ),
    "validate": Case(
        "validate table3 {in}/log.csv --plots {out}/plots --json {out}/gap.json --report {out}/page.html",
        ("plots", "gap.json", "page.html"),
        together=False,
    ),
    "residuals": Case("residuals {in}/log.csv --plant table3 -o {out}/r", ("r",)),
    "excite": Case("excite --plant qube --duration 2 -o {out}/u.csv", ("u.csv",)),
    "export-c": Case("export qube --controller lqr -o {out}/lqr.h", ("lqr.h",)),
    "export-onnx": Case("export qube {in}/policy.zip -o {out}/p.onnx", ("p.onnx",)),
    "export-mjcf": Case("export qube -o {out}/qube.xml", ("qube.xml",)),
    "compare": Case("compare --plant qube --trials 4 --duration 0.5 --groups balance,push -o {out}/c", ("c",)),
    "train": Case(
        "train --plant qube --algo ppo --steps 20000 -o {out}/policy.zip",
        ("policy.zip", "policy.json"),
        together=False,
        again=("--resume", "policy.checkpoint/[0-9]*"),
        last="policy.json",
    ),
    "trials": Case(
        "trials --seeds 1 --kinds none --rigs workshop --jobs 2 -o {out}/t", ("t",), False, last="t/summary.json"
    ),
    "diagnose": Case("diagnose {in}/log.csv --held-out {in}/other.csv --max-effects 1 -o {out}/d", ("d",)),
    "demo": Case("demo --out {out}/demo", ("demo",)),
}
