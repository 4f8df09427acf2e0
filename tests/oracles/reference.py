"""Model (5) and every effect of the contract's table, in plain Python: slow, explicit, one line an equation.

Written from the paper's equations (5) to (13), the errata (C11 carries q̇2) and the contract's table of
effects. An effect is a name and a dict of parameters: `{"arm_spring": {"k": 0.3, "q1n": -0.5}}`.

State of the motion: (q1, q2, v1, v2). Effects with memory add
* `arm_presliding`: z, the bristle's deflection; F = σ0 z stands for θ8 tanh(r v1), ż = v1 (1 − sgn(v1) σ0 z / θ8)^i,
  settling at a rate of 1000 1/s at most (by definition of the model: faster cannot be told from settled);
* `arm_hysteresis`: z and z2, the deflections of two stops in parallel; ż = v1 inward, (1 − ρ |z|/d) v1 outward, and 0
  where |z| = d and v1 drives outward; relaxed at q1 = 0, from where the arm has come to its first angle in one stroke;
* `arm_backlash`: s = rotor angle − arm angle and w = ṡ; the rotor has the inertia ρ θ1;
* `actuator_lag`: τ, which is integrated in closed form over each held command;
* `input_delay`: nothing, because the record of commands is the memory: τ(t) = u(t − d).

The command passes through delay → offset → asymmetry → cubic → dead zone → saturation → lag.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import copysign, cos, exp, expm1, inf, pi, sin, sqrt, tanh

import numpy as np
from scipy.integrate import solve_ivp

Effects = dict[str, dict[str, float]]

KNOWN = frozenset(
    {
        *("input_delay", "input_offset", "input_gain_asymmetry", "input_cubic_gain", "input_dead_zone"),
        *("input_saturation", "actuator_lag", "arm_stribeck", "arm_coulomb_asymmetry", "arm_quadratic_drag"),
        *("arm_spring", "arm_ripple", "arm_position_friction", "arm_presliding", "arm_friction_drift"),
        *("arm_viscous_drift", "arm_backlash", "periodic_torque", "pendulum_quadratic_drag"),
        *("pendulum_stribeck", "pendulum_coulomb_asymmetry", "base_tilt", "friction_sharpness", "payload_step"),
        *("arm_cable", "arm_taut_cable", "arm_hysteresis", "pendulum_encoder_offset"),
        *("pendulum_encoder_eccentricity", "arm_encoder_eccentricity", "input_gain_drift"),
    }
)
MEMORY = {"arm_presliding": 1, "arm_backlash": 2, "arm_hysteresis": 2}  # integrated states, in this order
FASTEST_BRISTLE = 1000.0  # 1/s
CONTACT_FREQUENCY = 200.0
CONTACT_DAMPING_RATIO = 0.7


def held_command(t: float, t_u, u) -> float:
    """Zero-order hold: the last command given at or before t; before the record, its first command."""
    value = u[0]
    for time, command in zip(t_u, u, strict=True):
        if time <= t:
            value = command
    return float(value)


def static_command(u: float, effects: Effects) -> float:
    """The maps of the command without memory, one after another."""
    tau = u
    if "input_offset" in effects:
        tau = tau + effects["input_offset"]["b"]
    if "input_gain_asymmetry" in effects:
        sign = 0.0 if tau == 0 else copysign(1.0, tau)
        tau = tau * (1.0 + effects["input_gain_asymmetry"]["a"] * sign)
    if "input_cubic_gain" in effects:
        tau = tau + effects["input_cubic_gain"]["a"] * tau**3
    if "input_dead_zone" in effects:
        w = effects["input_dead_zone"]["w"]
        tau = tau - min(max(tau, -w), w)
    if "input_saturation" in effects:
        tau = rounded_clip(tau, **effects["input_saturation"])
    return tau


def rounded_clip(u: float, m: float, knee: float = 0.0) -> float:
    """The mean of clip(u + s, −m, m) over s in ±knee m, from the antiderivative of the clip."""
    if knee * m == 0.0 or m == float("inf"):
        return min(max(u, -m), m)

    def integral(x: float) -> float:
        return x * x / 2.0 if abs(x) <= m else m * abs(x) - m * m / 2.0

    return (integral(u + knee * m) - integral(u - knee * m)) / (2.0 * knee * m)


def measured(q1: float, q2: float, effects: Effects) -> tuple[float, float]:
    """What ideal encoders (no counts, no noise) show of the true angles."""
    y1, y2 = q1, q2
    if "pendulum_encoder_offset" in effects:
        y2 += effects["pendulum_encoder_offset"]["b"]
    if "pendulum_encoder_eccentricity" in effects:
        a, b = effects["pendulum_encoder_eccentricity"]["a"], effects["pendulum_encoder_eccentricity"]["b"]
        y2 += a * sin(q2) + b * (cos(q2) - 1.0)
    if "arm_encoder_eccentricity" in effects:
        a, b = effects["arm_encoder_eccentricity"]["a"], effects["arm_encoder_eccentricity"]["b"]
        y1 += a * sin(q1) + b * (cos(q1) - 1.0)
    return y1, y2


def loaded_theta(theta, t: float, effects: Effects) -> list[float]:
    """θ at time t: from t0 on the pendulum's mass is (1 + m) times as large, added at its centre of mass."""
    th = [float(value) for value in theta]
    if "payload_step" in effects:
        m, t0 = effects["payload_step"]["m"], effects["payload_step"]["t0"]
        if t >= t0:
            th[0] += m * th[2] ** 2 / th[1]  # m2 L1² = θ3²/θ2
            th[3] += m * th[1]
            th[1] *= 1.0 + m
            th[2] *= 1.0 + m
            th[4] *= 1.0 + m
    return th


