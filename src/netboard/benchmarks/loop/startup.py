"""``netboard bench startup``: how long commands and the processes of a session take until they are ready.

Each is timed in a new process: with an empty cache of compiled kernels, as after an installation or an update, and with
the kernels that the first start has left there. Beside them are programs that only import: Python itself, and the
libraries that no such process can do without. Processor time is that of the process until it is ready, with its
children that have ended; other programs on the machine disturb it less than the elapsed time.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from netboard.base.errors import NetboardError
from netboard.base.system.c_library import clock_ticks_hz
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.rig import Rig
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.network.protocol.control import Status

ROUNDS, QUICK_ROUNDS = 5, 2
"""Starts of each program, in turn [1]."""

LATER_ROUNDS = 3
"""Starts of a session with cached kernels [1]."""

CLI = ("-m", "netboard.services.cli")

BARE, TYPER, LIBRARIES, WINDOWS = "Python alone", "Typer", "Numba, pydantic and ZeroMQ", "these and Qt"
IMPORTED = {
    BARE: "pass",
    TYPER: "import typer",
    LIBRARIES: "import numba, pydantic, zmq",
    WINDOWS: "import numba, pydantic, zmq, PySide6.QtOpenGLWidgets",
}
"""Baselines: programs that only import."""

COMMANDS = {
    "netboard --version": ("--version",),
    "netboard --help": ("--help",),
    "netboard agent --help": ("agent", "--help"),
    "netboard plan list": ("plan", "list"),
}
"""Commands that need no kernel."""

DEMO = ("demo", "--no-displays", "--trials", "1")
"""A newcomer's first command, without windows: it ends after the trial."""

EMPTY, FILLED = "empty", "filled"
"""States of the cache of compiled kernels."""

SERVER = "server"

LONGEST = 900.0
"""Timeout of a process's start: with an empty cache on a busy machine it takes minutes [s]."""


@dataclass(frozen=True, slots=True)
class Start:
    """What a start takes until the program is ready.

    - `elapsed`, `cpu`: elapsed and processor time [s].
    """

    elapsed: float
    cpu: float


