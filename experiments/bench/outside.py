"""What no library names: mechanisms with their own motion or events, and what a model absorbs without a trace."""

from __future__ import annotations

import math

from .declaration import BenchEffect
from .kernels import fields as at


def _slipping_payload(d, p, bench):
    d.put(
        pay_m=p["m"] * d.kind.swing_mass,
        pay_s=1.2 * d.kind.swing_length,
        pay_arm=d.kind.arm_length,
        pay_t=-1.0,
        move=-p["slip"],
        move_t1=p["t1"],
        move_t2=p["t2"],
        move_t3=p["t3"],
    )


def _slipping_payload_sizes(s, k, v):
    t1 = v.near(5.0, 3.0, 7.0)
    return {
        "m": 0.25 * min(k / s.plain, 2.0),
        "slip": 0.25 * s.swing_length,
        "t1": t1,
        "t2": t1 + v.near(3.0, 2.0, 4.0),
        "t3": t1 + v.near(7.0, 5.0, 9.0),
    }


def _flexible_arm(d, p, bench):
    j = p["share"] * d.kind.inertia[0]
    rate = 2.0 * math.pi * p["f"]
    d.join(at.FLEXIBLE, p["share"], motor_j=j, join_k=j * rate**2, join_c=2 * 0.02 * j * rate)


def _stick_slip(d, p, bench):
    d.put(hard=1, static1=p["static"], static2=p["static"])


def _slipping_coupling(d, p, bench):
    share = 0.15
    j = share * d.kind.inertia[0]
    rate = 2.0 * math.pi * 30.0
    d.join(
        at.SLIPPING,
        share,
        motor_j=j,
        join_k=j * rate**2,
        join_c=2 * 0.2 * j * rate,
        join_slip=p["rate"],
        join_limit=2.0 * d.kind.drive,
        friction_at_motor=1,
    )


def _cable(d, p, bench):
    d.put(cable=p["k"], cable_q=p["width"])


def _beat(d, p, shape):
    d.put(beat=p["A"], beat_f=p["f"], beat_phase=0.7, beat_shape=shape)


def _beat_sizes(s, k, v):
    return {"A": 0.5 * k * s.coulomb[0], "f": v.near(0.9, 0.4, 1.6)}


def _lost_counts(d, p, bench):
    step = 2.0 * math.pi / d.kind.encoder_counts[1]
    d.encoders.jumps2 = tuple((p[f"t{i}"], p["counts"] * step) for i in (1, 2, 3))


def _lost_counts_sizes(s, k, v):
    sign = v.sign()
    return {
        "counts": sign * round(8.0 * k * s.encoder_counts[1] / 4096),
        "t1": v.near(4.0, 2.0, 6.0),
        "t2": v.near(9.0, 7.0, 11.0),
        "t3": v.near(15.0, 12.0, 18.0),
    }


def _random_torque(d, p, bench):
    d.random_torque.rms, d.random_torque.bandwidth = p["rms"], 10.0


def _gain(d, p, bench):
    d.command.gain = p["gain"]


_OUTSIDE = (
    BenchEffect(
        "slipping_payload", "outside", "a clamp slides down the pendulum in three jerks of 50 ms",
        {"m": "1", "slip": "m", "t1": "s", "t2": "s", "t3": "s"}, _slipping_payload_sizes, _slipping_payload,
    ),
    BenchEffect(
        "flexible_arm", "outside", "the arm bends: a share of its inertia swings against the rest at f",
        {"share": "1", "f": "Hz"}, lambda s, k, v: {"share": 0.08 * min(k, 2.0), "f": v.near(7.0, 6.0, 9.0)},
        _flexible_arm,
    ),
    BenchEffect(
        "stick_slip", "outside", "dry friction that truly sticks, with a static level above the sliding one",
        {"static": "1"}, lambda s, k, v: {"static": 1.0 + 1.2 * k / s.plain}, _stick_slip,
    ),
    BenchEffect(
        "slipping_coupling", "outside",
        "the coupling between motor and arm slips, at `rate` for a torque of twice the excitation, as its third power; "
        "the encoder sits on the motor",
        {"rate": "rad/s"}, lambda s, k, v: {"rate": 0.12 * k}, _slipping_coupling,
    ),
    BenchEffect(
        "cable_hysteresis", "outside", "a cable that yields: torque follows the arm's motion with memory",
        {"k": "{u}/rad", "width": "rad"},
        lambda s, k, v: {"k": 6.0 * k * s.coulomb[0], "width": v.near(0.08, 0.06, 0.12)}, _cable,
    ),
    BenchEffect(
        "sawtooth_torque", "outside", "a periodic torque on the arm with the shape of a saw",
        {"A": "{u}", "f": "Hz"}, _beat_sizes, lambda d, p, bench: _beat(d, p, at.SAWTOOTH),
    ),
    BenchEffect(
        "switching_torque", "outside", "a torque on the arm that switches between two values",
        {"A": "{u}", "f": "Hz"}, _beat_sizes, lambda d, p, bench: _beat(d, p, at.SQUARE),
    ),
    BenchEffect(
        "lost_counts", "outside", "the pendulum's encoder loses counts at three moments",
        {"counts": "1", "t1": "s", "t2": "s", "t3": "s"}, _lost_counts_sizes, _lost_counts,
    ),
)  # fmt: skip

_ABSORBED = (
    BenchEffect(
        "back_emf", "absorbed", "the motor's back-EMF: more viscous friction", {"kb": "{u}·s/rad"},
        lambda s, k, v: {"kb": 1.0 * k * s.viscous[0]}, lambda d, p, bench: d.put(back_emf=p["kb"]),
    ),
    BenchEffect(
        "amplifier_gain", "absorbed", "the amplifier's gain is not what it says: all θ scale", {"gain": "1"},
        lambda s, k, v: {"gain": 1.0 + 0.1 * k * v.sign()}, _gain,
    ),
)  # fmt: skip

_CONTROL = (
    BenchEffect(
        "random_arm_torque", "control", "random torque on the arm below 10 Hz", {"rms": "{u}"},
        lambda s, k, v: {"rms": 0.17 * k * s.coulomb[0]}, _random_torque,
    ),
)  # fmt: skip

EFFECTS: tuple[BenchEffect, ...] = (*_OUTSIDE, *_ABSORBED, *_CONTROL)
