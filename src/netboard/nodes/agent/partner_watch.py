"""Watches a robot partner, whose code is a lab's own: one that is too slow lets go, one that hangs ends its agent.

The loop of the agent cannot do that: it waits for the decision. A thread, of a higher priority, looks every 50 ms
whether the partner is deciding. A decision takes microseconds of each millisecond, so a partner that is found deciding
at most looks needs more time than it has. Looks are counted, not time, so an agent that was stopped for a while finds
nothing.
"""

import logging
import os
import time
from collections import deque
from contextlib import suppress
from threading import Thread
from typing import Protocol, final
from weakref import ref

from netboard.base.process.realtime import above_loop

log = logging.getLogger(__name__)

LOOK_SECONDS, LOOKS = 0.05, 40
"""Interval between two looks [s], and looks by which a partner is judged, two seconds of them [1]."""

TOO_SLOW_SHARE = 0.75
"""Share of the looks that find a partner deciding from which it is too slow [1]."""


class WatchedPartner(Protocol):
    """A device whose stylus a robot partner holds."""

    partner: str

    @property
    def decision(self) -> int | None:
        """Number of the decision that the partner is taking; None if it takes none at this moment."""

    def let_go(self) -> None:
        """Let go of the stylus until the next block."""


@final
class Looks:
    """The newest looks at a partner."""

    def __init__(self) -> None:
        self._found: deque[int | None] = deque(maxlen=LOOKS)

    def add(self, decision: int | None) -> None:
        """Add what a look has found: the number of the decision, or None."""
        self._found.append(decision)

    @property
    def _full(self) -> bool:
        return len(self._found) == LOOKS

    @property
    def hangs(self) -> bool:
        """Whether all of them found the same decision."""
        return self._full and self._found[0] is not None and len(set(self._found)) == 1

    @property
    def too_slow(self) -> bool:
        """Whether most of them found the partner deciding."""
        deciding = sum(found is not None for found in self._found)
        return self._full and deciding >= TOO_SLOW_SHARE * LOOKS


def watch(device: WatchedPartner) -> None:
    """Watch the partner of a device in a thread, for as long as the device exists."""
    Thread(target=_watch, args=(ref(device),), name="partner watch", daemon=True).start()


def _watch(watched: "ref[WatchedPartner]") -> None:
    with suppress(OSError):  # the loop may be real-time while this thread may not
        above_loop()
    looks = Looks()
    while (device := watched()) is not None:
        looks.add(device.decision)
        if looks.hangs:
            _end(device.partner)
        if looks.too_slow:
            device.let_go()
            looks = Looks()
        del device
        time.sleep(LOOK_SECONDS)


def _end(partner: str) -> None:
    """End the process: nothing else stops a decision that hangs. Its devices render no force while a partner plays."""
    log.critical(
        "the robot partner %r has not finished a decision for %g s: its agent ends", partner, LOOKS * LOOK_SECONDS
    )
    logging.shutdown()
    os._exit(1)
