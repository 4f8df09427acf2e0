"""What the reports say in sentences."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from identification.logs.log import Log

BADGE = {
    "named": "Named",
    "ambiguous": "One of several equals",
    "none": "Nothing missing",
    "unknown": "Unknown effect",
    "insufficient_excitation": "Not enough excitation",
}
"""By verdict: a few words for its badge."""

NEXT = {
    "named": (
        "Use plant.json in the simulator. To be sure, record a log of another kind of motion and run "
        "`furuta validate plant.json` on it: the error should stay near the noise floor."
    ),
    "ambiguous": (
        "Record a log that separates the equals, and diagnose all logs together: "
        "`furuta excite --plant plant.json --between {pair} -o next.csv` designs the command. A slow, wide sweep of "
        "the arm does it for most pairs, because the arm then spends time near zero speed at many angles."
    ),
    "none": (
        "Nothing needs doing. If the simulator fails in a motion that these logs do not contain, record that motion "
        "and diagnose it too."
    ),
    "unknown": (
        "Look at the missing torque: `furuta residuals LOG -o residuals` shows its row, time and variable. Record the "
        "same experiment again. If the torque returns, add it as a new effect. Use the plant for such motions only."
    ),
    "insufficient_excitation": (
        "Record a longer log with more motion: larger and faster changes of the command for the arm, and the pendulum "
        "away from its rest. A log of the hanging pendulum can be fitted together with one of the upright."
    ),
}
"""By verdict: what to do, where the search itself has no advice."""

NO_PLANT = "these logs move the rig too little to fit a plant"
"""Why nothing is measured, and no plant file written, where excitation is insufficient."""

GO_ON = "To look for more, give the same command more --minutes: it goes on where it ended. "
"""What to do first where the time given ended a search."""

PART_REMAINS = (
    "Use plant.json for motions like those of these logs. To find what remains, diagnose {logs} together and hold out "
    "a new log."
)
"""What to do with a named effect that leaves a part unexplained."""

TOGETHER = "Diagnose all logs together, and hold out a new one: `furuta diagnose {logs} --held-out NEW -o diagnosis`."
"""What to do where held-out logs are predicted far off, and a fit to all logs mends it or nothing was named."""

OTHER_PLANTS = (
    "If something was changed on the rig between the logs, diagnose the others by themselves. If nothing was, look at "
    "the supply, the screws and the cables, and record one experiment twice without a pause. If these two logs need "
    "different parameters as well, something changes by itself, or the model lacks something."
)
"""What to do where no plant explains all logs, and each is explained by one of its own."""

TELL_APART = (
    "To tell {titles}, run the experiment {what} for {seconds} s. Expected separation: {nats} nats. "
    "{file} holds it ({use}). Then diagnose all logs together."
)
"""What to do where a designed experiment tells look-alikes apart."""

ALIKE = "No experiment tried would tell {titles} apart, so either will do. "
"""The same where none does: before what else there is to do."""


def find_missing(command: str) -> str:
    """What to do where a model is not adequate. command: the `furuta diagnose` that looks for it."""
    return f"Find what is missing: `{command}`."


def by_name(logs: Sequence[Log]) -> str:
    """Logs as a command line has them, by their names, with the options that read them; for want of what was typed."""
    mappings = {log.mapping for log in logs}
    options = mappings.pop().options() if len(mappings) == 1 else ""
    return f"{shlex.join(log.source for log in logs)} {options}".strip()


def opening(text: str) -> str:
    """With a capital letter, unless a symbol begins it: Θ6 is no parameter."""
    return text if text.startswith(("θ", "u_max")) else f"{text[:1].upper()}{text[1:]}"


def joined(parts: Sequence[str], last: str) -> str:
    """a, b and c."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} {last} {parts[-1]}" if parts else ""
