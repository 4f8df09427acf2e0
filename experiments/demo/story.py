"""The mission on logs that come with the package: from a measured log to a plant, to what the model misses, and to
controllers and policies that balance the rig itself.

``furuta demo`` runs it. ``python -m experiments.demo.story --record`` makes the bundled logs anew, on the virtual
bench, which shares no code with the plant model that is fitted here.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.demo import policies
from experiments.demo.page import rig_section

if TYPE_CHECKING:
    from experiments.bench import Rig
    from experiments.report import Examination
    from furuta_gym.plant import Plant
    from identification.estimation.estimate import Estimate
    from identification.logs.log import Log

Say = Callable[..., None]
Work = policies.Work

FILES = ("rig.json", "gap.json", "diagnosis.json", "plant.json", "report.html", "parameters.png", "prediction.png",
         "comparison.json", "comparison_without.json", "policy_without.zip", "policy_with.zip",
         "demo.json")  # fmt: skip
"""What the demo writes."""

LOGS = Path(__file__).parent / "logs"
FITTED, HELD_OUT, TRUTH = LOGS / "paper.csv", LOGS / "wide.csv", LOGS / "truth.json"
HORIZON = 0.2  # s, of the predictions that are drawn
CONTROLLERS = ("lqr", "lqg")
_PARTS = 6  # of the story, the policies last
TRIALS = 20  # of each controller and group


def demo_rig() -> Rig:
    """One individual of a quick, direct-driven kind, with small torque noise. Its commands reach the motor late, which
    model (5) does not know; there a controller made with the effect differs from one made without."""
    from experiments.bench import HiddenEffect, Rig

    late = HiddenEffect("input_delay", strength=3.0)
    return Rig("servo", [late], individual=11, scatter=0.08, torque_noise=(1e-6, 1e-8), name="demo rig")


def record_logs() -> None:
    """Make the bundled logs: two experiments on the demo's rig."""
    from experiments.bench import record

    rig = demo_rig()
    LOGS.mkdir(exist_ok=True)
    record(rig, "paper", seed=1).write(FITTED)
    held_out = record(rig, "wide", seed=2)
    held_out.write(HELD_OUT)
    held_out.write_truth(TRUTH)


def run_demo(
    out: Path,
    seed: int = 0,
    say: Say = print,
    steps: int = policies.STEPS,
    shown: Path | None = None,
    work: Work = policies.quietly,
) -> dict[str, Any]:
    """Run the story, write its files into `out`, and return its figures.

    say(line) is called for every line of text. steps: of the training of each policy; 0 leaves the policies out. shown:
    the folder that the text names, where `out` will get another name. work: see `policies.Work`; what it is given names
    the step, and of how many. Raises OSError if `out` cannot be written.
    """
    from experiments.demo import plots
    from experiments.report import render
    from experiments.report.diagnosis_page import diagnosis_page

    started = time.perf_counter()
    out.mkdir(parents=True, exist_ok=True)
    truth = json.loads(TRUTH.read_text(encoding="utf-8"))
    tellers = [_Teller(n, _PARTS if steps else _PARTS - 1, say, work) for n in range(1, _PARTS + 1)]
    fitted, held_out = _read(tellers[0])
    estimate = _identify(fitted, out, tellers[1])
    gap = _validate(estimate, held_out, out, tellers[2])
    examination = _diagnose(fitted, held_out, truth, out, tellers[3])
    after = examination.diagnosis.after
    assert after is not None
    with tellers[3].work("drawing"):
        fits = {"model (5)": estimate, "effect added": after}
        plots.draw_parameters(fits, truth["theta"], out / "parameters.png")
        before, new = predictions(estimate.plant, held_out), predictions(after.plant, held_out)
        plots.draw_predictions(before, new, out / "prediction.png")
    compared = _compare(estimate.plant, after.plant, out, seed, tellers[4])
    played = _play(estimate.plant, after.plant, out, seed, steps, tellers[5]) if steps else None
    page = diagnosis_page(examination, extra=(rig_section(played),) if played else ())
    (out / "report.html").write_text(render(page), encoding="utf-8")
    figures = {
        "estimate": estimate.to_dict(),
        "gap": gap,
        "diagnosis": examination.to_dict(),
        "held": compared,
        "rig": played.to_dict() if played else None,
        "largest_error_in_std": {
            "model (5)": _off(estimate, truth["theta"]),
            "effect added": _off(after, truth["theta"]),
        },
        "runtime_s": round(time.perf_counter() - started, 1),
    }
    _write_json(out / "demo.json", figures)
    _conclude(shown or out, figures, played, say)
    return figures


