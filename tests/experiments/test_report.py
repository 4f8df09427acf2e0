"""The report of a diagnosis: its numbers are those of the files, its page stands alone and draws in a real browser."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

pytest.importorskip("plotly", reason="the report needs the extra 'report'")
pytest.importorskip("jinja2", reason="the report needs the extra 'report'")

from experiments.cli import app
from experiments.report import Examination, examine, render
from experiments.report.diagnosis_page import diagnosis_page
from experiments.report.drawing import MOST_POINTS
from experiments.report.estimate_page import estimate_page
from experiments.report.page import plotly_js
from experiments.report.search_figures import rankings
from experiments.report.validation_page import adequacy, validation_page
from experiments.report.verdict import verdict as first_screen
from furuta_gym.plant import TABLE_3, Effect
from identification.diagnosis.diagnose import diagnose
from identification.diagnosis.gap_change import GapChange, rms_interval
from identification.diagnosis.held_out import HeldOut
from identification.diagnosis.learned import Learned
from identification.diagnosis.policy import DecisionPolicy
from identification.diagnosis.verify import measure_gap, verified
from identification.estimation.estimate import rounded
from identification.logs.log import Log, read_log, write_log
from identification.validation.gap import closed_fraction, validate
from tests.factories import loop_log


@pytest.fixture(scope="module")
def logs() -> tuple[Log, Log]:
    """A log of a rig with a spring at the arm, and another run of it."""
    return loop_log("arm_spring", duration=8.0)[0], loop_log("arm_spring", duration=6.0, seed=1)[0]


@pytest.fixture(scope="module")
def examined(logs) -> Examination:
    found = diagnose([logs[0]], [logs[1]], TABLE_3, most=1, only=["arm_spring", "arm_viscous_drift"])
    return examine(found, [logs[0]], [logs[1]])


def build(examined: Examination) -> str:
    return render(diagnosis_page(examined))


@pytest.fixture(scope="module")
def page(examined) -> str:
    return build(examined)


@pytest.fixture(scope="module")
def checked(examined, logs) -> tuple[str, str]:
    """The pages of `identify` and of `validate` for the plant without the effect."""
    before = examined.diagnosis.before
    gap = examined.gap.before
    return (
        render(estimate_page(before, [logs[0]], gap, "", "rig.json")),
        render(validation_page(gap, before.plant, [logs[1]], "rig.json")),
    )


def held(log: Log, *held_out: Log) -> HeldOut:
    """What judges a search in a log: others, or its own last part."""
    return HeldOut((log,), held_out, DecisionPolicy())


def with_gap(examined: Examination, gap: GapChange | None) -> Examination:
    return replace(examined, diagnosis=replace(examined.diagnosis, gap=gap))


class Page(HTMLParser):
    """What a test asks of a page: ids, figures' JSON, labels, addresses, text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.figures: dict[str, dict] = {}
        self.unlabelled: list[str] = []
        self.addresses: list[str] = []
        self.tags: list[str] = []
        self.headings: list[str] = []
        self.inside = ""
        self.heading = False
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.tags.append(tag)
        self.ids += [found["id"]] if "id" in found else []
        self.addresses += [v for k, v in attrs if k in ("src", "href", "srcset", "action")]
        if found.get("class") == "plot" and not (found.get("role") == "img" and found.get("aria-label")):
            self.unlabelled.append(str(found))
        self.headings += [""] if tag == "h2" else []
        self.inside = found.get("data-for", "") if tag == "script" else ""
        self.heading = tag == "h2"

    def handle_endtag(self, tag):
        self.heading = self.heading and tag != "h2"

    def handle_data(self, data):
        if self.inside:
            self.figures[self.inside] = json.loads(data)
            self.inside = ""
        if self.heading:
            self.headings[-1] += data


def text_of(html: str) -> str:
    """What a reader sees of a piece of a page."""
    inside = re.sub(r"<(script|style).*?</\1>", "", html, flags=re.S)
    return " ".join(unescape(re.sub(r"<[^>]+>", "", inside)).split())


def size_of(data) -> int:
    """Number of entries of one of a trace's arrays, as Plotly writes them."""
    if isinstance(data, dict) and "bdata" in data:
        width = {"f4": 4, "f8": 8}.get(data["dtype"], 1)
        return len(data["bdata"]) * 3 // 4 // width
    return len(data) if isinstance(data, list) else 0


