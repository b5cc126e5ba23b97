"""Test site of a fault: a rig, and whatever else the fault needs.

That may be a relay on a peer's line, real links between stations, an adjustable wall clock, a small disk, or a second
dyad on the same server that must not be affected. A `Setup` lists these parts; cases with the same setup can run in one
site.
"""

import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

from evidence.faults import links, wall_clock
from evidence.faults.relay import Relay, relay_to_server
from evidence.faults.rigs import tampered, until_forces
from netboard.base.config import SIDES, Side
from netboard.benchmarks.harness.rig import Rig, Route, add_dyad_keys
from netboard.network import keys
from netboard.network.transport.ports import free_port

PACE = (
    *("task.level_time=0.05", "task.level_angle_deg=5.0", "task.level_rate_deg_s=30.0", "block.trials=10000"),
    *("safety.arm_time=0.2", "virtual.resolution=0", "virtual.friction=0"),
)
"""Settings for trials that start at once and never end the block, with full forces from the beginning, so that there is
always a force to check; and for devices without friction and encoder steps, so that consecutive forces differ. No limit
of the safety chain is changed."""

START_S = 300.0
"""Timeout for a site to start, including kernel compilation [s]."""

GUESTS = "guests"
"""Name of the folder with a dyad's keys for outside processes."""

DISK_BYTES = 300_000_000
"""Size of a small disk, slightly above what a logger needs to begin [bytes]."""


@dataclass(frozen=True)
class Setup:
    """Parts of a site.

    - `neighbour`: a second dyad on the same server, except in the short form.
    - `follow`: whether the logger continues with the next session of the server.
    """

    name: str
    settings: tuple[str, ...] = ()
    relayed: tuple[str, ...] = ()
    displays: bool = False
    neighbour: bool = False
    namespaces: bool = False
    wall_clock: bool = False
    small_disk: bool = False
    follow: bool = False
    keyed: bool = False

    def refusal(self) -> str:
        """Return why this machine cannot provide such a site, or an empty string."""
        asked: list[tuple[bool, Callable[[], str]]] = [
            (self.namespaces, links.refusal),
            (self.wall_clock, wall_clock.refusal),
            (self.small_disk, _disk_refusal),
        ]
        return next((reason for wanted, ask in asked if wanted and (reason := ask())), "")


@dataclass
class Site:
    """A rig and its surroundings."""

    setup: Setup
    rig: Rig
    relays: dict[str, Relay] = field(default_factory=dict)
    neighbour: Rig | None = None
    namespaces: links.Namespaces | None = None
    clock: wall_clock.WallClock | None = None
    quick: bool = False

    @property
    def rigs(self) -> list[Rig]:
        """Return the rigs of all dyads."""
        return [self.rig] if self.neighbour is None else [self.rig, self.neighbour]

    def start(self) -> None:
        """Start everything and wait until a trial runs."""
        self.restart("server")
        for rig in self.rigs:
            rig.start("logger", *self._logger())
            rig.start_stations(self.setup.displays)
        for rig in self.rigs:
            until_forces(rig, START_S)

    def restart(self, process: str) -> None:
        """Restart a process of the affected dyad, or the server of all dyads."""
        match process.split():
            case ["server"]:
                others = [word for rig in self.rigs[1:] for word in ("-c", str(rig.file))]
                self.rig.start("server", "server", *others, *(["--insecure"] if self.setup.namespaces else []))
            case ["logger"]:
                self.rig.start("logger", *self._logger())
            case [side, "display"]:
                self.rig.start(process, "display", "--station", side)
            case [side, _]:
                self.rig.start(process, "agent", "--side", side)

    def _logger(self) -> tuple[str, ...]:
        return ("logger",) if self.setup.follow else ("logger", "--once")

    def sleep(self, seconds: float, quick: float | None = None) -> None:
        """Sleep, for a shorter time in the short form [s]."""
        time.sleep(quick if self.quick and quick is not None else seconds)

    def end(self) -> None:
        """Kill every process that still runs."""
        for rig in self.rigs:
            rig.end()

    def finish(self) -> None:
        """Shut the sessions down in order."""
        for rig in reversed(self.rigs):
            rig.ask_to_end()
        self.rig.wait("server")
        for rig in self.rigs:
            if self.setup.follow:
                rig.stop("logger")
            else:
                rig.wait("logger")


@contextmanager
def open_site(setup: Setup, folder: Path, *, quick: bool) -> Iterator[Site]:
    """Create a site without running processes."""
    (folder / "a").mkdir(parents=True)
    settings, environment = tampered((folder / "a").resolve())
    with ExitStack() as stack:
        namespaces = stack.enter_context(links.Namespaces()) if setup.namespaces else None
        clock = wall_clock.WallClock(folder) if setup.wall_clock else None
        if setup.small_disk:
            stack.enter_context(_mounted(folder / "a" / "recordings"))
        if setup.keyed:
            settings += (f"network.keys={_keys(folder / 'a')}",)
        port = free_port()
        settings += (*PACE, f"network.port={port}", *_address(namespaces), *setup.settings)
        relays = {name: stack.enter_context(relay_to_server(port)) for name in setup.relayed}
        routes = {name: Route("127.0.0.1", relay.port) for name, relay in relays.items()}
        if namespaces is not None:
            routes |= {f"{side} agent": namespaces.route(side, port) for side in SIDES}
        rig = Rig(folder / "a", settings, environment | (clock.environment if clock else {}), routes)
        site = Site(setup, stack.enter_context(rig), relays, None, namespaces, clock, quick)
        if setup.neighbour and not quick:
            site.neighbour = stack.enter_context(_neighbour(folder / "b"))
        yield site


def _keys(folder: Path) -> Path:
    """Create the keys of a dyad, and equally valid ones for guests."""
    made = (folder / "keys").resolve()
    keys.init(made)
    for destination in (made, folder / GUESTS):
        add_dyad_keys(made, destination)
    return made


def _neighbour(folder: Path) -> Rig:
    folder.mkdir()
    settings, environment = tampered(folder.resolve())
    return Rig(folder, (*settings, *PACE, "session.name=S02", "session.dyad=D02"), environment)


def _address(namespaces: links.Namespaces | None) -> tuple[str, ...]:
    """Return the settings of a server that other hosts can reach."""
    if namespaces is None:
        return ()
    return f"network.host={links.SERVER}", f"network.bind={links.SERVER}", "network.curve=off"


def side_of(process: str) -> Side:
    """Return the side of a process from its name: ``left agent`` is on the left."""
    return cast("Side", process.split(maxsplit=1)[0])


@contextmanager
def _mounted(folder: Path) -> Iterator[None]:
    """Mount a small disk on a new folder."""
    folder.mkdir()
    links.run_command("mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "none", str(folder))
    try:
        yield
    finally:
        links.run_command("umount", "-l", str(folder))


def _disk_refusal() -> str:
    """Return why no small disk can be mounted here, or an empty string."""
    test = subprocess.run(["unshare", "-m", "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True, check=False)
    return "disks cannot be mounted here" if test.returncode else ""
