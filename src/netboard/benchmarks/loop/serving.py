"""Resource use of a real server for any number of dyads, with lightweight peers.

Two more processes are its peers (`netboard.benchmarks.loop.crowd`); their orders say which peers, and for how long.
"""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import Config
from netboard.base.errors import NetboardError
from netboard.benchmarks.loop.played import Punctuality, punctuality
from netboard.benchmarks.loop.rig import own_configs, write_configs
from netboard.benchmarks.loop.spreads import Times
from netboard.benchmarks.loop.usage import Cost, read_usage
from netboard.benchmarks.loop.workers import Workers
from netboard.network.transport import sockets
from netboard.nodes.operator.launcher import Launcher
from netboard.nodes.operator.operator import Operator

CROWD = "netboard.benchmarks.loop.crowd"

WARM_SECONDS = 4.0
"""Time for sessions to begin their trials and for agents to adjust their phase, before counting starts [s]."""

START_SECONDS = 120.0
ANSWER_SECONDS = 0.2


@dataclass(frozen=True)
class Company:
    """The peers of a server."""

    agents: bool = True
    loggers: bool = True
    displays: bool = False
    moving: bool = True
    trial: bool = True


@dataclass(frozen=True)
class Served:
    """Resource use and timing of a server.

    - `counts`: frames received by its peers [Hz].
    - `peers_late_ns`: delay of the samples when the peers sent them [ns].
    """

    cost: Cost
    counts: dict[str, float]
    ticks: Punctuality
    active: float
    peers_late_ns: Times


class Crowd(Workers):
    """The two processes that are all peers of a server; leaving the context ends them."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder
        self._agents, self._watchers = (self.start(role, CROWD, role, folder=folder) for role in ("agents", "watchers"))

    def serve(self, config: Config, dyads: int, company: Company, seconds: float) -> Served:
        """Run a server of some dyads with these peers."""
        configs = own_configs(config, self._folder, dyads)
        files = [str(file) for file in write_configs(configs, self._folder)]
        with Launcher(self._folder, {}) as launcher:
            words = [word for file in files for word in ("-c", file)]
            launcher.start("server", "server", *words, *([] if company.trial else ["--no-autostart"]))
            _await_answer(launcher, configs[-1])
            from_ns = now_ns() + round(WARM_SECONDS * 1e9)
            until_ns = from_ns + round(seconds * 1e9)
            order: dict[str, Any] = {"files": files, "from_ns": from_ns, "until_ns": until_ns}
            self._watchers.order(**order, loggers=company.loggers, displays=company.displays)
            if company.agents:
                self._agents.order(**order, moving=company.moving)
            cost, process = Cost(), launcher.process_id("server")
            _sleep_until(from_ns)
            before = read_usage(process)
            _sleep_until(until_ns)
            cost.add(before, read_usage(process))
            seen = self._watchers.answer()
            felt = self._agents.answer() if company.agents else {"counts": {}, "late_ns": []}
            os.kill(process, signal.SIGKILL)  # what it has not recorded was never meant to be
        return Served(
            cost,
            {name: count / seconds for name, count in (seen["counts"] | felt["counts"]).items()},
            punctuality(np.array(seen["late_ns"], np.int64), seen["passed_over"]),
            seen["active"],
            np.array(felt["late_ns"], np.int64),
        )


def _await_answer(launcher: Launcher, config: Config) -> None:
    """Wait until a server answers an operator."""
    until = time.monotonic() + START_SECONDS
    with sockets.open_context() as context:
        operator = Operator(config.network, context)
        while operator.ask(ANSWER_SECONDS) is None:
            if (ended := launcher.ended()) is not None:
                raise NetboardError(str(ended))
            if time.monotonic() > until:
                raise NetboardError(f"the server did not answer within {START_SECONDS:.0f} s")


def _sleep_until(at_ns: int) -> None:
    time.sleep(max(0.0, (at_ns - now_ns()) * 1e-9))