@dataclass(frozen=True)
class _Teller:
    """Tells of one part of the story, the n-th of so many."""

    n: int
    of: int
    say: Say
    shown_by: Work

    def begin(self, text: str) -> None:
        self.say(f"{'' if self.n == 1 else chr(10)}{self.n} of {self.of}  {text}")

    def work(self, text: str) -> AbstractContextManager[policies.Tell]:
        return self.shown_by(f"{self.n} of {self.of}, {text}")


def _read(tell: _Teller) -> tuple[Log, Log]:
    from identification.logs.reading import read_log

    tell.begin("Read two logs of one rig: one to fit, one of another experiment that is never fitted")
    logs = read_log(FITTED), read_log(HELD_OUT)
    for log in logs:
        tell.say(_indented(str(log)))
    return logs


def _identify(log: Log, out: Path, tell: _Teller) -> Estimate:
    from identification.estimation.identify import identify

    tell.begin("Identify model (5) from the first log (prediction error; a few seconds) …")
    with tell.work("fitting"):
        estimate = identify(log)
    estimate.save(out / "rig.json")
    tell.say(_indented(str(estimate)))
    return estimate


def _validate(estimate: Estimate, log: Log, out: Path, tell: _Teller) -> dict[str, Any]:
    from identification.validation.gap import validate

    tell.begin("Validate on the log that was not fitted …")
    with tell.work("predicting"):
        result = validate(estimate.plant, [log])
    _write_json(out / "gap.json", result.to_dict())
    tell.say(_indented(str(result)))
    return result.to_dict()["gap"]


def _diagnose(log: Log, held_out: Log, truth: dict[str, Any], out: Path, tell: _Teller) -> Examination:
    """Search for what is missing; writes diagnosis.json and plant.json (with it)."""
    from experiments.report import examine
    from identification.diagnosis.diagnose import diagnose

    say = tell.say
    tell.begin("The gap is far above the noise: diagnose what model (5) misses (a minute or two) …")
    with tell.work("diagnosing") as progress:
        examination = examine(diagnose([log], [held_out], progress=progress), [log], [held_out], progress=progress)
    _write_json(out / "diagnosis.json", examination.to_dict())
    if examination.diagnosis.plant is not None:
        examination.diagnosis.plant.save(out / "plant.json")
    say(_indented(str(examination.diagnosis)))
    change = examination.gap
    assert change is not None
    say(
        f"   held-out gap: {change.over_floor(change.before):.2f} times the noise floor before, "
        f"{change.over_floor(change.after):.2f} after; closed share {change.closed}"
    )
    hidden = ", ".join(
        f"{e['name']}(" + ", ".join(f"{p} = {v['value']:.4g}" for p, v in e["parameters"].items()) + ")"
        for e in truth["effects"]
    )
    say(f"   what the bench had hidden: {hidden}")
    say("\n      parameter   true      model (5)                      error    effect added                   error")
    for i, (name, true) in enumerate(truth["theta"].items()):
        sides = [
            f"{e.shown(name):<20} {100 * (e.values[i] / true - 1):+8.2f} %"
            for e in (examination.diagnosis.before, examination.diagnosis.after)
            if e is not None
        ]
        say(f"      {name}   {true:9.5f}  {'   '.join(sides)}")
    return examination


def predictions(plant: Plant, log: Log, horizon: float = HORIZON) -> dict[str, Any]:
    """Readings and what the plant predicted for them `horizon` seconds before, from the filtered states: arrays."""
    from identification.validation.free_run import Windows, free_run
    from identification.validation.gap import filtered

    path = filtered(plant, log)
    record = path.record
    windows = Windows.over(record.t, (horizon,), settle=1.0, per_horizon=20)
    errors = free_run(path, windows)[:, 0]
    at = windows.targets[:, 0]
    return {"t": record.t[at], "measured": record.y[at], "predicted": record.y[at] - errors, "horizon": horizon}


def _compare(without: Plant, with_it: Plant, out: Path, seed: int, tell: _Teller) -> dict[str, dict[str, float]]:
    """Controllers designed from both plants, in the same trials on the plant that has the effect. Writes
    comparison.json of those that know the effect, and comparison_without.json. Returns the share of trials held, by
    plant and controller."""
    from controllers.comparison.evaluation import compare

    names = " and ".join(CONTROLLERS)
    tell.begin(f"Design {names} from the plant without and with the effect, and play them on the one that has it …")
    held: dict[str, dict[str, float]] = {}
    for side, design, file in (("without", without, "comparison_without"), ("with", with_it, "comparison")):
        with tell.work(f"playing what was designed {side} the effect"):
            found = compare(
                with_it, CONTROLLERS, design_plant=design, trials=TRIALS, duration=5.0, groups=("balance",), seed=seed
            )
        _write_json(out / f"{file}.json", found.to_dict())
        held[side] = {name: rows["balance"]["success"].value for name, rows in found.scores.items()}
        shares = [f"{name} holds {100 * share:.0f} % of {TRIALS} trials" for name, share in held[side].items()]
        shares += [f"{name} is left out: {why}" for name, why in found.skipped.items()]
        tell.say(f"   designed {side} the effect: {', '.join(shares)}")
    return held


