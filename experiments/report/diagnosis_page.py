"""The page of `furuta diagnose`: the verdict, then its evidence, then the statistics behind it."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version

from markupsafe import Markup

from furuta_gym.plant import EFFECTS, Effect
from identification.diagnosis.gap_change import GapChange
from identification.diagnosis.locate.location import Where
from identification.diagnosis.outcome import ABSORBED, Diagnosis
from identification.estimation.informative import spans_text

from . import learned_figures, prediction_figures, search_figures, tables, where_figures
from .contents import Block, Details, Figure, Grid, Heading, Page, Section, Text
from .drawing import Drawing
from .examination import Examination
from .verdict import data, effects, equals, place, times, verdict
from .words import NO_PLANT, joined

_CLOSED_LOOP = "The whole experiment simulated in closed loop"
_SMALL = 0.01  # of the command's rms: torques below it are not blown up to fill a figure


def diagnosis_page(x: Examination, extra: tuple[Section, ...] = ()) -> Page:
    """The report of an examined diagnosis; extra: sections of the caller's, before the one about the logs."""
    d = x.diagnosis
    names = joined([log.source for log in x.logs], "and")
    held = f" · held out: {joined([log.source for log in x.held_out], 'and')}" if x.held_out else ""
    first = verdict(d, x.next_experiment)
    sections = (_measured(x), _where(x), _compared(d), *_learned(d), _parameters(d), _errors(x), *extra, _about(x))
    return Page(
        "Diagnosis",
        f"furuta diagnose · {names}{held}",
        first.with_blocks(tuple(_effect(e, d) for e in effects(d))),
        sections,
        (
            Text(
                f"furuta-gym {version('furuta-gym')}; search and report took {d.runtime_s + x.seconds:.0f} s. The same "
                f"numbers are in diagnosis.json{f', {_written(d)} in plant.json' if d.plant else ''}."
            ),
        ),
    )


def _written(d: Diagnosis) -> str:
    """Which plant plant.json holds."""
    if d.learned is not None and d.learned.added:
        return "the plant with the learned torque"
    return "the plant of the second fit" if d.second is not None and d.plant is d.second.plant else "the plant"


def _effect(effect: Effect, d: Diagnosis) -> Text:
    """An effect in small: identifier, law, values with error bars, and whose law it only describes."""
    assert d.after is not None
    assert d.naming is not None
    told = "" if d.naming.describes(effect.name) is None else f"; only {d.naming.relation(effect.name)}"
    unit = d.after.plant.unit
    values = ", ".join(_value(effect, p.name, unit) for p in effect.type.in_play(effect.parameters))
    line = Markup('<code>{}</code> <span class="equation">{}</span>, with {}{}').format(
        effect.name, effect.type.equation, values, told
    )
    return Text(line, "quiet")


def _value(effect: Effect, name: str, unit: str) -> str:
    parameter = next(p for p in effect.type.parameters if p.name == name)
    own = parameter.unit.format(u=unit)
    return f"{name} = {effect.shown(name)}" + ("" if own in ("", "1") else f" {own}")


def not_available(reason: str) -> Text:
    """In the place of what could not be measured."""
    return Text(f"Not available: {reason}.", "note")


def _measured(x: Examination) -> Section:
    blocks: list[Block] = []
    if x.gap is None:
        blocks.append(not_available(x.remarks.get("gap", NO_PLANT)))
    else:
        if x.gap.tail is not None:
            head, tail = 100 - 100 * x.gap.tail, 100 * x.gap.tail
            why = "No log was held out" if x.diagnosis.different is None else "Other logs need other parameters"
            blocks.append(
                Text(
                    f"{why}. So the plants were fitted anew to the first {head:.0f} % of each log, and "
                    f"predict its last {tail:.0f} %. This is a weaker test than a log of another experiment.",
                    "note",
                )
            )
        blocks.append(Figure(prediction_figures.predictions(x.gap.logs, prediction_figures.sides(x.gap))))
    if x.closed_loop:
        shown = Figure(prediction_figures.closed_loop(x.closed_loop, x.shown))
        blocks.append(Details(_CLOSED_LOOP, (shown,)))
    elif "closed loop" in x.remarks:
        blocks.append(Details(_CLOSED_LOOP, (Text(f"Not available: {x.remarks['closed loop']}."),)))
    return Section("measured", "Measured over predicted", tuple(blocks))


