"""The envelope around a controller on a rig: whatever is read, what is commanded is finite, limited, and off in time.

The same rules in Python (`Guarded`) and in the C headers (`exports.envelope_c`), in this order, once a sample:

1. A reading or reference that is no number or beyond ±10⁴ rad, and an angle more than half a turn from the last good
   one, as of readings that are wrapped, command 0 and are not shown to the controller; after `bad_readings` of them in
   a row the controller goes off. An arm whose angle is wrapped would never leave a travel of half a turn and more.
2. Arm beyond `arm_travel`; arm faster than `arm_speed` over some samples, up to `SPEED_TIME` together, by more than
   one count of its encoder, as a count a sample says little of a speed; pendulum beyond `tilt` from upright; arm's
   reading the very same while the command was beyond `breakaway` for `held` seconds in all and the pendulum moved by
   `stirred`, as an encoder that came unplugged reads; both readings the very same for `frozen` seconds of such a
   command, as a driver that repeats its last answer reads: off.
3. After missed samples the controller is first called once for each of them, with readings on the line from the last
   good one to the present one. These commands are discarded. So its filters and integrals keep their clock. The law
   is not told that 0 was sent instead, nor what the rules below change: its observer, its delay line and the last
   command that a policy sees hold its own commands, and learn of the difference by the next readings alone.
4. What is to be added to the command, as an excitation, is added. A command that is no number: off.
5. Soft start: the command grows linearly to its full size over `soft_start`.
6. Slew: it changes by at most slew · T a sample, 0 before the first. T is the caller's period. A policy that acts at
   every n-th sample of a loop nears its command there in n steps. Its C header, called once in these n samples, and
   the env that it learned on change the command by up to slew · n · T at once, and so arrive at the same command.
7. Clamp: |u| ≤ u_max.

Off means a command of 0 until reset, and the reason is kept.
"""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.plant_file import ARM_TRAVEL

from .base import Controller
from .comparison.trials import HORIZONTAL
from .design import choose_sensors
from .known_effects import KnownEffects

LONGEST_START = 60.0  # s of a soft start
HELD = 0.5  # s for which a controller may push an arm whose reading stands
FROZEN = 1.0  # s for which it may push while neither reading changes; friction may hold both axes for a moment
MOST_BAD_READINGS = 1000  # in a row; a rig that reads nothing for so long is not controlled

REASONS = ("on", "reading", "arm", "speed", "tilt", "law", "held", "late")
"""Why a controller is off, indexed by the C header's numbers. The header is called by a timer, and is never late."""
LATE = 0.1  # s that a loop may stall, while the motor holds its last command
FARTHEST = 1e4  # rad; no rig turns so far
LARGEST = 1e30  # a single-precision number still, and no command
JUMP = math.pi  # rad; neither arm nor pendulum turns so far in a sample
SPEED_TIME = 5e-3  # s, over which the arm's speed is taken at most, or one sample where that is longer
_FRICTIONS = 3.0  # times θ8, which surely moves the arm: friction at rest may be twice that of a motion
_SURE = 1.5  # times friction, where more is not to be had
_REACHED = 0.9  # of u_max, which a controller that pushes a rig in vain reaches
_CREEP, _ANGLES = 1e-3, 181  # rad/s, slower than any law of friction changes; angles over the travel
_COUNTS = 10.0  # of the arm's encoder, by which a command at the limit moves it within `held`
_STIRRED, _STIRRED_COUNTS = 0.011, 3.5  # rad, and counts: more than a pendulum moves while arm and pendulum rest