def _play(without: Plant, with_it: Plant, out: Path, seed: int, steps: int, tell: _Teller) -> policies.Trial | None:
    """Policies and LQRs of both plants on the rig; None without the extra "rl"."""
    say = tell.say
    tell.begin("Train a policy on the plant without and with the effect, and play it and an LQR on the rig itself …")
    try:
        trial = policies.try_on_rig(without, with_it, demo_rig(), out, seed, say, steps, tell.work)
    except ValueError as error:
        say(f"   left out: {error}")
        return None
    say(f"   {policies.RUNS} runs of {policies.DURATION:g} s on the rig, from the same starts (95 % intervals)")
    for row in (trial.head, *trial.rows):
        say("   " + "".join(f"{cell:<{width}}" for cell, width in zip(row, (34, 8, 26, 28, 0), strict=True)).rstrip())
    for name in trial.names:
        say(f"   {name} with the effect, against without it: {trial.verdict(name)}")
    return trial


def _off(estimate: Estimate, truth: dict[str, float]) -> float:
    """The largest error of an identified θ in units of its standard deviation."""
    lost = estimate.identifiability.unidentified
    names = [name for name in truth if name not in lost]
    value = dict(zip(estimate.names, zip(estimate.values, estimate.std, strict=True), strict=True))
    return max(float(abs(value[n][0] - truth[n]) / value[n][1]) for n in names)


def _conclude(out: Path, figures: dict[str, Any], trial: policies.Trial | None, say: Say) -> None:
    off = figures["largest_error_in_std"]
    change = figures["diagnosis"]["gap"]
    say("\nWhat was found")
    say(f"  - Model (5) alone: the identified θ are up to {off['model (5)']:.1f} standard deviations from the bench's")
    say(f"    truth, and the held-out error is {change['before']['ratio_to_floor']:.2f} times the noise floor.")
    say(
        f"  - With the effect added: {off['effect added']:.1f} standard deviations, "
        f"{change['after']['ratio_to_floor']:.2f} times."
    )
    for name in trial.names if trial else ():
        assert trial is not None
        say(f"  - On the rig, the {name} made with the effect against the one made without: {trial.verdict(name)}.")
    say("What to look at")
    for name, what in (
        ("report.html", "the whole story, from the verdict to the rig; open it in a browser"),
        ("prediction.png", "the held-out log, and what the plants predicted for it, without and with the effect"),
        ("parameters.png", "the error of each estimate against the truth, with 95 % error bars"),
        ("comparison.json", "the controllers designed with the effect, figure by figure, with 95 % intervals"),
        ("plant.json", "the plant file; try `furuta compare --plant plant.json --controllers lqr,lqg -o out`"),
        *(
            (("policy_with.zip", "the policy; `furuta export plant.json policy_with.zip -o policy.h`"),)
            if trial
            else ()
        ),
    ):
        say(f"  {out / name}: {what}")
    say("Caveats")
    for text in CAVEATS:
        say(f"  - {text}")
    say(f"Done in {figures['runtime_s']:.0f} s.")


CAVEATS = (
    "The logs are from a simulated bench. It shares no code with the plant model, but what it hides is in the library "
    "of effects, in the library's own form. A real rig may follow another law. Error bars may then be too small.",
    "This rig was chosen because the effect matters for its control. Where it matters less, controllers made with it "
    "and without it hardly differ.",
    "u_max in plant.json is the largest command in the log, with a margin. Set it to your amplifier's limit. The "
    "policies and LQRs of step 6 know the rig's own.",
    "Each policy was trained once, for a short time. Another seed gives another policy, and the difference may exceed "
    "that of ten runs.",
)


def _write_json(path: Path, data: Any) -> None:
    path.write_text(json.dumps(data, ensure_ascii=False, indent=2) + "\n", encoding="utf-8")


def _indented(text: str) -> str:
    return "\n".join("   " + line for line in text.splitlines())


if __name__ == "__main__":
    if sys.argv[1:] != ["--record"]:
        sys.exit("usage: python -m experiments.demo.story --record   (to run the demo: furuta demo)")
    record_logs()
