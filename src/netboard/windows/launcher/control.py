"""The launcher's work, without a window: choose a session, prepare it, start, watch and stop its processes.

Nothing here waits: `LauncherControl.poll` is called ten times a second. Preparations run as a process of their own.
"""

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Annotated

from pydantic import StrictBool

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.looks import ThemeName
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.base.terminal.shell import shell_command
from netboard.network.protocol.station import ProcessStatus
from netboard.network.transport import sockets
from netboard.nodes.launching.machines import (
    LocalMachine,
    SessionMachine,
    device_conflict,
    log_folder,
    log_size,
    log_tail,
)
from netboard.nodes.launching.programs import command_of, process_name, session_commands
from netboard.nodes.launching.remote import RemoteMachine
from netboard.nodes.launching.session import LaunchedSession, UnaskedEnd
from netboard.nodes.launching.terminal import HERE, places_at, remote_machines
from netboard.nodes.operator.launcher import CHECK_INTERVAL_S, UNBUFFERED, Launcher
from netboard.nodes.operator.operator import Operator
from netboard.nodes.ports.emergency import AWAITING_RELEASE, STOP
from netboard.nodes.server.planned import Planned, StudySession
from netboard.task.studies.study import Study
from netboard.windows.launcher.model import LaunchFacts, LaunchStage, Notices, edited_while_running
from netboard.windows.launcher.session_files import FileLooks, SessionFiles

PREPARATION, CHECK, ANALYSIS = "preparation", "check", "analysis"
CONFIRM_NS = 500_000_000
"""Timeout for the confirmation of an emergency stop [ns]."""


@dataclass(frozen=True, slots=True)
class SessionChoice:
    """What is run: a session of a study, on a rig."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    rig: Annotated[str, about("configuration file of the rig; empty: the defaults, with simulated devices")] = ""
    study: Annotated[str, about("a built-in study or a study file; empty: a single block of the rig")] = "paper"
    dyad: Annotated[int, about("number of the dyad, from 1 without gaps", "1", ge=1, le=10_000)] = 1
    session: Annotated[int, about("number of the session in the dyad's plan", "1", ge=1, le=100)] = 1
    seed: Annotated[int, about("random seed of the study's plan", "1", ge=0, lt=2**31)] = 1
    resume: Annotated[StrictBool, about("true: resume the session where it was interrupted")] = False


@dataclass(frozen=True, slots=True)
class LauncherMemory:
    """What the launcher remembers for the next time."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    session: SessionChoice = field(default_factory=SessionChoice)


@dataclass(frozen=True, slots=True)
class FileReaders:
    """How files are read; the command gives it."""

    config: Callable[[Path | None], Config]
    study: Callable[[str, Config], Study]


