"""Logs on the command line: the options that say how they are written, where else it is said, and what is wrong."""

from __future__ import annotations

import functools
import inspect
import logging
import os
import shlex
import warnings
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from . import options as opt
from .letters import without_controls
from .told import Said, in_one, said_of

if TYPE_CHECKING:
    from furuta_gym.plant import Plant
    from identification.logs.log import Log
    from identification.logs.proposal import Proposal
    from identification.logs.rig_mapping import RigMapping
    from identification.logs.table import Table

_PANEL = "How the file is written (furuta init finds it out)"
_PLANT_FILE = "the plant file"  # where the mapping of the log that it was fitted to stands
_logger = logging.getLogger("furuta.reading")


def _option(help: str, *names: str) -> Any:
    return typer.Option(*names, help=help, rich_help_panel=_PANEL)


Columns = Annotated[
    list[str] | None, _option("Names in the file: t=Time,q1=theta,q2=alpha,u=volts; it may be repeated.")
]
Unit = Annotated[
    list[str] | None, _option("Angles in rad (default), deg, turns or counts; or q1=deg,q2=rad; it may be repeated.")
]
PendulumZero = Annotated[str | None, _option("Where the file's q2 is zero: upright (default) or hanging.")]
Flip = Annotated[list[str] | None, _option("Turn the sign of q1, q2 or u; repeat it, or use commas; none turns none.")]
EncoderCounts = Annotated[str | None, _option("Counts per revolution, one number or two: 2048 or 2048,4096.")]
InputUnit = Annotated[str | None, _option("Unit of the command: V or N·m.")]
InputScale = Annotated[float | None, _option("What the file's command is multiplied by: 0.001 for millivolts.")]
TimeUnit = Annotated[
    str | None,
    _option(
        "Of the time column: s (default), ms, us, ns or d (days). Of a counter: the seconds of one count, as 0.002."
    ),
]
Skip = Annotated[
    float | None, _option("Seconds to leave out at the start of each log, such as the hand-over to the controller.")
]
Cut = Annotated[
    list[str] | None,
    _option("A stretch left out of each log, FROM:TO in seconds of the log's own clock; it may be repeated."),
]
MappingFile = Annotated[
    Path | None,
    _option(
        "The rig's rig.toml. none: no mapping, not even the plant file's. Default: beside the log, "
        "else what the plant file has, else here.",
        "--mapping",
        "--rig",
    ),
]
AsGiven = Annotated[
    bool, _option("Read the file as the options say, even where the data contradict them.", "--as-given")
]

_OPTIONS: dict[str, tuple[Any, Any]] = {
    "columns": (Columns, None),
    "unit": (Unit, None),
    "pendulum_zero": (PendulumZero, None),
    "flip": (Flip, None),
    "encoder_counts": (EncoderCounts, None),
    "input_unit": (InputUnit, None),
    "input_scale": (InputScale, None),
    "time_unit": (TimeUnit, None),
    "skip": (Skip, None),
    "cut": (Cut, None),
    "mapping": (MappingFile, None),
    "as_given": (AsGiven, False),
}

_HINTS = {  # of errors in these options, where the command line has another way out than Python
    "input_unit": ". For a current or PWM give the unit of the scaled command, and its scale by --input-scale",
    "input_scale": " (use --flip for the sign)",
}


