"""``netboard station``: the service of a station on another machine than the server's."""

from pathlib import Path

import typer

from netboard.services.loading import load
from netboard.services.options import ConfigFile, HandSide, Offscreen, Overrides, examples, settings_of

app = typer.Typer()


@app.command(epilog=examples("netboard station --side left -c /etc/netboard/netboard.toml"))
def station(
    side: HandSide, config: ConfigFile = None, overrides: Overrides = None, offscreen: Offscreen = False
) -> None:
    """Run the service of a station: the server's machine then starts and stops its agent and display."""
    settings = load(config, overrides)
    from netboard.base.process.display_server import choose_screen
    from netboard.base.process.stopping import Stopping, no_terminal_suspension
    from netboard.base.terminal.logs import log_to_stderr
    from netboard.network.transport import sockets
    from netboard.nodes.launching.machines import LocalMachine, log_folder
    from netboard.nodes.launching.station import StationService, fixed_state, ring_of, station_commands
    from netboard.nodes.operator.launcher import UNBUFFERED, Launcher

    log_to_stderr(f"station {side}")
    ring = ring_of(settings, side)
    if offscreen:
        choose_screen(offscreen)
    commands = station_commands(side, settings_of(config, overrides or ()), offscreen=offscreen)
    with Stopping() as stopping, no_terminal_suspension(), sockets.open_context() as context:
        logs = log_folder(Path("logs"), f"station-{side}")
        with LocalMachine(commands, Launcher(logs, UNBUFFERED)) as machine:
            StationService(settings, side, ring, machine, context, fixed_state()).run(stopping)