def test_the_json_keeps_the_contract(examined):
    found = json.loads(json.dumps(examined.to_dict(), allow_nan=False))
    assert {"verdict", "effects", "ranking", "where", "gap", "next_experiment", "runtime_s"} <= set(found)
    assert {"channel", "intervals_s", "variable", "map"} <= set(found["where"])
    assert {"back_emf", "amplifier_gain"} <= set(found["absorbed"])
    names = {"before", "after", "noise_floor", "closed_fraction", "closed_interval", "held_out"}
    assert names <= set(found["gap"])
    for side in ("before", "after", "noise_floor"):
        assert {"rms_q1", "rms_q2"} <= set(found["gap"][side])
    assert found["gap"]["held_out"] is True
    assert found["next_experiment"]


def test_error_bars_are_told_too_small_where_something_is_left(examined):
    left = examined.diagnosis.falling_short(2.0)
    told = {d.leftover: (build(replace(examined, diagnosis=d)), str(d)) for d in (examined.diagnosis, left)}
    for leftover, (page, text) in told.items():
        assert ("The error bars are too small for that reason" in page) == leftover
        assert ("they are too small afterwards as well" in page) == leftover
        assert ("here they are too small" in text) == leftover


def test_one_verdict_that_no_section_contradicts(examined):
    complete = text_of(build(examined))
    assert "no torque stands out of the noise any more" in complete
    assert "remains" not in complete
    short = text_of(build(replace(examined, diagnosis=examined.diagnosis.falling_short(2.4))))
    assert "Named; a part remains" in short
    assert short.count("2.4 times") >= 2
    for promise in ("Nothing is left", "any more", "the error should stay near the noise floor"):
        assert promise not in short
    vetoed = text_of(build(replace(examined, diagnosis=examined.diagnosis.vetoed())))
    assert "A cable that pulls at the arm would explain the fitted logs, but the error on new data" in vetoed
    assert "Use plant.json in the simulator" not in vetoed


def test_the_first_sentence_is_physical_and_its_numbers_are_the_files(examined, page):
    k, q1n = (examined.diagnosis.after.plant.effect("arm_spring").parameters[n] for n in ("k", "q1n"))
    data = examined.to_dict()
    before, after = (data["gap"][side]["ratio_to_floor"] for side in ("before", "after"))
    headline = text_of(page[page.index("<h1>") : page.index("</h1>")])
    assert headline == (
        f"A cable pulls the arm towards {math.degrees(q1n):.0f}°: {k:.3g} V/rad. After adding it, the error on new "
        f"data falls from {before:.1f} to {after:.1f} times the noise."
    )


def test_the_law_is_drawn_through_what_the_log_asks_for(examined, page):
    """A spring is a line of slope −k, and the points lie on it."""
    k, q1n = (examined.diagnosis.after.plant.effect("arm_spring").parameters[n] for n in ("k", "q1n"))
    shown = examined.law.best_seen(examined.where_after.maps)
    assert (shown.row, shown.variable) == ("arm", "arm angle")
    place, torque = examined.law.mean(shown)
    assert torque == pytest.approx(-k * (place - q1n), abs=1e-9)
    slope = np.polyfit(place, torque + shown.mean, 1, w=1.0 / shown.std)[0]
    assert slope == pytest.approx(-k, rel=0.1)
    assert np.all(examined.law.torque[:, 1] == pytest.approx(0.0, abs=1e-9))
    figure = Page(page).figures["law"]
    assert [trace["name"] for trace in figure["data"]] == ["fitted law", "asked for by the log"]


def test_bars_show_the_contenders(examined):
    """Lengths are shares of the leader's; what lost thousands of nats has no bar, and so squeezes no other."""
    naming = examined.diagnosis.naming
    leader, other = naming.rankings[0][0], naming.rankings[0][-1]
    far_off = replace(other, name="base_tilt", gain=-4558.0, net=-4565.0)
    (bars, *_) = rankings(replace(naming, rankings=((leader, other, far_off), *naming.rankings[1:])))
    shares = {bar.identifier: bar.share for bar in bars.bars}
    assert shares["arm_spring"] == 1.0
    assert shares["base_tilt"] == 0.0
    assert all(0.0 <= share <= 1.0 for share in shares.values())