@dataclass(frozen=True)
class Reading:
    """What the command line says of how logs are written.

    file: a rig.toml. as_given: what is said is not held against the data. told: what was printed of it already."""

    said: RigMapping
    file: Path | None = None
    as_given: bool = False
    told: set[str] = field(default_factory=set, compare=False)

    @classmethod
    def of(
        cls,
        mapping: Path | None,
        as_given: bool,
        flip: list[str] | None,
        columns: list[str] | None,
        unit: list[str] | None,
        **said: Any,
    ) -> Reading:
        """From the values of the options. Raises LogError."""
        from identification.logs.rig_mapping import RigMapping

        turned = None if flip is None else ",".join(f for f in flip if f != "none")
        named, units = (",".join(texts) if texts else None for texts in (columns, unit))
        with opt.as_typed(*_OPTIONS, hints=_HINTS):
            return cls(RigMapping.of(named, units, flip=turned, **said), mapping, as_given)

    def again(self, paths: Sequence[Path], logs: Sequence[Log]) -> str:
        """The options by which a later command, which knows no plant, reads logs once more as these; each after a
        space."""
        from identification.logs.rig_file import find_mapping

        mappings = {log.mapping for log in logs}
        file = None if self.file is None else os.fspath(self.file)
        found = {rig_file for path in paths if (rig_file := find_mapping(path))}
        if file or len(mappings) > 1:
            options = [self.said.options()]
        elif found and any(self._reads_as(rig_file, mappings) for rig_file in found):
            options = [self.said.options()]  # it is taken again
        else:
            options = [mappings.pop().options()] if mappings else [self.said.options()]
            file = "none" if found else None
        options += [] if file is None else [f"--mapping {shlex.quote(file)}"]
        options += ["--as-given"] if self.as_given else []
        return "".join(f" {option}" for option in options if option)

    def _reads_as(self, rig_file: Path, mappings: Collection[RigMapping]) -> bool:
        from identification.logs.checks import LogError
        from identification.logs.rig_file import load_mapping

        try:
            return self.said.over(load_mapping(rig_file)) in mappings
        except LogError:  # the working folder's, which nobody had to read so far
            return False


