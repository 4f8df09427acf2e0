"""Writes what follows from the program: the pages of docs/reference, and the schemas of docs/schema.

    python docs/generate.py               # effects, commands, files, schemas, Python; with the effects' pictures
    python docs/generate.py --check       # exit code 1 where a page is not what the program says

`tests/test_docs.py` holds the pages to the program.
"""

from __future__ import annotations

import importlib
import json
import sys
from enum import Enum
from math import exp
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

if TYPE_CHECKING:
    from furuta_gym.plant import Parameter

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

NOTE = "<!-- Written by docs/generate.py from the program. Change the program, then run it again. -->\n"
PLACES = {
    "arm": "Torques on the arm",
    "pendulum": "Torques on the pendulum",
    "arm and pendulum": "Torques on both",
    "input": "Between command and torque",
    "sensor": "In the readings",
    "parameters": "Parameters that change",
}
KINDS = {str: "text", Path: "file", int: "whole number", float: "number", bool: ""}
PACKAGES = ("furuta_gym", "identification", "controllers")


def pages() -> dict[str, str]:
    """Every generated page, by its path below docs/."""
    made = {
        "reference/effects.md": effects_page(),
        "reference/commands.md": commands_page(),
        "reference/plant_file.md": file_page("plant", PLANT_WORDS) + known_sets(),
        "reference/diagnosis_file.md": file_page("diagnosis", DIAGNOSIS_WORDS),
    }
    for kind in DECLARED:
        made[f"schema/furuta-{kind}-1.schema.json"] = json.dumps(schema_of(kind), indent=2, ensure_ascii=False) + "\n"
    return made | {f"reference/{package}.md": python_page(package) for package in PACKAGES}


# ------------------------------------------------------------------------------------------------------- effects


def _prior(p: Parameter) -> str:
    """What a fit believes of a shape before it sees a log: with 95 %, between two numbers."""
    reach, of = 1.96 * p.spread, f" × {p.relative_to}" if p.relative_to else ""
    ends = (
        (p.default * exp(-reach), p.default * exp(reach)) if p.logarithmic else (p.default - reach, p.default + reach)
    )
    low, high = max(ends[0], p.lower), min(ends[1], p.upper)
    return f"{p.name} between {low:.2g} and {high:.2g}{of} (95 %)"


def effects_page() -> str:
    from furuta_gym import EFFECTS

    lines = [
        NOTE,
        "# Effects\n",
        f"The library has {len(EFFECTS)} effects. Each adds one mechanism to [model (5)](../explanation/model.md). "
        "`furuta diagnose` chooses among them, and `furuta effects NAME` prints an entry of this page.\n",
        "With its *size* parameters at their neutral values an effect is not there, and its *shape* parameters do "
        "nothing. "
        "{u} stands for the unit of the command, V or N·m. The default size is what an effect has that is added by its "
        "name alone (`--effect NAME`): worth noticing on a rig, and for some a share of a quantity of the plant. The "
        "[blind trials](../diagnosis_trials.md#the-plan) choose other sizes.\n",
        "The pictures show 4 s of the set `qube` in closed loop (`lqr`) under the paper's excitation, without the "
        "effect (grey), with it at its default size (blue), and the difference (orange). What happens at an instant, "
        "happens at 2 s. "
        "`python docs/generate.py --pictures` draws them.\n",
        "| effect | in words | acts on |",
        "|---|---|---|",
    ]
    lines += [f"| [`{e.name}`](#{e.name}) | {e.title} | {e.place} |" for e in EFFECTS.values()]
    for place, title in PLACES.items():
        kinds = [e for e in EFFECTS.values() if e.place == place]
        if kinds:
            lines.append(f"\n## {title}")
        for kind in kinds:
            lines += _effect(kind)
    return "\n".join(lines) + "\n"


def _effect(kind: Any) -> list[str]:
    lines = [
        f"\n### {kind.name}\n",
        f"{kind.title[0].upper()}{kind.title[1:]}.\n",
        f"```text\n{kind.equation}\n```\n",
        f"**On the rig:** {kind.symptom}.\n".replace("..", "."),
        "| parameter | unit | meaning | role | default size |",
        "|---|---|---|---|---|",
    ]
    for p in kind.parameters:
        of = f" × {p.relative_to}" if p.relative_to else ""
        lines.append(f"| {p.name} | {p.unit or '1'} | {_cell(p.meaning)} | {p.role} | {p.default:g}{of} |")
    for p in kind.parameters:
        if p.spread:
            lines.append(
                f"\n**Prior:** before it sees a log, a fit expects {_prior(p)}. If the log does not show it, this "
                "remains."
            )
        if p.rough:
            lines.append(
                f"\n**No error bar:** the likelihood of {p.name} has many narrow peaks. Fit two logs one at a time, "
                "and compare."
            )
    if kind.mistaken_for:
        alike = ", ".join(f"[`{name}`](#{name})" for name in kind.mistaken_for)
        lines.append(
            f"\n**Look-alikes:** {alike}. `furuta excite --between` designs an experiment that separates them."
        )
    lines.append(f"\n![Arm and pendulum without and with {kind.name}](effects/{kind.name}.png)")
    return lines


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


