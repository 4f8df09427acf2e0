"""The plant file as it is declared: names, types, bounds and meanings of its keys.

What is read is held against it (`furuta_gym.declared`), `Plant` and `Sensors` check their fields by it, and
docs/schema/furuta-plant-1.schema.json follows from it. A list of bounded length stands where a pair would do: beside a
bounded number, msgspec 0.22 reads a tuple's length from the wrong place.
"""

import math
from typing import Annotated, Any, Literal

from msgspec import UNSET, Meta, Struct, UnsetType
from msgspec.structs import fields

from .parameters import FRICTION_SHARPNESS, THETA_MEANING

SCHEMA = "furuta-plant/1"
DESCRIPTION = (
    "A Furuta pendulum as `furuta identify` writes it. Nested at most 64 levels; every number is finite. The program "
    "also checks that the mass matrix and the covariance are positive, and the bounds of each effect's parameters."
)

ARM_TRAVEL = 2.0 * math.pi
"""Largest angle of the arm to either side of zero [rad] where a plant's limits have none: a cable allows no more."""

Unit = Literal["V", "N·m"]
Theta = Annotated[float, Meta(ge=-1e12, le=1e12)]
Sharpness = Annotated[float, Meta(gt=0, le=1e6)]  # friction that turns within 1 µrad/s is a step to every measurement
Value = Annotated[float, Meta(ge=-1e100, le=1e100)]
NotNegative = Annotated[float, Meta(ge=0, le=1e12)]
Pair = Annotated[list[NotNegative], Meta(min_length=1, max_length=2)] | NotNegative
Offset = Annotated[float, Meta(ge=-1e12, le=1e12)]
Limit = Annotated[float, Meta(gt=0, le=1e9)]
Matrix = list[list[float]]


def _meaning(name: str) -> Meta:
    return Meta(description=THETA_MEANING[name][0])


class ThetaEntry(Struct, forbid_unknown_fields=True):
    theta1: Annotated[Theta, _meaning("theta1")]
    theta2: Annotated[Theta, _meaning("theta2")]
    theta3: Annotated[Theta, _meaning("theta3")]
    theta4: Annotated[Theta, _meaning("theta4")]
    theta5: Annotated[Theta, _meaning("theta5")]
    theta6: Annotated[Theta, _meaning("theta6")]
    theta7: Annotated[Theta, _meaning("theta7")]
    theta8: Annotated[Theta, _meaning("theta8")]
    theta9: Annotated[Theta, _meaning("theta9")]


class CovarianceEntry(Struct):
    names: Annotated[list[str], Meta(description="As theta1, r, or EFFECT.PARAMETER, each once")]
    matrix: Annotated[Matrix, Meta(description="One row and one column for each name")]


class ParameterEntry(Struct, forbid_unknown_fields=True):  # a slip in "value" would switch an effect off
    value: Annotated[Value | None, Meta(description="null is the neutral value")] = None
    std: Annotated[Annotated[float, Meta(ge=0)] | None, Meta(description="Standard deviation")] = None
    unit: Annotated[Any, Meta(description="Held against the one that follows from the command's")] = None


class EffectEntry(Struct):
    name: Annotated[str, Meta(description="As in the effects page, which gives the equation; or arm_learned")]
    parameters: Annotated[
        dict[str, ParameterEntry | Value | None],
        Meta(description="By name: a number, or an object with value, std and unit"),
    ]


class SensorsEntry(Struct):
    encoder_counts: Annotated[Pair | None, Meta(description="Counts per revolution, of q1 and q2; 0 reads exactly")] = (
        None
    )
    noise_std: Annotated[Pair | None, Meta(description="Of the readings, in rad")] = None
    offset: Annotated[
        Annotated[list[Offset], Meta(min_length=2, max_length=2)] | None,
        Meta(description="What is added to the readings of q1 and q2, in rad"),
    ] = None
    velocity_cutoff: Annotated[
        Annotated[float, Meta(gt=0, le=1e12)] | None,
        Meta(description="Of the filter that makes speeds from readings, in rad/s"),
    ] = None


