"""``netboard up``: a whole session with one command, or the processes of one machine.

Without ``--server`` and ``--station`` it starts everything, and what is missing is created first. With them it starts
the processes of this machine and restarts nothing: when one ends, the others are stopped. For restarts, let systemd run
each service (docs/how-to/two-stations.md).
"""

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load, load_study, one_file
from netboard.services.options import (
    Autostart,
    Blocks,
    ConfigFile,
    Confirmation,
    Dyad,
    Insecure,
    Offscreen,
    Overrides,
    Resume,
    SessionNumber,
    SessionOf,
    StudySeed,
    Trials,
    Yes,
    examples,
    settings_of,
)

if TYPE_CHECKING:
    from netboard.base.config import Config
    from netboard.base.tables.rig import Network
    from netboard.nodes.server.planned import StudySession

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard up --study paper --dyad 3",
        "netboard up --study paper --dyad 3 -c /etc/netboard/netboard.toml",
        "netboard up --server -c /etc/netboard/netboard.toml",
        "netboard up --station left -c /etc/netboard/netboard.toml",
    )
)
def up(
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="The same as --config.")] = None,
    config: ConfigFile = None,
    station: Annotated[
        Literal["left", "right", "both"] | None,
        typer.Option(help="Run only the agent and display of this station."),
    ] = None,
    server: Annotated[bool, typer.Option("--server", help="Run only the server and the logger.")] = False,
    console: Annotated[
        bool, typer.Option("--console/--no-console", help="Open the operator's console, if everything is started.")
    ] = True,
    prepare: Annotated[
        bool, typer.Option("--prepare", help="Only create what a whole session lacks, and start nothing.")
    ] = False,
    offscreen: Offscreen = False,
    overrides: Overrides = None,
    autostart: Autostart = None,
    insecure: Insecure = False,
    study: SessionOf = None,
    dyad: Dyad = 1,
    session: SessionNumber = 1,
    seed: StudySeed = 1,
    blocks: Blocks = None,
    trials: Trials = None,
    resume: Resume = False,
    yes: Yes = False,
    confirmation: Confirmation = "",
) -> None:
    """Start a whole session, and stop it in order on Ctrl-C; with --server or --station, only those processes."""
    config = one_file("up", file, config)
    settings = load(config, overrides)
    everything = not server and station is None
    if (study is not None or resume) and station is not None and not server:
        raise ConfigError("--study, --resume: found without --server, which runs the session of a study")
    if prepare and not everything:
        raise ConfigError("--prepare: found with --server or --station, expected neither: it prepares a whole session")
    if resume and not yes:
        raise ConfigError("--resume: netboard up cannot ask for a confirmation; add --yes")
    wanted = None
    if study is not None:
        load_study(study)  # refused before any process starts
        from netboard.nodes.server.planned import StudySession

        wanted = StudySession(study, dyad, session, seed, blocks, trials)
    options = [] if wanted is None else wanted.options
    options += (
        ["--resume", "--yes"] * resume + ["--insecure"] * insecure + ["--confirm", confirmation] * bool(confirmation)
    )
    if autostart is not None:
        options.append("--autostart" if autostart else "--no-autostart")
    from netboard.base.config import SIDES
    from netboard.base.process.stopping import Stopping, no_terminal_suspension
    from netboard.base.terminal.logs import log_to_stderr
    from netboard.nodes.launching.programs import session_commands

    words = settings_of(config, overrides or ())
    sides = [side for side in SIDES if station in (side, "both") or (everything and not settings.stations.of(side))]
    commands = session_commands(
        words,
        sides,
        server=options if server or everything else None,
        trigger=settings.triggers.declared,
        console=console and everything,
        offscreen=offscreen,
    )
    log_to_stderr("up")
    address = nullcontext() if "server" not in commands else free_address(settings.network)
    with address, Stopping() as stopping, no_terminal_suspension():
        if not everything:
            from netboard.nodes.operator.launcher import supervise

            raise typer.Exit(supervise(commands, stopping))
        from netboard.base.terminal.output import plain_console
        from netboard.nodes.launching import terminal

        if not insecure:
            from netboard.network import keys

            keys.refuse_open_network(settings.network)
        launch = terminal.Launch(settings, blocks_of_session(settings, wanted), words, sides, commands)
        if prepare:
            terminal.prepare(launch, terminal.lines_on(plain_console()))
            return
        raise typer.Exit(terminal.run(launch, stopping, plain_console()))


def blocks_of_session(config: "Config", wanted: "StudySession | None") -> list["Config"]:
    """Return the blocks that the server will run; raise an error if the plan does not fit the rig."""
    if wanted is None:
        return [config]
    from netboard.nodes.server.planned import Planned

    planned = Planned(config, load_study(wanted.study, config), wanted)
    return planned.of_session(planned.config.session)


def free_address(network: "Network") -> AbstractContextManager[None]:
    """Hold the server's address; raise an error if another server has it: all processes would join its session."""
    from netboard.network.transport import channels, sockets

    return sockets.free_address(channels.addresses(network).listen(channels.MOTION))