def test_every_number_of_nats_says_what_it_counts(examined, page):
    """Those of the bars are net gains on the searched logs, one is of the next readings of new data; no others."""
    ranked = {f"{s.net:+.0f}".replace("-", "−") for step in examined.diagnosis.naming.rankings for s in step}
    text = text_of(page)
    for said in re.findall(r"([+−]\d+) nats", text):
        assert said in ranked
    likelier = f"One reading ahead, the addition makes new data likelier by {examined.gap.likelier:.0f} nats"
    assert likelier in text
    assert "nats" not in text_of(page[page.index("<h1>") : page.index("</header>")])


def test_the_gap_is_that_of_the_validation(examined, logs):
    change = examined.gap
    before, after = (validate(e.plant, [logs[1]]) for e in (examined.diagnosis.before, examined.diagnosis.after))
    assert change.before.rms == pytest.approx(before.rms)
    assert change.closed == closed_fraction(before, after)
    assert change.closed.value > 0.9
    said = change.to_dict()
    assert said["before"]["rms_q1"] == pytest.approx(float(before.rms[0]))
    for side in ("before", "after"):  # one floor for both, the lower
        ratios = [said[side][q] / said["noise_floor"][q] for q in ("rms_q1", "rms_q2")]
        assert said[side]["ratio_to_floor"] == pytest.approx(float(np.sqrt(np.mean(np.square(ratios)))))
    assert said["noise_floor"]["rms_q1"] == pytest.approx(min(before.floor[0], after.floor[0]))


def test_without_a_held_out_log_only_the_tail_is_predicted(examined, logs):
    log = logs[0]
    change = measure_gap(examined.diagnosis, held(log))
    assert change.tail == 0.3
    assert change.to_dict()["held_out"] is False
    starts = change.before.times - change.before.horizon
    assert starts.min() >= log.t[0] + 0.7 * log.duration - 1e-9
    assert change.before.rms == pytest.approx(np.sqrt(np.mean(change.before.errors**2, axis=0)))
    assert change.closed.value > 0.8
    rest = log.slice(stop=float(log.t[0]) + 0.7 * log.duration)  # what the plants may know
    moved = replace(log, q1=np.where(log.t > rest.t[-1], log.q1 + 0.05, log.q1))
    assert measure_gap(examined.diagnosis, held(moved)).before.rms[0] > change.before.rms[0]


def test_intervals_of_the_rms_cover_it(examined):
    low, high = rms_interval(examined.gap.after).T
    assert np.all((low < examined.gap.after.rms) & (examined.gap.after.rms < high))


def test_the_page_stands_alone_and_reads_from_top_to_bottom(page, checked):
    for html, sections in ((page, 6), (checked[0], 4), (checked[1], 3)):
        found = Page(html)
        assert [heading.split()[0] for heading in found.headings] == [str(i + 1) for i in range(sections)]
        assert {address[1:] for address in found.addresses} <= set(found.ids)
        assert all(address.startswith("#") for address in found.addresses)
        assert len(found.addresses) == sections
        assert not {"link", "iframe", "img", "object"} & set(found.tags)
        assert "default-src 'none'" in html
        assert "@media print" in html
        assert "://" not in html.replace(plotly_js(), "")
        assert len(html.encode()) < 2e6
        assert not found.unlabelled
        assert len(set(found.ids)) == len(found.ids)
        assert {f"plot-{name}" for name in found.figures} <= set(found.ids)
    drawn = {"predictions", "closed-loop", "law", "torque-0", "map-arm-arm-angle", "parameters", "horizons"}
    assert drawn <= set(Page(page).figures)
    assert {"predictions", "horizons", "residuals"} <= set(Page(checked[1]).figures)
    assert "precision" in Page(checked[0]).figures


def test_the_bundle_is_that_of_the_python_package():
    from plotly.offline import get_plotlyjs_version

    assert f"plotly.js (basic - minified) v{get_plotlyjs_version()}" in plotly_js()[:200]


