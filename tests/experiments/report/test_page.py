"""A report's page stands alone, and says what was found, with every verdict."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("plotly", reason="the report needs the extra 'report'")
pytest.importorskip("jinja2", reason="the report needs the extra 'report'")

from experiments.cli.diagnose import _evidence
from experiments.report import Examination, examine, render
from experiments.report.contents import Text
from experiments.report.diagnosis_page import _errors
from experiments.report.drawing import MOST_POINTS
from experiments.report.page import plotly_js
from experiments.report.prediction_figures import closed_loop
from experiments.report.validation_page import adequacy, validation_page
from experiments.report.verdict import verdict as first_screen
from furuta_gym.plant import TABLE_3, Effect
from identification.diagnosis.learned import Learned
from identification.diagnosis.naming.found import FoundEffect
from identification.diagnosis.verify import measure_gap, verified
from identification.estimation.estimate import rounded
from identification.logs.log import Log
from identification.logs.rig_mapping import RigMapping
from identification.validation.one_rig import OneByOne
from tests.identification.diagnosis.fits import a_change, a_diagnosis

from .asking import Page, build, held, numbers_of, size_of, text_of, with_gap


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


def test_the_ticks_of_errors_have_whole_numbers_and_enclose_what_is_drawn(page):
    figure = Page(page).figures["horizons"]
    for suffix in ("", "2"):
        axis = figure["layout"][f"yaxis{suffix}"]
        assert [float(text) for text in axis["ticktext"]] == axis["tickvals"]
        assert len(axis["tickvals"]) >= 2
        drawn = [trace for trace in figure["data"] if trace["yaxis"] == f"y{suffix}"]
        low, high = (10**end for end in axis["range"])
        assert all(low <= value <= high for trace in drawn for value in numbers_of(trace["y"]))
        assert figure["layout"][f"xaxis{suffix}"]["title"]["text"].startswith("seconds ahead, q")
    assert "text" not in figure["layout"]["yaxis2"]["title"]  # it would lie over the panel on its left


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
        assert f"{gap.ratio_to_floor:.1f} times the noise floor" in first
        assert f"{gap.fit_percent[0]:.1f} and".replace("-", "−") in first
        assert "Next: Find what is missing: furuta diagnose" in first
        assert "-o diagnosis" in first
    before = examined.diagnosis.before
    assert rounded(before.value("theta1"), float(before.std[0])) in text_of(checked[0])
    assert "Θ" not in checked[0]  # θ6 begins a sentence there
    assert text_of(checked[0]).count("(not identified)") == len(before.identifiability.unidentified) > 0
    fitted = render(validation_page(gap, examined.diagnosis.before.plant, examined.held_out, "rig.json", "", ["a.csv"]))
    assert "a.csv: the plant was fitted to it, so this is no test on held-out data." in text_of(fitted)


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
        told = x.to_dict()
        assert told["where"] is None
        assert told["gap"] is None
        assert told["remarks"].keys() == {"where", "gap"}
    else:
        naming = replace(d.naming, found=(), rejected=d.naming.rankings)
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
    none = replace(d, verdict="none", after=d.before, naming=replace(d.naming, found=()), gap=gap)
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


def test_logs_that_need_other_parameters_are_said_beside_the_name(examined):
    apart = OneByOne(("the searched logs", "the held-out logs"), (1.0, 1.02), {"theta4": 1.2})
    asked = replace(examined, diagnosis=examined.diagnosis.beside_other_plants(apart))
    told = text_of(build(asked))
    assert "Named; other logs need other parameters" in told
    assert "θ4 by a factor of 1.2" in told
    assert "All else here is of the searched logs alone" in told
    assert "If something was changed on the rig" in told
    assert "Use plant.json in the simulator" not in told
    entry = asked.to_dict()
    assert entry["different_plants"]["ratio_to_floor"] == [1.0, 1.02]
    assert entry["leftover"]


@pytest.mark.parametrize(("together", "remains"), [(0.9, False), (1.9, True)])
def test_a_named_effect_with_uncertain_parameters_leaves_no_part(examined, together, remains):
    gap = replace(examined.diagnosis.gap, after=examined.diagnosis.gap.before)
    d = replace(examined.diagnosis, gap=gap).astray(gap.after_over_floor, together)
    assert d.verdict == "named"
    screen = first_screen(d, "next")
    assert not screen.good
    assert screen.badge.endswith("unexplained structure" if remains else "parameters uncertain")
    shown = text_of(build(replace(examined, diagnosis=d)))
    assert f"all logs together it is {together:.1f} times" in shown
    assert ("Unexplained structure remains" in shown) is remains
    assert ("Diagnose all logs together, and hold out a new one" in shown) is not remains


def test_what_only_describes_a_law_is_in_small_and_not_in_the_headline(examined):
    d = examined.diagnosis
    (spring,), ripple = d.naming.found, TABLE_3.default_effect("arm_ripple")
    describing = FoundEffect((replace(spring.suspect, name="arm_ripple"), *spring.ranking[1:]))
    naming = replace(d.naming, found=(describing, FoundEffect(spring.ranking)), laws={"arm_ripple": "arm_spring"})
    after = replace(d.after, plant=d.after.plant.with_effects(*d.after.plant.effects, ripple))
    told = replace(d, naming=naming, after=after)
    assert first_screen(told, "next").headline == first_screen(d, "next").headline
    shown = text_of(build(replace(examined, diagnosis=told)))
    assert "only describes what the law of arm_spring misses" in shown


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


def test_all_logs_together_are_named_as_they_were_typed(examined):
    """With their folders and options; without these by name, with the options that read them."""
    x = replace(examined, diagnosis=replace(examined.diagnosis, together=0.5))
    typed = replace(x, typed="data/a.csv 'b c.csv' --skip 1")
    assert "`furuta diagnose data/a.csv 'b c.csv' --skip 1 --held-out NEW -o diagnosis`" in typed.next_experiment
    skipped = replace(x.logs[0], source="my log.csv", mapping=RigMapping(skip=1.0))
    named = replace(x, logs=(skipped,), held_out=())
    assert "`furuta diagnose 'my log.csv' --skip 1 --held-out NEW" in named.next_experiment


def test_the_time_of_a_fall_is_that_of_the_axis(examined):
    log = examined.shown
    late = replace(log, t=log.t + 1.7e9)
    fell = [replace(run, t=run.t[:-10] + 1.7e9, angles=run.angles[:-10]) for run in examined.closed_loop]
    told = closed_loop(tuple(fell), late).caption
    assert f"until it fell at {fell[0].t[-1] - late.t[0]:.1f} s" in told


def test_what_follows_the_clock_of_its_log_is_not_called_untested_beside_its_figures() -> None:
    change = a_change((0.9, 1.0), 100.0)
    drift = replace(a_diagnosis("arm_viscous_drift"), gap=change)
    headline = first_screen(drift, "").headline
    assert "could not be tested" not in headline
    assert "Another log cannot judge what follows the clock of its own." in headline
    assert f"{change.after_over_floor:.1f} times with it" in headline
    assert "could not be tested on held-out data" in first_screen(replace(drift, gap=None), "").headline


@pytest.mark.parametrize("resting", [0.95, 0.4])
def test_a_floor_that_is_not_to_be_trusted_is_said_on_the_page_and_in_the_terminal(resting: float) -> None:
    change = a_change(after=1.2)
    change = replace(change, after=replace(change.after, resting=np.array([0.0, resting])))
    x = Examination(a_diagnosis("arm_spring", gap=change), (), (), None, None, None, None, None, {}, 0.0)
    told = "the floor is not to be trusted, as q2 rests or creeps: in 95 % of the windows"
    (page,) = (block.text for block in _errors(x).blocks if isinstance(block, Text))
    assert (f"Here {told}" in page) is (resting > 0.9)
    assert any(line.startswith(f"in doubt: {told}") for line in _evidence(x)) is (resting > 0.9)
