"""The processes of one machine, started together and stopped in order.

Nothing is restarted automatically: when a process ends, the others are stopped and the reason is printed. For restarts,
let systemd run each service (docs/how-to/two-stations.md).
"""

import logging
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from netboard.base.config import SIDES, Side
from netboard.base.errors import ConfigError
from netboard.base.process import Stopping, speak
from netboard.base.tables.rig import Network
from netboard.network.transport import channels, sockets
from netboard.nodes.operator.launcher import Ended, Launcher

STOP_ORDER = ("display", "agent", "server", "logger")
"""Nobody must see or feel a server that is gone, and the server's last records must still be written."""

ROUND_SECONDS = 0.1

log = logging.getLogger(__name__)


def processes(
    config: Path | None,
    overrides: Sequence[str],
    *,
    server: bool,
    station: Side | Literal["both"] | None,
    autostart: bool = True,
    insecure: bool = False,
) -> dict[str, list[str]]:
    """Return the commands to run, by the names of their processes, in the order of their start."""
    if not server and station is None:
        raise ConfigError("say what belongs on this machine: --server, --station left|right|both, or both of these")
    sides = [side for side in SIDES if station in (side, "both")]
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


def require_free(network: Network) -> None:
    """Check that no other server is running: logger, agents and displays would join its session."""
    sockets.require_free(channels.addresses(network).listen(channels.MOTION))


def main(wanted: dict[str, list[str]]) -> int:
    """Run processes until stopped or one of them ends; then stop the others."""
    speak("up")
    with Stopping() as stopping, Launcher(None, {}) as launcher:
        for name, command in wanted.items():
            launcher.start(name, *command)
        log.info("started: %s", ", ".join(wanted))
        ended: Ended | None = None
        while not stopping() and ended is None:
            time.sleep(ROUND_SECONDS)
            ended = launcher.ended()
        if ended is not None:
            log.info("%s; stopping the others", ended)
        failed: list[Ended] = []
        for kind in STOP_ORDER:
            failed += launcher.stop(*(name for name in launcher.running() if name.endswith(kind)))
    for one in failed:
        log.error("%s", one)
    return 1 if failed else 0
