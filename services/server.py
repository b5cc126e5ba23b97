"""``netboard server``: the physics server, for one or several dyads, or for a session of a study."""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load, load_study
from netboard.services.options import (
    USED_FILE,
    Autostart,
    Blocks,
    Confirmation,
    Dyad,
    Insecure,
    Overrides,
    Resume,
    SessionNumber,
    SessionOf,
    StudySeed,
    Trials,
    Yes,
    examples,
    refuse_without_study,
)

if TYPE_CHECKING:
    from netboard.base.config import Config
    from netboard.network.transport.authenticator import Authenticator
    from netboard.nodes.server.attempts import Attempts
    from netboard.nodes.server.blocks import BlockSequence

app = typer.Typer()
log = logging.getLogger(__name__)


@app.command(
    epilog=examples(
        "netboard server",
        "netboard server -c rig.toml --no-autostart",
        "netboard server -c rig.toml --study paper --dyad 3",
        "netboard server -c rig.toml --study paper --dyad 3 --resume",
        "netboard server -c a.toml -c b.toml",
    )
)
def server(
    context: typer.Context,
    config: Annotated[
        list[Path] | None,
        typer.Option(
            "--config",
            "-c",
            metavar="FILE",
            help=f"{USED_FILE} Repeat for several dyads, each with its own port in its file.",
        ),
    ] = None,
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
    """Run the physics server: it simulates the board and runs the trials."""
    refuse_without_study(context, study, "dyad", "session", "seed", "blocks", "trials")
    settings = [load(file, overrides) for file in config or (None,)]
    _refuse_rigs(settings, insecure=insecure)
    if study is None and resume:
        raise ConfigError("--resume: needs --study; a single block cannot be resumed")
    found = None if study is None else load_study(study, settings[0])
    if study is not None and len(settings) > 1:
        raise ConfigError(f"--study: found {len(settings)} configuration files, expected one: run a server per dyad")
    from netboard.base.terminal.logs import log_to_stderr
    from netboard.nodes.server.stand_ins import require_known

    if confirmation:
        require_known(confirmation)
    from netboard.network import keys

    authenticators = [keys.make_authenticator(one.network) for one in settings]
    log_to_stderr("server")
    log.info("preparing every block")
    if study is None or found is None:
        single_blocks = [_single_block(one) for one in settings]
        raise typer.Exit(
            serve(single_blocks, authenticators, autostart=autostart is not False, confirmation=confirmation)
        )
    from netboard.nodes.server.planned import Planned, StudySession, confirm

    planned = Planned(settings[0], found, StudySession(study, dyad, session, seed, blocks, trials))
    opened = planned.resume(confirm(yes)) if resume else planned.begin()
    raise typer.Exit(serve([opened], authenticators, autostart=autostart is True, confirmation=confirmation))


def _refuse_rigs(settings: "Sequence[Config]", *, insecure: bool) -> None:
    """Refuse rigs whose trigger box this machine does not know, or whose network is open without that word."""
    from netboard.devices.triggers import registry as trigger_boxes
    from netboard.network import keys

    for one in settings:
        trigger_boxes.require_known(one.triggers)
        if not insecure:
            keys.refuse_open_network(one.network)


def _single_block(config: "Config") -> "tuple[BlockSequence, Attempts]":
    """Return the only block of a configuration; refuse the pseudonyms of another dyad in a real session."""
    from netboard.nodes.server.attempts import Attempts
    from netboard.nodes.server.blocks import BlockSequence
    from netboard.nodes.server.pseudonyms import require_own_pseudonyms, uses_in

    require_own_pseudonyms(config.session, uses_in(Path(config.recording.directory)) if config.session.real else ())
    return BlockSequence([config]), Attempts()


def serve(
    sessions: Sequence[tuple["BlockSequence", "Attempts"]],
    authenticators: Sequence["Authenticator | None"],
    *,
    autostart: bool,
    confirmation: str = "",
) -> int:
    """Serve sessions until all have ended; return 1 if some records may not be on disk."""
    from netboard.base.process.realtime import Priority, cpus_for, io_priority, prepare
    from netboard.base.process.stopping import Stopping, no_terminal_suspension
    from netboard.base.system.c_library import allow_files
    from netboard.network.transport import sockets
    from netboard.nodes.server.server import Server

    allow_files()
    wanted = sessions[0][0].block.config.realtime  # real-time settings apply to the process
    granted = prepare(wanted, Priority.SERVER, cpus_for("server", wanted))
    io_thread = io_priority(granted, Priority.SERVER)
    network = sockets.open_context(io_thread, best_effort=True, loop_priority=Priority.SERVER)
    with Stopping() as stopping, no_terminal_suspension(), network as context:
        server = Server(sessions, context, authenticators, autostart=autostart, confirmation=confirmation)
        server.run(stopping, granted)
    return 0 if server.everything_recorded else 1
