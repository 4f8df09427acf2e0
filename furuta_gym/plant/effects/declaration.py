"""What an effect is: one declaration, from which simulation, estimation, files, command line and docs follow."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..compiled import compiled
from ..layout import BASE_NAMES
from ..parameters import THETA_NAMES
from .words import Quantity

_COULOMB = "theta8"
JOINTS = ("arm", "pendulum")
PLACES = ("arm", "pendulum", "arm and pendulum", "input", "sensor", "parameters")

# Where a kernel enters, and the names it may ask for besides its own parameters and memory.
_OWN = tuple(f"plant_{name}" for name in BASE_NAMES)  # as the plant has them, before any effect
_BODY = ("t", "q1", "q2", "v1", "v2", "tau", *BASE_NAMES, *_OWN)
HOOKS: dict[str, tuple[str, ...]] = {
    "delay": (),  # -> delay of the command [s]
    "command": ("u",),  # -> command after a static map
    "filter": ("u", "since", "tau0"),  # -> torque `since` seconds after u took hold, from tau0
    "theta": ("t", *THETA_NAMES, *_OWN),  # -> new values of `changes`
    "torque": _BODY,  # -> (arm, pendulum) torques added to the right-hand side
    "rate": (*_BODY, "a1"),  # -> d/dt of the memory, after the acceleration a1 = q̈1 is known
    "update": ("q1", "q2", "v1", "v2"),  # -> the memory after a Runge–Kutta step, from the state at its end
    "sensor": ("q1", "q2"),  # -> what is added to the readings (y1, y2)
}


_LATIN = {
    **{"α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta", "ε": "epsilon", "ζ": "zeta", "η": "eta", "θ": "theta"},
    **{"κ": "kappa", "λ": "lambda", "μ": "mu", "ν": "nu", "ξ": "xi", "π": "pi", "ρ": "rho", "σ": "sigma", "τ": "tau"},
    **{"φ": "phi", "χ": "chi", "ψ": "psi", "ω": "omega", "Δ": "d"},
}


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    `default` is a size worth noticing on a rig; with `relative_to` it is a fraction of that quantity of the plant
    (theta1 … theta9, u_max or 1/u_max²). A `size` parameter makes the effect vanish at `neutral`; a `shape` parameter
    (Stribeck speed, ripple order) then has no influence. In `unit`, {u} stands for the plant's command unit.

    For a search in data: `grid` are values worth trying (in the unit of `default`, or "frequencies" / "times" that the
    log's length decides); `span` says that a shape enters linearly together with the size, as a "phase" (A sin(x + φ)),
    as a "product" (k (x − s)) or through the effect's `linear` ("linear"), so that no grid is needed (with one, the
    search tries its values, and only the steps of a descent make use of it); `optional`, on a parameter that the plain
    law leaves at its default and on what goes with it, is the name of that parameter: while it is at its default, an
    estimator leaves them as they are and a search does not try them; `spread`, on a positive shape, is the standard
    deviation around the default that mechanics allow, an estimator's prior: of its logarithm, or where the default is
    zero of the shape itself; `rough` says that small
    changes make what follows different throughout (a stop is hit or just missed), so that only trying leads to the best
    value; `abrupt` that there is no small size, so that what the data answer to one says nothing, and only a fit does;
    `of_a_day` that it counts from the arm's zero or the start of the log's clock, so that it is another on another day;
    `jumps` that readings answer to a tiny change either not at all or with a jump, as to a time between two samples, so
    that derivatives need a longer step; `travel` that it is a way of the arm [rad], and that a law with a longer one
    than the arm goes is none of this effect; `near_rest` that it is the speed below which friction is another, so that
    a search keeps it where Coulomb friction has turned over.
    """

    name: str
    unit: str
    meaning: str
    default: float
    relative_to: str | None = None
    neutral: float = 0.0
    lower: float = -float("inf")
    upper: float = float("inf")
    role: str = "size"
    integer: bool = False
    grid: tuple[float, ...] | str = ()
    span: str = ""
    optional: str = ""
    spread: float = 0.0
    rough: bool = False
    abrupt: bool = False
    jumps: bool = False
    travel: bool = False
    of_a_day: bool = False
    near_rest: bool = False

    @property
    def typed(self) -> str:
        """Its name as a keyboard without Greek letters has it: φ is phi, and ΔF is dF."""
        return "".join(_LATIN.get(letter, letter) for letter in self.name)

    @property
    def positive(self) -> bool:
        """Whether only positive values make sense (an estimator then works on the logarithm)."""
        return self.lower >= 0.0

    @property
    def scales(self) -> bool:
        """Whether it goes with the common scale of θ3, θ4, θ5, θ7 and θ9: a torque on the pendulum."""
        return self.unit.startswith("{u}") and self.relative_to in ("theta7", "theta9")

    @property
    def logarithmic(self) -> bool:
        """Whether its logarithm is what is known about it: a positive shape, or one with a log-normal prior."""
        return (self.role == "shape" and self.lower > 0.0) or (self.spread > 0.0 and self.default > 0.0)

    @property
    def repeats(self) -> bool:
        """Whether it is a frequency, so that what it describes comes again."""
        return self.grid == "frequencies"

    @property
    def instant(self) -> bool:
        """Whether it is a time on the log's clock."""
        return self.grid == "times"

    @property
    def information(self) -> float:
        """Half the power with which information on it grows with the number of samples: 3/2 for a frequency, 1 for an
        instant, 1/2 for anything else."""
        return 1.5 if self.repeats else 1.0 if self.instant else 0.5

    def grid_on(self, usual: float) -> tuple[float, ...]:
        """The numbers of its grid on a plant where its default is `usual`; none where a log decides."""
        factor = usual / self.default if self.default else 1.0
        return () if isinstance(self.grid, str) else tuple(float(x) * factor for x in self.grid)


