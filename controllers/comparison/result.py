"""The result of a comparison: figures with intervals, a table to print, and files to keep."""

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from msgspec import Struct

from furuta_gym.declared import checked, written
from furuta_gym.files import in_short, read_json, write_whole
from furuta_gym.plant import Plant

from .conditions import map_name
from .statistics import Interval, IntervalEntry
from .trained import TrainedEntry
from .variations import delay_of

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "furuta-comparison/2"
Scores = Mapping[str, Mapping[str, Mapping[str, Interval]]]

UNITS = {
    "success": "",
    "rms_q1": "rad",
    "rms_q2": "rad",
    "energy": "{u}²·s",
    "roughness": "{u}/s",
    "settling": "s",
    "largest_q1": "rad",
    "largest_push": "rad/s",
}
UNITS |= {f"worst_{figure}": UNITS[figure] for figure in ("settling", "largest_q1", "roughness", "energy")}


class ComparisonFile(Struct):
    """comparison.json. groups: by condition its group, as the first schema had it, or by group its conditions. trained:
    of learned controllers; earlier files have none."""

    schema: Literal["furuta-comparison/1", "furuta-comparison/2"]
    plant: dict[str, Any]
    settings: dict[str, Any]
    groups: dict[str, str | dict[str, Any]]
    controllers: dict[str, dict[str, dict[str, IntervalEntry]]]
    skipped: dict[str, str]
    trained: dict[str, TrainedEntry] = {}