@dataclass(frozen=True)
class Envelope:
    """Limits in the command's unit, rad and s; infinity where there is none. Raises ValueError unless positive.

    soft_start may be zero, which is the default: who balances must act at once. So may resolution, one count of the
    arm's encoder. bad_readings is a whole number. held [s] infinite: the arm's reading may stand for ever. stirred: by
    how much the pendulum must have moved meanwhile, as a cable or a tilt may hold an arm whose pendulum rests. frozen
    [s]: for how long both readings may stand; infinite: for ever.
    """

    u_max: float
    arm_travel: float = ARM_TRAVEL
    arm_speed: float = math.inf
    tilt: float = math.inf
    slew: float = math.inf
    soft_start: float = 0.0
    bad_readings: int = 3
    resolution: float = 0.0
    held: float = math.inf
    breakaway: float = math.inf
    stirred: float = _STIRRED
    frozen: float = math.inf

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            least = 0.0 if field.name in ("soft_start", "resolution") else math.nextafter(0.0, 1.0)
            if not (isinstance(value, int | float) and value >= least):
                raise ValueError(f"envelope: {field.name} must be a positive number, got {value!r}")
        if not all(map(math.isfinite, (self.u_max, self.soft_start, self.resolution))):
            raise ValueError("envelope: u_max, soft_start and resolution must be finite")
        if type(self.bad_readings) is not int or self.bad_readings > MOST_BAD_READINGS:
            wanted = f"a whole number from 1 to {MOST_BAD_READINGS}"
            raise ValueError(f"envelope: bad_readings must be {wanted}, got {self.bad_readings!r}")
        if self.soft_start > LONGEST_START:
            raise ValueError(f"envelope: soft_start {self.soft_start:g} s, expected {LONGEST_START:g} s at most")

    @classmethod
    def of(cls, controller: Any, **changes: Any) -> "Envelope":
        """From the controller and its encoders, and the plant file's limits where it has them; `changes` that are not
        None win.

        A controller that only balances goes off when the pendulum is horizontal. The arm may not turn further than it
        did in a policy's training.
        """
        plant = controller.plant
        limits = plant.limits or {}
        arm, pendulum = choose_sensors(plant, getattr(controller, "sensors", None)).resolution.tolist()
        given = changes.get("u_max")
        u_max = min(controller.u_max, limits.get("supply", math.inf)) if given is None else given
        made = cls(
            u_max=u_max,
            arm_travel=min(limits.get("arm_travel", ARM_TRAVEL), getattr(controller, "arm_limit", math.inf)),
            arm_speed=limits.get("arm_speed", math.inf),
            tilt=math.inf if "swing_up" in controller.tasks else HORIZONTAL,
            slew=limits.get("slew", math.inf),
            resolution=arm,
            held=HELD,
            breakaway=breakaway(plant, arm, u_max),
            stirred=max(_STIRRED, _STIRRED_COUNTS * pendulum),
            frozen=FROZEN,
        )
        return dataclasses.replace(made, **{name: value for name, value in changes.items() if value is not None})


def breakaway(plant: Plant, count: float, u_max: float = math.inf) -> float:
    """The command [{u}] that must move an arm at rest within HELD: three times its friction, what a spring or a tilt
    holds against it within its travel, what moves its inertia and viscous friction by ten counts [rad], and the dead
    zone where the plant has one.

    Where that is nearly `u_max` or more, less is taken: a little below u_max, if one and a half times the friction and
    the rest is less than that. Infinity where no command is enough, so that nothing can be told from it."""
    dead = plant.effect("input_dead_zone")
    dry, against = _at_rest(plant)
    moved = _COUNTS * count * (2.0 * plant.theta[0] / HELD + max(plant.theta[5], 0.0)) / HELD
    rest = against + moved + (abs(dead.parameters["w"]) if dead else 0.0)
    for level in (_FRICTIONS * dry + rest, _REACHED * u_max):
        if _SURE * dry + rest <= level <= _REACHED * u_max:
            return float(level) or math.inf
    return math.inf


def _at_rest(plant: Plant) -> tuple[float, float]:
    """Largest dry friction of an arm that hardly moves, and largest other torque on it, within its travel [{u}]."""
    known = KnownEffects(plant, friction_speed=_CREEP)
    travel = min(plant.limit("arm_travel", math.pi), math.pi)
    q1 = np.linspace(-travel, travel, _ANGLES)
    x = np.zeros((4, q1.size))
    x[0], x[2] = q1, 10.0 * _CREEP
    there = known.torque_on_arm(x)
    x[2] = -x[2]
    back = known.torque_on_arm(x)
    return float(np.abs(there - back).max() / 2.0), float(np.abs(there + back).max() / 2.0)


def speed_samples(sample_time: float) -> int:
    """Over how many samples the arm's speed is taken at most."""
    return max(1, round(SPEED_TIME / sample_time))


