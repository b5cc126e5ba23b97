"""A test case of a fault: the action and the requirement, each as text and as code.

Requirements after every fault are not repeated in the table: no force step above the slew limit, no vertical force
while a trial is paused, every tick recorded or listed as lost with its cause, no recording that `netboard check` calls
damaged, a running trial at the end, and no effect on another dyad on the same server.
"""

from dataclasses import dataclass

from netboard.base.config import Side
from netboard.benchmarks.faults.checks import (
    Check,
    back,
    gentle,
    goes_on,
    neighbour_unmoved,
    no_damage,
    nothing_lost,
    rests,
    whole,
)
from netboard.benchmarks.faults.harm import Act
from netboard.benchmarks.faults.sites import Setup

LEFT, RIGHT, SERVER, LOGGER, DISPLAY = "left agent", "right agent", "server", "logger", "left display"

DYAD = Setup("two dyads on one server", neighbour=True)
SERVED = Setup("one dyad", follow=True)
LOGGED = Setup("one dyad, a log ring of 3 s", settings=("network.log_ring_s=3",))
UNSPILLED = Setup("one dyad, a log ring of 3 s, no spill", ("network.log_ring_s=3", "network.log_spill_mb=0"))
SHOWN = Setup("one dyad with displays, the left one's line through a relay", relayed=(DISPLAY,), displays=True)
RELAYED = Setup(
    "one dyad, its agents through relays, any clock",
    settings=("network.clock_bound_ms=100",),
    relayed=(LEFT, RIGHT),
)
"""No neighbour: the relays are not real-time processes, and two dyads leave them no time on two cores."""

DISTRUSTED = Setup("one dyad, its agents through relays", relayed=(LEFT, RIGHT))
CABLED = Setup("one dyad, real links", spaces=True)
CLOCKED = Setup("one dyad, a wall clock that can be set", wall_clock=True)
SMALL_DISK = Setup("one dyad, a small disk", small_disk=True)
SINGLE = Setup("one dyad")


@dataclass(frozen=True)
class Case:
    """One fault.

    - `expected`: required reaction, as text, in addition to the requirements after every fault.
    - `checks`: the checks of that reaction.
    """

    name: str
    part: str
    done: str
    expected: str
    setup: Setup
    act: Act
    checks: tuple[Check, ...]
    cut: Side | None = None
    alone: bool = False

    @property
    def all_checks(self) -> tuple[Check, ...]:
        """Return every check of this case."""
        return (*self.checks, gentle(self.cut), rests, whole, no_damage, back, neighbour_unmoved)


PARTS = {
    "processes": "Processes killed and stopped",
    "links": "Links cut, slow and lossy",
    "peers": "Unauthorised peers",
    "devices": "Devices that fail",
    "machines": "Clocks and disks",
    "attacks": "Peers that send too much",
}
"""Titles of the tables."""

# What many rows have in common.

PAUSED = "paused, marked, repeated"
REMEMBERED = "the recording has the force that the device was handed meanwhile"
GOES_ON = "the trial goes on, nothing is lost"
FALLS = "both forces fall in time and are zero in time; "
LEFT_FALLS = "the left force falls in time and is zero in time; "

OUTAGE = ("no sample from the left agent", "not armed", "the left agent")
"""Pause reasons of a trial that has lost an agent."""

UNNOTICED: tuple[Check, ...] = (goes_on, nothing_lost)
