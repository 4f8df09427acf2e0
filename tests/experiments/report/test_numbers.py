"""The numbers of a report are those of the files and of the validation."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("plotly", reason="the report needs the extra 'report'")
pytest.importorskip("jinja2", reason="the report needs the extra 'report'")

from experiments.report import tables
from experiments.report.law import law_of
from experiments.report.search_figures import parameters, precision, rankings
from experiments.report.where_figures import fitted_law
from furuta_gym.plant import TABLE_3, Effect
from identification.diagnosis.gap_change import Part, rms_interval
from identification.diagnosis.outcome import SecondWitness
from identification.diagnosis.verify import measure_gap
from identification.validation.closed_fraction import ClosedFraction, closed_fraction
from identification.validation.gap import validate

from .asking import Page, build, held, numbers_of, text_of


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
        assert ("The error bars allow for it as far as the logs show" in page) == leftover
        assert ("so the last column may be too small as well" in page) == leftover
        assert ("the error bars above allow for that" in text) == leftover


def test_one_verdict_that_no_section_contradicts(examined):
    complete = text_of(build(examined))
    assert "no torque stands out of the noise any more" in complete
    assert "remains" not in complete
    short = text_of(build(replace(examined, diagnosis=examined.diagnosis.falling_short(2.4))))
    assert "Named; unexplained structure" in short
    assert short.count("2.4 times") >= 2
    for promise in ("Nothing is left", "any more", "the error should stay near the noise floor"):
        assert promise not in short
    vetoed = text_of(build(replace(examined, diagnosis=examined.diagnosis.vetoed())))
    assert "A cable that pulls like a spring would explain the fitted logs, but the error on held-out data" in vetoed
    assert "Use plant.json in the simulator" not in vetoed


def test_the_first_sentence_is_physical_and_its_numbers_are_the_files(examined, page):
    k, q1n = (examined.diagnosis.after.plant.effect("arm_spring").parameters[n] for n in ("k", "q1n"))
    data = examined.to_dict()
    before, after = (data["gap"][side]["ratio_to_floor"] for side in ("before", "after"))
    headline = text_of(page[page.index("<h1>") : page.index("</h1>")])
    assert headline == (
        f"A cable pulls the arm towards {math.degrees(q1n):.0f}°: {k:.3g} V/rad. After adding it, the error on "
        f"held-out data falls from {before:.1f} to {after:.1f} times the noise floor."
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


def test_a_law_that_follows_time_is_drawn_against_time(examined, logs):
    """Against the speed a drift of friction looks like friction."""
    rig = TABLE_3.with_effects(Effect("arm_friction_drift", {"a": 0.02}))
    law = law_of(rig, ["arm_friction_drift"], [logs[0]])
    figure = json.loads(fitted_law(law, examined.where_after).json)
    assert figure["layout"]["xaxis"]["title"]["text"].startswith("t [s]")
    traces = {trace["name"]: trace for trace in figure["data"] if trace["mode"] == "lines" and "fill" not in trace}
    assert list(traces) == ["asked for by the log", "fitted law"]
    torque = np.abs(numbers_of(traces["fitted law"]["y"]))
    assert torque[-100:].max() > 3 * torque[:100].max()
    assert numbers_of(traces["fitted law"]["x"])[-1] == pytest.approx(logs[0].duration, abs=0.05)


def _lost(estimate, name: str, times: float):
    """An estimate whose logs say little of one parameter, with an error bar of so many times the value."""
    covariance = estimate.covariance.copy()
    i = estimate.names.index(name)
    covariance[i, i] = (times * estimate.value(name)) ** 2
    return replace(estimate, covariance=covariance)


def test_a_parameter_without_information_does_not_set_the_axis_for_the_others(examined):
    """A bar of twenty times the value ends at the axis, with a mark; what is not identified is a word."""
    before = examined.diagnosis.before
    lost_already = before.identifiability.unidentified
    names = [n for n in before.names if n.startswith("theta") and n not in lost_already][:2]
    assert len(names) == 2
    shown = {}
    for name in names:
        wide = _lost(before, name, 20.0)
        row = name.replace("theta", "θ")
        for drawn in (precision(wide), parameters(wide, examined.diagnosis.after)):
            figure = json.loads(drawn.json)
            low, high = figure["layout"]["xaxis"]["range"]
            assert max(-low, high) < 200.0
            marks = [trace for trace in figure["data"] if trace.get("name") == "goes on"]
            assert {y for trace in marks for y in trace["y"]} >= {row}
            assert "arrow head" in drawn.caption
        verdict = replace(wide.identifiability, unidentified=(*lost_already, name))
        lost = replace(wide, identifiability=verdict)
        shown[name] = [
            trace["text"][trace["y"].index(row)]
            for drawn in (precision(lost), parameters(lost, examined.diagnosis.after))
            for trace in json.loads(drawn.json)["data"]
            if trace.get("name") == "no place"
        ]
        assert [row not in trace["y"] for trace in json.loads(precision(lost).json)["data"][:1]] == [True]
    assert shown == {name: ["not identified", "not identified before"] for name in names}


def test_bars_show_the_contenders(examined):
    """Lengths are shares of the leader's; what lost thousands of nats has no bar, and so squeezes no other."""
    naming = examined.diagnosis.naming
    found = naming.found[0]
    leader, other = found.suspect, found.ranking[-1]
    far_off = replace(other, name="base_tilt", gain=-4558.0, net=-4565.0)
    (bars, *_) = rankings(replace(naming, found=(replace(found, ranking=(leader, other, far_off)), *naming.found[1:])))
    shares = {bar.identifier: bar.share for bar in bars.bars}
    assert shares["arm_spring"] == 1.0
    assert shares["base_tilt"] == 0.0
    assert all(0.0 <= share <= 1.0 for share in shares.values())


