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
    refuse_without_study,
    settings_of,
)

if TYPE_CHECKING:
    from netboard.base.config import Config, Side
    from netboard.base.tables.rig import Network
    from netboard.nodes.launching.terminal import Launch
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
    context: typer.Context,
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
        bool,
        typer.Option(
            "--prepare", help="Only create what a whole session lacks, with all compiled code, and start nothing."
        ),
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
    refuse_without_study(context, study, "dyad", "session", "seed", "blocks", "trials")
    config = one_file("up", file, config)
    settings = load(config, overrides)
    whole = not server and station is None
    of_study, asks = study is not None or resume, resume and not yes
    _refuse_contradictions(of_study=of_study, serves=server or whole, prepare=prepare, whole=whole, asks=asks)
    wanted = None if study is None else _session_of(study, dyad, session, seed, blocks, trials)
    options = _server_options(wanted, autostart, resume=resume, insecure=insecure, confirmation=confirmation)
    words, sides = settings_of(config, overrides or ()), _sides(settings, station, whole=whole)
    from netboard.nodes.launching.programs import session_commands

    commands = session_commands(
        words,
        sides,
        server=options if server or whole else None,
        trigger=settings.triggers.declared,
        console=console and whole,
        offscreen=offscreen,
    )
    launch = None
    if whole:
        from netboard.nodes.launching.terminal import Launch

        launch = Launch(settings, blocks_of_session(settings, wanted), words, sides, commands)
    raise typer.Exit(_run(settings, commands, launch, prepare=prepare, insecure=insecure))


def _refuse_contradictions(*, of_study: bool, serves: bool, prepare: bool, whole: bool, asks: bool) -> None:
    """Refuse options that exclude each other."""
    if of_study and not serves:
        raise ConfigError("--study, --resume: found without --server, which runs the session of a study")
    if prepare and not whole:
        raise ConfigError("--prepare: found with --server or --station, expected neither: it prepares a whole session")
    if asks:
        raise ConfigError("--resume: netboard up cannot ask for a confirmation; add --yes")


def _session_of(
    study: str, dyad: int, session: int, seed: int, blocks: int | None, trials: int | None
) -> "StudySession":
    """Return a session of a study; a study with an error is refused here, before any process starts."""
    load_study(study)
    from netboard.nodes.server.planned import StudySession

    return StudySession(study, dyad, session, seed, blocks, trials)


def _server_options(
    wanted: "StudySession | None", autostart: bool | None, *, resume: bool, insecure: bool, confirmation: str
) -> list[str]:
    """Return the options with which the server runs the session; it asks nothing."""
    options = [] if wanted is None else wanted.options
    options += ["--resume", "--yes"] * resume + ["--insecure"] * insecure
    options += ["--confirm", confirmation] * bool(confirmation)
    if autostart is not None:
        options.append("--autostart" if autostart else "--no-autostart")
    return options


def _sides(config: "Config", station: str | None, *, whole: bool) -> "list[Side]":
    """Return the sides whose agent and display run here: those asked for, or all that no other machine has."""
    from netboard.base.config import SIDES

    return [side for side in SIDES if station in (side, "both") or (whole and not config.stations.of(side))]


def _run(
    config: "Config",
    commands: dict[str, list[str]],
    launch: "Launch | None",
    *,
    prepare: bool,
    insecure: bool,
) -> int:
    """Run or only prepare a whole session, or run the processes of this machine; return the exit code."""
    from netboard.base.process.stopping import Stopping, no_terminal_suspension
    from netboard.base.terminal.logs import log_to_stderr

    log_to_stderr("up")
    address = nullcontext() if "server" not in commands else free_address(config.network)
    with address, Stopping() as stopping, no_terminal_suspension():
        if launch is None:
            from netboard.nodes.operator.launcher import supervise

            return supervise(commands, stopping)
        from netboard.base.terminal.output import plain_console
        from netboard.nodes.launching import terminal

        if not insecure:
            from netboard.network import keys

            keys.refuse_open_network(config.network)
        if not prepare:
            return terminal.run(launch, stopping, plain_console())
        terminal.prepare(launch, terminal.lines_on(plain_console()))
        return 0


def blocks_of_session(config: "Config", wanted: "StudySession | None") -> list["Config"]:
    """Return the blocks that the server will run; raise an error if the plan does not fit the rig."""
    if wanted is None:
        return [config]
    from netboard.nodes.server.planned import Planned

    planned = Planned(config, load_study(wanted.study, config), wanted)
    return planned.of_session(planned.config.session)


def free_address(network: "Network") -> AbstractContextManager[None]:
    """Hold the server's address; raise an error if another server has it: all processes would join its session."""
    from netboard.network.transport import addresses, channels

    return addresses.free_address(channels.addresses(network).listen(channels.MOTION))