def test_axes_have_titles_and_traces_are_thinned(page):
    for name, figure in Page(page).figures.items():
        axes = [axis for key, axis in figure["layout"].items() if key.startswith("yaxis")]
        assert any("title" in axis for axis in axes) or name in ("parameters", "precision"), name
        assert {trace["type"] for trace in figure["data"]} <= {"scatter", "bar"}, "what the basic bundle draws"
        assert any("title" in axis for key, axis in figure["layout"].items() if key.startswith("xaxis")), name
        for trace in figure["data"]:
            assert size_of(trace["x"]) <= 2 * MOST_POINTS + 2, name  # a band goes there and back


def test_the_page_says_what_was_found(page, examined):
    k = examined.diagnosis.after.plant.effect("arm_spring").parameters["k"]
    assert f"k = {k:.4g}" in page
    assert "<code>arm_spring</code>" in page
    assert f"<b>{100 * examined.gap.closed.value:.1f} %</b>" in page
    assert "back emf (adds to θ6), amplifier gain (scales every θ)" in page
    assert "the model misses a torque on the arm that depends on the arm angle" in page


def test_the_first_screen_of_identify_and_validate(examined, checked):
    gap = examined.gap.before
    for html in checked:
        first = text_of(html[html.index("<h1>") : html.index("</header>")])
        assert "The model is not adequate" in first
        assert f"{gap.ratio_to_floor:.1f} times what noise alone leaves" in first
        assert f"{gap.fit_percent[0]:.1f} and".replace("-", "−") in first
        assert "Next: Find what is missing: furuta diagnose" in first
        assert "-o diagnosis" in first
    before = examined.diagnosis.before
    assert rounded(before.value("theta1"), float(before.std[0])) in text_of(checked[0])
    assert "Θ" not in checked[0]  # θ6 begins a sentence there
    assert text_of(checked[0]).count("(not identified)") == len(before.identifiability.unidentified) > 0
    fitted = render(validation_page(gap, examined.diagnosis.before.plant, examined.held_out, "rig.json", ["a.csv"]))
    assert "a.csv: fitted by this plant, so this is no test on new data." in text_of(fitted)


@pytest.mark.parametrize("ratio", [0.5, 0.74, 0.76, 1.0, 1.09, 1.11, 1.9, 2.1, 30.0])
@pytest.mark.parametrize("torque", [0.5, 0.99])
def test_the_badge_says_what_the_validation_says(examined, ratio, torque):
    """One decision: the page's word and `Gap.verdict` go together."""
    reading = np.sqrt(1.0 - torque) * examined.gap.before.floor
    gap = replace(examined.gap.before, rms=ratio * examined.gap.before.floor, reading_floor=reading, repeats=False)
    words = {
        "Adequate": "nothing of size is missing",
        "Something small is missing": "something small is missing",
        "Not adequate": "the plant misses something",
        "Cannot be judged": "",
    }
    judged = adequacy(gap)
    assert words[judged.badge] in gap.verdict
    assert (judged.badge == "Cannot be judged") == gap.verdict.startswith(("this says little", "below the floor"))
    assert judged.good == (judged.badge == "Adequate")


def test_the_page_shows_the_tail_that_judged_a_repeating_effect(page, examined, logs):
    assert "On the last part of the searched logs" not in page
    own_tail = measure_gap(examined.diagnosis, held(logs[0]))
    html = build(with_gap(examined, replace(examined.gap, own_tail=own_tail)))
    assert "On the last part of the searched logs" in html
    windows = f", {len(own_tail.before.errors)} windows."
    assert windows in html
    assert windows not in page


@pytest.mark.parametrize("verdict", ["none", "unknown", "insufficient_excitation"])
def test_other_verdicts_have_a_page_too(examined, verdict):
    d = examined.diagnosis
    if verdict == "insufficient_excitation":
        nothing = replace(d, verdict=verdict, before=None, after=None, naming=None, left_over=math.nan, gap=None)
        x = examine(nothing, examined.logs)
        assert x.where is None
        assert x.gap is None
    else:
        naming = replace(d.naming, accepted=(), equals=())
        d = replace(d, verdict=verdict, after=d.before, naming=naming, gap=None)
        x = replace(examined, diagnosis=d, where_after=None, law=None, closed_loop=examined.closed_loop[:1])
    json.dumps(x.to_dict(), allow_nan=False)
    found = Page(build(x))
    assert len(found.headings) == 6
    for figure in found.figures.values():
        assert not {trace.get("name") for trace in figure["data"]} & {"before", "after"}


