"""Every printed table, on narrow and wide terminals: rows stay distinguishable when cells are cut."""

import ast
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from io import StringIO
from math import nan
from pathlib import Path

import numpy as np
import pytest
from rich.cells import cell_len
from rich.console import Console, RenderableType
from typer.testing import CliRunner

import netboard
import rehearsed
from netboard import services
from netboard.base.finding import Finding
from netboard.base.terminal.output import GAP, WIDEST_NAMES, FittedTable
from netboard.benchmarks.harness.results import ResultPart, show
from netboard.devices.contract.device import Reading
from netboard.devices.contract.profile import Placement
from netboard.devices.setup.identification import Identified
from netboard.devices.setup.listing import BackendState, DeviceListing, ListedDevice
from netboard.devices.setup.words import (
    findings_table,
    identified_table,
    listing_tables,
    placement_table,
    reading_table,
)
from netboard.network.protocol.codec import decode
from netboard.network.protocol.control import LinkStatus
from netboard.nodes.operator.status_table import status_tables
from netboard.nodes.rehearsal import session as rehearsal
from netboard.nodes.rehearsal.jobs import BlockResult
from netboard.recording.replay.text import quality_table
from netboard.services import power
from netboard.services.cli import app
from netboard.task.studies import library
from netboard.task.trials.quality import FLAGS, Verdict
from netboard.task.trials.state_machine import Cause

pytestmark = pytest.mark.slow

WIDTHS = (80, 120)
LONG = "bimanual, haptics on, stiffness 1200 N/m, board of 0.85 kg"
ADVICE = "write a rule for udev, reload the rules, and plug the device in again; " * 3
PEERS = ("agent.left", "agent.right", "display.left", "display.left", "display.right", "console", "console", "logger")
ESTIMATE = (0.0421, 0.0013)
UNBALANCED = 'orders.main = "3 duo"\n[kinds.duo]\n[factors.f]\nlevels.a = {}\nlevels.b = {}\n'
DATA = Path(__file__).parent.parent / "data"
POWER = json.loads((DATA.parent.parent / "docs" / "data" / "power.json").read_text())
RUNNER = CliRunner()
assert rehearsal.console.width  # imported here, because a console keeps the width of COLUMNS at its creation

RESULT = BlockResult("S01", 1, LONG, "bimanual", "full", 30, 17, 4.567, 456_789, 3.2, False, "")
RESULTS = [
    replace(RESULT, session=f"S{session:02}", block=block, label=f"{LONG}, {level}", given_up=block == 2)
    for session in (1, 2)
    for block, level in enumerate(("light", "heavy", "light again"), start=1)
]
VERDICTS = [Verdict(trial, attempt, 0, 1, Cause.FELL, nan, tuple(FLAGS)) for trial in (1, 12) for attempt in (1, 2, 3)]
LISTING = DeviceListing(
    devices=(
        *(
            ListedDevice("Touch (formerly PHANTOM Omni)", f"2011270{k}", f"0483:572{k}", f"usb 1-{k}", ("pyusb",))
            for k in "123"
        ),
        ListedDevice("Falcon", "", "0403:cb48", "usb 2-1", ("pyusb", "hidapi"), ("/dev/bus/usb/002/003",)),
    ),
    backends=(BackendState("openhaptics", ADVICE), BackendState("falcon", "")),
    remarks=(),
)
FINDINGS = [Finding(f"timer slack of process {k}", "yellow", "50 us, expected 1 us", ADVICE) for k in range(3)]
PART = ResultPart(
    "forces",
    "What a force condition costs [N]",
    ("condition of force and method of integration", "seconds", "what happens", "error [m]"),
    [(f"{LONG} {k}", 1.234567, "rests", 1e-12) for k in range(5)],
)


def printer_of(renderable: RenderableType) -> Callable[[int], str]:
    """Return a function that prints on a terminal of a given width."""

    def print_at(width: int) -> str:
        console = Console(width=width, file=StringIO(), record=True)
        console.print(renderable)
        return console.export_text()

    return print_at


def runner_of(*words: str, code: int = 0) -> Callable[[int], str]:
    """Return a function that runs a command in a terminal of a given width."""

    def print_at(width: int) -> str:
        result = RUNNER.invoke(app, words, env={"COLUMNS": str(width), "NO_COLOR": "1"})
        assert result.exit_code == code, result.output
        return result.output

    return print_at


def shown_part(width: int) -> str:
    console = Console(width=width, file=StringIO(), record=True)
    show(console, PART)
    return console.export_text()


def status() -> RenderableType:
    """A server with two displays at one station, and two consoles."""
    golden = decode((DATA / "frames" / "status.bin").read_bytes())
    links = tuple(
        LinkStatus(
            peer, f"haptics-laboratory-{number}:47{number}", "0.2.0.dev12", 0.0123, 0.000431, 0.000217, nan, 999.8, 1234
        )
        for number, peer in enumerate(PEERS)
    )
    return status_tables(replace(golden, links=links))  # type: ignore[type-var]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of recordings whose names differ only at their ends, hand tables and an unbalanced study."""
    created = tmp_path_factory.mktemp("printed")
    (created / "rec").mkdir()
    for end in ("practice", "test"):
        rehearsed.write(created / "rec" / f"{'S01_D03_2026-11-22_' * 3}{end}.mcap", rehearsed.rows())
        columns = np.stack([np.arange(201) / 1000, *np.zeros((4, 201))], 1)
        np.savetxt(
            created / f"{end}.csv", columns, delimiter=",", header="t,z_left,v_left,z_right,v_right", comments=""
        )
    (created / "uneven.toml").write_text(UNBALANCED)
    return created