@dataclass(frozen=True)
class FrictionMemory:
    """How a regression along the arm's way finds start values of dry friction that remembers it.

    element: "stop" (Prandtl–Ishlinskii) or "bristle" (Dahl). beside_coulomb: whether Coulomb friction acts beside it;
    else it takes that one's place. start: a function of its level [{u}] and of its travel [rad] to parameters.
    """

    element: str
    beside_coulomb: bool
    start: Callable[[float, float], dict[str, float]]


@dataclass(frozen=True)
class EffectType:
    """An entry of the library; `kernels` maps each hook (see `HOOKS`) to compiled scalar code.

    `title` names the effect in a sentence ("a cable that pulls like a spring"), and `says` is a function of some fitted
    parameters, by name, to a sentence about the rig, without its full stop. It is given `Quantity` values, which print
    with their units; `Effect.sentence` calls it.

    The arguments of a kernel are bound by name. `memory` names the states the effect carries; `changes` names the
    entries of theta (or r1, r2) that its `theta` kernel returns. `linear`, for a search in data, is a function of some
    parameters, by name: the coefficients of fixed functions of the motion of which the effect is the sum while the
    shapes that have a grid and no span stay as they are. `includes` says which other effects are special cases of this
    one: a function of the other's parameters and of this one's gives this one's parameters that do what both did.
    `friction_of`, on a law in place of the arm's Coulomb friction, says which other effects are this one where no
    Coulomb friction is left beside them: a function of the other's parameters gives the level θ8 and parameters of this
    one that do nearly the same. `wider` gives starts of a wider law of the same cause, in which the optional parameters
    play a part, from the parameters of the plain one. `periods_a_turn` names the parameter that says how often a law of
    the arm's angle repeats in a turn. `caution` is a function of some parameters to what a reader should know of these
    values, "" where that is nothing. `constant` marks what adds a constant, to the command or to a reading. `reads`, on
    an effect with a `sensor` kernel, is the joint whose encoder it is of. `travels`, on a law that remembers the
    motion, is a function of some parameters, and of the Coulomb level theta8 if it asks, to the ways [rad] that it
    remembers. `friction_memory` says how it starts if a regression can find it (see `FrictionMemory`). `learned` marks
    what is no name: no search proposes it, and no descent moves its parameters.
    """

    name: str
    title: str
    place: str
    equation: str
    symptom: str
    says: Callable[..., str]
    parameters: tuple[Parameter, ...]
    kernels: dict[str, Callable[..., Any]]
    mistaken_for: tuple[str, ...] = ()
    memory: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()
    learned: bool = False
    constant: bool = False
    reads: str = ""
    travels: Callable[..., tuple[float, ...]] | None = None
    friction_memory: FrictionMemory | None = None
    periods_a_turn: str = ""
    caution: Callable[..., str] | None = None
    linear: Callable[..., tuple[float, ...]] | None = None
    includes: Mapping[str, Callable[[Mapping[str, float], Mapping[str, float]], dict[str, float]]] = field(
        default_factory=dict
    )
    friction_of: Mapping[str, Callable[[Mapping[str, float]], tuple[float, dict[str, float]]]] = field(
        default_factory=dict
    )
    wider: Callable[[Mapping[str, float]], tuple[dict[str, float], ...]] | None = None
    arguments: dict[str, tuple[str, ...]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.place not in PLACES:
            raise ValueError(f"effect {self.name}: place must be one of {PLACES}, got {self.place!r}")
        own = {p.name for p in self.parameters} | set(self.memory)
        arguments = {}
        for hook, kernel in self.kernels.items():
            arguments[hook] = tuple(inspect.signature(kernel).parameters)
            if strange := set(arguments[hook]) - own - set(HOOKS[hook]):
                raise ValueError(f"effect {self.name}: its {hook} kernel asks for unknown {sorted(strange)}")
        for what, function in (
            ("linear coefficients", self.linear),
            ("sentence", self.says),
            ("caution", self.caution),
            ("travels", self.travels),
        ):
            asked = set(inspect.signature(function).parameters) if function else set()
            if strange := asked - set(self.parameter_names) - ({_COULOMB} if function is self.travels else set()):
                raise ValueError(f"effect {self.name}: its {what} ask for unknown {sorted(strange)}")
        if (self.reads in JOINTS) != ("sensor" in self.kernels) or self.reads not in ("", *JOINTS):
            raise ValueError(
                f"effect {self.name}: reads must be one of {JOINTS} with a sensor kernel and empty without, "
                f"got {self.reads!r}"
            )
        if self.periods_a_turn and self.periods_a_turn not in self.parameter_names:
            raise ValueError(f"effect {self.name}: it has no parameter {self.periods_a_turn!r} (periods_a_turn)")
        object.__setattr__(self, "arguments", arguments)
        compiled_kernels = {hook: compiled(k, forceinline=True) for hook, k in self.kernels.items()}
        object.__setattr__(self, "kernels", compiled_kernels)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(p.name for p in self.parameters)

    def coefficients(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """`linear` of an effect that has it, at the parameters `values`."""
        assert self.linear is not None
        return _called(self.linear, values)

    def sentence(self, values: Mapping[str, float], unit: str) -> str:
        """What the effect does to a rig at the parameters `values`, in words; unit: of the command."""
        spoken = {p.name: Quantity(values[p.name], p.unit.format(u=unit)) for p in self.parameters}
        return _called(self.says, spoken)

    def caution_at(self, values: Mapping[str, float]) -> str:
        """What a reader should know of the parameters `values`; "" where that is nothing."""
        return _called(self.caution, values) if self.caution else ""

    def remembered(self, values: Mapping[str, float], coulomb: float) -> tuple[float, ...]:
        """The ways of the arm [rad] that it remembers at the parameters `values` and the Coulomb level θ8 of the plant;
        none for a law without such a memory."""
        return _called(self.travels, {**values, _COULOMB: coulomb}) if self.travels else ()

    @property
    def wrong_zero(self) -> str:
        """The joint whose encoder's zero it stands for; "" for any other effect."""
        return self.reads if self.constant else ""

    @property
    def follows_clock(self) -> bool:
        """Whether it goes by the time since its log began, which another run does not share."""
        return any("t" in asked for asked in self.arguments.values())

    @property
    def repeats(self) -> bool:
        """Whether it has a frequency of its own, so that a later part of a log can speak of it."""
        return any(p.repeats for p in self.parameters)

    @property
    def of_arm_angle(self) -> bool:
        """Whether it depends on where the arm stands."""
        return any("q1" in asked for asked in self.arguments.values())

    @property
    def of_angle_alone(self) -> bool:
        """Whether it is a torque that goes with the arm's angle alone."""
        return list(self.kernels) == ["torque"] and set(self.arguments["torque"]) - set(self.parameter_names) == {"q1"}

    @property
    def dry(self) -> bool:
        """Whether its torque turns over with a direction of motion, as dry friction does."""
        return bool({"r1", "r2"} & set(self.arguments.get("torque", ())))

    @property
    def sharpens(self) -> bool:
        """Whether it gives friction another sharpness than the plant's own."""
        return {"r1", "r2"} <= set(self.changes) and tuple(p.name for p in self.parameters) == ("r1", "r2")

    @property
    def changes_gain(self) -> bool:
        """Whether it is a gain of the command that changes in time."""
        return {"t", "tau"} <= set(self.arguments.get("torque", ()))

    @property
    def whole_number(self) -> bool:
        """Whether it has a shape that is a whole number, which no descent moves."""
        return any(p.integer and p.role == "shape" for p in self.parameters)

    @property
    def rough(self) -> bool:
        """Whether the likelihood of one of its parameters is too rough for an error bar, and so that of the others,
        which go with it."""
        return any(p.rough for p in self.parameters)

    def in_play(self, values: Mapping[str, float]) -> tuple[Parameter, ...]:
        """The parameters that the law has at `values`: all but those whose optional size is neutral."""
        absent = self.neutral()
        return tuple(p for p in self.parameters if not p.optional or values[p.optional] != absent[p.optional])

    def neutral(self) -> dict[str, float]:
        """Parameter values at which the effect is absent (shape parameters at their defaults)."""
        return {p.name: p.neutral if p.role == "size" else p.default for p in self.parameters}


def _called(function: Callable[..., Any], values: Mapping[str, float]) -> Any:
    """A function's result at those of the values that it asks for."""
    return function(**{name: values[name] for name in inspect.signature(function).parameters})