def _where(x: Examination) -> Section:
    title = "Where the model fails"
    if x.where is None:
        reason = x.remarks.get("where", NO_PLANT)
        return Section("where", title, (not_available(reason),))
    blocks: list[Block] = [Text(_where_sentence(x), "strong")]
    time = tuple(map(Figure, where_figures.torques(x.where, x.where_after, _SMALL * x.diagnosis.command_rms)))
    maps = where_figures.maps(x.where, x.where_after)
    if x.law is not None and x.where_after is not None:
        blocks.append(Figure(where_figures.fitted_law(x.law, x.where_after)))
        blocks.append(_grid("The law against every variable", where_figures.partials(x.law, x.where_after)))
        blocks.append(Details("The missing torque in time", time))
        blocks.append(_maps(maps, x.where_after is not None, folded=True))
    else:
        blocks += [*time, _maps(maps, x.where_after is not None, folded=False)]
    if x.where.found:
        blocks.append(Details("Which variable explains the missing torque", (tables.suspicions(x.where),)))
    return Section("where", title, tuple(blocks))


def _where_sentence(x: Examination) -> str:
    assert x.where is not None
    d = x.diagnosis
    missing = f"Without any addition, the model misses {place(x.where)}."
    if x.where_after is None:
        if x.where.found and x.where.negligible:
            return f"There is {place(x.where)}, but it is negligible ({_counts(x.where)})."
        return missing if x.where.found else "No torque stands out of the noise on the searched logs."
    before = missing if x.where.found else ""
    small = x.where_after.found and x.where_after.negligible
    if x.where_after.matters:
        after = f"With {_them(d)} added, there is still {place(x.where_after)}."
    elif d.leftover:
        after = f"With {_them(d)} added, no torque stands out on the searched logs; the part that remains shows "
        after += (
            f"on held-out data only ({times(d.still_off)} times the noise floor)."
            if d.still_off > 1
            else "in other tests."
        )
    else:
        after = f"With {_them(d)} added, no torque stands out of the noise any more."
    if small:
        after += f" What can still be made out, {place(x.where_after)}, is negligible ({_counts(x.where_after)})."
    return f"{before} {after}".strip()


def _counts(where: Where) -> str:
    return f"it moves predictions 0.3 s ahead by {where.counts.max():.2g} encoder counts"


def _them(d: Diagnosis) -> str:
    return joined([EFFECTS[s.name].title for s in d.named], "and")


def _grid(summary: str, drawings: Sequence[Drawing]) -> Details:
    return Details(summary, (Grid(tuple(drawings)),))


def _maps(drawings: Sequence[Drawing], both: bool, folded: bool) -> Block:
    how = "Mean missing torque where a variable has each value, with 95 % bars"
    how += "; ○ before, ◆ after" if both else ""
    text = Text(f"{how}. Before an effect is added, the parameters of model (5) imitate a part of it.")
    blocks = (text, Grid(tuple(drawings)))
    summary = "The missing torque against each variable" + (", before and after" if both else "")
    return Details(summary, blocks, opened=not folded)


def _compared(d: Diagnosis) -> Section:
    found = search_figures.rankings(d.naming) if d.naming else []
    if not found:
        reason = "no effect was worth fitting" if d.before else "the search needs a plant to start from"
        return Section("compared", "What was compared", (not_available(reason),))
    blocks: list[Block] = [found[0]]
    if len(found) > 1:
        blocks.append(Details("Further steps of the search", tuple(found[1:])))
    nat = "A nat is a factor e in likelihood: with 10 nats more, the logs are 22 000 times as likely."
    return Section("compared", "What was compared", (*blocks, Text(nat, "quiet")))


def _learned(d: Diagnosis) -> tuple[Section, ...]:
    """What was learned because no name explains it; no section where nothing was."""
    if d.learned is None:
        return ()
    became = "It is part of the plant" if d.learned.added else "It is not part of the plant"
    text = (
        "Names come first. What they leave was learned as a smooth torque over the arm's angle and speed. "
        f"{became}: {d.learned.reason}."
    )
    blocks: list[Block] = [Text(text), Figure(learned_figures.curves(d.learned))]
    if d.learned.change is not None:
        blocks.append(Details("Errors with and without it", (tables.parts(d.learned.change.by_kind, "experiment"),)))
    return (Section("learned", "What no name explains", tuple(blocks)),)