class LauncherControl:
    """Runs one session at a time. ``offscreen``: whether windows are drawn where nobody sees them.

    ``theme``: that of the console.
    """

    def __init__(
        self,
        choice: SessionChoice,
        reading: FileReaders,
        *,
        offscreen: bool = False,
        theme: ThemeName = "system",
        launcher: Callable[[Path, dict[str, str]], Launcher] = Launcher,
    ) -> None:
        self.choice, self.notices = choice, Notices()
        self.stage = LaunchStage.IDLE
        self.config = Config()
        self.problem = ""
        self.study: Study | None = None
        self._reading, self._offscreen, self._theme, self._launcher = reading, offscreen, theme, launcher
        self._stack = ExitStack()
        self._context = self._stack.enter_context(sockets.open_context())
        self._local: LocalMachine | None = None
        self._stations: dict[str, RemoteMachine] = {}
        self._session: LaunchedSession | None = None
        self._operator: Operator | None = None
        self._heard_ns = self._stop_ns = 0
        self._files, self._looks = SessionFiles(), FileLooks()
        self._edited = False  # whether an edit of the study was explained
        self.choose(choice)

    # --- the choice ----------------------------------------------------------------------------------------------

    def choose(self, choice: SessionChoice) -> None:
        """Take a choice, and find out whether it can be started; refused while a session runs."""
        if self.stage is not LaunchStage.IDLE:
            self.say("A session is running, and keeps its choice; choose again when it has ended.", stays=True)
            return
        self.choice, self.problem, self.study = choice, "", None
        try:
            self.config = self._reading.config(Path(choice.rig) if choice.rig else None)
            if choice.study:
                self.study = self._reading.study(choice.study, self.config)
                Planned(self.config, self.study, self.wanted)
        except NetboardError as error:
            self.problem = str(error)
        self._forget_stations()
        if self._local is not None:
            self._local.commands = self.commands()

    @property
    def wanted(self) -> StudySession:
        """The session of the study."""
        return StudySession(self.choice.study, self.choice.dyad, self.choice.session, self.choice.seed)

    @property
    def here(self) -> list[Side]:
        """Sides whose station is this machine."""
        return [side for side in SIDES if not self.config.stations.of(side)]

    def commands(self) -> dict[str, list[str]]:
        """Return the commands that this machine runs, by process: those of the session, then tasks.

        It looks for the folder of the next analysis.
        """
        recordings, results = self.config.recording.directory, str(self.results)
        return self._commands() | {ANALYSIS: command_of(ANALYSIS, "", (), recordings=recordings, results=results)}

    def _commands(self) -> dict[str, list[str]]:
        """Return all of these but the analysis, without a look at the disk."""
        settings = ["-c", self.choice.rig] if self.choice.rig else []
        study = self.wanted.options if self.choice.study else []
        resume = ["--resume", "--yes"] * self.choice.resume
        found = session_commands(
            settings,
            self.here,
            server=[*study, *resume],
            trigger=self.config.triggers.declared,
            console=True,
            offscreen=self._offscreen,
        )
        found["console"] += [] if self._theme == "system" else ["--theme", self._theme]
        found[PREPARATION] = command_of(PREPARATION, "", settings, study)
        found["doctor"] = command_of("doctor", "", settings)
        for side in self.here:
            found[process_name("device test", side)] = command_of("device test", side, settings)
        recordings = self.config.recording.directory
        found[CHECK] = command_of(CHECK, "", (), recordings=recordings)
        return found

    @property
    def results(self) -> Path:
        """Folder of the next analysis."""
        folder = Path(self.config.recording.directory)
        return next(path for number in count(1) if not (path := folder / f"results_{number}").exists())

    @property
    def last_report(self) -> Path | None:
        """Report of the newest analysis."""
        found = Path(self.config.recording.directory).glob("results*/report.html")
        return max(found, key=lambda path: path.stat().st_mtime, default=None)

    # --- processes -----------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Create what is missing; the session then starts by itself."""
        if self.stage is not LaunchStage.IDLE:
            self.say("A session is running already; stop it first (F4).", stays=True)
            return
        self.choose(self.choice)  # the files may have changed since, and the processes read them now
        if self.problem:
            self.say(self.problem, stays=True)
        elif self.run(PREPARATION):
            self.stage = LaunchStage.PREPARING

    def run(self, name: str) -> bool:
        """Start a process or a task by its name; return whether it was started."""
        if refused := device_conflict(name, self.processes):
            self.say(f"{name}: {refused}", stays=True)
            return False
        try:
            machine = self._machine_of(name)
            if name in self.places and self._session is not None:
                self._session.restart(name)
            else:
                machine.start(name)
        except (NetboardError, OSError) as error:
            self.say(f"{name}: {error}", stays=True)
            return False
        self.say(f"{name} started:  {self.command_line(name)}", stays=False)
        return True

    def end(self, name: str) -> None:
        """Ask a process to stop."""
        status = self.processes.get(name)
        if status is None or status.phase != "running":
            self.say(f"The {name} does not run.", stays=False)
            return
        self._ask_to_stop(name)
        self.say(f"{name} was asked to stop", stays=False)

    def stop(self) -> None:
        """Stop everything in order; a second time, without waiting long. It is never refused."""
        if self.stage is LaunchStage.STOPPING and self._session is not None:
            self._session.hurry()
        for name, status in self.processes.items():
            if name not in self.places and status.phase == "running":
                self._ask_to_stop(name)
        if self._session is not None:
            self._session.stop()
            self.stage = LaunchStage.STOPPING
        else:
            self.stage = LaunchStage.IDLE

    def emergency_stop(self) -> None:
        """Set all forces to zero, now and until the server confirms it. It is never refused."""
        if self._operator is None:
            self.say(
                "No server runs here, so no force is commanded. Let go of the styluses if one is felt.", stays=True
            )
            return
        self._stop_ns = self._stop_ns or now_ns()
        self._operator.command(STOP)

    def poll(self) -> None:
        """Find out how everything is, and do what follows."""
        for machine in self._machines.values():
            machine.poll()
        if self.stage is LaunchStage.PREPARING:
            self._after_preparation()
        if self._session is not None:
            self._session.poll()
            if self._session.stopping:
                self.stage = LaunchStage.STOPPING
            if self._session.over:
                self._finish()
        self._files.poll()
        if self._operator is not None:
            self._ask_server(self._operator)

    def end_all(self) -> None:
        """Stop everything, and wait until it has ended, as when the window is closed."""
        self.stop()
        while self.stage is not LaunchStage.IDLE:
            self.poll()
            time.sleep(CHECK_INTERVAL_S)

    def close(self) -> None:
        """Close all connections; what still runs here is ended."""
        self._leave_server()
        self._files.close()
        self._looks.close()
        if self._local is not None:
            self._local.__exit__()
        self._forget_stations()
        self._stack.close()

    # --- what is shown -------------------------------------------------------------------------------------------

    @property
    def places(self) -> Mapping[str, str]:
        """The machine of each process of the session."""
        local = session_commands((), self.here, server=(), trigger=self.config.triggers.declared, console=True)
        elsewhere = {f"{side} station": side for side in SIDES if side not in self.here}
        far = {process_name(program, side): at for program in ("agent", "display") for at, side in elsewhere.items()}
        return dict.fromkeys(local, HERE) | far

    @property
    def tasks(self) -> Mapping[str, str]:
        """The machine of each task."""
        local = [name for name in (*self._commands(), ANALYSIS) if name not in self.places]
        stations = [side for side in SIDES if side not in self.here]
        far = {f"{side} {task}": f"{side} station" for side in stations for task in ("doctor", "device test")}
        return dict.fromkeys(local, HERE) | far

    @property
    def processes(self) -> dict[str, ProcessStatus]:
        """The state of all processes that were started."""
        found: dict[str, ProcessStatus] = {}
        for machine in self._machines.values():
            found |= machine.processes
        return found

    def facts(self) -> LaunchFacts:
        """Return everything that the window shows."""
        operator = self._operator
        return LaunchFacts(
            self.stage,
            self.problem,
            self.places,
            self.tasks,
            self.processes,
            frozenset() if self._session is None else frozenset(self._session.broken),
            {name: machine.trouble for name, machine in self._stations.items()},
            None if operator is None else operator.status,
            (now_ns() - self._heard_ns) * 1e-9,
            self._files.size,
        )

    def station_states(self) -> dict[str, dict[str, str]]:
        """Return the state of the machine of each station that runs elsewhere."""
        return {name: machine.state for name, machine in self._stations.items()}

    def watch_stations(self) -> None:
        """Connect to the stations, to see their machines before a session."""
        if not self._stations and any(side not in self.here for side in SIDES):
            try:
                self._stations = remote_machines(self.config, self.here, self._context)
            except (ConfigError, OSError) as error:
                self.say(str(error), stays=True)

    def log_of(self, name: str) -> str:
        """Return the end of a process's log as it is now."""
        machine = self._machine_with(name)
        return "" if machine is None else machine.tail(name)

    def shown_log_of(self, name: str) -> str:
        """Return the end of a process's log as of the last look, which delays nothing."""
        for machine in self._machines.values():
            if isinstance(machine, RemoteMachine):
                machine.watched = name if name in machine.processes else ""
        found = self._machine_with(name)
        if isinstance(found, LocalMachine):
            path = found.log_of(name)
            return self._looks.newest(("end", path), partial(log_tail, path), "")
        return "" if found is None else found.tail(name)

    def command_line(self, name: str) -> str:
        """Return the command that does the same as a button."""
        command = (self.commands() if name == ANALYSIS else self._commands()).get(name)
        return (
            f"done by the service at the {self.tasks.get(name) or self.places[name]}"
            if command is None
            else _line(command)
        )

    def say(self, words: str, *, stays: bool) -> None:
        """Show a notice: a refusal or a fault stays until it is read."""
        self.notices.add(words, time.monotonic(), stays=stays)

    # --- within --------------------------------------------------------------------------------------------------

    @property
    def _machines(self) -> dict[str, SessionMachine]:
        local: dict[str, SessionMachine] = {} if self._local is None else {HERE: self._local}
        return local | dict(self._stations)

    def _machine_with(self, name: str) -> SessionMachine | None:
        """Return the machine on which a process was started; None if it was not."""
        return next((machine for machine in self._machines.values() if name in machine.processes), None)

    def _log_size(self, path: Path) -> int:
        """Return the size of a log as of the last look [bytes]."""
        return self._looks.newest(("size", path), partial(log_size, path), 0)

    def _machine_of(self, name: str) -> SessionMachine:
        """Return the machine on which a process runs, ready to start it."""
        place = {**self.tasks, **self.places}[name]
        if place != HERE:
            self.watch_stations()
            if place not in self._stations:
                raise NetboardError(f"the {place} cannot be used without its key")
            return self._stations[place]
        if self._local is not None:
            self._local.commands = self.commands()  # each analysis has a folder of its own
        else:
            folder = log_folder(Path(self.config.recording.directory), "launch")
            self._local = LocalMachine(self.commands(), self._launcher(folder, UNBUFFERED), self._log_size)
        return self._local

    def _ask_to_stop(self, name: str) -> None:
        """Ask a process to stop where it runs, which another choice may have changed since."""
        for machine in self._machines.values():
            if name in machine.processes:
                machine.stop(name)

    def _after_preparation(self) -> None:
        """Start the session when its preparation has succeeded."""
        status = self.processes[PREPARATION]
        if status.phase in ("running", "stopping"):
            return
        if status.code != 0:
            self.stage = LaunchStage.IDLE
            lines = self.log_of(PREPARATION).strip().splitlines() or ["it said nothing"]
            self.say(f"The preparation failed: {lines[-1]}", stays=True)
            return
        self.watch_stations()
        if any(side not in self.here for side in SIDES) and not self._stations:
            self.stage = LaunchStage.IDLE
            return
        assert self._local is not None
        places = {name: at for name, at in self.places.items() if at == HERE} | places_at(self._stations)
        machines: dict[str, SessionMachine] = {HERE: self._local, **self._stations}
        self._session = LaunchedSession(machines, places, self._ended)
        self._files.begin(Path(self.config.recording.directory), Path(self.choice.study))
        self._edited = False
        self._session.start()
        self._operator = Operator(self.config.network, self._context)
        self.stage = LaunchStage.RUNNING
        self.say("Everything is started.", stays=False)

    def _ended(self, end: UnaskedEnd) -> None:
        words = "\n".join((str(end), *end.log[-3:]))
        self.say(words[:1].upper() + words[1:], stays=end.failed)

    def _finish(self) -> None:
        """Forget a session that has ended; its logs stay visible."""
        self._leave_server()
        self._session = None
        self.stage = LaunchStage.IDLE
        self.choice = replace(self.choice, resume=False)
        self.say("Everything has ended.", stays=False)

    def _ask_server(self, operator: Operator) -> None:
        try:
            if operator.poll(trace=False) is not None:
                self._heard_ns = now_ns()
        except NetboardError as error:
            self.say(str(error), stays=True)  # a stop is repeated all the same
        if operator.status is not None and AWAITING_RELEASE in operator.status.waiting_for:
            self._stop_ns = 0
        if self._stop_ns:
            operator.command(STOP)
            if now_ns() - self._stop_ns > CONFIRM_NS:
                self.say("The server has not confirmed the emergency stop: LET GO OF THE STYLUSES.", stays=True)
        if not self._edited and (words := edited_while_running(*self._files.studies, self.choice.study)):
            self.say(words, stays=True)
            self._edited = True

    def _leave_server(self) -> None:
        if self._operator is not None:
            self._operator.leave()
            self._operator = None
            self._stop_ns = 0  # an unconfirmed stop is not for the server of the next session

    def _forget_stations(self) -> None:
        for station in self._stations.values():
            station.close()
        self._stations = {}


def _line(command: list[str]) -> str:
    return shell_command("netboard", *command)
