"""Every threshold of the diagnosis in one value, each with its reason and what it was chosen on.

A test or a study changes one with `dataclasses.replace(DecisionPolicy(), believed=20.0)` and passes it to `diagnose`.
`furuta diagnose --policy` prints the table, and diagnosis.json holds the values that were used.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from ..validation.adequacy import ADEQUATE_BELOW

MOST_EFFECTS = 6
"""Effects that a search looks for at most, where nothing else is said."""

DEV = "trials of the split `dev`"
THEORY = "theory"
COST = "run time"


def _rule(default: Any, why: str, chosen_on: str, unit: str = "") -> Any:
    return field(default=default, metadata={"why": why, "chosen_on": chosen_on, "unit": unit})


@dataclass(frozen=True)
class Rule:
    """One threshold as a row of the table."""

    name: str
    value: Any
    unit: str
    why: str
    chosen_on: str


@dataclass(frozen=True)
class DecisionPolicy:
    """The thresholds of the diagnosis. `rules()` lists them with their reasons. Log-likelihoods are in nats.

    Raises ValueError for a value of another type than the default's, or one that is not positive.
    """

    # which effects are fitted
    shortlist: int = _rule(6, "effects of the best scores that are fitted", COST, "effects")
    near_best_score: float = _rule(0.15, "an effect is fitted if its score is at least this share of the best", DEV)
    faint_first: float = _rule(0.5, "a first effect is fitted if its score is at least this share of its price", DEV)
    faint_later: float = _rule(1.5, "a further effect is fitted if its score is at least so many times its price", DEV)
    faint_quiet: float = _rule(
        1.0, "any effect is fitted if its score at reduced torque noise is at least so many times its price", DEV
    )
    look_alikes_of: int = _rule(3, "best effects whose declared look-alikes are fitted too", COST, "effects")
    hiding_noise: float = _rule(
        10.0, "noise may hide an effect if torque noise is more than so many times the least", DEV
    )
    quieter: float = _rule(100.0, "torque noise is divided by this for a second set of scores", DEV)

    # which effect is named
    present: float = _rule(0.95, "confidence at which the size of one of several names is not zero", THEORY)
    believed: float = _rule(10.0, "an effect is believed if its gain exceeds its price by this", DEV, "nats")
    equal: float = _rule(
        5.0, "effects are equals if their net gains lie this near to the best (odds of e⁵)", THEORY, "nats"
    )
    as_good: float = _rule(
        0.9, "a look-alike is an equal from this share of the best gain, if what is left depends on its variable", DEV
    )
    nearly: float = _rule(0.98, "any effect is an equal from this share of the best gain, if structure is left", DEV)
    own_share: float = _rule(
        0.2,
        "a further effect must explain at least this share of the largest gain by itself; with less of an earlier "
        "one's gain, it may be another law of that",
        DEV,
    )
    least_share: float = _rule(0.1, "the same share, if the effect removes all structure that was left", DEV)
    doubtful_share: float = _rule(
        0.05, "a doubtful effect is kept until the end if it explains this share of the smallest other gain", DEV
    )
    alike_share: float = _rule(
        0.5,
        "a further effect must explain at least this share of its look-alike's gain by itself; with less, in the same "
        "variables, it gets no name",
        DEV,
    )
    another_law: float = _rule(
        0.45, "an effect gets no name if this share of its net gain goes with an earlier effect's variables", DEV
    )
    foreign: float = _rule(
        0.1,
        "a further effect is one of its own if at most this share of its net gain goes with a larger one's variables",
        DEV,
    )
    much: float = _rule(
        100.0, "such an effect counts from this net gain, however small it is beside the others", DEV, "nats"
    )
    contested: float = _rule(
        0.3,
        "a rival is fitted again beside other effects from this share of the best net gain, and a look-alike shown to "
        "held-out data that are predicted far off",
        DEV,
    )
    together: float = _rule(
        0.8, "two effects replace one if they gain at least this share of its gain between them", DEV
    )
    pairs: int = _rule(6, "pairs that are tried in place of one effect", COST, "pairs")
    absorbed: float = _rule(
        0.995, "an effect is not visible in principle if θ imitates more than this share of its response", THEORY
    )

    # how far a fit goes
    strong: float = _rule(
        0.1, "other starts are tried first if model (5) leaves more than this share of the command unexplained", DEV
    )
    remembered: float = _rule(
        0.7, "other starts are tried first if a memory leaves less than this share of the arm's row", DEV
    )
    log_starts: int = _rule(3, "of the logs' own starts, from each of which every effect is fitted", COST, "starts")
    thinned: float = _rule(8e-3, "sample time of the records on which that is done", COST, "s")
    thinned_length: float = _rule(40.0, "of them, all together", COST, "s")
    fitted_whole: int = _rule(3, "effects of these that are fitted to all samples", COST, "effects")
    reach: float = _rule(25.0, "fits this near to the best go on", DEV, "nats")
    round_iterations: int = _rule(4, "iterations in a round of the multi-start", COST, "iterations")
    rounds: int = _rule(8, "rounds of the multi-start at most", COST, "rounds")
    catches_up: float = _rule(
        3.0,
        "a fit goes on only if it could reach the best within so many rounds, at the pace of its last one or at what "
        "its derivatives promise, if that is less",
        DEV,
        "rounds",
    )
    stands: float = _rule(
        1.0, "a fit stands still if its last round brought less than this, or the next one promises less", COST, "nats"
    )
    rivals: int = _rule(2, "fits, besides the look-alikes, that restart from the best fit's parameters", COST, "fits")
    strained: float = _rule(
        2.0, "a fit is asked again without the search's prior if this much is promised to it", COST, "nats"
    )
    no_friction: float = _rule(
        0.1,
        "a hysteresis has taken the place of Coulomb friction if θ8 is at most this share of both: then an arm that "
        "gives before it slides starts from it as well",
        "three rigs of seeds 65, 66 and 68",
    )
    special: float = _rule(
        1.0, "a fit that is better than its special case by less than this starts from its grid as well", DEV, "nats"
    )
    plain: float = _rule(
        100.0,
        "a model that is further behind than this need not be fitted to the nat",
        COST,
        "nats",
    )
    finalists: int = _rule(4, "effects that are fitted to the end at most", COST, "effects")
    dragged: float = _rule(0.3, "a fit starts again at the anchor's θ if ln θ3 … θ5 changed by more than this", DEV)
    restart_noise: float = _rule(10.0, "factor on the torque noise of such a restart", DEV)
    larger: float = _rule(3.0, "a second start has so many times the suggested size", DEV)
    smaller: float = _rule(
        0.6, "effects found earlier start at so many times their size when a further one shares their part", DEV
    )
    anchor_std: float = _rule(0.5, "standard deviation of ln θ1 … ln θ5 around the anchor", "a prototype")
    least_theta2: float = _rule(
        0.3, "θ2 of the anchor is at least this share of its θ4; a uniform rod has 0.75 by Table 2", THEORY
    )
    sharpness: float = _rule(100.0, "r that model (5) is taken to have, so that another is a finding", "paper", "s/rad")
    usual_sharpness: float = _rule(3.0, "factor around it, within which r is fitted and is no missing effect", "rigs")
    periods: float = _rule(
        2.0,
        "periods within a log, or of a ripple within the arm's travel, below which nothing is said to repeat",
        THEORY,
        "periods",
    )

    turned: float = _rule(
        3.0,
        "a search keeps a Stribeck speed beyond so many 1/r; nearer to rest Coulomb friction itself changes",
        THEORY,
    )

    # whether structure is left
    left: float = _rule(8.0, "a torque is said to be left from this evidence", DEV, "nats")
    negligible: float = _rule(0.5, "rounding hides a smaller change of a prediction 0.3 s ahead", THEORY, "counts")
    unnoticed: float = _rule(
        0.05,
        "two predictions are equal if they differ by less than this share of their error, which it changes by 0.1 %",
        THEORY,
    )
    zero_told: float = _rule(
        1.0, "the report mentions a pendulum's zero that is off by more than this", THEORY, "counts"
    )
    constant: float = _rule(1e-3, "level of the test that parameters are the same all along a log", THEORY)
    simpler: float = _rule(10.0, "the simpler family of torques is preferred within so much", DEV, "nats")
    simpler_share: float = _rule(1e-3, "the same as a share of the best family's gain", DEV)
    stands_out: float = _rule(
        3.0, "a smoothed torque is marked in time if it exceeds so many of its own deviations", THEORY
    )
    shortest: float = _rule(1.0, "shorter stretches between breaks of the clock are not looked at", THEORY, "s")
    samples: int = _rule(
        100_000, "a search takes so many samples at most: of more, some all along and what says most about θ", COST
    )
    along: float = _rule(0.6, "this share of them goes all along, for what changes with time", "a choice, not measured")

    # whether held-out data agree
    likelier: float = _rule(10.0, "effects are confirmed by this gain on held-out data, as for naming", DEV, "nats")
    adequate: float = _rule(
        ADEQUATE_BELOW,
        "held-out data decide on look-alikes, and on slight effects of much gain, above so many times the noise floor",
        "McGill's log",
    )
    far: float = _rule(1.5, "an error of more than so many times the noise floor says that more is missing", DEV)
    worth: float = _rule(0.05, "a further, small effect must have this closed share on held-out data", THEORY)
    beyond: float = _rule(
        0.05,
        "held-out logs alone do not speak against what depends on the arm's angle if it leaves the searched angles for "
        "more than this share of the time",
        THEORY,
    )
    disagree: float = _rule(
        4.0, "two fits disagree if they differ by more than so many deviations of their difference", THEORY
    )
    tail: float = _rule(0.3, "this share of each log is held out where there is no other log", COST)

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            wanted = int if isinstance(f.default, int) else float
            if not isinstance(value, (int, wanted)) or isinstance(value, bool) or not value > 0:
                raise ValueError(f"{f.name} must be a positive {wanted.__name__}, got {value!r}")

    def rules(self) -> tuple[Rule, ...]:
        """Every threshold with its reason, in order."""
        return tuple(
            Rule(f.name, getattr(self, f.name), *(f.metadata[k] for k in ("unit", "why", "chosen_on")))
            for f in fields(self)
        )

    def to_dict(self) -> dict[str, float | None]:
        """name → value, as diagnosis.json has it."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def table(self) -> str:
        """The rules as a Markdown table."""
        rows = ["| threshold | value | what it is for | chosen on |", "|---|---|---|---|"]
        for rule in self.rules():
            unit = f" {rule.unit}" if rule.unit else ""
            rows.append(f"| `{rule.name}` | {rule.value:g}{unit} | {rule.why} | {rule.chosen_on} |")
        return "\n".join(rows)
