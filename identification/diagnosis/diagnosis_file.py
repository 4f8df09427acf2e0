"""diagnosis.json as it is declared: names, types and meanings of its keys, in the order in which they are written.

The `entry` of each value of a diagnosis (`Diagnosis`, `GapChange`, `Where`, `Learned`, …) fills one, the report adds
what it measures, and docs/schema/furuta-diagnosis-1.schema.json follows from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from msgspec import UNSET, Meta, Struct, UnsetType

SCHEMA = "furuta-diagnosis/1"
DESCRIPTION = (
    "The answer of `furuta diagnose`. Later versions may add keys; the number rises when a key changes its meaning."
)

Verdict = Literal["named", "ambiguous", "none", "unknown", "insufficient_excitation"]
Number = float | None  # null where it is not finite
Positive = Annotated[float, Meta(ge=0)] | None
Span = Annotated[list[float], Meta(min_length=2, max_length=2)]
Interval = Annotated[list[Number], Meta(min_length=2, max_length=2)] | None


class ParameterFound(Struct):
    value: Annotated[Number, Meta(description="As estimated; null is the neutral value")]
    std: Annotated[Positive, Meta(description="Standard deviation; null where it is not known")]
    unit: Annotated[str, Meta(description="Of value, std and interval")]
    interval: Annotated[
        Interval | UnsetType, Meta(description="95 % interval, uneven where the logarithm is estimated")
    ] = UNSET


class EffectFound(Struct, kw_only=True):
    name: Annotated[str, Meta(description="As in the effects page")]
    parameters: Annotated[
        dict[str, ParameterFound],
        Meta(description="By the names that the effects page has"),
    ]
    equation: Annotated[str, Meta(description="What the effect adds to model (5)")]
    place: Annotated[str | UnsetType, Meta(description="What it acts on")] = UNSET
    log_likelihood_gain: Annotated[
        float, Meta(description="In nats, over the model without it; the price of its parameters is not taken off")
    ]
    confused_with: Annotated[list[str], Meta(description="Effects that explain these logs as well")]
    predict_the_same: Annotated[list[str] | UnsetType, Meta(description="Those of them that predict the same")] = UNSET


class OtherLaw(EffectFound, kw_only=True):
    law_of: Annotated[str, Meta(description="The named effect")]
    follows: Annotated[bool, Meta(description="Whether it is a wrong zero that follows from that effect, no law")] = (
        False
    )


class Ranked(Struct):
    name: str
    log_likelihood_gain: Annotated[
        Number,
        Meta(
            description="After refitting, in nats; the price of its parameters is not taken off; null where no fit "
            "was made"
        ),
    ]
    score: Annotated[Number, Meta(description="Before refitting, in nats")]


class Errors(Struct):
    rms_q1: Annotated[Positive, Meta(description="Of the arm's angle, in rad")] = None
    rms_q2: Annotated[Positive, Meta(description="Of the pendulum's angle, in rad")] = None
    ratio_to_floor: Annotated[
        Positive | UnsetType,
        Meta(description="The gap: root mean square of the two errors, each divided by its noise floor"),
    ] = UNSET


class Floors(Struct):
    rms_q1: Annotated[Positive, Meta(description="Of the arm's angle, in rad")] = None
    rms_q2: Annotated[Positive, Meta(description="Of the pendulum's angle, in rad")] = None


class PartEntry(Struct):
    name: Annotated[str, Meta(description="Of the log or of the kind of experiment")]
    logs: Annotated[int, Meta(description="How many")]
    before: Errors
    after: Errors
    ratio_to_floor: Annotated[Interval, Meta(description="Before and after")]
    closed_fraction: Number
    closed_interval: Interval


class GapEntry(Struct, kw_only=True):
    before: Annotated[Errors, Meta(description="Without the effects")]
    after: Annotated[Errors, Meta(description="With them")]
    noise_floor: Annotated[Floors, Meta(description="The errors that a right plant would leave")]
    closed_fraction: Annotated[
        Number, Meta(description="Closed share of the squared error above the noise floor; 1 reaches the floor")
    ]
    closed_interval: Annotated[Interval, Meta(description="Its 95 % interval")]
    log_likelihood_gain: Annotated[
        Number | UnsetType, Meta(description="Of the effects on these data, in nats, one step ahead")
    ] = UNSET
    held_out: Annotated[bool, Meta(description="Whether these are logs of their own, not the end of fitted ones")]
    tail: Annotated[
        Number | UnsetType, Meta(description="Share of each fitted log that was held out; null where whole logs were")
    ] = UNSET
    own_tail: Annotated[
        GapEntry | UnsetType | None,
        Meta(
            description="The same on the last part of each searched log. It decides on effects that depend on time, "
            "as `periodic_torque` does"
        ),
    ] = UNSET
    searched_angles: Annotated[
        Interval | UnsetType | None,
        Meta(
            description="Where the arm is in the searched logs, from and to, in rad, if an effect depends on its angle "
            "and it leaves them in the held-out logs; else null"
        ),
    ] = UNSET
    horizon_s: Annotated[float, Meta(description="How far ahead predictions run, in s")]
    logs: Annotated[list[str] | UnsetType, Meta(description="The files")] = UNSET
    by_log: Annotated[list[PartEntry] | UnsetType, Meta(description="Every log by itself")] = UNSET
    by_kind: Annotated[list[PartEntry] | UnsetType, Meta(description="The logs by the kind of experiment")] = UNSET


class EffectInPlant(Struct):
    """As a plant file has it."""

    name: Annotated[str, Meta(description="As in the effects page; or arm_learned")]
    parameters: Annotated[dict[str, ParameterFound], Meta(description="By name")]

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> EffectInPlant:
        """From what `Effect.to_dict` gives."""
        return cls(data["name"], {name: ParameterFound(**entry) for name, entry in data["parameters"].items()})


class SecondWitnessEntry(Struct):
    method: Annotated[str, Meta(description="Of the second fit")]
    theta: Annotated[list[Number], Meta(description="θ1 to θ9 of the second fit")]
    effects: Annotated[list[EffectInPlant], Meta(description="The effects, with the sizes of the second fit")]
    disagreeing: Annotated[
        list[str], Meta(description="Parameters that differ from the first fit's by more than the errors of both allow")
    ]
    closed_fraction: Annotated[Number, Meta(description="Closed share from the first fit to the second")]
    closed_interval: Annotated[Interval, Meta(description="Its 95 % interval")]
    better: Annotated[
        bool, Meta(description="Whether the whole interval is above zero; plant.json then follows the second fit")
    ]


class DifferentPlants(Struct):
    sources: Annotated[list[str], Meta(description="Names of the logs, or parts of them, that were fitted apart")]
    ratio_to_floor: Annotated[
        list[Number], Meta(description="Error over the noise floor of each with its own parameters")
    ]
    factors: Annotated[
        dict[str, Number],
        Meta(description="Parameters that differ for certain: largest factor from the first to another"),
    ]
    one_factor: Annotated[Number | None, Meta(description="By which all θ differ, if they do by one")]


class GainChanged(Struct):
    source: Annotated[str, Meta(description="The log")]
    factor: Annotated[
        Number,
        Meta(description="What the command does after the change over what it did before; or at the end of the log"),
    ]
    since: Annotated[
        Number | None,
        Meta(description="When it changed, by the clock of the log, in s; null where it did so all along"),
    ]
    sure: Annotated[Number, Meta(description="How sure that is, in standard deviations")]
    beside: Annotated[bool, Meta(description="Whether that is beside a drift of the gain that the plant has")]


class LearnedEntry(Struct):
    effect: Annotated[EffectInPlant | None, Meta(description="The torque, as an entry of a plant file's effects")]
    evidence: Annotated[Number, Meta(description="Log-evidence for the torque, in nats")]
    gap: Annotated[
        GapEntry | None, Meta(description="How held-out errors change with it; null where they could not be measured")
    ]
    added: Annotated[bool, Meta(description="Whether plant.json has it")]
    reason: Annotated[str, Meta(description="Why it was added or refused")]


class SuspicionEntry(Struct):
    channel: Annotated[str, Meta(description="arm, pendulum, input or sensor")]
    variable: Annotated[str, Meta(description="What the torque depends on")]
    gain: Annotated[Number, Meta(description="Nats gained by such torques beyond other values of θ")]
    net: Annotated[Number, Meta(description="The same less the price of their parameters")]
    share: Annotated[Number, Meta(description="Gain, as a share of what all families together would gain")]


class InnovationsEntry(Struct):
    largest_correlation: Annotated[list[Number], Meta(description="With their own past")]
    largest_command_correlation: Annotated[list[Number], Meta(description="With earlier changes of the command")]
    p_white: Annotated[list[Number], Meta(description="p-value of the Ljung–Box test for white innovations")]
    p_command: Annotated[list[Number], Meta(description="p-value for no correlation with the command")]


class MapEntry(Struct):
    row: Annotated[str, Meta(description="arm or pendulum")]
    variable: Annotated[str, Meta(description="What the torque is averaged against")]
    edges: Annotated[list[Number], Meta(description="Of the bins, one more than there are bins")]
    mean: Annotated[list[Number], Meta(description="Missing torque in each bin, in command units")]
    std: Annotated[list[Number], Meta(description="Its standard deviation in each bin")]


class WhereEntry(Struct, kw_only=True):
    channel: Annotated[
        str | None,
        Meta(
            description="Where the likeliest missing torque acts: arm, pendulum, input or sensor; null if none is "
            "left. Of `where`, with found false: where the named effects act"
        ),
    ]
    intervals_s: Annotated[
        list[Span], Meta(description="Seconds (from, to) of the first log in which the torque stands out of its band")
    ]
    variable: Annotated[str | None, Meta(description="What it depends on; null if none is left")]
    map: Annotated[str, Meta(description="What was found, in a sentence")]
    found: Annotated[bool | UnsetType, Meta(description="Whether a missing torque is left")] = UNSET
    evidence: Annotated[
        Number | UnsetType,
        Meta(description="Nats that the likeliest family of torques gains, less the price of its parameters"),
    ] = UNSET
    counts: Annotated[
        list[Number] | UnsetType,
        Meta(description="How far it changes q1 and q2 predicted 0.3 s ahead, in counts of their encoders"),
    ] = UNSET
    negligible: Annotated[bool | UnsetType, Meta(description="Whether that is too little to matter")] = UNSET
    suspicions: Annotated[
        list[SuspicionEntry] | UnsetType, Meta(description="Families of torques, the likeliest first, six at most")
    ] = UNSET
    predictable_r2: Annotated[
        list[Number] | UnsetType,
        Meta(description="Share of the smoothed torque on each row that is predictable, by cross-validation"),
    ] = UNSET
    fisher_g: Annotated[
        list[Number] | UnsetType,
        Meta(description="Share of the largest line in the periodogram of the torque on each row"),
    ] = UNSET
    frequency_hz: Annotated[list[Number] | UnsetType, Meta(description="Frequencies of these lines")] = UNSET
    parameters_constant_p: Annotated[
        dict[str, Number] | UnsetType,
        Meta(description="p-value for each parameter, and for all, of being constant along the longest stretch"),
    ] = UNSET
    parameters_change_counts: Annotated[
        list[Number] | UnsetType,
        Meta(description="How far their changes move q1 and q2 predicted 0.3 s ahead, in counts of the encoders"),
    ] = UNSET
    parameters_change: Annotated[bool | UnsetType, Meta(description="Whether they change so much that it matters")] = (
        UNSET
    )
    innovations: Annotated[
        list[InnovationsEntry] | UnsetType,
        Meta(
            description="Tests of the innovations of each stretch between breaks of the clock; each list is of q1 and "
            "q2"
        ),
    ] = UNSET
    maps: Annotated[
        list[MapEntry] | UnsetType, Meta(description="Mean missing torque on a row against a variable, in bins")
    ] = UNSET


class SeparationEntry(Struct):
    truth: Annotated[str, Meta(description="The effect that is simulated")]
    fitted: Annotated[str, Meta(description="The effect that is fitted to it")]
    nats: Annotated[Number, Meta(description="By how much it would be less likely")]


class TriedEntry(Struct):
    experiment: str
    separations: Annotated[list[SeparationEntry], Meta(description="For each pair of effects, both ways")]
    problem: Annotated[str | None, Meta(description="Why it cannot be run; null if it can")]


class DesignEntry(Struct):
    suspects: Annotated[list[str], Meta(description="The effects to separate")]
    experiment: Annotated[str, Meta(description="The best one that was tried")]
    whole_command: Annotated[bool, Meta(description="True: play it as the command. False: add it to the controller's")]
    separation_nats: Annotated[Number, Meta(description="Its smallest separation of a pair, in nats")]
    sentence: Annotated[str, Meta(description="The advice in a sentence")]
    tried: Annotated[list[TriedEntry], Meta(description="All experiments that were tried")]


class LogUsed(Struct):
    source: Annotated[str, Meta(description="Name of the file")]
    sha256: Annotated[str | None, Meta(description="Hash of the file; null of a log that was read from none")]
    held_out: Annotated[bool, Meta(description="Whether it was held out; else it was searched")]


class DiagnosisFile(Struct, kw_only=True):
    schema: Annotated[Literal["furuta-diagnosis/1"], Meta(description="Kind and version of the file")]
    verdict: Annotated[Verdict, Meta(description="The answer in a word")]
    summary: Annotated[str, Meta(description="The answer in a sentence")]
    effects: Annotated[
        list[EffectFound],
        Meta(
            description="The effects found, in order. With the verdict named or ambiguous these are the names. With "
            "unknown they were only tried. Even then plant.json has them, unless held-out data speak against them"
        ),
    ]
    other_laws: Annotated[
        list[OtherLaw] | UnsetType,
        Meta(
            description="Effects that are in the plant only because a named effect follows another law than the "
            "library's, or because they follow from it. Each is an entry as in effects; law_of is that named effect"
        ),
    ] = UNSET
    ended_early: Annotated[bool | UnsetType, Meta(description="Ended by its time limit: more may be missing")] = UNSET
    ranking: Annotated[list[Ranked], Meta(description="The effects that were tried first, the best first")]
    not_visible: Annotated[
        list[str] | UnsetType,
        Meta(description="Effects that θ imitates on these logs, so that nothing can be said about them"),
    ] = UNSET
    absorbed: Annotated[dict[str, str], Meta(description="What θ imitates in every log, each with the reason")]
    leftover: Annotated[bool, Meta(description="Whether unexplained structure remains")]
    rest: Annotated[
        WhereEntry | UnsetType | None,
        Meta(description="What remains after the named effects"),
    ] = UNSET
    left_over_torque: Annotated[Number | UnsetType, Meta(description="Unexplained torque, rms, in command units")] = (
        UNSET
    )
    command_rms: Annotated[Number | UnsetType, Meta(description="Rms of the command, to compare it with")] = UNSET
    zeros: Annotated[
        dict[str, Span] | UnsetType,
        Meta(description="By log, where its encoders count from [rad]: arm, pendulum"),
    ] = UNSET
    gain_changes: Annotated[
        list[GainChanged] | UnsetType,
        Meta(description="Searched logs in which the command did not do the same all along, beside the effects found"),
    ] = UNSET
    gap: Annotated[
        GapEntry | None,
        Meta(description="Prediction errors on held-out data; null where they could not be measured, see remarks"),
    ]
    together_over_floor: Annotated[
        Number | UnsetType,
        Meta(
            description="Error on held-out data over the noise floor with the parameters fitted to them as well; null "
            "unless they were predicted far off. At most 1.5: the searched logs say too little about the parameters"
        ),
    ] = UNSET
    second_witness: Annotated[
        SecondWitnessEntry | UnsetType | None,
        Meta(
            description="A second fit by multiple shooting; null unless held-out errors stay large or the floor is in "
            "doubt"
        ),
    ] = UNSET
    learned: Annotated[
        LearnedEntry | UnsetType | None,
        Meta(description="A torque without a name, learned from what is left; null where none was tried"),
    ] = UNSET
    different_plants: Annotated[
        DifferentPlants | UnsetType | None,
        Meta(
            description="Fits of the logs apart, where no plant explains them together and each is explained by one of "
            "its own: all else is of the first alone then. null elsewhere"
        ),
    ] = UNSET
    logs: Annotated[
        list[LogUsed] | UnsetType, Meta(description="The logs, the searched ones first, in the order of the command")
    ] = UNSET
    stretches_s: Annotated[
        list[list[Span]] | UnsetType,
        Meta(description="Of each searched log, the seconds (from, to) that were taken; empty where all were"),
    ] = UNSET
    policy: Annotated[dict[str, Number] | UnsetType, Meta(description="Every threshold that was used")] = UNSET
    runtime_s: Annotated[
        Positive | UnsetType, Meta(description="Duration of the search and of what the report measures, in s")
    ] = UNSET
    where: Annotated[
        WhereEntry | UnsetType | None,
        Meta(
            description="Where model (5) fails before any effect is added; null where that could not be measured, see "
            "remarks"
        ),
    ] = UNSET
    where_after: Annotated[
        WhereEntry | UnsetType | None,
        Meta(description="Where the plant with the effects fails; null where no effect was added"),
    ] = UNSET
    next_experiment: Annotated[str | UnsetType | None, Meta(description="What to do next, in a sentence")] = UNSET
    design: Annotated[
        DesignEntry | UnsetType | None,
        Meta(description="The experiment that separates equals; null where there are none"),
    ] = UNSET
    remarks: Annotated[
        dict[str, str] | UnsetType,
        Meta(description="What could not be done, and why, by part: where, gap, law, closed loop, design"),
    ] = UNSET
