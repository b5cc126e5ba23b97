"""The commands that a session consists of, or that an operator runs beside it.

``netboard up``, the station service and the launcher's window start exactly these: a name is looked up here, and a
request never contains a command line.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from netboard.base.config import SIDES, Side
from netboard.base.errors import ConfigError
from netboard.base.nearest import one_of


@dataclass(frozen=True, slots=True)
class Program:
    """A command of netboard."""

    name: str
    text: str  # what it does, for operators
    words: tuple[str, ...]  # of the command line after "netboard"; {side} and folders are replaced
    sided: bool = False  # whether each side has its own
    window: bool = False  # whether it needs a screen
    task: bool = False  # whether it ends by itself


PROGRAMS = {
    program.name: program
    for program in (
        Program("logger", "writes the recordings", ("logger",)),
        Program("server", "simulates the board and runs the trials", ("server",)),
        Program("trigger", "gives TTL pulses for events of the session", ("trigger",)),
        Program("agent", "reads the device and renders the force", ("agent", "--side", "{side}"), sided=True),
        Program("display", "shows the board to a participant", ("display", "--station", "{side}"), True, window=True),
        Program("console", "the operator's window", ("console",), window=True),
        Program("doctor", "checks whether the machine is fit for a session", ("doctor", "--quick"), task=True),
        Program(
            "device test",
            "measures rate, noise and range of the device for ten seconds; it renders no force",
            ("devices", "test", "--side", "{side}", "--yes"),
            sided=True,
            task=True,
        ),
        Program("preparation", "creates what a session lacks", ("up", "--prepare"), task=True),
        Program(
            "check",
            "checks the recordings, and computes every tick again",
            ("check", "{recordings}", "--verify"),
            task=True,
        ),
        Program("analysis", "analyses the recordings", ("analyse", "{recordings}", "-o", "{results}"), task=True),
    )
}
"""All programs by name, those of a session in the order in which they start."""

AT_A_STATION = ("agent", "display", "doctor", "device test")
"""Programs that a station's service runs."""


def process_name(program: str, side: Side | Literal[""] = "") -> str:
    """Return the name of a program's process, such as ``left agent``."""
    return f"{side} {program}" if PROGRAMS[program].sided else program


def command_of(
    program: str, side: Side | Literal[""], settings: Sequence[str], options: Sequence[str] = (), **folders: str
) -> list[str]:
    """Return the words of a program's command line.

    ``settings``: its configuration, as ``-c FILE``. ``folders``: those of recordings and results, where it has them.
    """
    if program not in PROGRAMS:
        raise ConfigError(f"{program}: no such program, expected {one_of(program, PROGRAMS)}")
    return [*(word.format(side=side, **folders) for word in PROGRAMS[program].words), *options, *settings]


def session_commands(
    settings: Sequence[str],
    sides: Iterable[Side],
    *,
    server: Sequence[str] | None,
    trigger: bool = False,
    console: bool = False,
    offscreen: bool = False,
) -> dict[str, list[str]]:
    """Return the commands of a session on one machine, by process, in the order of their start.

    ``sides``: stations on this machine. ``server``: options of the server; None to run no server. ``trigger``: whether
    the rig has a trigger box, which is at the server's machine. ``offscreen``: whether windows are drawn off screen.
    """
    here = [side for side in SIDES if side in set(sides)]
    wanted: list[tuple[str, Side | Literal[""]]] = [("logger", ""), ("server", "")] if server is not None else []
    wanted += [("trigger", "")] if trigger and server is not None else []
    wanted += [(program, side) for program in ("agent", "display") for side in here]
    wanted += [("console", "")] if console else []
    commands = {}
    for program, side in wanted:
        options = [*(server or ())] if program == "server" else []
        options += ["--offscreen"] * (offscreen and PROGRAMS[program].window)
        commands[process_name(program, side)] = command_of(program, side, settings, options)
    return commands
