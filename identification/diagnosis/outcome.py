"""What a diagnosis found, as a value: the verdict in a sentence, the plants without and with the effects."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from msgspec import structs

from furuta_gym.declared import written
from furuta_gym.plant import Plant

from ..estimation.estimate import Estimate, GainChange
from ..estimation.informative import spans_text
from ..validation.one_rig import OneByOne
from . import sentences
from .diagnosis_file import (
    SCHEMA,
    DiagnosisFile,
    DifferentPlants,
    EffectFound,
    EffectInPlant,
    GainChanged,
    OtherLaw,
    ParameterFound,
    Ranked,
    SecondWitnessEntry,
    Verdict,
)
from .gap_change import GapChange
from .learned import Learned
from .locate.location import Where
from .naming.found import FoundEffect, Naming
from .policy import DecisionPolicy

ABSORBED = {
    "back_emf": "adds to θ6",
    "amplifier_gain": "scales every θ",
    "arm_encoder_offset": "changes nothing in model (5)",
}
"""What no log can tell from the parameters of model (5), and what becomes of it: never named, always reported."""


@dataclass(frozen=True)
class SecondWitness:
    """The same structure fitted by multiple shooting: its plant, the parameters about which it disagrees beyond the
    errors of both, how the gap changes from the first fit to this one, and whether it is better for certain."""

    plant: Plant
    disagreeing: tuple[str, ...]
    change: GapChange
    better: bool

    def entry(self) -> SecondWitnessEntry:
        """As the "second_witness" of diagnosis.json."""
        return SecondWitnessEntry(
            method="multiple shooting",
            theta=self.plant.theta.tolist(),
            effects=[EffectInPlant.of(effect.to_dict(self.plant.unit)) for effect in self.plant.effects],
            disagreeing=list(self.disagreeing),
            closed_fraction=self.change.closed.value,
            closed_interval=list(self.change.closed.interval),
            better=self.better,
        )

    def to_dict(self) -> dict[str, Any]:
        """`entry` as JSON has it."""
        return written(self.entry())


@dataclass(frozen=True)
class Diagnosis:
    """verdict: named, ambiguous, none, unknown or insufficient_excitation; `summary` says it in sentences.

    before, after: estimates without and with the effects found (after is before where none was). naming: the search.
    rest: where the final model fails. left_over: rms of the torque [{u}] that it does not explain, over a tenth of a
    second, and `command_rms` to compare it with. policy: the thresholds that were used.

    gap: the prediction errors on data that no fit saw, or None where they could not be had; `gap_remark` says why.
    confirmed: False where such data have shown no gain from the effects; `plant` is then without them. still_off:
    error over the noise floor that is left on such data, where that is much; 1 otherwise. together: the same with the
    parameters fitted to these data as well, where they were predicted far off. second: what
    multiple shooting makes of the same structure, where much is left or the floor is in doubt. learned: a torque
    without a name that was learned from what is left, and whether it was added. different: fits of the logs apart,
    where no plant explains them together; the search is that of the first of them alone then. stretches: of each log,
    the seconds (from, to) that were searched; empty where all were.
    """

    verdict: Verdict
    summary: str
    before: Estimate | None = field(repr=False)
    after: Estimate | None = field(repr=False)
    naming: Naming | None = field(repr=False)
    rest: Where | None = field(repr=False)
    left_over: float
    command_rms: float
    runtime_s: float
    policy: DecisionPolicy = field(default_factory=DecisionPolicy, repr=False)
    gap: GapChange | None = None
    gap_remark: str = ""
    confirmed: bool = True
    still_off: float = 1.0
    together: float | None = None
    second: SecondWitness | None = field(default=None, repr=False)
    learned: Learned | None = field(default=None, repr=False)
    different: OneByOne | None = field(default=None, repr=False)
    stretches: tuple[tuple[tuple[float, float], ...], ...] = ()

    @property
    def leftover(self) -> bool:
        """Whether the final model leaves structure that no effect found explains, as where names were taken back, or
        other logs need other parameters."""
        refused = not self.confirmed or (self.naming is not None and self.naming.refused is not None)
        refused = refused or self.different is not None
        return refused or self.still_off > 1.0 or (self.rest is not None and self.rest.structured)

    @property
    def ended_early(self) -> bool:
        """Whether the time given ended the search, so that more effects may be missing."""
        return self.naming is not None and self.naming.ended_early

    @property
    def torque_floor_exceeded(self) -> bool:
        """Whether data that no fit saw are predicted worse than noise alone would, and that noise is nearly all torque
        noise: torques that the plant misses, or wrong parameters, pass for it."""
        after = self.gap.after if self.gap is not None else None
        return after is not None and after.judgement.mostly_torque and after.ratio_to_floor >= self.policy.adequate

    @property
    def added(self) -> bool:
        """Whether the plant after the search has effects that the one before lacks."""
        if self.before is None or self.after is None:
            return False
        return {e.name for e in self.after.plant.effects} != {e.name for e in self.before.plant.effects}

    @property
    def plant(self) -> Plant | None:
        """The plant to use: with the effects found, unless held-out data speak against them; that of the second
        witness where it is better; with what was learned, where it was added."""
        if self.learned is not None and self.learned.added:
            return self.learned.plant
        if self.confirmed and self.second is not None and self.second.better:
            return self.second.plant
        best = self.after if self.confirmed else self.before
        return best.plant if best else None

    @property
    def timed(self) -> bool:
        """Whether an effect found follows the clock of its log, and so cannot be looked for in another."""
        return bool(self._timed)

    @property
    def repeating(self) -> bool:
        """Whether every such effect repeats, so that a later part of the same log can speak about it."""
        return self.timed and all(effect.type.repeats for effect in self._timed)

    @property
    def _timed(self) -> list[FoundEffect]:
        return [effect for effect in self.found if effect.type.follows_clock]

    @property
    def found(self) -> tuple[FoundEffect, ...]:
        """The effects that the search found, whatever held-out data say of them."""
        return self.naming.found if self.naming else ()

    @property
    def named(self) -> tuple[FoundEffect, ...]:
        """Of these, the ones that are named: without what only describes another law of one."""
        return self.naming.own if self.naming else ()

    @property
    def not_visible(self) -> list[str]:
        """Effects that θ imitates on these logs, so that nothing can be said about them."""
        shares = self.naming.absorbed if self.naming else {}
        return sorted(name for name, share in shares.items() if share > self.policy.absorbed)

    def vetoed(self) -> Diagnosis:
        """The same once held-out data have shown no gain from the effects: what is missing is something else."""
        summary = sentences.vetoed([effect.name for effect in self.found])
        return replace(self, verdict="unknown", summary=summary, confirmed=False)

    def falling_short(self, ratio: float) -> Diagnosis:
        """The same once data that no fit saw are still predicted with `ratio` times the error that noise leaves."""
        return replace(self, summary=f"{self.summary} {sentences.still_off(ratio)}", still_off=ratio)

    def astray(self, ratio: float, together: float | None) -> Diagnosis:
        """The same once data that no fit saw are predicted with `ratio` times the error that noise leaves, and with
        `together` times where the parameters are fitted to them as well (None: nobody can say). What such a fit mends,
        the searched logs said too little about; what it does not is a part that is missing, or something unknown."""
        if self.verdict == "unknown" or (together is None and self.added):
            return self.falling_short(ratio)
        summary = f"{self.summary} {sentences.astray(ratio, together, self.policy.far)}"
        told = replace(self, summary=summary, together=together)
        if together is None or together <= self.policy.far:
            return told
        return replace(told, verdict=self.verdict if self.added else "unknown", still_off=ratio)

    def beside_other_plants(self, different: OneByOne) -> Diagnosis:
        """The same, of the first of several logs that no plant explains together."""
        return replace(
            self,
            summary=f"{self.summary} {sentences.different_plants(different, self.policy.adequate)}",
            different=different,
        )

    @property
    def uncertain(self) -> bool:
        """Whether the searched logs say too little about the parameters to predict other data."""
        return self.together is not None and self.together <= self.policy.far

    @property
    def _left(self) -> str:
        """Where what is left over shows; never that nothing is, beside a summary that says that something is."""
        assert self.rest is not None
        if not self.confirmed:
            return "held-out data are not predicted better by what explains the searched logs"
        if self.rest.found:
            return self.rest.sentence
        if self.different is not None:
            return "other logs need other parameters"
        where = "on held-out data only" if self.still_off > 1.0 else "in other tests"
        return f"no torque stands out of the noise on the searched logs; what remains shows {where}"

    @property
    def gain_changes(self) -> tuple[GainChange, ...]:
        """Where what the command does changed within a searched log, beside the effects that `plant` has."""
        shown = self.after if self.confirmed else self.before
        return shown.gain_changes if shown else ()

    def entry(self) -> DiagnosisFile:
        """What diagnosis.json holds of it."""
        naming = self.naming
        effects = [self._effect(effect) for effect in self.found]
        describes = [naming.describes(effect.name) for effect in naming.found] if naming else []
        first = naming.rankings[0] if naming and naming.rankings else ()
        return DiagnosisFile(
            schema=SCHEMA,
            verdict=self.verdict,
            summary=self.summary,
            effects=[e for e, of in zip(effects, describes, strict=True) if of is None],
            other_laws=[
                OtherLaw(**structs.asdict(e), law_of=of, follows=naming is not None and naming.follows(e.name) == of)
                for e, of in zip(effects, describes, strict=True)
                if of is not None
            ],
            ended_early=self.ended_early,
            ranking=[Ranked(s.name, s.gain, s.score) for s in first],
            not_visible=self.not_visible,
            absorbed=dict(ABSORBED),
            leftover=self.leftover,
            rest=self.rest.entry() if self.rest else None,
            left_over_torque=self.left_over,
            command_rms=self.command_rms,
            zeros=self.after.zeros_by_log if self.after else {},
            gain_changes=[GainChanged(c.source, c.factor, c.since, c.sure, c.beside) for c in self.gain_changes],
            gap=self.gap.entry() if self.gap else None,
            together_over_floor=self.together,
            second_witness=self.second.entry() if self.second else None,
            learned=self.learned.entry() if self.learned else None,
            different_plants=self._different(),
            stretches_s=[[list(span) for span in spans] for spans in self.stretches],
            policy=self.policy.to_dict(),
            runtime_s=self.runtime_s,
        )

    def to_dict(self) -> dict[str, Any]:
        """`entry` as JSON has it."""
        return written(self.entry())

    def _different(self) -> DifferentPlants | None:
        found = self.different
        if found is None:
            return None
        return DifferentPlants(list(found.sources), list(found.ratios), dict(found.factors), found.one_factor)

    def _effect(self, effect: FoundEffect) -> EffectFound:
        assert self.after is not None
        found = self.after.plant.effect(effect.name)
        assert found is not None
        parameters = found.to_dict(self.after.plant.unit)["parameters"]
        intervals = {name: found.interval(name) for name in parameters}
        return EffectFound(
            name=found.name,
            parameters={
                name: ParameterFound(**entry, interval=list(between) if (between := intervals[name]) else None)
                for name, entry in parameters.items()
            },
            equation=effect.type.equation,
            place=effect.type.place,
            log_likelihood_gain=effect.suspect.gain,
            confused_with=list(effect.equals),
            predict_the_same=list(effect.same),
        )

    def __str__(self) -> str:
        lines = [f"{self.verdict.upper()}: {self.summary}"]
        if self.stretches:
            lines.append(
                f"  searched on {spans_text(self.stretches)}: some all along the logs, and what says most about θ"
            )
        if self.naming:
            for step, ranking in enumerate(self.naming.rankings, 1):
                shown = ", ".join(f"{s.name} {s.net:+.0f}" for s in ranking[:4])
                lines.append(f"  step {step}, nats gained net of the price: {shown or 'no suspect'}")
            for effect in self.naming.found:
                found = self.after.plant.effect(effect.name) if self.after else None
                sign = "+" if self.confirmed else "tried, not named:"
                lines.append(f"  {sign} {found}   [{effect.type.equation}]")
                if self.naming.describes(effect.name) is not None:
                    lines.append(f"    {self.naming.relation(effect.name)}; no effect of its own")
                    continue
                if self.confirmed:
                    lines.append(f"    on the rig: {effect.type.symptom}")
                if found is not None and (caution := found.type.caution_at(found.parameters)):
                    lines.append(f"    {caution}")
                if effect.apart:
                    lines.append(f"    equals on these logs: {', '.join(effect.apart)}")
        lines += [f"  {line}" for line in self.after.zeros_told] if self.after else []
        lines += [f"  ! {change}" for change in self.gain_changes]
        if self.leftover and self.rest:
            lines.append(f"  unexplained structure: {self._left}")
            if self.found:
                lines.append("  the error bars above allow for that as far as the logs show it; they may be too small")
        if self.learned:
            lines.append(f"  learned: {self.learned.effect}; {self.learned.reason}")
        if self.plant is not None and self.confirmed:
            lines.append(f"  {sentences.unexplained(self.left_over, self.command_rms, self.plant.unit)}")
        taken = "; ".join(f"{name.replace('_', ' ')} ({how})" for name, how in ABSORBED.items())
        lines.append(f"  never named, as θ takes them in: {taken}")
        return "\n".join(lines)