@dataclass(frozen=True)
class Comparison:
    """`scores[controller][condition][figure]` is an `Interval`; `groups[condition]` is the group it belongs to.

    skipped[controller]: why it was left out. trained[controller]: how a learned one was trained, as its file says.
    policies[controller]: the controller itself; files do not keep it.
    """

    plant: Plant
    settings: Mapping[str, Any]
    groups: Mapping[str, str]
    scores: Scores
    skipped: Mapping[str, str] = field(default_factory=dict)
    trained: Mapping[str, TrainedEntry] = field(default_factory=dict)
    policies: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)

    def to_dict(self) -> dict[str, Any]:
        return {
            "schema": SCHEMA,
            "plant": self.plant.to_dict(),
            "settings": dict(self.settings),
            "units": {name: unit.format(u=self.plant.unit) for name, unit in UNITS.items()},
            "groups": {group: self._in_group(group) for group in dict.fromkeys(self.groups.values())},
            "controllers": {
                controller: {
                    condition: {figure: interval.to_dict() for figure, interval in figures.items()}
                    for condition, figures in rows.items()
                }
                for controller, rows in self.scores.items()
            },
            "skipped": dict(self.skipped),
            "trained": {controller: written(entry) for controller, entry in self.trained.items()},
        }

    def _in_group(self, group: str) -> dict[str, dict[str, Any]]:
        """{condition: {controller: its success rate and what the worst 5 % of its trials reach}}."""
        return {
            condition: {
                controller: {
                    figure: interval.to_dict()
                    for figure, interval in rows[condition].items()
                    if figure == "success" or figure.startswith("worst_")
                }
                for controller, rows in self.scores.items()
                if condition in rows
            }
            for condition, of in self.groups.items()
            if of == group
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Comparison":
        """Inverse of `to_dict`; also reads the first schema. Raises ValueError for anything else."""
        read = checked(data, ComparisonFile)
        groups: dict[str, str] = {}
        for name, of in read.groups.items():
            groups |= {name: of} if isinstance(of, str) else dict.fromkeys(of, name)
        scores = {
            controller: {
                condition: {figure: entry.interval() for figure, entry in figures.items()}
                for condition, figures in rows.items()
            }
            for controller, rows in read.controllers.items()
        }
        return cls(Plant.from_dict(read.plant), read.settings, groups, scores, read.skipped, read.trained)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Comparison":
        """Read comparison.json. Raises FileNotFoundError, or ValueError with the file's name."""
        try:
            return cls.from_dict(read_json(Path(path).read_bytes()))
        except ValueError as error:
            raise ValueError(f"{path}: no comparison, as `furuta compare` writes it: {in_short(error)}") from error

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write `comparison.json` into a folder, made if need be; its path. `plots.draw_comparison` draws it."""
        text = json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        return write_whole(Path(folder) / "comparison.json", text)

    def table(self) -> "Table":
        """The comparison as a table for the terminal: what matters from each group, 95 % intervals in brackets."""
        from rich.markup import escape
        from rich.table import Table

        unit = self.plant.unit
        table = Table(
            title=f"{self._trials()}, every {1e3 * self.settings['sample_time']:g} ms",
            caption="± is half of the 95 % interval; success rates have Wilson's interval\nOther figures are of the "
            "trials that held",
            padding=(0, 0),
        )
        columns = self._columns()
        table.add_column("controller")
        for title, _, figure in columns:
            named = UNITS[figure].format(u=unit)
            table.add_column(title + (escape(f"\n[{named}]") if named else ""), justify="right")
        restless = False
        for controller, rows in self.scores.items():
            cells = [_cell(rows.get(condition, {}), figure) for _, condition, figure in columns]
            table.add_row(escape(controller), *cells)
            restless |= any(" of " in cell for cell in cells)
        if restless:
            table.caption = f"{table.caption}\nn of m: so many of those that held came to rest"
        if own := delay_of(self.plant):
            table.caption = f"{table.caption}\nlate: later than the plant, whose own delay is {1e3 * own:.3g} ms"
        for controller, entry in self.trained.items():
            table.caption = f"{table.caption}\n{escape(f'training of {controller}: {entry}')}"
        for controller, reason in self.skipped.items():
            table.add_section()
            table.add_row(f"{escape(controller)}\nleft out", style="dim")
            table.caption = f"{table.caption}\n{escape(reason)}"
        return table

    def _trials(self) -> str:
        """How many trials each figure is of."""
        held = (figures.get("success") for rows in self.scores.values() for figures in rows.values())
        sizes = sorted({found.n for found in held if found is not None})
        most = sizes[-1] if sizes else self.settings["trials"]
        fewer = f" ({' or '.join(map(str, sizes[:-1]))} under harder conditions)" if len(sizes) > 1 else ""
        return f"{most} trials each{fewer}"

    def _columns(self) -> list[tuple[str, str, str]]:
        """(title, condition, figure) of the table; of the groups with many conditions, the hardest for all."""
        wanted = [
            ("upright", "balance", "success"),
            ("rms q1", "balance", "rms_q1"),
            ("rms q2", "balance", "rms_q2"),
            ("energy", "balance", "energy"),
            ("roughness", "balance", "roughness"),
            ("settling", "balance", "settling"),
            ("push", "push", "largest_push"),
            ("θ ±20 %", "θ ±20 %", "success"),
            ("16 ms late", "delay 16 ms", "success"),
            ("swing-up", "swing-up", "success"),
            ("up after", "swing-up", "settling"),
            ("worst 5 %", "swing-up", "worst_settling"),
            ("largest q1", "swing-up", "largest_q1"),
            ("16 ms late", "swing-up, 16 ms late", "success"),
            ("supply 60 %", "swing-up, supply 60 %", "success"),
            ("θ ±20 %", "swing-up, θ ±20 %", "success"),
            ("built ±20 %\n8 ms late", "swing-up, built ±20 %, 8 ms late", "success"),
            ("pushed", "swing-up, pushed", "success"),
            ("map: as is", map_name(0, 0), "success"),
            ("±20 %\n8 ms late", map_name(8, 20), "success"),
            ("±20 %\n16 ms late", map_name(16, 20), "success"),
            ("24 ms late", map_name(24, 0), "success"),
        ]
        return [column for column in wanted if column[1] in self.groups]

    def __str__(self) -> str:
        from rich.console import Console

        table = self.table()
        console = Console(width=1000)
        console = Console(width=max(120, console.measure(table).maximum))  # no heading and no name is cut
        with console.capture() as capture:
            console.print(table)
        return capture.get()


def _cell(figures: Mapping[str, Interval], figure: str) -> str:
    x = figures.get(figure)
    if figure == "settling" and x is not None and (held := _held(figures)) > x.n:
        return f"{x.value:.3g}\n{x.n} of {held}" if x.n else f"–\n0 of {held}"
    if x is None or x.n == 0:
        return "–"
    if figure == "success":
        return f"{100 * x.value:.4g} %\n{100 * x.low:.0f}–{100 * x.high:.0f}"
    if math.isnan(x.low):
        return f"{x.value:.3g}" + ("\none trial" if x.n == 1 else "")
    return f"{x.value:.3g}\n±{0.5 * (x.high - x.low):.1g}"


def _held(figures: Mapping[str, Interval]) -> int:
    """Trials that succeeded; 0 where the success rate is not told."""
    rate = figures.get("success")
    return round(rate.value * rate.n) if rate is not None and rate.n else 0