def late_recording(folder: Path) -> Path:
    """A recording with several episodes of each of two causes."""
    path, rows = folder / "late.mcap", rehearsed.rows()
    for at in (700, 710, 720):
        rows["late_ns"][at] = 5_000_000
        rows["left_loop_ns"][at + 100] += 5_000_000
    rows["left_stamp_ns"] -= rows["tick"] % 2  # otherwise it looks like a robot's
    return path if path.exists() else rehearsed.write(path, rows)


def cases(folder: Path) -> list[Callable[[int], str]]:
    """Functions that print each command's output and each table at a given width."""
    recording = str(min((folder / "rec").iterdir()))
    keys = ("--set", f'network.keys="{folder}"')
    overwrite = ("--output", f"{folder}/all/", "--force")
    RUNNER.invoke(app, ["keys", "init", *keys])
    for role in ("logger", "console", "listener"):
        RUNNER.invoke(app, ["keys", "add", role, *keys])
    return [
        printer_of(status()),
        printer_of(rehearsal.table_of(RESULTS)),
        printer_of(quality_table(VERDICTS)),
        printer_of(listing_tables(LISTING)),
        printer_of(findings_table("This computer", FINDINGS)),
        printer_of(identified_table("Touch", Identified(*[ESTIMATE] * 6, 1e-5, 0.05, 7))),
        printer_of(placement_table("Touch", Placement())),
        printer_of(reading_table("Touch", Reading(0, 0.1, 0.2, 0.3, 0.0, 0.0, -0.1, 1, ready=True))),
        shown_part,
        *(printer_of(power.table_of(part)) for part in POWER["parts"]),
        runner_of("info", recording),
        runner_of("sessions", str(folder / "rec")),
        runner_of("whatif", recording, "--set", "physics.k_h=400"),
        runner_of("replay", recording, "--markers"),
        runner_of(
            "trace",
            str(late_recording(folder)),
            "--scheduler",
            str(Path(__file__).parent.parent / "data/sched_switch.txt"),
        ),
        runner_of("simulate", "--input", f"{folder}/test.csv", "--output", f"{folder}/out.csv", "--force"),
        runner_of("simulate", *("--input", f"{folder}/test.csv", "--input", f"{folder}/practice.csv"), *overwrite),
        runner_of("keys", "list", *keys),
        runner_of("participants", "draw"),
        runner_of("plan", "list"),
        runner_of("plan", "check", f"{folder}/uneven.toml", code=2),
        *(runner_of("plan", "show", "--study", name, "--dyads", "4", "--dyad", "2") for name in library.NAMES),
    ]


def table_makers() -> set[str]:
    """Return every function of the source that creates a table."""
    found = set()
    for root in (Path(netboard.__file__).parent, Path(services.__file__).parent):
        for path in root.rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.FunctionDef) and any(map(_makes, ast.walk(node))):
                    found.add(f"{path.name}: {node.name}")
    return found


def _makes(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == FittedTable.__name__


@pytest.mark.parametrize(
    ("module", "name"), [("output.py", "rich.table"), ("bars.py", "BarColumn"), ("output.py", " Console(")]
)
def test_tables_progress_bars_and_terminals_are_made_in_one_module_each(module: str, name: str) -> None:
    for root in (Path(netboard.__file__).parent, Path(services.__file__).parent):
        for path in root.rglob("*.py"):
            assert (name in path.read_text(encoding="utf-8")) == (path.name == module), path


def test_results_are_printed_with_three_digits() -> None:
    part = {"columns": ("key", "correlation", "runs"), "rows": [["kp", 0.5732246465306207, 12345]], "title": "recovery"}
    console = Console(width=80, file=StringIO())
    console.print(power.table_of(part))
    assert console.file.getvalue().split()[-3:] == ["kp", "0.573", "12345"]  # type: ignore[attr-defined]


def test_every_printed_table_keeps_its_rows_distinguishable(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tables: list[FittedTable] = []
    creators: set[str] = set()
    make = FittedTable.__init__

    def record_table(self: FittedTable, *columns: object, **options: object) -> None:
        make(self, *columns, **options)  # type: ignore[arg-type]
        caller = sys._getframe(1).f_code
        creators.add(f"{Path(caller.co_filename).name}: {caller.co_name}")
        tables.append(self)

    monkeypatch.setattr(FittedTable, "__init__", record_table)
    monkeypatch.chdir(folder)
    for case in cases(folder):
        for width in WIDTHS:
            output = case(width)
            assert "\N{HORIZONTAL ELLIPSIS}" not in output, output
    assert creators >= table_makers()
    for table in tables:
        for width in WIDTHS:
            require_distinguishable_rows(table, width)


def require_distinguishable_rows(table: FittedTable, width: int) -> None:
    """Require that each row shows its names, whole or wrapped, and no broken number."""
    output = printer_of(table)(width)
    words, names = set(output.split()), table.names
    assert all(cell_len(line.rstrip()) <= width for line in output.splitlines()), output
    widest = [
        max((cell_len(line) for row in table.rows for line in row[index].plain.split("\n")), default=0)
        for index in range(names)
    ]
    fits = sum(widest) + GAP * names <= round(width * WIDEST_NAMES)
    for row in table.rows:
        for index, cell in enumerate(row):
            lines = cell.plain.splitlines()
            if table.columns[index].number:
                assert all(line in output for line in lines), output
            if index < names and fits:
                assert all(line.strip() in output for line in lines), output
                assert words >= set(cell.plain.split()), output