def sharpness(r: float, effects: Effects) -> tuple[float, float]:
    """r of the two axes; zero means: keep the plant's."""
    chosen = effects.get("friction_sharpness", {"r1": 0.0, "r2": 0.0})
    return chosen["r1"] or r, chosen["r2"] or r


def rotor_inertia(theta, effects: Effects) -> float:
    """Of the motor's side of the play; what the arm keeps is positive with the pendulum free to give way."""
    th1, _, th3, th4 = (float(value) for value in theta[:4])
    return min(effects["arm_backlash"].get("ρ", 0.1) * th1, 0.9 * (th1 - th3**2 / th4))


def reduced_inertia(theta, effects: Effects) -> float:
    """Of rotor and arm that swing against each other, with the pendulum free to give way."""
    rotor = rotor_inertia(theta, effects)
    arm = float(theta[0]) - float(theta[2]) ** 2 / float(theta[3]) - rotor
    return 1.0 / (1.0 / rotor + 1.0 / arm)


def contact_torque(s: float, w: float, inertia: float, b: float) -> float:
    """Torque from rotor to arm through a play of half-width b: spring and damper that push and never pull."""
    k = inertia * CONTACT_FREQUENCY**2
    c = 2.0 * CONTACT_DAMPING_RATIO * inertia * CONTACT_FREQUENCY
    if s > b:
        return max(0.0, k * (s - b) + c * w)
    if s < -b:
        return min(0.0, k * (s + b) + c * w)
    return 0.0


def integrate(f, a: float, b: float) -> float:
    """∫ f from a to b by Gauss's rule of three points, exact for polynomials up to the fifth degree."""
    middle, half = 0.5 * (a + b), 0.5 * (b - a)
    reach = half * sqrt(0.6)
    return half / 9.0 * (5.0 * f(middle - reach) + 8.0 * f(middle) + 5.0 * f(middle + reach))


def stop_rate(z: float, v: float, d: float, rho: float) -> float:
    """ż of a stop: it follows the motion until |z| = d, the less the further it is if it yields gradually, slips there,
    and follows again as soon as v turns inward."""
    if z * v <= 0.0:
        return v
    return 0.0 if abs(z) >= d else v * (1.0 - rho * abs(z) / d)


def stop_elements(effects: Effects) -> list[tuple[float, float, float]]:
    """(κ, d, ρ) of the elements of `arm_hysteresis`."""
    p = effects.get("arm_hysteresis")
    return [(p["κ"], p["d"], p.get("ρ", 0.0)), (p["κ2"], p["d2"], p.get("ρ", 0.0))] if p else []