def reads_logs(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of how a log is written, in place of its parameter `reading`."""
    hints = get_type_hints(command, include_extras=True)
    signature = inspect.signature(command)
    parameters: list[inspect.Parameter] = []
    for name, parameter in signature.parameters.items():
        if name == "reading":
            keyword = inspect.Parameter.KEYWORD_ONLY
            parameters += [
                inspect.Parameter(option, keyword, default=default, annotation=kind)
                for option, (kind, default) in _OPTIONS.items()
            ]
        else:
            parameters.append(parameter.replace(annotation=hints[name], kind=inspect.Parameter.KEYWORD_ONLY))

    @functools.wraps(command)
    def run(**values: Any) -> Any:
        options = {name: values.pop(name) for name in _OPTIONS}
        return command(reading=Reading.of(**options), **values)

    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    del run.__wrapped__  # type: ignore[attr-defined]
    return run


@dataclass(frozen=True)
class _Source:
    """A log with its table, the mapping that applies to it, the part of it that no option says, and where that part
    stands."""

    path: Path
    table: Table
    mapping: RigMapping
    unsaid: RigMapping
    origin: str


def read(
    paths: Sequence[Path],
    reading: Reading,
    plant: Plant | None = None,
    constant_command: str | None = None,
    beside: Sequence[Path] = (),
) -> tuple[Log, ...]:
    """Logs as the options say, else as `sources_of` finds, and checked against what the data show.

    beside: other logs of the command, as logs of one file name are called by their folders too. Prints on stderr where
    the mapping comes from. Raises LogError with all that is wrong at once.
    """
    from furuta_gym.files import told_apart
    from identification.logs.reading import read_logs

    sources = sources_of(paths, reading, plant)
    beside_it = "" if reading.said.empty else f"; as the options say: {reading.said.options()}"
    for origin, unsaid in dict.fromkeys((s.origin, s.unsaid) for s in sources):
        message = f"Read as {origin} says: {unsaid.options() or 'nothing that no option says'}{beside_it}"
        if origin and not (unsaid.empty and reading.said.empty) and message not in reading.told:
            typer.echo(without_controls(message), err=True)
            reading.told.add(message)
    for source in sources:
        message = _unlike_the_plants(source, reading, plant)
        if message and message not in reading.told:
            typer.echo(f"Warning: {message}", err=True)
            reading.told.add(message)
    if not reading.as_given:
        refuse_wrong(sources, constant_command)
    mappings, tables = [s.mapping for s in sources], [s.table for s in sources]
    logs = read_logs(paths, mappings=mappings, tables=tables, **_severity(constant_command))
    for path, name in zip(paths, told_apart([*paths, *beside]), strict=False):
        if name != path.name:
            logs = tuple(replace(log, source=name) if at == path else log for at, log in zip(paths, logs, strict=True))
    for log in logs:
        _logger.info("read %s: %d samples, %.4g s, sha256 %s", log.source, len(log), log.duration, log.sha256)
    return logs


def tell_undriven(logs: Sequence[Log]) -> None:
    """Say on stderr which logs have no command: they cannot judge what a command does."""
    if still := [log.source for log in logs if not log.u.any()]:
        typer.echo(
            f"Warning: the command is 0 in every sample of {', '.join(still)}. A free decay says nothing of what the "
            "command does, such as its gain or a delay. If it is none, name the column: --columns u=NAME.",
            err=True,
        )


def sources_of(paths: Sequence[Path], reading: Reading, plant: Plant | None = None) -> list[_Source]:
    """Each log with the mapping that applies to it: the options, over the file of --mapping or a rig.toml beside the
    log, over the plant file's, over the rig.toml of the working folder."""
    from identification.logs.formats import read_table
    from identification.logs.rig_mapping import RigMapping
    from identification.logs.said import COLUMNS

    sources = []
    for path in paths:
        table = read_table(path)
        base, origin = _base(path, reading, plant)
        names = {ours: base.columns.get(ours, ours) for ours in COLUMNS}
        lacking = [theirs for theirs in names.values() if not _has(table, theirs)]
        if origin and reading.file is None and lacking and all(_has(table, ours) for ours in COLUMNS):
            message = f"{path.name} has no column {', '.join(lacking)} of {origin}; read by its own t, q1, q2, u."
            typer.echo(message, err=True)
            base, origin = RigMapping(), ""
        said = [name for name, value in vars(reading.said).items() if value is not None]
        sources.append(_Source(path, table, reading.said.over(base), base.without(*said), origin))
    return sources


def _unlike_the_plants(source: _Source, reading: Reading, plant: Plant | None) -> str:
    """What a rig.toml says otherwise than the plant file does of the logs that the plant was fitted to; "" if nothing.

    What an option says, and what one of the two leaves open, is no difference; other names of columns are one only
    where the log has both. Seconds left out change no reading."""
    from identification.logs.rig_mapping import RigMapping
    from identification.logs.said import COLUMNS

    stored = plant.provenance.get("mapping") if plant is not None else None
    if not stored or not source.origin or source.origin == _PLANT_FILE:
        return ""
    fitted, here = (RigMapping.from_dict(stored), source.mapping)
    usual = {"unit_q1": "rad", "unit_q2": "rad", "time_unit": "s", "pendulum_zero": "upright", "input_scale": 1.0}
    usual |= {"flip": (), **{name: name for name in COLUMNS}}
    theirs, ours = (
        {name: value for name, value in vars(m).items() if name not in ("skip", "cut")} for m in (fitted, here)
    )
    there = {name: usual.get(name) if value is None else value for name, value in theirs.items()}
    now = {name: usual.get(name) if value is None else value for name, value in ours.items()}
    other = [
        name
        for name, value in there.items()
        if None not in (value, now[name])
        and value != now[name]
        and getattr(reading.said, name) is None
        and (name not in COLUMNS or _has(source.table, str(value)))
    ]
    if not other:
        return ""

    def options(said: dict[str, Any]) -> str:
        units = {"unit_q1", "unit_q2"} if {"unit_q1", "unit_q2"} & set(other) else set()
        only = RigMapping(**{name: said[name] for name in {*other, *units}})
        return only.options()

    return (
        f"{source.path.name} is read with {options(now)}, as {source.origin} says. The plant's own logs were read with "
        f"{options(there)}. If one logger wrote them all, add {options(there)}, or identify the plant again."
    )


def _has(table: Table, name: str) -> bool:
    return name in table.columns or any(column.endswith(f".{name}") for column in table.columns)


def _base(path: Path, reading: Reading, plant: Plant | None) -> tuple[RigMapping, str]:
    from identification.logs.rig_file import find_mapping, load_mapping, mapping_beside
    from identification.logs.rig_mapping import RigMapping

    if reading.file is not None and str(reading.file) == "none":
        return RigMapping(), ""
    stored = plant.provenance.get("mapping") if plant is not None else None
    file = reading.file or (mapping_beside(path) if stored else find_mapping(path))
    if file is not None:
        return load_mapping(file), os.fspath(file)
    return (RigMapping.from_dict(stored), _PLANT_FILE) if stored else (RigMapping(), "")


def refuse_wrong(sources: Sequence[_Source], constant_command: str | None = None) -> None:
    """Raise LogError with everything that the data contradict, and the options that read the logs."""
    from furuta_gym.files import told_apart
    from identification.logs.checks import LogError
    from identification.logs.proposal import propose
    from identification.logs.said import COLUMNS

    mappings = dict.fromkeys(s.mapping for s in sources)
    severity = constant_command or ("warn" if len(sources) > 1 else "error")
    paths = [s.path for s in sources]
    called = dict(zip(paths, told_apart(paths), strict=True))
    said: list[Said] = []
    for mapping in mappings:
        of_it = [s for s in sources if s.mapping == mapping]
        tables = {called[s.path]: s.table for s in of_it}
        names = {ours: mapping.columns.get(ours, ours) for ours in COLUMNS}
        if lacking := [ours for ours, theirs in names.items() if not _has(of_it[0].table, theirs)]:
            said += [Said(text, tuple(tables)) for text in _unread(list(tables.values()), mapping, lacking)]
            continue

        def asked(tables: Sequence[Table], mapping: RigMapping = mapping) -> Proposal:
            return propose(tables, mapping, assumed=True, constant_command=severity)

        found = asked(list(tables.values()))
        said += said_of(found.fatal, tables, lambda table, asked=asked: asked([table]).fatal)
        for problem in found.problems:
            if problem.between and not problem.fatal:  # of one log alone, reading says it
                typer.echo(without_controls(f"Warning: {problem}"), err=True)
    if said:
        readable = reads_as_given(paths, [s.table for s in sources], [s.mapping for s in sources], constant_command)
        raise LogError(in_one(said, paths, readable=readable))


def _severity(constant_command: str | None) -> dict[str, Any]:
    """How a constant command counts, for `read_logs`; None leaves it to what it does otherwise."""
    return {} if constant_command is None else {"constant_command": constant_command}


def reads_as_given(
    paths: Sequence[Path],
    tables: Sequence[Table],
    mappings: Sequence[RigMapping],
    constant_command: str | None = None,
) -> bool:
    """Whether logs can be read as their mappings say, whatever the data show; constant_command: as `read` takes it."""
    from identification.logs.checks import LogError, LogWarning
    from identification.logs.reading import read_logs

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        try:
            read_logs(paths, mappings=mappings, tables=tables, **_severity(constant_command))
        except LogError:
            return False
    return True


def _unread(tables: Sequence[Table], mapping: RigMapping, lacking: Sequence[str]) -> list[str]:
    """Columns that a log does not have, with the options that may read it, and what else is wrong."""
    from identification.logs.proposal import propose
    from identification.logs.proposal.values import NoColumn

    whole = propose(tables, mapping.without(*lacking))
    names = ", ".join(mapping.columns.get(ours, ours) for ours in lacking)
    there = ", ".join(list(tables[0].columns)[:20]) or "none"
    options = whole.mapping.options() if set(lacking) <= set(whole.mapping.columns) else ""
    first = f"no column {names}. Found: {there}. Expected t, q1 (arm), q2 (pendulum), u."
    same = [p for p in whole.fatal if isinstance(p, NoColumn)]
    mend = f"It may be read with {options}" if options else " ".join(dict.fromkeys(p.mend for p in same))
    return [f"{first} {mend}".strip(), *(str(p) for p in whole.fatal if p not in same)]
