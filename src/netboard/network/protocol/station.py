"""Messages of a station's service: what it is asked for, and how its machine and its processes are.

A message is data only; `netboard.network.protocol.messages` holds the rules for all of them.
"""

from dataclasses import dataclass
from typing import NamedTuple

ACTIONS = ("report", "start", "stop")
"""What a station can be asked for."""


class ProcessStatus(NamedTuple):
    """A process of a session: an item of `StationReport.processes`."""

    name: str
    phase: str
    code: int | None
    process_id: int
    seconds: float
    log_bytes: int


@dataclass(frozen=True, slots=True)
class StationRequest:
    """A request of the server's machine to a station; each is answered by a `StationReport`.

    Attributes
    ----------
    action : str
        ``report``; ``start`` or ``stop`` a process.
    process : str
        Name of one of the processes that the station declares, such as ``left agent``. With ``report``, the end of its
        log is wanted; empty for none.
    """

    action: str
    process: str


@dataclass(frozen=True, slots=True)
class StationReport:
    """How a station is.

    Attributes
    ----------
    side : str
        Side of the station.
    version : str
        Version of netboard at the station.
    machine : dict of str
        State of its machine in words, by what it is about.
    processes : tuple of ProcessStatus
        For each that was started: name; ``running``, ``stopping`` (asked to stop), ``stopped`` (after it was asked) or
        ``ended`` (by itself); exit code, None while it runs; process id [1]; time since its start [s]; size of its log
        in bytes [1].
    logs : dict of str
        End of the log of each process that has failed, and of the one in the request.
    refused : str
        Why the request was not carried out; empty if it was.
    """

    side: str
    version: str
    machine: dict[str, str]
    processes: tuple[ProcessStatus, ...]
    logs: dict[str, str]
    refused: str
