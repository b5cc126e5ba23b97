"""The safeguards of a safety chain, as bits of a sample, and the texts of those that stop the forces."""

from enum import IntFlag


class Safeguard(IntFlag):
    """Actions of the agent's safety chain since the previous sample, and its state.

    Attributes
    ----------
    ARMED
        Forces from the server are rendered.
    RAMPING
        Armed recently: forces from the server are rendered in part.
    CLAMPED
        A force was larger than the limit.
    SLEWED
        A force changed faster than the limit.
    STALE
        The last force is too old: it fades.
    TOO_FAST
        The stylus was faster than the limit: no force.
    NOT_FINITE
        A force or a reading was not a finite number: no force.
    DEVICE_LOST
        The device does not answer.
    WORN
        The motors have reached their limit of mean force: the force is reduced for a while.
    STOPPED
        An emergency stop at the device: no force.
    NOT_READY
        The device is not calibrated, not in a hand or outside of its workspace: no force.
    """

    ARMED = 1
    RAMPING = 2
    CLAMPED = 4
    SLEWED = 8
    STALE = 16
    TOO_FAST = 32
    NOT_FINITE = 64
    DEVICE_LOST = 128
    WORN = 256
    STOPPED = 512
    NOT_READY = 1024


TRIP_CAUSES = {
    Safeguard.STALE: "no fresh force from the server",
    Safeguard.TOO_FAST: "the stylus was too fast",
    Safeguard.NOT_FINITE: "a force or a reading was not a number",
    Safeguard.DEVICE_LOST: "the device does not answer",
    Safeguard.WORN: "the mean-force limit of the motors is reached",
    Safeguard.STOPPED: "emergency stop at the device",
    Safeguard.NOT_READY: "the device is not calibrated, not in a hand, or outside of its workspace",
}
"""Safeguards that are reported as events when they begin, with the text of each."""

PARTNER_LET_GO = "the robot partner has let go of the stylus; the log of its agent says why"
"""Text of `Safeguard.NOT_READY` at a device whose stylus a robot partner holds."""