def main(options: Options) -> None:
    """Run the benchmark."""
    run("startup", study, options)


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Time commands, then the processes of a session and a demo with an empty and with a filled cache."""
    imports = {name: ("-c", text) for name, text in IMPORTED.items() if name != WINDOWS or find_spec("PySide6")}
    programs = imports | {name: (*CLI, *words) for name, words in COMMANDS.items()}
    times = _in_turn(programs, QUICK_ROUNDS if quick else ROUNDS, tell)
    yield _commands(times)
    with TemporaryDirectory() as name:
        bare = times[LIBRARIES].cpu
        yield _caches("session", "Processes of a session, until the server has them", _sessions(Path(name), tell), bare)
        yield _caches("demo", "A demo of one trial, until it has ended", _demos(Path(name), tell), bare)


def _in_turn(programs: Mapping[str, Sequence[str]], rounds: int, tell: Tell) -> dict[str, Start]:
    """Run each program once, then again in turn; return the medians."""
    found: dict[str, list[Start]] = {name: [] for name in programs}
    for number in range(rounds + 1):  # the first time, Python may compile modules
        for name, words in programs.items():
            tell(name, 0.3 * number / (rounds + 1))
            found[name].append(_run(words, {}))
    return {
        name: Start(median(one.elapsed for one in starts[1:]), median(one.cpu for one in starts[1:]))
        for name, starts in found.items()
    }


def _run(words: Sequence[str], environment: Mapping[str, str], folder: Path | None = None) -> Start:
    """Run a Python program to its end."""
    before, began = os.times(), time.perf_counter()
    command, settings = [sys.executable, *words], {**os.environ, **environment}
    done = subprocess.run(command, env=settings, cwd=folder, capture_output=True, text=True, check=False)
    elapsed, after = time.perf_counter() - began, os.times()
    if done.returncode:
        raise NetboardError(f"{' '.join(words)}: ended with exit code {done.returncode}: {done.stderr[-2000:]}")
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return Start(elapsed, spent)


def _commands(times: Mapping[str, Start]) -> ResultPart:
    part = ResultPart(
        "commands",
        "Commands, from their start to their end: medians",
        "program | elapsed [s] | CPU time [s] | CPU time / Python alone [1] | CPU time / Typer [1]",
    )
    for name, start in times.items():
        part.add(name, start.elapsed, start.cpu, start.cpu / times[BARE].cpu, start.cpu / times[TYPER].cpu)
    return part


def _caches(name: str, title: str, starts: Mapping[str, Mapping[str, Start]], bare: float) -> ResultPart:
    """Return a table of starts with an empty and with a filled cache. ``bare``: CPU time of the libraries alone [s]."""
    part = ResultPart(
        name,
        f"{title}, with an empty and with a filled cache of compiled kernels",
        "process | empty: elapsed [s] | empty: CPU time [s] | filled: elapsed [s] | filled: CPU time [s] | "
        "filled: CPU time / libraries alone [1]",
    )
    for process, first in starts[EMPTY].items():
        later = starts[FILLED][process]
        part.add(process, first.elapsed, first.cpu, later.elapsed, later.cpu, later.cpu / bare)
    return part


def _sessions(place: Path, tell: Tell) -> dict[str, dict[str, Start]]:
    """Start a session with an empty cache, and then with the kernels that this has left there."""
    cache = {"NUMBA_CACHE_DIR": str(place / "session-cache")}
    tell("a session, with an empty cache", 0.35)
    found = {EMPTY: _session(place / "first", cache)}
    later = []
    for number in range(LATER_ROUNDS):
        tell("a session, with a filled cache", 0.5 + 0.05 * number)
        later.append(_session(place / f"later-{number}", cache))
    found[FILLED] = {
        name: Start(median(one[name].elapsed for one in later), median(one[name].cpu for one in later))
        for name in found[EMPTY]
    }
    return found


def _session(folder: Path, environment: Mapping[str, str]) -> dict[str, Start]:
    """Start the processes of a session one after the other; return when each was ready."""
    folder.mkdir()
    arguments = {
        "logger": ("logger", "--once"),
        "agent.left": ("agent", "--side", "left"),
        "agent.right": ("agent", "--side", "right"),
    }
    if find_spec("PySide6"):
        arguments["display.left"] = ("display", "--station", "left", "--offscreen")
    with Rig(folder, ("block.trials=1",), environment) as rig:
        began = time.perf_counter()
        process = rig.start(SERVER, SERVER, "--no-autostart")
        rig.until(lambda status: True, LONGEST)
        found = {SERVER: Start(time.perf_counter() - began, _cpu_time(process.pid))}
        for name, words in arguments.items():
            began = time.perf_counter()
            process = rig.start(name, *words)
            rig.until(lambda status, name=name: _has(status, name), LONGEST)  # type: ignore[misc]
            found[name] = Start(time.perf_counter() - began, _cpu_time(process.pid))
        return found


def _has(status: Status, name: str) -> bool:
    """Return whether the server has a peer."""
    return any(link.peer == name for link in status.links) or any(
        f"display.{one.side}" == name for one in status.displays
    )


def _cpu_time(process: int) -> float:
    """Return the CPU time of a running process, and of its children that have ended [s]."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / clock_ticks_hz()


def _demos(place: Path, tell: Tell) -> dict[str, dict[str, Start]]:
    """Run a demo with an empty cache, and then with its kernels."""
    found = {}
    environment = {"NUMBA_CACHE_DIR": str(place / "demo-cache")}
    for number, state in enumerate((EMPTY, FILLED)):
        tell(
            f"a demo, with an {state} cache" if state == EMPTY else f"a demo, with a {state} cache", 0.7 + 0.2 * number
        )
        found[state] = {"netboard demo": _run((*CLI, *DEMO), environment, place)}
    return found
