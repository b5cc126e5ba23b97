"""A station on another machine, through its service: one request at a time, repeated until it is answered.

Nothing here waits. While the station does not answer, `RemoteMachine.trouble` says so, and requests wait.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from netboard.base.clock import now_ns
from netboard.base.config import Config, Side
from netboard.base.errors import WireError
from netboard.base.process.resources import NAME
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.station import ProcessStatus, StationReport, StationRequest
from netboard.network.station_keys import credentials_for
from netboard.network.transport import channels, names, sockets
from netboard.nodes.operator.launcher import STOP_SECONDS

REPORT_NS = 500_000_000
"""Time between two reports [ns]."""

REPEAT_NS = 1_000_000_000
"""Time after which an unanswered request is sent again [ns]."""

SILENCE_NS = 4_000_000_000
"""Silence after which the station counts as unreachable: a busy machine answers within a second [ns]."""


class RemoteMachine:
    """A station's machine, as `netboard.nodes.launching.machines.SessionMachine`."""

    def __init__(
        self, config: Config, side: Side, context: sockets.Context, clock_ns: Callable[[], int] = now_ns
    ) -> None:
        self.side = side
        self.state: dict[str, str] = {}
        self.refused = ""  # why the last request was refused
        self.watched = ""  # the process whose log each report brings
        self._host, port = config.stations.of(side), config.stations.port_of(side)
        self._where = f"{self._host}:{port}"
        security = credentials_for(Path(config.network.keys), side)
        endpoint = channels.station_endpoint(self._host, port, security)
        self._socket = sockets.station_client(context, endpoint, f"server@{NAME}")
        self._clock_ns = clock_ns
        self._requests = deque([StationRequest("report", "")])  # it tells what ended before the first start
        self._sent_ns = self._due_ns = 0
        self._heard_ns = clock_ns()
        self._stopped_ns = 0
        self._awaiting = False
        self._version = ""
        self._statuses: dict[str, ProcessStatus] = {}
        self._earlier: set[tuple[str, int]] = set()  # processes that ended before a start of that name was asked for
        self._logs: dict[str, str] = {}

    @property
    def trouble(self) -> str:
        """Why the station does not answer, or should not be used; empty if all is well."""
        if self._clock_ns() - self._heard_ns > SILENCE_NS:
            why = names.trouble(self._host) or "is it switched on, does netboard station run there with its key?"
            return f"the {self.side} station does not answer at {self._where}: {why}"
        if self._version and self._version != version("netboard"):
            return f"the {self.side} station has netboard {self._version}, this machine {version('netboard')}"
        return self.refused

    @property
    def processes(self) -> Mapping[str, ProcessStatus]:
        """The processes of the station, as of its last report."""
        return self._statuses

    def start(self, name: str) -> None:
        """Ask the station to start a process, unless it runs; an earlier end of it is not shown any more."""
        self._stopped_ns = 0
        self._ask(StationRequest("start", name))
        self._show(list(self._statuses.values()))

    def stop(self, name: str) -> None:
        """Ask the station to stop a process, if it runs."""
        status = self._statuses.get(name)
        if status is not None and status.phase == "running":
            self._stopped_ns = self._stopped_ns or self._clock_ns()
            self._ask(StationRequest("stop", name))

    def hurry(self) -> None:
        """Wait no longer for a station that does not answer."""
        if self._clock_ns() - self._heard_ns > SILENCE_NS:
            self._statuses.clear()

    def poll(self) -> None:
        """Take reports, and send the next request when it is due; forget processes of a station that is gone."""
        now = self._clock_ns()
        while (frame := sockets.receive(self._socket)) is not None:
            try:
                message = decode(frame)
            except WireError as error:
                self.refused = f"the {self.side} station sent no valid report: {error}"
                continue
            if isinstance(message, StationReport):
                self._take(message, now)
        if self._awaiting and now - self._sent_ns > REPEAT_NS:
            self._awaiting = False
        if not self._awaiting and (self._requests or now >= self._due_ns):
            request = self._requests[0] if self._requests else StationRequest("report", self.watched)
            self._sent_ns, self._due_ns = now, now + REPORT_NS
            self._awaiting = sockets.send_or_renew(self._socket, encode(request))
        if self._stopped_ns and now - self._stopped_ns > STOP_SECONDS * 1e9:
            self.hurry()

    def tail(self, name: str) -> str:
        """Return the end of a process's log, as of the last report that had it."""
        return self._logs.get(name, "")

    def close(self) -> None:
        """Close the connection."""
        sockets.close_after_goodbye(self._socket)

    def _ask(self, request: StationRequest) -> None:
        if request not in self._requests:
            self._requests.append(request)

    def _take(self, report: StationReport, now: int) -> None:
        """Store a report; it answers the request that was sent last."""
        self._heard_ns, self._version, self.state = now, report.version, report.machine
        self._logs |= report.logs
        if self._awaiting and self._requests:
            self._requests.popleft()
            self.refused = report.refused
        self._awaiting = False
        self._show(report.processes)

    def _show(self, statuses: Sequence[ProcessStatus]) -> None:
        """Show the states of processes, but no end from before a request to start the process."""
        starting = {request.process for request in self._requests if request.action == "start"}
        over = (status for status in statuses if status.phase in ("stopped", "ended"))
        self._earlier |= {(status.name, status.process_id) for status in over if status.name in starting}
        shown = (status for status in statuses if (status.name, status.process_id) not in self._earlier)
        self._statuses = {status.name: status for status in shown}
