"""Which trials are planned: kinds, sizes, splits and draws."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from experiments.bench import SETS, HiddenEffect, catalogue
from experiments.trials.draws import COMPOSITE, ONE_TORQUE, TWINS
from experiments.trials.plan import make_plan
from experiments.trials.sizes import reach
from experiments.trials.trial import SPLITS, Trial

LIBRARY = [name for name, e in catalogue().items() if e.kind == "library"]


def test_the_full_plan_has_the_promised_counts():
    """docs/how-to/cluster.md gives the sum, and that of a share and of some kinds."""
    plan = make_plan("final")
    assert Counter(t.kind for t in plan) == {
        "library": 620, "rounding": 120, "strong": 116, "composite": 60, "outside": 56, "two": 52,
        "torque_noise": 40, "none": 40, "absorbed": 40, "hard": 20,
    }  # fmt: skip
    assert len(plan) == 1164
    assert len(make_plan("final", share=0.35)) == 428
    assert len(make_plan("final", kinds=["none", "torque_noise", "two"])) == 132
    cells = Counter((t.subject, t.rig) for t in plan if t.kind == "library")
    assert cells == {(name, rig): 5 for name in LIBRARY for rig in SETS}
    assert len({t.id for t in plan}) == len(plan)


def test_ratios_are_log_uniform_and_signs_and_forms_vary():
    trials = [t for t in make_plan("final") if t.kind == "library"]
    hidden = [t.hidden[0] for t in trials]
    highest = np.minimum(10.0, [reach(t.hidden[0].name, t.rig, t.experiment) for t in trials])
    can = highest > 1.1
    assert can.mean() > 0.95
    place = np.log(np.array([h.ratio for h in hidden]) / 1.1)[can] / np.log(highest[can] / 1.1)
    assert 0.0 <= place.min() <= place.max() <= 1.0 + 1e-9
    expected = np.arange(1, 10) / 10
    assert np.abs(np.quantile(place, expected) - expected).max() < 0.06
    assert 0.4 < np.mean([h.form == "table" for h in hidden]) < 0.6
    offsets = [(t.rig, t.hidden[0]) for t in trials if t.subject == "input_offset"]
    signs = [np.sign(HiddenEffect(h.name, variation=h.variation).values(SETS[rig])["b"]) for rig, h in offsets]
    assert set(signs) == {-1.0, 1.0}
    small = np.array([t.hidden[0].ratio for t in make_plan("final", power=True)])
    assert small.min() >= 1.005
    assert small.max() <= 3.0
    assert np.median(small - 1) == pytest.approx(math.sqrt(0.005 * 2.0), rel=0.25)


@pytest.mark.parametrize("power", [False, True])
def test_the_splits_share_no_seed_no_rig_and_no_place(power):
    parts = {name: make_plan(name, power=power) for name in SPLITS}

    def numbers(plan: list[Trial]) -> set[int]:
        return {n for t in plan for n in (t.seed, t.individual, *(h.variation for h in t.hidden))}

    dev, final = numbers(parts["dev"]), numbers(parts["final"])
    assert max(dev) + 2 < min(final), "held-out logs take the seeds after"
    assert not {t.id for t in parts["dev"]} & {t.id for t in parts["final"]}
    assert {t.scatter for t in parts["dev"]}.isdisjoint({t.scatter for t in parts["final"]})


def test_another_seed_is_another_world_of_the_same_split():
    plans = [make_plan(seeds=1, seed=seed) for seed in (0, 1)]
    assert [len(p) for p in plans] == [len(make_plan(seeds=1))] * 2
    assert plans[0] == make_plan(seeds=1)
    assert not {t.seed for t in plans[0]} & {t.seed for t in plans[1]}
    assert Counter(t.subject for t in plans[0] if t.kind not in ("two", "composite")) == Counter(
        t.subject for t in plans[1] if t.kind not in ("two", "composite")
    )
    with pytest.raises(ValueError, match="seed -1"):
        make_plan(seed=-1)


def test_a_larger_plan_contains_the_smaller_one():
    whole = {t.id: t for t in make_plan(seeds=5)}
    for part in (make_plan(seeds=2), make_plan(share=0.2), make_plan(effects=["arm_spring"], kinds=["library"])):
        assert all(whole[t.id] == t for t in part)
    assert {t.id for t in make_plan(share=0.1)} <= {t.id for t in make_plan(share=0.3)}


def test_a_share_takes_evenly():
    whole, part = make_plan("final"), make_plan("final", share=0.2)
    cells = Counter(t.subject for t in part if t.kind == "library")
    assert set(cells) == set(LIBRARY)
    assert set(cells.values()) == {4}
    rigs = {name: {t.rig for t in part if t.kind == "library" and t.subject == name} for name in LIBRARY}
    assert all(len(seen) == 4 for seen in rigs.values())
    for kind, count in Counter(t.kind for t in whole).items():
        strata = len({t.subject for t in whole if t.kind == kind})
        assert 0.2 * count <= sum(t.kind == kind for t in part) < 0.2 * count + strata, "rounded up in each"


def test_strong_effects_are_as_large_as_promised_and_the_held_out_log_counts_from_elsewhere():
    trials = [t for t in make_plan("final") if t.kind == "strong"]
    ratios = np.array([t.hidden[0].ratio for t in trials])
    assert len(trials) >= 60
    assert len({t.subject for t in trials}) >= 20
    assert ratios.min() >= 10.0
    assert 150.0 < ratios.max() <= 300.0
    arm, pendulum = np.array([t.zeros for t in trials]).T
    assert np.abs(arm).max() <= 0.5 < 2.2 * np.abs(arm).mean()
    assert 0.0 < np.abs(pendulum).max() <= 2.0 * math.pi / 4096


def test_composite_rigs_hide_three_to_five_effects():
    trials = [t for t in make_plan("final") if t.kind == "composite"]
    assert len(trials) >= 60
    assert {len(t.hidden) for t in trials} == {3, 4, 5}
    assert {h.name for t in trials for h in t.hidden} == set(COMPOSITE)
    assert all(t.zeros != (0.0, 0.0) for t in trials)
    assert not [t for t in make_plan(effects=["arm_spring"]) if t.kind == "composite"]


def test_pairs_can_be_told_apart():
    pairs = [{h.name for h in t.hidden} for t in make_plan("final") if t.kind == "two"]
    assert len(pairs) >= 50
    assert all(len(pair) == 2 and pair not in (*TWINS, *ONE_TORQUE) for pair in pairs)
    assert len({frozenset(pair) for pair in pairs}) > 40


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"effects": ["arm_sprung"]}, "arm_sprung"),
        ({"rigs": ["qube"]}, "qube"),
        ({"kinds": ["some"]}, "some"),
        ({"split": "test"}, "dev or final"),
        ({"share": 0.0}, "share"),
        ({"seeds": 0}, "seeds"),
    ],
)
def test_what_does_not_exist_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        make_plan(**arguments)
