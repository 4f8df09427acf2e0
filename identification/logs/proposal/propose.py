"""`propose`: tables in, a proposal of how to read them out."""

from __future__ import annotations

from collections.abc import Sequence

from ..checks import LogError
from ..rig_mapping import RigMapping
from ..table import Table
from .items import items_of
from .look import Look
from .policy import ProposalPolicy
from .problems import problems_of, same_columns, same_gain, same_rig
from .values import Proposal


def propose(
    tables: Table | Sequence[Table],
    given: RigMapping | None = None,
    policy: ProposalPolicy | None = None,
    *,
    assumed: bool = False,
    constant_command: str | None = None,
) -> Proposal:
    """Propose how to read the tables of one rig's logs, and say everything that is wrong with them.

    tables: as `formats.read_table` gives them. given: what is known already; it is kept, and held against the data.
    assumed: hold also what `read_log` takes where nothing is said (columns t, q1, q2, u in s and rad, upright) against
    the data. policy: holds the thresholds. constant_command: as for `read_log`; by default an error in a lone log.
    Raises LogError for no tables.
    """
    tables = [tables] if isinstance(tables, Table) else list(tables)
    if not tables:
        raise LogError("no log was given. Expected at least one file.")
    policy, given = policy or ProposalPolicy(), given or RigMapping()
    looks = [Look(table, given, policy, assumed) for table in tables]
    first = next((look for look in looks if look.driven), looks[0])
    items = items_of(first, [look for look in looks if look is not first])
    severity = constant_command or ("warn" if len(tables) > 1 else "error")
    problems = [p for look in looks for p in problems_of(look, severity)]
    problems += same_columns(first, looks) + same_rig(looks, policy) + same_gain(looks, policy)
    unique = {(p.text, p.mend): p for p in problems}
    return Proposal(tuple(t.name for t in tables), tuple(items), tuple(unique.values()), given)
