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
from netboard.services.loading import load
from netboard.services.options import USED_FILE, Insecure, Overrides, examples

if TYPE_CHECKING:
    from netboard.base.tables.rig import Network

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard up --server /etc/netboard/netboard.toml",
        "netboard up --station left /etc/netboard/netboard.toml",
        "netboard up --server --station both",
    ),
)
def up(
    config: Annotated[Path | None, typer.Argument(metavar="CONFIG", help=USED_FILE)] = None,
    station: Annotated[
        Literal["left", "right", "both"] | None, typer.Option(help="Run the agent and the display of this station.")
    ] = None,
    server: Annotated[bool, typer.Option("--server", help="Run the server and the logger.")] = False,
    overrides: Overrides = None,
    autostart: Annotated[bool, typer.Option(help="Start the block as soon as all peers are connected.")] = True,
    insecure: Insecure = False,
) -> None:
    """Start all processes of this machine, and stop them in order on Ctrl-C."""
    settings = load(config, overrides)
    wanted = processes(config, overrides or (), server=server, station=station, autostart=autostart, insecure=insecure)
    from netboard.base.process import Stopping, log_to_stderr, no_terminal_suspension
    from netboard.nodes.operator.launcher import supervise

    log_to_stderr("up")
    address = free_address(settings.network) if server else nullcontext()
    with address, Stopping() as stopping, no_terminal_suspension():
        raise typer.Exit(supervise(wanted, stopping))


def processes(
    config: Path | None,
    overrides: Sequence[str],
    *,
    server: bool,
    station: Literal["left", "right", "both"] | None,
    autostart: bool = True,
    insecure: bool = False,
) -> dict[str, list[str]]:
    """Return the commands to run, by the names of their processes, in the order of their start."""
    if not server and station is None:
        raise ConfigError("up: expected --server, --station left|right|both, or both options")
    sides = [side for side in ("left", "right") if station in (side, "both")]
    common = ["-c", str(config)] if config else []
    common += [word for setting in overrides for word in ("--set", setting)]
    wanted: dict[str, list[str]] = {}
    if server:
        options = ["--autostart" if autostart else "--no-autostart", *(["--insecure"] if insecure else [])]
        wanted["logger"] = ["logger", *common]
        wanted["server"] = ["server", *options, *common]
    for side in sides:
        wanted[f"{side} agent"] = ["agent", "--side", side, *common]
    for side in sides:
        wanted[f"{side} display"] = ["display", "--station", side, *common]
    return wanted


def free_address(network: "Network") -> AbstractContextManager[None]:
    """Hold the server's address; raise an error if another server has it: all processes would join its session."""
    from netboard.network.transport import channels, sockets

    return sockets.free_address(channels.addresses(network).listen(channels.MOTION))
