"""When an agent arms, disarms and stops its device. Pure; one step for each reading, before the sample is sent.

Rule 1: a pressed stop button is an emergency stop. It lasts until the server knows of it: from then on the server
forbids arming. Only then does the agent disarm, which clears the stop.
Rule 2: a device that is not ready, or without the consent of the hand, is disarmed.
Rule 3: the device is armed only while the server allows it and commands no force, as its heartbeats say. So if the
connection is lost in a trial, the device stays disarmed until the trial has been paused and resumed.
"""

import numpy as np

from netboard.base.compiled import Records, kernel
from netboard.base.safeguards import Safeguard
from netboard.devices.safety.chain import Guard, SafetyChain, Trip, fail, trip

SILENT, FORBIDS, ALLOWS = range(3)
"""What the server's newest message says of arming: nothing, unless it is a heartbeat."""

KNOWN, UNSENT = -1, 2**62
"""Number of the first sample that tells of an emergency stop: of none, or of one that is not sent yet."""

ARMING = np.dtype(
    [
        ("stop_buttons", "<i8"),  # bit masks
        ("consent_buttons", "<i8"),
        # The first sample that tells of an emergency stop that the server may not know yet; or `KNOWN`, `UNSENT`.
        ("stop_seq", "<i8"),
    ]
)
"""State of the arming of one device."""

# Plain integers, which numba folds into the kernels below as constants.
_ARM, _DISARM, _DISARMED = int(Trip.ARM), int(Trip.DISARM), int(Guard.DISARMED)
_STOPPED, _NOT_READY = int(Safeguard.STOPPED), int(Safeguard.NOT_READY)


@kernel
def arm(arming: Records, chain: Records, buttons: int, ready: bool, permission: int, answered_seq: int) -> int:
    """Apply the rules to a reading; return the safeguards.

    ``permission``: of the server, as `SILENT`. ``answered_seq``: number of the newest sample that it has answered.
    """
    a = arming[0]
    if buttons & a["stop_buttons"]:
        fail(chain, _STOPPED)
        a["stop_seq"] = UNSENT
        return 0
    if not ready or buttons & a["consent_buttons"] != a["consent_buttons"]:
        _disarm(arming, chain, answered_seq)
        return _NOT_READY
    if permission == FORBIDS:
        _disarm(arming, chain, answered_seq)
    elif permission == ALLOWS and chain[0]["guard"] == _DISARMED:
        trip(chain, _ARM)
    return 0


@kernel
def _disarm(arming: Records, chain: Records, answered_seq: int) -> None:
    """Disarm, unless that would clear an emergency stop of which the server may not know."""
    a = arming[0]
    if a["stop_seq"] != KNOWN and answered_seq >= a["stop_seq"]:
        a["stop_seq"] = KNOWN
    if a["stop_seq"] == KNOWN:
        trip(chain, _DISARM)


@kernel
def note_stop(arming: Records, seq: int, safeguards: int) -> None:
    """Note that a sample is sent.

    The first one with the pressed button does not tell of the stop: its safeguards are those before it.
    """
    if arming[0]["stop_seq"] == UNSENT and safeguards & _STOPPED:
        arming[0]["stop_seq"] = seq


class Arming:
    """The arming of one device; kernels take its ``state``."""

    def __init__(self, stop_buttons: int, consent_buttons: int) -> None:
        self.state = np.zeros(1, ARMING)
        self.state[0] = stop_buttons, consent_buttons, KNOWN

    def keep_stop(self, safety: SafetyChain) -> None:
        """Stop a new chain, if the server may not know of the emergency stop: it could arm the chain before."""
        if self.state[0]["stop_seq"] != KNOWN:
            safety.stop()