# ------------------------------------------------------------------------------------------------------- commands


def commands_page() -> str:
    """Every command with its arguments and options, from the program itself."""
    import typer

    from experiments.cli.app import app
    from experiments.cli.bench import app as bench

    root = typer.main.get_command(app)
    lines = [NOTE, "# Commands\n", f"{root.help}\n", "| command | does |", "|---|---|"]
    commands: dict[str, Any] = {}
    reading: list[Any] = []
    for name, command in root.commands.items():  # type: ignore[attr-defined]
        inner = typer.main.get_command(bench).commands if name == "bench" else {"": command}  # type: ignore[attr-defined]
        commands |= {f"{name} {sub}".strip(): one for sub, one in inner.items()}
    for name, command in commands.items():
        first = (command.help or "").split("\n\n")[0].replace("\n", " ")
        lines.append(f"| [`furuta {name}`](#furuta-{name.replace(' ', '-')}) | {_cell(first)} |")
    lines.append("\nOptions before the command:\n")
    lines += _table(root.params)
    for name, command in commands.items():
        own = [p for p in command.params if getattr(p, "rich_help_panel", None) is None]
        shared = [p for p in command.params if p not in own]
        lines += [f"\n## furuta {name}\n", f"{_words(command.help)}\n", *_table(own)]
        if shared:
            reading = shared
            lines.append("\nAlso the options of [how a log is written](#how-a-log-is-written).")
    lines += [
        "\n## How a log is written\n",
        "`furuta init` finds these out and keeps them in `rig.toml`.\n",
        *_table(reading),
    ]
    lines.append(
        "\nThe exit code is 0 after a result, 2 after bad input, with one message, and 130 after Ctrl-C. A check has "
        "two more: 10 and 11 of `furuta validate --limit`. Nothing is half-written. Compiled "
        "code is kept in the folder that the variable `FURUTA_CACHE` names, else in the user's cache folder."
    )
    return "\n".join(lines) + "\n"


def _table(parameters: list[Any]) -> list[str]:
    rows = ["| name | value | what it is |", "|---|---|---|"]
    for p in parameters:
        if getattr(p, "hidden", False) or p.name in ("help", "install_completion", "show_completion"):
            continue
        names = ", ".join(f"`{name}`" for name in (*p.opts, *p.secondary_opts)) if p.opts else ""
        flag = getattr(p, "is_flag", False) or getattr(p, "count", False)
        if p.param_type_name == "argument":
            names = f"`{(p.metavar or p.name).strip('{}')}`"
        kind = "" if flag else p.metavar or _type_name(p.type_descriptor.annotation)
        default = p.default
        shown = getattr(p, "show_default", True) and not callable(default) and not flag
        said = _words(getattr(p, "help", None))
        if p.required:
            said += " Required."
        elif (
            shown
            and type(default) in (int, float, str, type(Path()))
            and default != ""
            and "default" not in said.lower()
        ):
            said += f" Default: {default}."
        rows.append(f"| {names} | {_cell(str(kind).strip('{}').lower())} | {_cell(said)} |")
    return rows


def _type_name(kind: Any) -> str:
    if get_args(kind):
        return _type_name(get_args(kind)[0])
    return " or ".join(str(one) for one in kind) if issubclass(kind, Enum) else KINDS[kind]


def _words(text: str | None) -> str:
    return " ".join((text or "").split())


# ------------------------------------------------------------------------------------------------------- files

PLANT_WORDS = """A plant file is the model of one rig with numbers in it. `furuta identify` and `furuta diagnose`
write it, `Plant.save` and `Plant.load` write and read it in Python, and every command that takes `--plant` reads it.
`gymnasium.make("FurutaID-v0", plant="rig.json")` simulates it.

To read it in another language, you need a JSON reader, UTF-8, and five keys. `theta` and `friction_sharpness` go into
[equation (5)](../explanation/model.md). `unit` says what the command is in, and `u_max` its largest size. Each entry of
`effects` adds the equation of its name in the [effects page](effects.md). One name is not on that page: `arm_learned`,
[a torque without a name](../explanation/diagnosis.md#what-has-no-name), whose equation is in
`furuta_gym/plant/effects/learned.py`. A program that does not know one of the effects should
refuse the file: without that effect it would simulate another plant. Angles are in rad,
times in s. Keys that you do not know may be left out."""

DIAGNOSIS_WORDS = """`furuta diagnose -o DIR` writes `DIR/diagnosis.json`. Most of its keys are those of
`Diagnosis.to_dict()`. The file is for reading; no function turns it into a `Diagnosis` again. The plant to use goes
into `plant.json` beside it.

If the verdict is `insufficient_excitation`, no plant can be fitted to the logs. Then `where` and `gap` are null,
`effects` and `ranking` are empty, and there is no `plant.json`. `summary` says which parameters the logs do not show,
and `next_experiment` what to record. With another verdict, `gap` or `where` may be null on short logs. `remarks` says
why."""


DECLARED = {
    "plant": ("furuta_gym.plant.plant_file", "PlantFile"),
    "diagnosis": ("identification.diagnosis.diagnosis_file", "DiagnosisFile"),
}


