"""diagnosis.json as it is declared: names, types and meanings of its keys, in the order in which they are written.

`Diagnosis` and `GapChange` fill these structures, and docs/schema/furuta-diagnosis-1.schema.json follows from them.
"""

from __future__ import annotations

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
    value: Number
    std: Annotated[Positive, Meta(description="Standard deviation")]
    unit: str
    interval: Annotated[Interval | UnsetType, Meta(description="95 % interval")] = UNSET


class EffectFound(Struct, kw_only=True):
    name: Annotated[str, Meta(description="As in the effects page")]
    parameters: Annotated[
        dict[str, ParameterFound],
        Meta(
            description="By name: value, standard deviation, 95 % interval (uneven where the logarithm is "
            "estimated) and unit"
        ),
    ]
    equation: Annotated[str, Meta(description="What the effect adds to model (5)")]
    place: Annotated[str | UnsetType, Meta(description="What it acts on")] = UNSET
    log_likelihood_gain: Annotated[float, Meta(description="In nats, over the model without it")]
    confused_with: Annotated[list[str], Meta(description="Effects that explain these logs as well")]
    predict_the_same: Annotated[list[str] | UnsetType, Meta(description="Those of them that predict the same")] = UNSET


class OtherLaw(EffectFound, kw_only=True):
    law_of: Annotated[str, Meta(description="The named effect")]


class Ranked(Struct):
    name: str
    log_likelihood_gain: Annotated[Number, Meta(description="After refitting, in nats; null where no fit was made")]
    score: Annotated[Number, Meta(description="Before refitting, in nats")]


class Errors(Struct):
    rms_q1: Annotated[Positive, Meta(description="Of the arm's angle, in rad")] = None
    rms_q2: Annotated[Positive, Meta(description="Of the pendulum's angle, in rad")] = None
    ratio_to_floor: Annotated[
        Positive | UnsetType, Meta(description="The error ratio: their size over the noise floor")
    ] = UNSET


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
    noise_floor: Annotated[Errors, Meta(description="What a right plant would leave")]
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
            description="The same on the last part of each searched log. It decides where held-out logs cannot: on "
            "effects that depend on time, as `periodic_torque` does, or on angles at which the held-out arm is not"
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


class DiagnosisFile(Struct, kw_only=True):
    schema: Annotated[Literal["furuta-diagnosis/1"], Meta(description="Kind and version of the file")]
    verdict: Annotated[Verdict, Meta(description="The answer in a word")]
    summary: Annotated[str, Meta(description="The answer in a sentence")]
    effects: Annotated[
        list[EffectFound],
        Meta(
            description="The effects found, in order. They are names if the verdict is named or ambiguous. If it is "
            "unknown they were tried and are no names; plant.json has them unless held-out data spoke against them"
        ),
    ]
    other_laws: Annotated[
        list[OtherLaw] | UnsetType,
        Meta(
            description="Effects that only describe what the library's law of a named one misses; part of the plant, "
            "as an entry of effects has it, with law_of: the name of that effect"
        ),
    ] = UNSET
    ranking: Annotated[list[Ranked], Meta(description="The effects that were tried first, the best first")]
    not_visible: Annotated[
        list[str] | UnsetType,
        Meta(description="Effects that θ imitates on these logs, so that nothing can be said about them"),
    ] = UNSET
    absorbed: Annotated[dict[str, str], Meta(description="What θ imitates in every log, each with the reason")]
    leftover: Annotated[bool, Meta(description="Whether unexplained structure remains")]
    rest: Annotated[
        dict[str, Any] | UnsetType | None,
        Meta(description="What remains after the named effects, in the layout of `where`"),
    ] = UNSET
    left_over_torque: Annotated[Number | UnsetType, Meta(description="Unexplained torque, rms, in command units")] = (
        UNSET
    )
    command_rms: Annotated[Number | UnsetType, Meta(description="Rms of the command, to compare it with")] = UNSET
    zeros: Annotated[
        dict[str, Span] | UnsetType,
        Meta(description="By log, where its encoders count from [rad]: arm, pendulum"),
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
        dict[str, Any] | UnsetType | None,
        Meta(description="A check by multiple shooting, where structure remains"),
    ] = UNSET
    learned: Annotated[
        dict[str, Any] | UnsetType | None,
        Meta(description="A torque without a name, learned from what is left, and whether it was added"),
    ] = UNSET
    stretches_s: Annotated[
        list[list[Span]] | UnsetType,
        Meta(description="Of each searched log, the seconds (from, to) that were taken; empty where all were"),
    ] = UNSET
    policy: Annotated[dict[str, Number] | UnsetType, Meta(description="Every threshold that was used")] = UNSET
    runtime_s: Annotated[Positive | UnsetType, Meta(description="Duration of the search in s")] = UNSET
    where: Annotated[
        dict[str, Any] | UnsetType | None,
        Meta(
            description="Where model (5) fails before any effect is added; null where that could not be measured, see "
            "remarks"
        ),
    ] = UNSET
    where_after: Annotated[
        dict[str, Any] | UnsetType | None, Meta(description="Where the plant with the effects fails")
    ] = UNSET
    next_experiment: Annotated[str | UnsetType | None, Meta(description="What to do next, in a sentence")] = UNSET
    design: Annotated[
        dict[str, Any] | UnsetType | None,
        Meta(description="The experiment that separates equals, where there are any"),
    ] = UNSET
    remarks: Annotated[
        dict[str, str] | UnsetType,
        Meta(description="What could not be done, and why, by part: where, gap, law, closed loop, design"),
    ] = UNSET