def test_every_number_of_nats_says_what_it_counts(examined, page):
    """Those of the bars are net gains on the searched logs, one is of the next readings of held-out data; no others."""
    ranked = {f"{s.net:+.0f}".replace("-", "−") for step in examined.diagnosis.naming.rankings for s in step}
    text = text_of(page)
    told = re.findall(r"([+−]\d+) nats", text)
    assert told
    assert set(told) <= ranked
    likelier = f"One reading ahead, the addition makes held-out data likelier by {examined.gap.likelier:.0f} nats"
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


@pytest.mark.parametrize("better", [True, False])
def test_a_second_fit_is_shown_and_whose_plant_was_written(examined, better):
    first = examined.diagnosis.after
    plant = first.plant.replace(theta=first.plant.theta * np.where(np.arange(9) == 4, 1.1, 1.0))
    second = SecondWitness(plant, ("theta5",), examined.gap, better)
    page = build(replace(examined, diagnosis=replace(examined.diagnosis, second=second)))
    head = text_of(page[page.index("<h1>") : page.index("</header>")])
    assert "A second fit, by multiple shooting, disagrees about θ5" in head
    assert ("its plant is the one that was written" in head) == better
    assert ("the first may have taken a missing torque for noise" in head) != better
    whole = text_of(page)
    assert f"{plant.theta[4]:.4g} ●" in whole
    assert ("the plant of the second fit in plant.json" in whole) == better
    assert "second fit" not in text_of(build(examined))


def test_no_nan_is_shown_where_the_error_was_at_the_floor_before(examined):
    gap = examined.gap
    good = replace(gap, closed=ClosedFraction(math.nan, (math.nan, math.nan)))
    part = Part("log A", 1, good.before.rms, good.after.rms, (0.9, 0.85), good.closed)
    table = tables.parts([part], "log")
    assert "nan" not in " ".join(table.rows[0])
    assert "at the floor before" in " ".join(table.rows[0])


def test_an_unknown_effect_that_closes_nothing_is_called_by_its_title(examined):
    low = replace(examined.gap, closed=ClosedFraction(-0.1, (-0.3, 0.1)))
    unknown = replace(examined.diagnosis, verdict="unknown", gap=low)
    head = text_of(build(replace(examined, diagnosis=unknown)))
    assert "Nearest comes a cable that pulls like a spring. The error on held-out data is" in head
