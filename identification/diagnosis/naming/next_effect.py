"""The next effect beside those found: whether it joins them, and whether it stays in doubt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .fits import Fit
from .judge import Judge
from .search import Search
from .suspects import Ranking


@dataclass(frozen=True)
class NextEffect:
    """The rankings of all effects, that of the newest last.

    laws: effects that only describe another law of an effect found, each with the name of that effect.
    leaves_more, small: why the newest is in doubt. It leaves more than it explains, or is small beside the others.
    """

    together: tuple[Ranking, ...]
    laws: Mapping[str, str]
    leaves_more: bool
    small: bool

    @property
    def in_doubt(self) -> bool:
        """Whether the newest stays for the time being only."""
        return self.leaves_more or self.small


def next_effect(
    search: Search,
    judge: Judge,
    found: Sequence[Ranking],
    ranking: Ranking,
    current: Fit,
    laws: Mapping[str, str],
) -> NextEffect | None:
    """The first of a ranking beside the effects found; None if it is refused. current: the model without it."""
    newest = ranking[0].name
    leaves_more = judge.takes_shape(found, ranking[0], current)
    if leaves_more and judge.minor(found, ranking[0]):
        return None
    together = search.reconsidered([*found, ranking], judge.asked_for)
    laws = _of_successors(laws, found, together)
    small = judge.slight(together, ranking[0], current)
    exchanged = {r[0].name for r in together[:-1]} != {r[0].name for r in found}  # it took the place of another
    before = search.reduced(together[-1][0].fit, newest) if exchanged and len(together) > 1 else current
    law_of = judge.law_of(together, before)
    if law_of is not None and judge.confirmed(before, together[-1][0].fit):
        laws = with_law(laws, newest, law_of)
    elif law_of is not None or (small and judge.minor(together[:-1], together[-1][0])):
        return None
    else:
        laws.pop(newest, None)  # it may have come back, as an effect of its own
        if (law_of := judge.look_alike_law_of(together)) is not None:
            laws = with_law(laws, newest, law_of)
    if (ripple := judge.ripple_of_law(together)) is not None:
        laws = with_law(laws, ripple, together[-1][0].name)
    return NextEffect(tuple(together), laws, leaves_more, small)


def _of_successors(laws: Mapping[str, str], found: Sequence[Ranking], together: Sequence[Ranking]) -> dict[str, str]:
    """The laws, each with what took the place of an effect found in that effect's place."""
    had, now = ({ranking[0].name for ranking in rankings} for rankings in (found, together))
    fresh = [ranking for ranking in together[:-1] if ranking[0].name not in had]
    taken = {s.name: ranking[0].name for ranking in fresh for s in ranking[1:] if s.name in had - now}
    told = {taken.get(name, name): taken.get(of, of) for name, of in laws.items()}
    return {name: of for name, of in told.items() if name != of}


def with_law(laws: Mapping[str, str], name: str, of: str) -> dict[str, str]:
    """The laws with one more. What it describes is an effect of its own: the root of a chain, and never itself."""
    root = laws.get(of, of)
    kept = {n: o for n, o in laws.items() if root != name or n != of}
    return {**kept, name: of if root == name else root}
