"""What the report shows beside the diagnosis: where each plant fails, the closed loop run again, what to do next."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from msgspec import structs

from furuta_gym.declared import checked, written
from furuta_gym.plant import EFFECTS
from identification.design.discriminate import CLEAR, Separation
from identification.diagnosis.diagnosis_file import DesignEntry, LogUsed
from identification.diagnosis.gap_change import GapChange
from identification.diagnosis.locate.locate import locate, of_effects
from identification.diagnosis.locate.location import Where
from identification.diagnosis.one_plant import first_alone
from identification.diagnosis.outcome import Diagnosis
from identification.diagnosis.searched_part import searched_part
from identification.estimation.zeros import moved
from identification.logs.log import Log
from identification.validation.resimulation import Resimulation, resimulate

from .advice import COMMAND_FILE, design_next
from .law import Law, law_of
from .words import ALIKE, GO_ON, NEXT, NO_PLANT, OTHER_PLANTS, PART_REMAINS, TELL_APART, TOGETHER, by_name, joined


@dataclass(frozen=True)
class Examination:
    """A diagnosis with its evidence.

    where, where_after: of the plant without and with the effects found (where_after is None where none was).
    law: the torque of the effects found, None where it is no function of the motion.
    closed_loop (before, after): None where it could not be had; `remarks` says why, by "where", "gap" and
    "closed loop". design: the experiment that tells equals apart, None where there are none (or, with the remark
    "design", no experiment could be found). seconds: how long this took, the search not included. typed: all logs as
    the command line has them, with the options that read them; None for their names.
    """

    diagnosis: Diagnosis
    logs: tuple[Log, ...]
    held_out: tuple[Log, ...]
    where: Where | None
    where_after: Where | None
    law: Law | None
    closed_loop: tuple[Resimulation, ...] | None
    design: Separation | None
    remarks: dict[str, str]
    seconds: float
    typed: str | None = None

    @property
    def gap(self) -> GapChange | None:
        """The prediction errors on data that no fit saw."""
        return self.diagnosis.gap

    @property
    def shown(self) -> Log:
        """The log whose prediction is drawn: held out where there is one."""
        return _shown(self.diagnosis, self.logs, self.held_out)

    @property
    def next_experiment(self) -> str:
        """What was designed, else what the verdict asks for."""
        go_on = GO_ON if self.diagnosis.ended_early else ""
        if self.diagnosis.different is None:
            return go_on + self._next_of_these_logs
        return f"{go_on}{OTHER_PLANTS} {self._next_of_these_logs}" if self.design is not None else go_on + OTHER_PLANTS

    @property
    def _next_of_these_logs(self) -> str:
        d, design = self.diagnosis, self.design
        if d.uncertain or (d.together is not None and not d.added):
            return TOGETHER.format(logs=by_name((*self.logs, *self.held_out)) if self.typed is None else self.typed)
        if design is not None and design.nats >= CLEAR:
            entry, duration = design.best.entry, design.best.setup.duration
            use = "it is the whole command" if design.whole_command else "add it to your controller's command"
            return TELL_APART.format(
                titles=_titles(design.names, "from"),
                what=f"“{entry.name}” ({entry.advice})",
                seconds=f"{duration:g}",
                nats=f"{design.nats:.3g}",
                file=COMMAND_FILE,
                use=use,
            )
        alike = "" if design is None else ALIKE.format(titles=_titles(design.names, "and"))
        if d.verdict == "named" or alike:
            if not d.leftover:
                return alike + NEXT["named"]
            names = [log.source for log in (*self.logs, *self.held_out)]
            names += [] if self.held_out else ["a log of another motion"]
            return alike + PART_REMAINS.format(logs=joined(names, "and"))
        pair = next((f"{effect.name},{effect.apart[0]}" for effect in d.found if effect.apart), "EFFECT,EFFECT")
        return NEXT[d.verdict].format(pair=pair)

    def to_dict(self) -> dict[str, Any]:
        """The whole of diagnosis.json; what is not a finite number is null there."""
        found = structs.replace(
            self.diagnosis.entry(),
            where=self.where.entry() if self.where else None,
            where_after=self.where_after.entry() if self.where_after else None,
            next_experiment=self.next_experiment,
            design=checked(self.design.to_dict(), DesignEntry, "design") if self.design else None,
            remarks=self.remarks,
            logs=[
                LogUsed(log.source, log.sha256, held)
                for held, logs in ((False, self.logs), (True, self.held_out))
                for log in logs
            ],
            runtime_s=self.diagnosis.runtime_s + self.seconds,
        )
        return plain(written(found))


def examine(
    diagnosis: Diagnosis,
    logs: Sequence[Log],
    held_out: Sequence[Log] = (),
    progress: Callable[[str], None] | None = None,
    typed: str | None = None,
) -> Examination:
    """Measure what the report shows beside the diagnosis. What cannot be measured on these logs becomes a remark.

    logs: those that were searched. held_out: those that were held out; of long ones the part that `diagnose` takes is
    looked at. progress(text) is called at each step. typed: see `Examination`.
    """
    began = time.monotonic()
    logs, held_out = (searched_part(given, diagnosis.policy).logs for given in (logs, held_out))
    tell = progress or (lambda text: None)
    remarks: dict[str, str] = {}
    different = diagnosis.different
    searched = logs if different is None else first_alone(logs, different)

    def tried(what: str, compute: Callable[[], Any]) -> Any:
        try:
            return compute()
        except ValueError as error:
            remarks[what] = str(error)
            return None

    where = where_after = law = closed_loop = design = None
    before, after = diagnosis.before, diagnosis.after
    if before is None or after is None:
        remarks |= {"where": NO_PLANT, "gap": NO_PLANT}
    else:
        plants = [before.plant, after.plant] if diagnosis.added else [before.plant]
        tell("locating the gap")
        where = rest = diagnosis.rest or tried(
            "where", lambda: locate(plants[-1], moved(searched, after.zeros), diagnosis.policy)
        )
        if len(plants) > 1:
            where, where_after = (
                tried("where", lambda: locate(plants[0], moved(searched, before.zeros), diagnosis.policy)),
                rest,
            )
            names = [effect.name for effect in diagnosis.found]
            if diagnosis.verdict in ("named", "ambiguous"):
                where = where and of_effects(where, [effect.name for effect in diagnosis.named])
            law = tried("law", lambda: law_of(after.plant, names, moved(searched, after.zeros)))
        if diagnosis.gap is None:
            remarks["gap"] = diagnosis.gap_remark
        shown = _shown(diagnosis, logs, held_out)
        closed_loop = tried("closed loop", lambda: tuple(resimulate(plant, shown) for plant in plants))
        if diagnosis.verdict == "ambiguous":
            tell("designing the experiment that decides")
            design = tried("design", lambda: design_next(diagnosis, searched))
    seconds = time.monotonic() - began
    return Examination(diagnosis, logs, held_out, where, where_after, law, closed_loop, design, remarks, seconds, typed)


def _shown(diagnosis: Diagnosis, logs: Sequence[Log], held_out: Sequence[Log]) -> Log:
    return (tuple(held_out) if diagnosis.different is None and held_out else tuple(logs))[0]


def _titles(names: Sequence[str], last: str) -> str:
    return joined([EFFECTS[name].title for name in names], last)


def plain(data: Any) -> Any:
    """The same with None for NaN and infinities, which JSON does not know."""
    if isinstance(data, dict):
        return {key: plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [plain(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data