def extra_torques(t, q1, q2, v1, v2, theta, r, effects: Effects, at_rest_theta, tau=0.0) -> tuple[float, float]:
    """Right-hand sides that the effects add to the arm's and to the pendulum's row; tau: the motor's torque."""
    r1, r2 = sharpness(r, effects)
    arm = pendulum = 0.0
    for name, p in effects.items():
        if name == "arm_stribeck":
            arm -= p["ΔF"] * exp(-(abs(v1 / p["vs"]) ** p["δ"])) * tanh(r1 * v1)
        elif name == "arm_coulomb_asymmetry":
            arm -= p["a"] * abs(tanh(r1 * v1))
        elif name == "arm_quadratic_drag":
            arm -= p["c"] * v1 * abs(v1)
        elif name == "arm_spring":
            arm -= p["k"] * (q1 - p["q1n"])
        elif name == "arm_cable":
            arm -= integrate(lambda q, p=p: p["k"] + 3.0 * p["k3"] * (q - p["q1s"]) ** 2, p["q1n"], q1)
        elif name == "arm_taut_cable":
            for low, high, stiffness in ((-inf, p["qt"], p["k1"]), (p["qt"], inf, p["k2"])):
                arm -= stiffness * (min(max(q1, low), high) - min(max(p["q1n"], low), high))
        elif name == "arm_ripple":
            arm -= p["A"] * sin(p["n"] * q1 + p["φ"])
        elif name == "arm_position_friction":
            arm -= (p["a"] * sin(q1) + p["b"] * cos(q1)) * tanh(r1 * v1)
        elif name == "arm_friction_drift":
            arm -= at_rest_theta[7] * p["a"] * t * tanh(r1 * v1)
        elif name == "arm_viscous_drift":
            arm -= at_rest_theta[5] * p["a"] * t * v1
        elif name == "input_gain_drift":
            arm += max(p["a"] * (-expm1(-p["s"] * t) / p["s"] if p["s"] else t), -1.0) * tau
        elif name == "periodic_torque":
            arm += p["A"] * sin(2.0 * pi * p["f"] * t + p["φ"])
        elif name == "pendulum_quadratic_drag":
            # air passes the point that moves as ℓ q̇2 + L1 cos q2 q̇1; what it takes there acts through the same levers
            lever1, lever2 = p.get("λ", 0.0) * theta[2] / theta[3] * cos(q2), 1.0
            passes = lever1 * v1 + lever2 * v2
            arm -= p["c"] * lever1 * passes * abs(passes)
            pendulum -= p["c"] * lever2 * passes * abs(passes)
        elif name == "pendulum_stribeck":
            pendulum -= p["ΔF"] * exp(-(abs(v2 / p["vs"]) ** p["δ"])) * tanh(r2 * v2)
        elif name == "pendulum_coulomb_asymmetry":
            pendulum -= p["a"] * abs(tanh(r2 * v2))
        elif name == "base_tilt":
            ax, ay, G1 = p["αx"], p["αy"], p["G1"]
            e = -ax * sin(q1) + ay * cos(q1)
            arm += G1 * e - theta[4] * sin(q2) * (ax * cos(q1) + ay * sin(q1))
            pendulum += theta[4] * cos(q2) * e
    return arm, pendulum


