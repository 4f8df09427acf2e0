"""What a rig is made of, as the kernels read it: one record of numbers, and the places in the state vector.

All torques are in the unit of the command, masses and inertias accordingly (divided by the torque per command).
"""

import math

import numpy as np

# state: angles and speeds of arm and pendulum, then what some effects remember
Q1, Q2, V1, V2 = 0, 1, 2, 3
LAG_A, LAG_B = 4, 5  # actuator
BRISTLE = 6  # deflection of the arm's friction contact [rad]
QM, VM = 7, 8  # a second body on the arm's axis: the motor where it is not rigidly joined, or the arm's outer part
TWIST = 9  # twist of a coupling that slips [rad]
CABLE = 10  # deflection of a cable that yields [rad]
N_STATES = 11

# what joins that body to the arm; the drive acts on the arm if FLEXIBLE, on the motor if PLAY or SLIPPING
RIGID, FLEXIBLE, PLAY, SLIPPING = 0, 1, 2, 3
SMOOTH_TANH, SMOOTH_ALGEBRAIC = 0, 1  # how smooth Coulomb friction turns over
SINE, SINE_WITH_OVERTONE, SAWTOOTH, SQUARE = 0, 1, 2, 3

_FLOATS: dict[str, float] = {
    # kinetic and potential energy: T = ½ q̇ᵀ M q̇, V = th5 (n · pendulum) + g1 (n · arm)
    "th1": 0.0, "th2": 0.0, "th3": 0.0, "th4": 0.0, "th5": 0.0,
    "nx": 0.0, "ny": 0.0, "nz": 1.0, "g1": 0.0,
    # friction
    "fv1": 0.0, "fv2": 0.0, "fc1": 0.0, "fc2": 0.0, "r1": 100.0, "r2": 100.0,
    "static1": 1.0, "static2": 1.0,
    "strib1": 0.0, "strib1_v": 1.0, "strib1_tail": 0.0, "strib2": 0.0, "strib2_v": 1.0, "strib2_tail": 0.0,
    "asym1": 0.0, "asym2": 0.0,
    "drag1": 0.0, "drag1_e": 2.0, "drag2": 0.0, "drag2_e": 2.0, "drag2_sweep": 0.0,
    "place_sin": 0.0, "place_cos": 0.0, "place_2nd": 0.0,
    "warm_c": 0.0, "warm_c_tau": math.inf, "warm_v": 0.0, "warm_v_tau": math.inf,
    "back_emf": 0.0,
    "bristle": 0.0, "bristle_e": 1.0,
    # other torques on the arm
    "spring": 0.0, "spring_q": 0.0, "spring_cubic": 0.0,
    "stiffer": 0.0, "stiffer_q": 0.0, "stiffer_from": 0.0, "below": 0.0, "above": 0.0, "taut_q": 0.0, "taut_rest": 0.0,
    "table_from": 0.0, "table_step": 0.0,
    "ripple": 0.0, "ripple_n": 1.0, "ripple_phase": 0.0, "ripple_2nd": 0.0,
    "beat": 0.0, "beat_f": 1.0, "beat_phase": 0.0,
    "cable": 0.0, "cable_q": 1.0, "cable_e": math.inf,
    # actuator
    "lag_a": 0.0, "lag_b": 0.0, "fade": 0.0, "fade_tau": math.inf,
    # the second body and its joint
    "motor_j": 0.0, "join_k": 0.0, "join_c": 0.0, "join_gap": 0.0, "join_slip": 0.0, "join_limit": 1.0,
    # a mass on the pendulum, at distance pay_s from the pivot on an arm of length pay_arm
    "pay_m": 0.0, "pay_s": 0.0, "pay_arm": 0.0, "pay_t": math.inf, "pay_ramp": 0.0,
    "move": 0.0, "move_t1": math.inf, "move_t2": math.inf, "move_t3": math.inf, "move_time": 0.05,
    "gravity": 9.81,
}  # fmt: skip
_INTS: dict[str, int] = {
    "hard": 0, "turn1": SMOOTH_TANH, "turn2": SMOOTH_TANH, "asym_turn": SMOOTH_TANH,
    "beat_shape": SINE, "join": RIGID, "friction_at_motor": 0,
    "mujoco": 0, "mj_forward": 0, "mj_mulm": 0, "mj_model": 0, "mj_data": 0,
}  # fmt: skip

TABLE = 13  # points of a measured cable's torque, at equal distances of the arm's angle

RECORD = np.dtype(
    [(k, "f8") for k in _FLOATS] + [(k, "i8") for k in _INTS] + [(k, "f8", (TABLE,)) for k in ("table", "slopes")]
)


def blank() -> np.ndarray:
    """A record (1,) of a rig without any effect and without any mass: fill in theta before use."""
    record = np.zeros(1, RECORD)
    for key, value in {**_FLOATS, **_INTS}.items():
        record[key] = value
    return record
