"""A whole session from a terminal: what is missing is created, everything is started, watched and stopped in order.

Each step is a line with the command that does the same. A process that fails is named with the end of its log. One
Ctrl-C ends everything in order; a second one shortens the wait.
"""

import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import NetboardError
from netboard.base.process.display_server import require_screen
from netboard.base.process.stopping import interrupted_by_stop_signals
from netboard.base.system.supervision import supervision
from netboard.base.terminal.shell import shell_command
from netboard.network.protocol.control import Status
from netboard.network.protocol.station import ProcessStatus
from netboard.network.transport import sockets
from netboard.nodes.launching.kernels import compile_kernels
from netboard.nodes.launching.machines import LocalMachine, SessionMachine, log_folder
from netboard.nodes.launching.preparation import missing_steps
from netboard.nodes.launching.programs import PROGRAMS, process_name
from netboard.nodes.launching.remote import RemoteMachine
from netboard.nodes.launching.session import LaunchedSession, UnaskedEnd
from netboard.nodes.operator.launcher import CHECK_INTERVAL_S, UNBUFFERED, EndedProcess, Launcher
from netboard.nodes.operator.operator import Operator
from netboard.nodes.operator.shell import state_text

HERE = "this machine"
"""Name of the machine on which a session is started."""

LASTING = ("idle", "paused", "finished")
"""Phases that have a line each; the others follow each other too fast."""


@dataclass(frozen=True, slots=True)
class Launch:
    """What is started, and how."""

    config: Config
    blocks: Sequence[Config]  # of the session, whose kernels are compiled first
    settings: Sequence[str]  # options with the configuration, such as -c rig.toml
    here: Sequence[Side]  # sides whose station is this machine
    commands: Mapping[str, Sequence[str]]  # of each process here, in the order of their start


def prepare(launch: Launch, say: Callable[[str, str], object]) -> None:
    """Create what is missing. ``say``: shows a step by its name and in words."""
    for step in missing_steps(launch.config, launch.here, launch.settings):
        step.do()
        say(step.what, f"{step.missing}; created: {step.command}")
    began = time.monotonic()
    with interrupted_by_stop_signals():
        compiled = compile_kernels(launch.config, launch.blocks, launch.here)
    took = f"{time.monotonic() - began:.0f} s"
    say("kernels", f"{compiled} compiled in {took}, and kept for every later start" if compiled else "ready")


def lines_on(console: Console) -> Callable[[str, str], object]:
    """Return a function that prints a line for each step."""

    def say(what: str, words: str) -> None:
        console.print(f"{what:<14} {words}", soft_wrap=True, markup=False, highlight=False)

    return say


def run(launch: Launch, stopping: Callable[[], bool], console: Console) -> int:
    """Prepare and run a session until it ends or is stopped; return 1 if anything failed."""
    windows = [words for words in launch.commands.values() if PROGRAMS[words[0]].window]
    if any("--offscreen" not in words for words in windows):
        require_screen()
    say = lines_on(console)
    prepare(launch, say)
    folder = log_folder(Path(launch.config.recording.directory), "up")
    local = LocalMachine(launch.commands, Launcher(folder, UNBUFFERED))
    with local, sockets.open_context() as context:
        stations = remote_machines(launch.config, launch.here, context)
        places = dict.fromkeys(launch.commands, HERE) | places_at(stations)
        machines: dict[str, SessionMachine] = {HERE: local, **stations}
        session = LaunchedSession(machines, places, lambda end: _show(end, say))
        for name, command in launch.commands.items():
            say(name, shell_command("netboard", *command))
        for name, machine in places_at(stations).items():
            say(name, f"started by the service at the {machine}")
        say("logs", str(folder))
        session.start()
        operator = Operator(launch.config.network, context)
        watch(session, progress(operator), stopping, say)
        operator.leave()
        with suppress(KeyboardInterrupt):  # leaving ends what is left
            end(session, say)
        for station in stations.values():
            station.close()
    failed = failures(session)
    for name, status in failed.items():
        where = local.log_of(name) if places[name] == HERE else f"its log is at the {places[name]}"
        lost = f"the {name} was not started, or its station did not answer"
        words = lost if status is None else str(EndedProcess(name, status.code or 0, ""))
        say("failed", f"{words}: {where}")
    return 1 if failed else 0


def remote_machines(config: Config, here: Collection[Side], context: sockets.Context) -> dict[str, RemoteMachine]:
    """Return the stations on other machines, by name."""
    return {f"{side} station": RemoteMachine(config, side, context) for side in SIDES if side not in here}


def places_at(stations: Mapping[str, RemoteMachine]) -> dict[str, str]:
    """Return the station of each process of a session that runs at one."""
    return {
        process_name(program, station.side): name
        for program in ("agent", "display")
        for name, station in stations.items()
    }


def watch(
    session: LaunchedSession, lines: Iterator[str], stopping: Callable[[], bool], say: Callable[[str, str], object]
) -> None:
    """Watch a session until it is asked to stop, or its server has ended."""
    troubles = dict.fromkeys(session.machines, "")
    while not session.stopping:
        if stopping():
            session.stop()
        session.poll()
        for name, machine in session.machines.items():
            if machine.trouble != troubles[name]:
                troubles[name] = machine.trouble
                say(name, machine.trouble or "answers again")
        if line := next(lines):
            say("session", line)
        time.sleep(CHECK_INTERVAL_S)


def end(session: LaunchedSession, say: Callable[[str, str], object]) -> None:
    """Wait until all processes have ended; a Ctrl-C shortens the wait."""
    say("stopping", ", ".join(session.running) or "everything has ended")
    while not session.over:
        try:
            session.poll()
            time.sleep(CHECK_INTERVAL_S)
        except KeyboardInterrupt:
            session.hurry()


def failures(session: LaunchedSession) -> dict[str, ProcessStatus | None]:
    """Return the processes that have failed, did not end cleanly, or (None) of which no machine knows."""
    found: dict[str, ProcessStatus | None] = {}
    for name in session.places:
        status = session.status(name)
        unclean = status is None or (status.phase == "stopped" and status.code not in (0, supervision.terminated))
        if name in session.broken or unclean:
            found[name] = status
    return found


def progress(operator: Operator) -> Iterator[str]:
    """Yield a line whenever the state of the session has changed, else an empty text."""
    shown = line = ""
    while True:
        try:
            status = operator.poll(trace=False)
        except NetboardError as error:
            status, line = None, str(error)
        if status is not None:
            line = state_line(status)
        yield line if line != shown else ""
        shown = line


def state_line(status: Status) -> str:
    """Return the state of a session in one line."""
    block = f"block {status.block} of {status.blocks}: " if status.blocks > 1 else ""
    if not status.opened:
        return f"{block}the session waits for its form (console, F3)"
    return block + (state_text(status) if status.phase in LASTING else "a trial is running")


def _show(end: UnaskedEnd, say: Callable[[str, str], object]) -> None:
    say("ended", str(end))
    for line in end.log:
        say("", f"| {line}")
