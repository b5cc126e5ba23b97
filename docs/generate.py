"""Write the generated parts of the documentation, or check that they are up to date.

    python docs/generate.py            writes them
    python docs/generate.py --check    exits with 1 and says which are stale

A page holds generated text between ``<!-- generated: NAME -->`` and ``<!-- end of NAME -->``, a file of udev rules
between ``# generated: NAME`` and ``# end of NAME``; the rest is written by hand. The state diagram comes from the table
of the trial state machine, the configuration reference from the dataclasses, the command reference from the commands,
so they cannot differ from the program; the evidence for the measures comes from the marks of their tests. Tables of
measurements are declared in `docs/study_tables.py`.
"""

import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields
from importlib.util import module_from_spec, spec_from_file_location
from inspect import isclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, get_type_hints

import typer.main
from study_tables import DOCS, cell, loop_in_short, study_tables
from wire_tables import messages

from netboard.base.config import Config
from netboard.base.device_kind import DeviceKind
from netboard.base.settings import Key, tables, to_toml
from netboard.base.tables.forces import CONDITIONS
from netboard.base.tables.scene import FRICTION
from netboard.base.tables.simulated import PARTICIPANT_SOURCES, Participant
from netboard.base.tables.triggers import OTHER_EVENTS, TRIAL_EVENTS
from netboard.devices.contract.registry import BACKENDS, Backend
from netboard.devices.setup import udev
from netboard.participants.body.device_models import MODELS, DeviceModel
from netboard.participants.people.partner_models import PARTNER_MODELS
from netboard.participants.people.population import VARIED
from netboard.participants.robots.robot import HandPolicy
from netboard.participants.seat.partners import POLICIES
from netboard.recording.export.formats import FORMATS
from netboard.recording.export.tables import TRIALS
from netboard.recording.importing.columns import COLUMNS
from netboard.recording.integrity.checking import CHECKS
from netboard.services.cli import app
from netboard.task.trials import state_machine
from netboard.task.trials.state_machine import BALL_FREE, TABLE, Action, Cause, Phase


def state_diagram() -> str:
    """Draw the trial state machine: one arrow for each edge of a trial, marked cause / action."""
    arrows = ["    [*] --> IDLE"]
    for phase, edges in TABLE.items():
        for cause, (then, action) in edges.items():
            if action in (Action.EXTEND, Action.SHORTEN):
                continue
            does = "" if action is Action.NONE else f" / {action.name.lower()}"
            arrows.append(f"    {phase.name} --> {then.name}: {cause.name.lower()}{does}")
    arrows.append("    FINISHED --> [*]")
    return "\n".join(["```mermaid", "stateDiagram-v2", *arrows, "```"])


def edge_table() -> str:
    """Write the trial state machine as a table: phases down, causes across, the next phase in each cell."""
    causes = [cause for cause in Cause if any(cause in edges for edges in TABLE.values())]
    lines = [
        "| phase | ball | " + " | ".join(cause.name.lower() for cause in causes) + " |",
        "|---|---|" + "---|" * len(causes),
    ]
    for phase in Phase:
        cells = [TABLE[phase][cause][0].name.lower() if cause in TABLE[phase] else "" for cause in causes]
        ball = "free" if phase in BALL_FREE else "fixed"
        lines.append(f"| **{phase.name.lower()}** | {ball} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def configuration() -> str:
    """Write a section for every table of the configuration, a row for every key."""
    sections = []
    for table in tables(Config):
        if table.keys:
            rows = [_key_row(key) for key in table.keys]
            head = [f"## [{table.name}]", "", table.text, "", "| key | default | unit | values | what it is |"]
            sections.append("\n".join([*head, "|---|---|---|---|---|", *rows]))
    return "\n\n".join(sections)


def device_options(options: type) -> Callable[[], str]:
    """Return what writes the table of a device backend's own options."""

    def write() -> str:
        (table,) = tables(options)
        head = "| option | default | unit | values | what it is |\n|---|---|---|---|---|"
        return "\n".join([head, *map(_key_row, table.keys)])

    return write


def options_of(backend: Backend) -> type:
    """Return the options of a backend: by convention a class beside its own, named after it."""
    options: type = resolve_name(f"{backend.target}Options")
    return options


REAL = {name: backend for name, backend in BACKENDS.items() if backend.kind in (DeviceKind.HAPTIC, DeviceKind.INPUT)}
"""Backends of devices that can be bought."""


def device_table() -> str:
    """Write the table of the device backends, those of devices that can be bought first."""
    lines = ["| device | backend | library | tests run with | ran on a real device |", "|---|---|---|---|---|"]
    for name, backend in sorted(BACKENDS.items(), key=lambda entry: entry[0] not in REAL):
        ran = (backend.ran_on or "**never**") if name in REAL else ""
        row = (backend.drives, f"[`{name}`]({backend.guide}.md)", backend.library, backend.tested_with, ran)
        lines.append(f"| {' | '.join(row)} |")
    return "\n".join(lines)


def _key_row(key: Key) -> str:
    """Write one key as a row of a Markdown table."""
    default = "" if isinstance(key.default, dict) else f"`{to_toml(key.default)}`"
    unit = "" if key.unit in ("", "1") else key.unit
    values = f"{key.kind} {key.limits}".strip().replace("|", "\\|")
    return f"| `{key.name}` | {default} | {unit} | {values} | {key.text} |"


def commands() -> str:
    """Write a section for every command."""
    root = typer.main.get_command(app)
    with typer.Context(root, info_name="netboard") as context:
        return "\n\n".join(_sections(root, context))


def _sections(command: Any, context: Any) -> Iterator[str]:
    """Write a command, then the commands within it."""
    lines = [f"## {context.command_path}", "", command.help or ""]
    lines += ["", "```console", f"$ {context.command_path} {' '.join(command.collect_usage_pieces(context))}", "```"]
    records = [record for parameter in command.params if (record := parameter.get_help_record(context))]
    if records:
        lines += ["", "| option | what it does |", "|---|---|"]
        lines += [f"| `{cell(name)}` | {cell(text)} |" for name, text in records]
    if command.epilog:
        _, *examples = command.epilog.split("\n\n")
        lines += ["", "Examples:", "", "```console", *(f"$ {example.strip()}" for example in examples), "```"]
    yield "\n".join(lines)
    for name in getattr(command, "commands", {}):
        inner = command.commands[name]
        with typer.Context(inner, parent=context, info_name=name) as inner_context:
            yield from _sections(inner, inner_context)


def trigger_codes() -> str:
    """Write the default code of each event, and the events that have none."""
    words = dict(re.findall(r"^    ([A-Z_]+) = \d+  # (.*)$", Path(state_machine.__file__).read_text(), re.MULTILINE))
    rows = [f"| {code} | `{name}` | {words[name.upper()]} |" for name, code in TRIAL_EVENTS.items()]
    others = ", ".join(f"`{name}`" for name in OTHER_EVENTS)
    return "\n".join(["| code | event | |", "|---|---|---|", *rows, f"| none | {others} | events of the session |"])


def trial_columns() -> str:
    """Write the columns of the exported table of trials."""
    lines = ["| column | unit | |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| `{f.name}` | {_unit(f.unit)} | {cell(f.text)} |" for f in TRIALS.fields)])