class LogEntry(Struct):
    sha256: Annotated[str | None, Meta(description="Hash of the file")] = None


class ProvenanceEntry(Struct):
    logs: Annotated[list[LogEntry] | None, Meta(description="The logs that were fitted")] = None
    torque_noise: Annotated[
        Annotated[list[Annotated[float, Meta(ge=0, le=1e308)]], Meta(max_length=2)] | None,
        Meta(description="Estimated intensity on arm and pendulum, in (command unit)² s"),
    ] = None
    moved: Annotated[
        dict[str, float | None] | UnsetType,
        Meta(
            description="What was moved by hand (theta6, EFFECT.PARAMETER), with the fit's value; null if it has none"
        ),
    ] = UNSET


class LimitsEntry(Struct, forbid_unknown_fields=True):
    arm_travel: Annotated[
        Limit | UnsetType,
        Meta(
            description="Largest angle of the arm to either side of zero, in rad. There a controller's command "
            "becomes 0, and the arm coasts on"
        ),
    ] = UNSET
    arm_speed: Annotated[Limit | UnsetType, Meta(description="Largest speed of the arm, in rad/s")] = UNSET
    slew: Annotated[Limit | UnsetType, Meta(description="Largest change of the command, in its unit a second")] = UNSET
    supply: Annotated[
        Limit | UnsetType, Meta(description="A smaller largest command that you choose for this rig, in its unit")
    ] = UNSET


class PlantFile(Struct):
    schema: Annotated[Literal["furuta-plant/1"], Meta(description="Kind and version of the file")]
    theta: Annotated[ThetaEntry, Meta(description="theta1 to theta9, the parameters of model (5), in command units")]
    unit: Annotated[Unit, Meta(description="Of the command. A file without it is read in V, with a warning")] = "V"
    friction_sharpness: Annotated[
        Annotated[list[Sharpness], Meta(min_length=1, max_length=2)] | Sharpness,
        Meta(description="r of tanh(r q̇) in s/rad, one or one for each axis"),
    ] = FRICTION_SHARPNESS
    covariance: Annotated[
        CovarianceEntry | Matrix | None,
        Meta(description="Over the named parameters, or a bare 9×9 matrix over theta"),
    ] = None
    effects: Annotated[list[EffectEntry] | None, Meta(description="What acts besides model (5)")] = None
    sensors: Annotated[
        SensorsEntry | None, Meta(description="What the encoders are like; further entries are ignored")
    ] = None
    sample_time: Annotated[Annotated[float, Meta(ge=1e-6, le=1)] | None, Meta(description="Control period in s")] = None
    u_max: Annotated[float, Meta(ge=1e-9, le=1e9, description="Largest command")] = 10.0
    provenance: Annotated[
        ProvenanceEntry | None,
        Meta(description="Where the numbers come from: logs, how they were read, method, program"),
    ] = None
    checks: Annotated[
        dict[str, Any] | None,
        Meta(
            description="Verdicts of the fit, such as whether a rigid body can have this θ. error_bars says why the "
            "covariance is too small, where the method's is. Draws of plants do not take the covariance for what "
            "identifiability.not_identified names. identifiability is that of furuta identify --json"
        ),
    ] = None
    limits: Annotated[
        LimitsEntry | None,
        Meta(description="What the rig can do; envelope, environments and controllers keep to it"),
    ] = None
    randomize: Annotated[
        dict[str, Annotated[str | float, Meta(description="such as uniform:0,0.03")]] | None,
        Meta(description="Ranges to train over by name, such as input_delay: uniform:0,0.03"),
    ] = None


FIELDS: dict[str, Any] = {field.name: field.type for field in fields(PlantFile)}
"""What is declared for each key of the file."""