def schema_of(kind: str) -> dict[str, Any]:
    """The JSON Schema of a file, from its declaration."""
    import msgspec

    where, name = DECLARED[kind]
    module = importlib.import_module(where)
    _, parts = msgspec.json.schema_components([getattr(module, name)], ref_template="#/$defs/{name}")
    top = parts.pop(name)
    about = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": module.SCHEMA,
        "description": module.DESCRIPTION,
    }
    return about | {key: value for key, value in top.items() if key not in about} | {"$defs": parts}


def file_page(kind: str, words: str) -> str:
    """A file's keys, from its JSON Schema."""
    name, schema = f"furuta-{kind}-1.schema.json", schema_of(kind)
    lines = [
        NOTE,
        f"# {kind.capitalize()} file\n",
        f"{words}\n",
        f"JSON Schema: [{name}](../schema/{name}). {schema['description']}\n",
        "| key | type | what it is |",
        "|---|---|---|",
        *_keys(schema, schema, "", {}),
    ]
    return "\n".join(lines) + "\n"


def known_sets() -> str:
    """The plants that come with the package, and where their numbers come from."""
    from furuta_gym.plant import PLANTS

    rows = []
    for name, plant in PLANTS.items():
        period = f"{1e3 * plant.sample_time:g} ms" if plant.sample_time else "none"
        said = [text for key, text in plant.provenance.items() if key in ("source", "assumed")]
        rows.append(f"| `{name}` | {plant.unit} | {plant.u_max:g} | {period} | {_cell('; '.join(said))} |")
    words = (
        "Every `plant` and `--plant` takes one of these names in place of a file. "
        "No log was fitted for `qube` and `large`. Nothing here is near your rig? "
        "[Masses and lengths](../explanation/model.md#from-masses-and-lengths-to-a-plant) make a plant too."
    )
    head = [
        "\n## Known sets\n",
        f"{words}\n",
        "| set | command | u_max | sample time | origin |",
        "|---|---|---|---|---|",
    ]
    return "\n".join([*head, *rows]) + "\n"


def _keys(schema: Any, whole: Any, before: str, shown: dict[str, str]) -> list[str]:
    """The rows of an object's keys. shown: of parts with keys of their own, the key at which these stand already."""
    rows = []
    for key, inner in schema.get("properties", {}).items():
        needed = " Required." if key in schema.get("required", ()) else ""
        said = inner.get("description", "")
        said = f"{said}.{needed}" if said else needed.strip()
        below, seen = [], ""
        for one in _alternatives(inner):
            parts = [(one, ""), (one.get("items", {}), "[]"), (one.get("additionalProperties", {}), ".NAME")]
            for part, step in parts:
                for named in _alternatives(part) if isinstance(part, dict) else ():
                    name, place = named.get("$ref", "").rpartition("/")[2], f"{before}{key}{step}"
                    if not name:
                        continue
                    if name in shown:
                        seen = f" Its keys: as `{shown[name]}`."
                        continue
                    shown[name] = place
                    below += _keys(whole["$defs"][name], whole, f"{place}.", shown)
        rows.append(
            f"| `{before}{key}` | {_cell(_type(inner, whole))} | {_cell(said + seen).replace('..', '.').strip()} |"
        )
        rows += below
    return rows


def _alternatives(inner: Any) -> list[Any]:
    return inner.get("anyOf", [inner])


def _type(inner: Any, whole: Any) -> str:
    if "anyOf" in inner:
        return " or ".join(dict.fromkeys(_type(one, whole) for one in inner["anyOf"]))
    if "enum" in inner:
        return " or ".join(f'"{value}"' for value in inner["enum"])
    return "object" if "$ref" in inner else inner.get("type", "any")


# ------------------------------------------------------------------------------------------------------- Python


LISTED = """This page lists the public names of the package. `make docs` builds it, with their signatures and
docstrings, in `out/site`. Elsewhere, `help(NAME)` in Python shows them.
"""


def python_page(package: str) -> str:
    """The public names of a package, for mkdocstrings to fill from their docstrings."""
    module = importlib.import_module(package)
    lines = [NOTE, f"# {package}\n", LISTED, f"{module.__doc__.strip()}\n"]  # type: ignore[union-attr]
    for name in module.__all__:
        thing = getattr(module, name)
        where = thing.__module__ if hasattr(thing, "__qualname__") else f"{package}{module._WHERE[name]}"
        lines.append(f"::: {where}.{name}\n")
    return "\n".join(lines)


def main(arguments: list[str]) -> int:
    stale = []
    for name, text in pages().items():
        path = DOCS / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            stale.append(name)
            if "--check" not in arguments:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")
    if "--check" in arguments:
        if stale:
            print(f"not what the program says: {', '.join(stale)}; run `python docs/generate.py`", file=sys.stderr)
        return 1 if stale else 0
    from furuta_gym import EFFECTS

    pictures = DOCS / "reference" / "effects"
    if "--pictures" in arguments or not all((pictures / f"{name}.png").is_file() for name in EFFECTS):
        from effect_pictures import draw_effects

        draw_effects(pictures)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
