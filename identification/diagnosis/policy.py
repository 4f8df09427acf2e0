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
    near_best_score: float = _rule(0.15, "share of the best score below which an effect is not fitted", DEV)
    faint_first: float = _rule(0.5, "share of its price, the score from which a first effect is fitted", DEV)
    faint_later: float = _rule(1.5, "times its price, the score from which a further effect is fitted", DEV)
    faint_quiet: float = _rule(
        1.0, "times its price, the score at reduced torque noise from which any effect is fitted", DEV
    )
    look_alikes_of: int = _rule(3, "best effects whose declared look-alikes are fitted too", COST, "effects")
    hiding_noise: float = _rule(10.0, "times the least torque noise, from which noise may hide an effect", DEV)
    quieter: float = _rule(100.0, "by what torque noise is divided for a second set of scores", DEV)

    # which effect is named
    believed: float = _rule(10.0, "gain net of the price from which an effect is believed", DEV, "nats")
    equal: float = _rule(5.0, "effects whose net gain is this near to the best are equals (odds of e⁵)", THEORY, "nats")
    as_good: float = _rule(
        0.9, "of the best gain, from which a look-alike is an equal if what is left follows its variable", DEV
    )
    nearly: float = _rule(0.98, "of the best gain, from which any effect is an equal if structure is left", DEV)
    own_share: float = _rule(0.2, "of the largest gain, what a further effect must explain by itself", DEV)
    least_share: float = _rule(0.1, "the same if the effect removes all structure that was left", DEV)
    doubtful_share: float = _rule(
        0.05, "of the smallest other gain, from which a doubtful effect is kept until the end", DEV
    )
    alike_share: float = _rule(0.5, "of its look-alike's gain, what a further effect must explain by itself", DEV)
    another_law: float = _rule(
        0.45, "of its net gain, what an earlier effect's variables explain too, from which it gets no name", DEV
    )
    whole_period: float = _rule(
        1.0,
        "of a ripple that the arm must pass, or it only describes another function of its angle",
        THEORY,
        "periods",
    )
    foreign: float = _rule(0.1, "the same share, up to which it is an effect of its own", DEV)
    much: float = _rule(100.0, "net gain from which such an effect counts however small it is beside them", DEV, "nats")
    contested: float = _rule(0.3, "of the best net gain, from which a rival is fitted again beside others", DEV)
    together: float = _rule(0.8, "of one effect's gain, what two in its place need between them", DEV)
    pairs: int = _rule(6, "pairs that are tried in place of one effect", COST, "pairs")
    absorbed: float = _rule(0.995, "share of an effect's response that θ imitates: not visible in principle", THEORY)

    # how far a fit goes
    strong: float = _rule(
        0.1, "of the command, unexplained torque of model (5) from which other starts are tried first", DEV
    )
    remembered: float = _rule(0.7, "of the arm's row, what a memory must leave for other starts to be tried first", DEV)
    log_starts: int = _rule(3, "of the logs' own starts, from each of which every effect is fitted", COST, "starts")
    thinned: float = _rule(8e-3, "sample time of the records on which that is done", COST, "s")
    thinned_length: float = _rule(40.0, "of them, all together", COST, "s")
    fitted_whole: int = _rule(3, "effects of these that are fitted to all samples", COST, "effects")
    reach: float = _rule(25.0, "fits this near to the best go on", DEV, "nats")
    round_iterations: int = _rule(4, "iterations in a round of the multi-start", COST, "iterations")
    rounds: int = _rule(8, "rounds of the multi-start at most", COST, "rounds")
    catches_up: float = _rule(3.0, "rounds at its last pace within which a fit must reach the best", DEV, "rounds")
    rivals: int = _rule(2, "fits, besides the look-alikes, that restart from the best fit's parameters", COST, "fits")
    plain: float = _rule(
        100.0, "gain from which the model without an effect need not be fitted to the nat", COST, "nats"
    )
    finalists: int = _rule(4, "effects that are fitted to the end at most", COST, "effects")
    dragged: float = _rule(0.3, "change of ln θ3 … θ5 from which a fit starts at the anchor's θ again", DEV)
    restart_noise: float = _rule(10.0, "factor on the torque noise of such a restart", DEV)
    larger: float = _rule(3.0, "times the suggested size, of a second start", DEV)
    smaller: float = _rule(0.6, "times the size of effects found before, when a further one shares their part", DEV)
    anchor_std: float = _rule(0.5, "standard deviation of ln θ1 … ln θ5 around the anchor", "a prototype")
    least_theta2: float = _rule(0.3, "of θ4 in the anchor's θ2; a uniform rod has 0.75", THEORY)
    sharpness: float = _rule(100.0, "r that model (5) is taken to have, so that another is a finding", "paper", "s/rad")
    periods: float = _rule(2.0, "periods within a log below which nothing is said to repeat", THEORY, "periods")

    # whether structure is left
    left: float = _rule(8.0, "evidence from which a torque is said to be left", DEV, "nats")
    negligible: float = _rule(0.5, "change of a prediction 0.3 s ahead that rounding hides", THEORY, "counts")
    unnoticed: float = _rule(
        0.05, "of the error of a prediction; two that lie nearer are equal, as it changes the error by 0.1 %", THEORY
    )
    zero_told: float = _rule(1.0, "a pendulum's zero that is off by more is told", THEORY, "counts")
    constant: float = _rule(1e-3, "level of the test that parameters are the same all along a log", THEORY)
    simpler: float = _rule(10.0, "the simpler family of torques is preferred within so much", DEV, "nats")
    simpler_share: float = _rule(1e-3, "the same as a share of the best family's gain", DEV)
    stands_out: float = _rule(3.0, "of its own deviation, a smoothed torque that is marked in time", THEORY)
    shortest: float = _rule(1.0, "stretches between gaps that are looked at", THEORY, "s")
    samples: int = _rule(
        100_000, "samples that a search takes; of more, some all along and what says most about θ", COST
    )
    along: float = _rule(
        0.6, "share of these that goes all along, for what changes with time", "a choice, not measured"
    )

    # whether held-out data agree
    likelier: float = _rule(10.0, "gain on held-out data that confirms effects, as for naming", DEV, "nats")
    adequate: float = _rule(
        ADEQUATE_BELOW,
        "times the noise floor, above which held-out data decide on look-alikes, and on slight effects of much gain",
        "McGill's log",
    )
    far: float = _rule(1.5, "times the noise floor: an error of this size says that more is missing", DEV)
    worth: float = _rule(0.05, "of the held-out gap that a further, small effect must close", THEORY)
    disagree: float = _rule(4.0, "deviations of their difference, from which two fits disagree", THEORY)
    tail: float = _rule(0.3, "of each log, held out where there is no other log", COST)

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

    def to_dict(self) -> dict[str, float]:
        """name → value, as diagnosis.json has it."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def table(self) -> str:
        """The rules as a Markdown table."""
        rows = ["| threshold | value | what it is for | chosen on |", "|---|---|---|---|"]
        for rule in self.rules():
            unit = f" {rule.unit}" if rule.unit else ""
            rows.append(f"| `{rule.name}` | {rule.value:g}{unit} | {rule.why} | {rule.chosen_on} |")
        return "\n".join(rows)