@pytest.mark.parametrize(
    ("together", "word", "why"),
    [(1.0, "none", "too little about the parameters"), (2.3, "unknown", "what is missing shows there")],
)
def test_nothing_missing_is_not_all_where_new_data_are_far_off(examined, together, word, why):
    d = examined.diagnosis
    gap = replace(d.gap, after=d.gap.before)
    assert gap.after_over_floor > d.policy.far
    none = replace(d, verdict="none", after=d.before, naming=replace(d.naming, accepted=(), equals=()), gap=gap)
    far = none.astray(gap.after_over_floor, together)
    assert far.verdict == word
    screen = first_screen(far, "next")
    assert not screen.good
    assert any(why in doubt for doubt in screen.doubts)
    x = replace(examined, diagnosis=far, where_after=None, law=None, closed_loop=examined.closed_loop[:1])
    assert x.to_dict()["together_over_floor"] == together
    shown = text_of(build(x))
    assert f"all logs together it is {together:.1f} times" in shown
    assert "Diagnose all logs together, and hold out a new one" in shown
    assert "Nothing needs doing" not in shown


def test_the_page_says_which_part_of_long_logs_was_searched(page, examined):
    part = replace(examined, diagnosis=replace(examined.diagnosis, stretches=(((0.0, 20.0), (40.0, 80.0)),)))
    assert "Only 0–20, 40–80 s were searched" in build(part)
    assert "were searched" not in page


@pytest.mark.parametrize("added", [True, False])
def test_what_was_learned_is_drawn_with_what_became_of_it(examined, added):
    plant = TABLE_3.with_effects(Effect("arm_learned", {"c00": 0.1, "c33": -0.2}))
    learned = Learned(plant, 60.0, examined.gap, added, "so said the held-out logs")
    with_it = replace(examined, diagnosis=replace(examined.diagnosis, learned=learned))
    html = build(with_it)
    text = text_of(html)
    assert ("It is part of the plant: so said the held-out logs" in text) is added
    assert ("It is not part of the plant: so said the held-out logs" in text) is not added
    assert "learned torque [V]" in html or f"learned torque [{plant.unit}]" in html
    assert "What no name explains" not in text_of(build(examined))
    assert with_it.to_dict()["learned"]["added"] is added


def test_a_file_name_cannot_write_into_the_page(examined):
    evil = '</script><img src=x onerror="alert(1)">.csv'
    log = replace(examined.logs[0], source=evil)
    torques = tuple(replace(torque, source=evil) for torque in examined.where.torques)
    x = replace(
        examined,
        logs=(log,),
        held_out=(replace(examined.held_out[0], source=evil),),
        where=replace(examined.where, torques=torques),
        remarks={"closed loop": evil},
        closed_loop=None,
    )
    x = with_gap(x, replace(examined.gap, logs=(log,)))
    assert "img" not in Page(build(x)).tags


def test_what_could_not_be_measured_is_said(examined):
    plain = Log(examined.logs[0].t, examined.logs[0].q1, examined.logs[0].q2, examined.logs[0].u)
    short = plain.slice(stop=0.9)
    x = examine(
        verified(replace(examined.diagnosis, rest=None, gap=None), held(short, short)),
        [short],
        [short],
    )
    assert {"where", "gap", "closed loop"} <= set(x.remarks)
    html = build(x)
    assert "Not available" in html
    folded = text_of("".join(re.findall(r"<details>.*?</details>", html, flags=re.S)))
    assert "controller_gain" in folded, "no warning: the log need not say it"
    assert "controller_gain" not in text_of(re.sub(r"<details>.*?</details>", "", html, flags=re.S))


SCREENS = [(1200, 800), (400, 800)]