def rates(t, x, tau, theta, r, effects: Effects, w=(0.0, 0.0)) -> list[float]:
    """ẋ for x = [q1, q2, v1, v2, z (if bristle), s, w (if play)] under the torque τ and constant torques w."""
    q1, q2, v1, v2 = (float(value) for value in x[:4])
    memory = list(x[4:])
    th1, th2, th3, th4, th5, th6, th7, th8, th9 = th = loaded_theta(theta, t, effects)
    r1, r2 = sharpness(r, effects)

    z = memory.pop(0) if "arm_presliding" in effects else None
    s, s_rate = (memory.pop(0), memory.pop(0)) if "arm_backlash" in effects else (None, None)
    stops = (memory.pop(0), memory.pop(0)) if "arm_hysteresis" in effects else ()

    coulomb1 = th8 * tanh(r1 * v1)
    memory_rates = []
    if z is not None:
        sigma0 = effects["arm_presliding"]["σ0"]
        coulomb1 = sigma0 * z
        settled = copysign(th8 / sigma0, v1)
        to_go, rate = 1.0 - z / settled, sigma0 * abs(v1) / th8
        if to_go >= 0.0:  # no power where a step went too far
            rate *= max(to_go, 1e-9) ** (effects["arm_presliding"].get("i", 1.0) - 1.0)
        memory_rates.append(min(rate, FASTEST_BRISTLE) * (settled - z))

    rotor, into_arm = 0.0, tau
    if s is not None:
        rotor = rotor_inertia(theta, effects)
        into_arm = contact_torque(s, s_rate, reduced_inertia(theta, effects), effects["arm_backlash"]["b"])

    M = np.array([[th1 - rotor + th2 * sin(q2) ** 2, th3 * cos(q2)], [th3 * cos(q2), th4]])
    C = np.array(
        [
            [0.5 * th2 * v2 * sin(2 * q2), -th3 * v2 * sin(q2) + 0.5 * th2 * v1 * sin(2 * q2)],
            [-0.5 * th2 * v1 * sin(2 * q2), 0.0],
        ]
    )
    g = np.array([0.0, -th5 * sin(q2)])
    friction = np.array([th6 * v1 + coulomb1, th7 * v2 + th9 * tanh(r2 * v2)])
    extra = np.array(extra_torques(t, q1, q2, v1, v2, th, r, effects, theta, tau))
    for (kappa, d, _), deflection in zip(stop_elements(effects), stops, strict=True):
        extra[0] -= kappa * min(max(deflection, -d), d)
    right = np.array([into_arm + w[0], w[1]]) + extra - C @ np.array([v1, v2]) - friction - g
    a1, a2 = np.linalg.solve(M, right)
    if s is not None:
        memory_rates += [s_rate, (tau - into_arm) / rotor - a1]
    memory_rates += [stop_rate(x, v1, d, rho) for (_, d, rho), x in zip(stop_elements(effects), stops, strict=True)]
    return [v1, v2, float(a1), float(a2), *memory_rates]


def energy(t, x, theta, effects: Effects) -> float:
    """Kinetic and potential energy, with what springs, bristle, tilted gravity and rotor hold.

    Defined for autonomous effects; with it, dE/dt is the power of the input and of the dissipative terms.
    """
    q1, q2, v1, v2 = (float(value) for value in x[:4])
    memory = list(x[4:])
    th = loaded_theta(theta, t, effects)
    total = 0.5 * (th[0] + th[1] * sin(q2) ** 2) * v1**2 + th[2] * cos(q2) * v1 * v2 + 0.5 * th[3] * v2**2
    total += th[4] * cos(q2)
    if "arm_presliding" in effects:
        total += 0.5 * effects["arm_presliding"]["σ0"] * memory.pop(0) ** 2
    if "arm_backlash" in effects:
        s, s_rate = memory.pop(0), memory.pop(0)
        inertia = rotor_inertia(theta, effects)
        gap = max(abs(s) - effects["arm_backlash"]["b"], 0.0)
        total += 0.5 * inertia * ((v1 + s_rate) ** 2 - v1**2)
        total += 0.5 * reduced_inertia(theta, effects) * CONTACT_FREQUENCY**2 * gap**2
    for (kappa, *_), z in zip(stop_elements(effects), memory, strict=True):
        total += 0.5 * kappa * z**2
    if "arm_cable" in effects:
        p = effects["arm_cable"]
        total += 0.5 * p["k"] * (q1 - p["q1n"]) ** 2 + 0.25 * p["k3"] * (q1 - p["q1s"]) ** 4
        total -= p["k3"] * (p["q1n"] - p["q1s"]) ** 3 * q1
    if "arm_taut_cable" in effects:
        p = effects["arm_taut_cable"]
        pull = [p["k1"] * min(q - p["qt"], 0.0) + p["k2"] * max(q - p["qt"], 0.0) for q in (q1, p["q1n"])]
        total += 0.5 * pull[0] * (q1 - p["qt"]) - pull[1] * q1
    if "arm_spring" in effects:
        p = effects["arm_spring"]
        total += 0.5 * p["k"] * (q1 - p["q1n"]) ** 2
    if "arm_ripple" in effects:
        p = effects["arm_ripple"]
        total -= p["A"] / p["n"] * cos(p["n"] * q1 + p["φ"])
    if "base_tilt" in effects:
        p = effects["base_tilt"]
        ax, ay = p["αx"], p["αy"]
        total -= p["G1"] * (ax * cos(q1) + ay * sin(q1)) + th[4] * sin(q2) * (ay * cos(q1) - ax * sin(q1))
    return total


