"""Conditions under which a block can begin and a trial can continue, with reasons for operators and the recording.

It only reads other parts of the session, with one exception: a gap in time is reported once, then cleared.
"""

from netboard.base.config import SIDES
from netboard.nodes.ports import emergency, samples
from netboard.nodes.ports.emergency import EmergencyStop
from netboard.nodes.ports.ports import Ports
from netboard.nodes.server.blocks import PreparedBlock
from netboard.nodes.server.operators import Operators
from netboard.nodes.server.tick_clock import TickClock


class Readiness:
    """Checks what a block and a running trial need."""

    def __init__(self, ports: Ports, operators: Operators, emergency_stop: EmergencyStop, clock: TickClock) -> None:
        self._motion, self._log = ports.motion, ports.log
        self._operators, self._emergency_stop, self._clock = operators, emergency_stop, clock

    def find_missing(self, block: PreparedBlock, resting: bool, now_ns: int) -> tuple[str, ...]:
        """Return what is missing before the block can begin.

        ``resting``: whether the block must wait until the rest before it is over.
        """
        lacking = [*self._motion.find_missing(now_ns, block.people), *block.delays.lacking]
        if block.config.network.require_logger and not self._log.loggers:
            lacking.append("the logger")
        if self._emergency_stop.halted:
            lacking.append(emergency.LACKING)
        if resting:
            lacking.append("the rest to be over")
        return tuple(lacking)

    def trouble(self, block: PreparedBlock, found: int, now_ns: int) -> str:
        """Return why a running trial cannot continue; empty if it can."""
        if self._emergency_stop.halted:
            return self._emergency_stop.halted
        if not self._operators.armed:
            return "the operator has disarmed the devices"
        if self._clock.gap:
            return self._clock.take_gap()
        for place, side in enumerate(SIDES):
            if not found & (samples.LIVE << place):
                return f"no sample from the {side} agent"
            if not found & (samples.ARMED << place):
                return f"the {side} device is not armed{self._emergency_stop.why(side, now_ns)}"
        if block.delays.trouble:
            return block.delays.trouble
        return self._log.trouble if block.config.network.require_logger else ""
