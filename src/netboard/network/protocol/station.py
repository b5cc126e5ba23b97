"""What a machine of a session reports about its processes.

A message is data only; `netboard.network.protocol.messages` holds the rules for all of them.
"""

from typing import NamedTuple


class ProcessStatus(NamedTuple):
    """A process of a session.

    ``phase``: ``running``, ``stopping`` (asked to stop), ``stopped`` (after it was asked), ``ended`` (by itself).
    """

    name: str
    phase: str
    code: int | None
    process_id: int
    seconds: float
    log_bytes: int
