"""How a learned policy was trained, as far as its file says, for those who read a comparison."""

from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from furuta_gym.envs.ranges import as_mapping

from ..base import Controller

_NAMES = 6  # of ranges that a line shows
_DIGITS = 12  # of a fingerprint in a line; the file has all


class TrainedEntry(Struct):
    """How a policy was trained, as its file says; None where it does not.

    algorithm: of stable-baselines3. steps: of the env, in all. seed: of the last training; earlier_seeds: of those
    that it goes on from. randomize: what episodes drew, ranges by name; True from the error bars of the plant, False
    nothing. effect_probabilities: of effects that came and went. plant_sha256: the fingerprint of the plant.
    """

    algorithm: str | None = None
    steps: int | None = None
    seed: int | None = None
    earlier_seeds: list[int] = []
    randomize: bool | dict[str, str] | None = None
    effect_probabilities: dict[str, float] | None = None
    plant_sha256: str | None = None

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> "TrainedEntry":
        """From a training record, see `learned.policy_file.read_record`. What is of another type is not recorded."""
        env = _of_type(record, "env", dict) or {}
        chances = _of_type(env, "effect_probabilities", dict)
        earlier = _of_type(record, "earlier_seeds", list) or []
        return cls(
            algorithm=_of_type(record, "algorithm", str),
            steps=_of_type(record, "steps", int),
            seed=_of_type(record, "seed", int),
            earlier_seeds=[seed for seed in earlier if type(seed) is int],
            randomize=_ranges(env.get("randomize"), _of_type(record, "plant", dict) or {}),
            effect_probabilities=chances and {n: float(p) for n, p in chances.items() if type(p) in (int, float)},
            plant_sha256=_of_type(record, "plant_sha256", str),
        )

    def __str__(self) -> str:
        """On a line, with what is not recorded."""
        seeds = [] if self.seed is None else [*self.earlier_seeds, self.seed]
        said = {
            "algorithm": self.algorithm or "",
            "steps": "" if self.steps is None else f"{self.steps} steps",
            "seed": f"seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds))}" if seeds else "",
            "ranges": self._drawn(),
            "plant": f"plant {self.plant_sha256[:_DIGITS]}" if self.plant_sha256 else "",
        }
        known, missing = [text for text in said.values() if text], [name for name, text in said.items() if not text]
        if not known:
            return "not recorded"
        text = ", ".join(known) + (f"; not recorded: {', '.join(missing)}" if missing else "")
        return "".join(letter for letter in text if letter.isprintable())  # a stranger may have written the file

    def _drawn(self) -> str:
        if self.randomize is None and not self.effect_probabilities:
            return ""
        if self.randomize is True:
            return "drawn within the plant's error bars"
        names = list(dict.fromkeys([*(self.randomize or {}), *(self.effect_probabilities or {})]))
        more = f" and {len(names) - _NAMES} more" if len(names) > _NAMES else ""
        return f"drawn: {', '.join(names[:_NAMES])}{more}" if names else "nothing drawn"


def trained(policies: Mapping[str, Any]) -> dict[str, TrainedEntry]:
    """How each of these controllers was trained, of those that were learned; also of one inside an envelope."""
    inner = {name: getattr(policy, "controller", policy) for name, policy in policies.items()}
    return {
        name: TrainedEntry.of(policy.record)
        for name, policy in inner.items()
        if isinstance(policy, Controller) and isinstance(policy.record, Mapping)
    }


def _of_type(data: Mapping[str, Any], name: str, kind: type) -> Any:
    value = data.get(name)
    return value if type(value) is kind else None


def _ranges(given: Any, plant: Mapping[str, Any]) -> bool | dict[str, str] | None:
    """What a record says of ranges. True means what the plant file says, where it says anything."""
    given = plant.get("randomize") or True if given is True else given
    if given is None or isinstance(given, bool):
        return given
    try:
        return as_mapping(given)
    except ValueError:
        return None