@dataclass(frozen=True)
class Reference:
    """A plant of the table: θ, r and effects; `run` integrates it to the solver's floor."""

    theta: tuple[float, ...]
    r: float
    effects: Effects = field(default_factory=dict)

    def __post_init__(self) -> None:
        assert set(self.effects) <= KNOWN, f"no oracle for {sorted(set(self.effects) - KNOWN)}: write one"

    @property
    def n_memory(self) -> int:
        """Integrated memory: the bristle's z, the play's s and w, the stops' z (lag and delay need none)."""
        return sum(n for name, n in MEMORY.items() if name in self.effects)

    def edges(self, t_u, start: float, stop: float) -> list[float]:
        """Instants at which the right-hand side jumps: delayed commands and the payload's arrival."""
        delay = self.effects.get("input_delay", {"d": 0.0})["d"]
        jumps = [float(t) + delay for t in t_u]
        if "payload_step" in self.effects:
            jumps.append(self.effects["payload_step"]["t0"])
        inside = {t for t in jumps if start + 1e-12 < t < stop - 1e-12}
        return [start, *sorted(inside), stop]

    def torque_at(self, t: float, t_u, u) -> float:
        """The command after delay and static maps (before the lag)."""
        delay = self.effects.get("input_delay", {"d": 0.0})["d"]
        return static_command(held_command(t - delay, t_u, u), self.effects)

    def run(self, x0, times, t_u, u, w=(0.0, 0.0), lag0: float | None = None, rtol=1e-11, atol=1e-12):
        """States at `times` (n, 4 + memory). Commands u (n,) are held from t_u (n,). lag0: the lag's first τ.

        Without lag0 the actuator has settled on the first command. Memory not given in x0 starts at zero.
        """
        times = np.asarray(times, dtype=float)
        x = np.zeros(4 + self.n_memory)
        x[: len(x0)] = x0
        if len(x0) == 4:
            for i, (_, d, _) in enumerate(stop_elements(self.effects)):
                x[x.size - 2 + i] = min(max(x0[0], -d), d)
        lag = self.effects.get("actuator_lag", {"T": 0.0})["T"]
        tau0 = self.torque_at(times[0], t_u, u) if lag0 is None else lag0
        states = np.full((times.size, x.size), np.nan)
        states[0] = x
        knots = self.edges(t_u, times[0], times[-1])
        for a, b in pairwise(knots):
            middle = 0.5 * (a + b)
            target = self.torque_at(middle, t_u, u)

            def torque(t, a=a, target=target, tau0=tau0):
                return target + (tau0 - target) * exp(-(t - a) / lag) if lag else target

            def field_(t, x, a=a, b=b, torque=torque):
                inside = min(max(t, a), np.nextafter(b, a))  # t0 itself belongs to the next piece
                return rates(inside, x, torque(t), self.theta, self.r, self.effects, w)

            wanted = times[(times > a) & (times <= b)]
            grid = np.unique(np.append(wanted, b))
            solution = solve_ivp(field_, (a, b), x, "DOP853", grid, rtol=rtol, atol=atol)
            assert solution.success, solution.message
            for t, state in zip(grid, solution.y.T, strict=True):
                states[times == t] = state
            x, tau0 = solution.y[:, -1], torque(b)
        return states