class Guarded:
    """A controller inside its envelope; called like the controller, with readings (2,).

    extra is added to the controller's command, within the envelope: an excitation, in the command's unit. t [s] is
    when the readings were taken, by a fine clock that goes on, as `time.perf_counter` does: the arm's speed then counts
    from the true time, samples that a slow loop leaves out are made up for (rule 3), and a loop that stalls for longer
    than `LATE` is switched off, "late". Without t each call is taken for the next sample. `off` is why it is off, "on"
    while it works; `reset` starts anew.
    """

    def __init__(self, controller: Controller, envelope: Envelope | None = None) -> None:
        self.controller = controller
        self.envelope = envelope or Envelope.of(controller)
        self.name, self.sample_time, self.u_max = controller.name, controller.sample_time, self.envelope.u_max
        self.tasks = controller.tasks
        self.reset()

    def reset(self) -> None:
        self.controller.reset()
        self.off = REASONS[0]
        self._u = 0.0
        self._last = np.zeros(2)  # good reading
        self._from, self._since = 0.0, 0.0  # the arm's reading that its speed is taken from, and samples since then
        self._low = self._high = 0.0  # of the pendulum, while the arm's reading stands
        self._good = self._missed = self._behind = self._samples = self._pushed = 0
        self._time: float | None = None
        self._begun, self._ticks = 0.0, 0  # first stamp, and samples since

    def __call__(self, y: ArrayLike, extra: float = 0.0, t: float | None = None) -> float:
        if t is not None:
            self._clocked(float(t))
        reference = self.controller.reference_at(self._samples)
        self._samples += 1
        self._u = self._step(np.array(y, dtype=float), reference, float(extra))
        return self._u

    def _clocked(self, t: float) -> None:
        """Take in when a sample was read [s]: how far the loop is behind its clock, and how long the sample took. A
        stamp that is no later than the one before, as of a clock that is coarse or was set, says neither."""
        if not math.isfinite(t) or t == self._time:
            self._ticks += 1
            return
        before, self._time = self._time, t
        if before is None or t < before:
            self._begun, self._ticks = t, 0
            return
        if t - before > LATE + self.sample_time:
            self.off = "late" if self.off == REASONS[0] else self.off
            return
        self._since += (t - before) / self.sample_time - 1.0 if self._good > 0 else 0.0
        self._ticks += 1
        late = max(round((t - self._begun) / self.sample_time) - self._ticks, 0)
        self._ticks += late
        self._samples += late
        self._behind += late

    def _step(self, q: NDArray[np.float64], reference: float, extra: float) -> float:
        e, T = self.envelope, self.sample_time
        if self.off != REASONS[0]:
            return 0.0
        self._since += self._good > 0
        jumped = self._good > 0 and np.abs(q - self._last).max() > JUMP
        if jumped or not all(abs(x) <= FARTHEST for x in (*q, reference)):
            self._missed += 1
            return self._latch("reading") if self._missed >= e.bad_readings else 0.0
        if abs(q[0]) > e.arm_travel:
            return self._latch("arm")
        if abs(q[0] - (self._from if self._good > 0 else q[0])) > e.arm_speed * T * self._since + e.resolution:
            return self._latch("speed")
        if self._good == 0 or self._since > speed_samples(T) - 0.5:
            self._from, self._since = q[0], 0.0
        if abs(q[1]) > e.tilt:
            return self._latch("tilt")
        if self._stands(q):
            return self._latch("held")
        if self._good > 0:
            missed = self._missed + self._behind
            for part in np.arange(1, missed + 1) / (missed + 1):
                self.controller.follow(self._last + part * (q - self._last), reference)
        self._missed, self._behind, self._last = 0, 0, q
        self._good += 1
        u = float(self.controller.follow(q, reference)) + extra
        if not abs(u) <= LARGEST:
            return self._latch("law")
        ramp = math.ceil(e.soft_start / T)
        if self._good <= ramp:
            u *= self._good / (ramp + 1)
        if e.slew < math.inf:
            u = min(max(u, self._u - e.slew * T), self._u + e.slew * T)
        return min(max(u, -e.u_max), e.u_max)

    def _stands(self, q: NDArray[np.float64]) -> bool:
        """Whether the arm's reading is one that stands still, as rule 2 says."""
        if self._good == 0 or q[0] != self._last[0]:
            self._pushed, self._low, self._high = 0, q[1], q[1]
            return False
        self._low, self._high = min(self._low, q[1]), max(self._high, q[1])
        self._pushed += abs(self._u) > self.envelope.breakaway
        stirred = self._high - self._low
        longest = self.envelope.held if stirred > self.envelope.stirred else self.envelope.frozen
        return bool(self._pushed >= longest / self.sample_time and (stirred == 0.0 or stirred > self.envelope.stirred))

    def _latch(self, reason: str) -> float:
        self.off = reason
        return 0.0


def unlimited(plant: Plant, travel: float = ARM_TRAVEL) -> str:
    """What it means for an exported controller that its plant does not limit the arm; "" for one that does. travel
    [rad]: where the envelope switches off all the same."""
    limits = plant.limits or {}
    if "arm_travel" in limits:
        return ""
    speed = "" if "arm_speed" in limits else " at any speed,"
    return (
        f"The plant has no limit arm_travel: the arm may turn {travel:.3g} rad to either side,{speed} with up to "
        f"{plant.supply:g} {plant.unit}. docs/how-to/first_run.md says how to write limits"
    )