def _parameters(d: Diagnosis) -> Section:
    if d.before is None or d.after is None:
        return Section("parameters", "Parameters", (not_available("the logs do not determine them"),))
    blocks: list[Block] = []
    table = tables.parameters(d.before, d.after if d.added else d.before, d.leftover)
    if d.added:
        blocks.append(Figure(search_figures.parameters(d.before, d.after)))
        blocks.append(Details("All parameters with their error bars", (table,)))
    else:
        blocks.append(table)
    if d.second is not None:
        blocks.append(Details("A second fit, by multiple shooting", (tables.second_fit(d.after, d.second),)))
    return Section("parameters", "Parameters", tuple(blocks))


def _errors(x: Examination) -> Section:
    blocks: list[Block] = []
    gap = x.gap
    if gap is None:
        blocks.append(not_available(x.remarks.get("gap", NO_PLANT)))
    else:
        blocks.append(Figure(prediction_figures.horizons(prediction_figures.sides(gap))))
        source = ", here the spread of repeated runs" if gap.before.repeats else ""
        floor = f"The noise floor is what readings and torque noise leave if the plant is right{source}."
        if changed := gap.before.changed:
            floor += f" {changed[:1].upper()}{changed[1:]}."
        if resting := gap.after.at_rest:
            floor += f" Here {resting}."
        inner: tuple[Block, ...] = (tables.gaps(gap), _likelier(gap))
        if len(gap.logs) > 1:
            inner += (tables.parts(gap.by_log, "log"), tables.parts(gap.by_kind, "kind of experiment"))
        blocks += [Text(floor), Details("Errors, intervals and likelihood", inner)]
        if gap.own_tail is not None:
            blocks += _own_tail(gap.own_tail)
    if x.where is not None:
        table = tables.leftovers(x.where, x.where_after, x.diagnosis.policy)
        blocks.append(Details("Tests of what is left on the searched logs", (table,)))
    return Section("errors", "The error on held-out data", tuple(blocks))


def _own_tail(gap: GapChange) -> list[Block]:
    assert gap.tail is not None
    head, tail = 100 - 100 * gap.tail, 100 * gap.tail
    text = (
        "What repeats by the clock of its own log cannot be judged on another, where its phase is unknown. So both "
        f"plants were also fitted anew to the first {head:.0f} % of each searched log and predict its last "
        f"{tail:.0f} %; the verdict follows that."
    )
    return [Heading("On the last part of the searched logs"), Text(text), tables.gaps(gap), _likelier(gap)]


def _likelier(gap: GapChange) -> Text:
    if not gap.changed:
        return Text("No effect was added, so there is nothing to compare with.")
    word = "likelier" if gap.likelier > 0 else "less likely"
    text = f"One reading ahead, the addition makes {data(gap)} {word} by {abs(gap.likelier):.0f} nats."
    if not gap.closed.interval[0] > 0:
        text += f" Over {gap.before.horizon:g} s the error is not shown to fall."
    return Text(text)


def _about(x: Examination) -> Section:
    d = x.diagnosis
    taken = joined([f"{name.replace('_', ' ')} ({how})" for name, how in ABSORBED.items()], "and")
    blocks: list[Block] = [
        tables.logs(x.logs, x.held_out),
        Text(f"No log can tell these from the parameters, because they take them in: {taken}."),
    ]
    if d.not_visible:
        unseen = joined([EFFECTS[name].title for name in d.not_visible], "and")
        blocks.append(Text(f"On these logs the parameters also imitate {unseen}. Not found does not mean absent."))
    if d.stretches:
        part = spans_text(d.stretches)
        blocks.append(
            Text(f"Only {part} were searched: some stretches all along the logs, and what says most about θ.")
        )
    if alike := equals(d):
        shown = [Markup("{} (<code>{}</code>)").format(EFFECTS[name].title, name) for name in alike]
        blocks.append(Text(Markup("Equal on these logs: {}.").format(Markup("; ").join(shown))))
    return Section("about", "The logs, and what they cannot show", tuple(blocks))