def import_columns() -> str:
    """Write the columns that an imported table can have."""
    lines = ["| column | unit | |", "|---|---|---|"]
    for column in COLUMNS.values():
        name = f"**`{column.name}`**, needed" if column.needed else f"`{column.name}`"
        lines.append(f"| {name} | {_unit(column.unit)} | {cell(column.text)} |")
    return "\n".join(lines)


def export_formats() -> str:
    """Write the table of the export formats."""
    lines = ["| format | what it is | for |", "|---|---|---|"]
    for one in FORMATS.values():
        extra = f"; needs `pip install 'netboard[{one.extra}]'`" if one.extra else ""
        lines.append(f"| `{one.name}` | {one.about}{extra} | {one.readers} |")
    return "\n".join(lines)


def integrity_checks() -> str:
    """Write the table of the integrity checks."""
    lines = ["| check | what it examines |", "|---|---|"]
    return "\n".join([*lines, *(f"| **{one.part}** | {cell(one.about)} |" for one in CHECKS)])


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


def device_models() -> str:
    """Write the models of the simulated device as a table, with a mark at every estimate."""
    virtual = next(table for table in tables(Config) if table.name == "virtual")
    keys = [key for key in virtual.keys if key.name in {field.name for field in fields(DeviceModel)}]
    lines = ["| `model` | device | " + " | ".join(f"`{key.name}` [{key.unit}]" for key in keys) + " | source |"]
    lines += ["|---|---|" + "---|" * (len(keys) + 1)]
    for name, model in MODELS.items():
        marks = ["(e)" if key.name in model.estimates else "" for key in keys]
        numbers = [f"{getattr(model, key.name):g} {mark}".strip() for key, mark in zip(keys, marks, strict=True)]
        lines.append(f"| `{name}` | {model.name} | " + " | ".join(numbers) + f" | {cell(model.source)} |")
    return "\n".join(lines)


def partner_models() -> str:
    """Write the models of the partner as a table."""
    lines = ["| `partner_model` | what the force tells | `reflex_gain` | `impedance_gain` | what it does | source |"]
    lines += ["|---|---|---|---|---|---|"]
    for name, it in PARTNER_MODELS.items():
        shown = f"`{name}` (default)" if name == Participant().partner_model else f"`{name}`"
        lines.append(
            f"| {shown} | {it.tells} | {it.reflex_gain:g} | {it.impedance_gain:g} | {it.does} | {cell(it.source)} |"
        )
    return "\n".join(lines)


def participant_parameters() -> str:
    """Write the parameters of a simulated participant as a table, with source and spread of each."""
    spreads = {name: spread for names, spread in VARIED.items() for name in names}
    lines = [
        "| key | meaning | value | unit | SD of its logarithm | source of the value |",
        "|---|---|---|---|---|---|",
    ]
    for key in next(table for table in tables(Config) if table.name == "participant").keys:
        spread = f"{spreads[key.name]:g}" if key.name in spreads else ""
        source = PARTICIPANT_SOURCES[key.name]
        lines.append(f"| `{key.name}` | {key.text} | {key.default} | {key.unit} | {spread} | {source} |")
    return "\n".join(lines)