@pytest.mark.parametrize(("width", "height"), SCREENS, ids=["desk", "telephone"])
def test_verdict_size_and_next_step_are_on_the_first_screen(page, checked, examined, tmp_path, width, height):
    """And nothing is asked of any network, nor is the page wider than the screen."""
    playwright = pytest.importorskip("playwright.sync_api", reason="the browser test needs playwright")
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no Chromium on PATH")
    left = build(replace(examined, diagnosis=examined.diagnosis.falling_short(2.4)))
    asked: list[str] = []
    with playwright.sync_playwright() as p:
        opened = p.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        tab = opened.new_page(viewport={"width": width, "height": height})
        tab.on("request", lambda request: asked.append(request.url))
        for number, html in enumerate((page, left, *checked)):
            path = tmp_path / f"{number}.html"
            path.write_text(html, encoding="utf-8")
            tab.goto(path.as_uri())
            for part in (".badge", "h1", ".facts", ".next"):
                box = tab.locator(f"header.verdict {part}").first.bounding_box()
                assert box is not None
                assert box["y"] + box["height"] <= height, (number, part)
            assert "times" in tab.locator("h1").inner_text()
            assert tab.evaluate("document.documentElement.scrollWidth") <= width
            assert tab.locator("nav a").count() >= 3
        opened.close()
    assert [url for url in asked if not url.startswith(("file://" + str(tmp_path), "data:", "blob:"))] == []
    assert len(asked) >= 4


@pytest.mark.timeout(400)
def test_a_browser_draws_every_figure(page, checked, tmp_path):
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no Chromium on PATH: nothing to draw the page with")
    for html in (page, *checked):
        path = tmp_path / "report.html"
        path.write_text(html, encoding="utf-8")
        flags = (
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--enable-logging=stderr",
            "--virtual-time-budget=30000",
        )
        offline = ("--host-resolver-rules=MAP * ~NOTFOUND",)
        run = subprocess.run(
            [browser, *flags, *offline, f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", path.as_uri()],
            capture_output=True,
            text=True,
            timeout=300,
        )
        body = run.stdout[run.stdout.index("<main>") :]
        drawn = re.findall(r'<div class="plot js-plotly-plot" id="plot-([^"]+)"', body)
        assert sorted(drawn) == sorted(Page(html).figures)
        assert len(re.findall(r'<svg class="main-svg"', body)) >= len(drawn)
        assert "CONSOLE" not in run.stderr, run.stderr


@pytest.fixture
def files(logs, tmp_path) -> tuple[Path, Path]:
    """Both logs as files."""
    paths = tmp_path / "fitted.csv", tmp_path / "other.csv"
    for path, log in zip(paths, logs, strict=True):
        write_log(path, log)
    return paths


@pytest.fixture
def at_once(monkeypatch, examined) -> None:
    """The search, which is tested elsewhere, is over at once; what the command holds out still judges it."""
    import identification.diagnosis.diagnose as search

    found = replace(examined.diagnosis, gap=None, still_off=1.0)
    monkeypatch.setattr(
        search,
        "diagnose",
        lambda logs, held_out, *args, **options: verified(found, held(*logs, *held_out)),
    )


def test_the_command_writes_all_three_files(files, at_once, tmp_path):
    out = tmp_path / "out"
    arguments = ["diagnose", files[0], "--held-out", files[1], "-o", out]
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in out.iterdir()) == ["diagnosis.json", "plant.json", "report.html"]
    found = json.loads((out / "diagnosis.json").read_text())
    assert found["gap"]["held_out"] is True
    assert found["gap"]["logs"] == ["other.csv"]
    assert found["policy"] == DecisionPolicy().to_dict()
    assert "gap closed" in result.stdout
    assert "other.csv" in (out / "report.html").read_text()
    (out / "next_experiment.csv").write_text("an earlier run's")
    (out / "mine.txt").write_text("mine")
    assert CliRunner().invoke(app, [str(a) for a in arguments]).exit_code == 0
    assert sorted(p.name for p in out.iterdir()) == ["diagnosis.json", "mine.txt", "plant.json", "report.html"]


@pytest.mark.parametrize("case", ["same log", "output is a file"])
def test_bad_input_is_refused_before_the_search(files, tmp_path, case):
    out = files[1] if case == "output is a file" else tmp_path / "out"
    held = files[0] if case == "same log" else files[1]
    result = CliRunner().invoke(app, ["diagnose", str(files[0]), "--held-out", str(held), "-o", str(out)])
    assert result.exit_code == 2
    assert {"same log": "hold out a log", "output is a file": "is a file"}[case] in result.stderr
    assert not (tmp_path / "out").exists()
    assert read_log(files[1])
