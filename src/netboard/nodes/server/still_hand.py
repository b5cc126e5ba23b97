"""A hand that is held still at height 0: the server itself fills in what an agent would have sent."""

from netboard.base.compiled import Words
from netboard.base.config import SIDES, Side
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK_WORDS
from netboard.nodes.ports.samples import leave_out
from netboard.participants.policy import identity_of
from netboard.participants.seat.body import LEAD_NS

IDENTITY = identity_of("held still")
"""What is recorded of it."""


def fill_still(words: Words, side: Side, tick: int, time_ns: int) -> None:
    """Fill in the sample of a tick: live, at rest, and without any force.

    ``words``: the row of the tick as 64-bit words; a sample of a device that is connected at this side but not in use
    is left out.
    """
    leave_out(words, SIDES.index(side))
    words[TICK_WORDS["tick"]], words[TICK_WORDS["time_ns"]] = tick, time_ns
    words[TICK_WORDS[f"{side}_live"]], words[TICK_WORDS[f"{side}_seq"]] = 1, tick
    words[TICK_WORDS[f"{side}_stamp_ns"]], words[TICK_WORDS[f"{side}_lead_ns"]] = time_ns - LEAD_NS, LEAD_NS
    words[TICK_WORDS[f"{side}_safeguards"]] = int(Safeguard.ARMED)
    words[TICK_WORDS[f"{side}_rendered"]] = 0  # the bits of 0.0, in place of an unknown force