def robot_parameters() -> str:
    """Write the parameters of the robot partners as a table, with the source of each."""
    found: dict[tuple[str, ...], list[str]] = {}
    for name, target in POLICIES.items():
        made = resolve_name(target)
        policy = made if isclass(made) else get_type_hints(made)["return"]
        if issubclass(policy, HandPolicy):
            for key in tables(policy.Parameters, (name,))[0].keys:
                row = (key.name, key.text, f"{key.default}", key.unit, policy.sources[key.name])
                found.setdefault(row, []).append(name)
    lines = ["| key | of | meaning | value | unit | source of the value |", "|---|---|---|---|---|---|"]
    robots = max(map(len, found.values()))
    for (key, text, value, unit, source), of in found.items():
        who = "all" if len(of) == robots else ", ".join(of)
        lines.append(f"| `{key}` | {who} | {text} | {value} | {unit} | {source} |")
    return "\n".join(lines)


def force_conditions() -> str:
    """Write the force conditions as a table."""
    lines = ["| `force` | the hand feels | information about the partner |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| `{name}` | {it.feels} | {it.partner} |" for name, it in CONDITIONS.items())])


def friction_laws() -> str:
    """Write the laws of friction of a ball as a table."""
    lines = ["| law | key | unit | force against the motion | source |", "|---|---|---|---|---|"]
    physics = next(table for table in tables(Config) if table.name == "physics")
    units = {key.name: key.unit for key in physics.keys}
    for key, law in FRICTION.items():
        lines.append(f"| {law.name} | `{key}` | {units[key]} | `{law.formula}` | {cell(law.source)} |")
    return "\n".join(lines)


def analysis_evidence() -> str:
    """Write what the tests show of each measure, as their marks say."""
    path = DOCS.parent / "tests" / "analysis" / "analysis_evidence.py"
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[path.stem] = module  # its dataclass looks there
    spec.loader.exec_module(module)
    return str(module.table())


GENERATED: dict[str, tuple[str, Callable[[], str]]] = {
    "state diagram": ("reference/trial-state-machine.md", state_diagram),
    "edge table": ("reference/trial-state-machine.md", edge_table),
    **{f"options of {name}": (f"how-to/{it.guide}.md", device_options(options_of(it))) for name, it in REAL.items()},
    "device table": ("how-to/devices.md", device_table),
    "udev rules": ("../deploy/udev/70-netboard.rules", udev.rules),
    "configuration": ("reference/configuration.md", configuration),
    "robot parameters": ("explanation/robots.md", robot_parameters),
    "force conditions": ("explanation/forces.md", force_conditions),
    "laws of friction": ("explanation/physics.md", friction_laws),
    "commands": ("reference/commands.md", commands),
    "columns of trials": ("how-to/export.md", trial_columns),
    "columns of imports": ("how-to/import.md", import_columns),
    "export formats": ("how-to/export.md", export_formats),
    "integrity checks": ("how-to/check.md", integrity_checks),
    "loop in short": ("../README.md", loop_in_short),
    "participant parameters": ("explanation/participants-model.md", participant_parameters),
    "partner models": ("explanation/participants-model.md", partner_models),
    "device models": ("explanation/participants-model.md", device_models),
    "messages": ("../src/netboard/network/protocol/PROTOCOL.md", messages),
    "trigger codes": ("how-to/triggers.md", trigger_codes),
    "analysis evidence": ("explanation/analysis-evidence.md", analysis_evidence),
    **study_tables(),
}


def renewed(page: str, name: str, text: str) -> str:
    """Put generated text between its two marks in a page.

    Raises
    ------
    ValueError
        If the page has not exactly one such pair of marks.
    """
    start, end = f"<!-- generated: {name} -->", f"<!-- end of {name} -->"
    if start not in page:
        start, end = f"# generated: {name}\n", f"# end of {name}\n"
    if page.count(start) != 1 or page.count(end) != 1:
        raise ValueError(f"the page must hold {start} and {end} once each")
    before, rest = page.split(start)
    blank = "\n\n" if start.endswith("-->") else "\n"
    return f"{before}{start}{blank}{text}{blank}{end}{rest.split(end)[1]}"


def pages() -> dict[Path, str]:
    """Make every page anew that has generated parts."""
    made: dict[Path, str] = {}
    for name, (file, make) in GENERATED.items():
        path = (DOCS / file).resolve()
        page = made[path] if path in made else path.read_text(encoding="utf-8")
        made[path] = renewed(page, name, make())
    return made


def main(arguments: list[str]) -> int:
    """Write or check."""
    stale = {path: text for path, text in pages().items() if text != path.read_text(encoding="utf-8")}
    checking = "--check" in arguments
    for path, text in stale.items():
        if not checking:
            path.write_text(text, encoding="utf-8", newline="\n")
        sys.stdout.write(f"{path.relative_to(DOCS.parent)}: {'stale; run make docs' if checking else 'written'}\n")
    return 1 if checking and stale else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
