"""``netboard up``: the processes of one machine, started together and stopped in order.

Nothing is restarted automatically: when a process ends, the others are stopped and the reason is printed. For restarts,
let systemd run each service (docs/how-to/two-stations.md).
"""

from collections.abc import Sequence
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
)

if TYPE_CHECKING:
    from netboard.base.tables.rig import Network

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard up --server -c /etc/netboard/netboard.toml",
        "netboard up --server --study paper --dyad 3 -c /etc/netboard/netboard.toml",
        "netboard up --station left -c /etc/netboard/netboard.toml",
        "netboard up --server --station both",
    )
)
def up(
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="The same as --config.")] = None,
    config: ConfigFile = None,
    station: Annotated[
        Literal["left", "right", "both"] | None, typer.Option(help="Run the agent and the display of this station.")
    ] = None,
    server: Annotated[bool, typer.Option("--server", help="Run the server and the logger.")] = False,
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
    """Start all processes of this machine, and stop them in order on Ctrl-C."""
    config = one_file("up", file, config)
    settings = load(config, overrides)
    if (study is not None or resume) and not server:
        raise ConfigError("--study, --resume: found without --server, which runs the session of a study")
    if resume and not yes:
        raise ConfigError("--resume: netboard up cannot ask for a confirmation; add --yes")
    options = []
    if study is not None:
        load_study(study)  # refused before any process starts
        from netboard.nodes.server.planned import StudySession

        options = StudySession(study, dyad, session, seed, blocks, trials).options
    options += (
        ["--resume", "--yes"] * resume + ["--insecure"] * insecure + ["--confirm", confirmation] * bool(confirmation)
    )
    if autostart is not None:
        options.append("--autostart" if autostart else "--no-autostart")
    wanted = processes(
        config, overrides or (), server=options if server else None, station=station, offscreen=offscreen
    )
    from netboard.base.process.stopping import Stopping, no_terminal_suspension
    from netboard.base.terminal.logs import log_to_stderr
    from netboard.nodes.operator.launcher import supervise

    log_to_stderr("up")
    address = free_address(settings.network) if server else nullcontext()
    with address, Stopping() as stopping, no_terminal_suspension():
        raise typer.Exit(supervise(wanted, stopping))


def processes(
    config: Path | None,
    overrides: Sequence[str],
    *,
    server: Sequence[str] | None,
    station: Literal["left", "right", "both"] | None,
    offscreen: bool = False,
) -> dict[str, list[str]]:
    """Return the commands to run, by the names of their processes, in the order of their start.

    ``server``: the server's own options; None to run no server. ``offscreen``: whether displays are drawn off screen.
    """
    if server is None and station is None:
        raise ConfigError("up: expected --server, --station left|right|both, or both options")
    sides = [side for side in ("left", "right") if station in (side, "both")]
    common = ["-c", str(config)] if config else []
    common += [word for setting in overrides for word in ("--set", setting)]
    wanted: dict[str, list[str]] = {}
    if server is not None:
        wanted["logger"] = ["logger", *common]
        wanted["server"] = ["server", *server, *common]
    for side in sides:
        wanted[f"{side} agent"] = ["agent", "--side", side, *common]
    for side in sides:
        wanted[f"{side} display"] = ["display", "--station", side, *["--offscreen"] * offscreen, *common]
    return wanted


def free_address(network: "Network") -> AbstractContextManager[None]:
    """Hold the server's address; raise an error if another server has it: all processes would join its session."""
    from netboard.network.transport import channels, sockets

    return sockets.free_address(channels.addresses(network).listen(channels.MOTION))
