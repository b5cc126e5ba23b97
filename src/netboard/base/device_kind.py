"""What a hand holds: the kinds of devices, and what stands in for a device, a person or a screen, in words.

A backend's entry in `netboard.devices.contract.registry` declares its kind. The agent states it with model and serial
number in the details of its `Hello`, which the recording keeps; `held_by` reads them for all that show a device.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import NamedTuple

MAX_CHARACTERS = 64
"""Longest text of a peer that a status repeats [1]."""


class DeviceKind(StrEnum):
    """Kinds of devices."""

    HAPTIC = "haptic"
    INPUT = "input"
    POINTER = "pointer"
    SIMULATED = "simulated"
    PLAYBACK = "playback"
    ROBOT = "robot"
    UNDECLARED = "undeclared"


WORDS = {
    DeviceKind.HAPTIC: "haptic device",
    DeviceKind.INPUT: "device without force feedback",
    DeviceKind.POINTER: "mouse pointer, no device",
    DeviceKind.SIMULATED: "simulated, no device",
    DeviceKind.PLAYBACK: "recorded movements, no device",
    DeviceKind.ROBOT: "robot partner, no device",
    DeviceKind.UNDECLARED: "device of undeclared kind",
}
"""Text of each kind."""

STAND_INS = {
    DeviceKind.INPUT: "without force",
    DeviceKind.POINTER: "mouse pointer",
    DeviceKind.SIMULATED: "simulated",
    DeviceKind.PLAYBACK: "playback",
    DeviceKind.ROBOT: "robot partner",
    DeviceKind.UNDECLARED: "undeclared",
}
"""Kinds that stand in for a haptic device, in the words that confirm them; `INPUT` only where haptic feedback is on."""

KINDS_BEFORE = {
    "falcon": DeviceKind.HAPTIC,
    "mouse": DeviceKind.POINTER,
    "openhaptics": DeviceKind.HAPTIC,
    "playback": DeviceKind.PLAYBACK,
    "spacemouse": DeviceKind.INPUT,
    "virtual": DeviceKind.SIMULATED,
}
"""Kinds of the backends in recordings from before agents stated the kind of their device."""

MOVED_BY_SERVER = {"robot": "robot partner, moved by the server", "still": "held still by the server"}
"""Text of each hand that no agent moves, by its mover in ``[block]``. The server moved robots in recordings from before
agents did."""

HIDDEN, HIDDEN_TEXT = "hidden", "not shown, because the block is blinded"
"""Kind and text of what each hand holds in a blinded block."""

SEATED = "seated"
"""Detail of an agent whose stylus the robot partner of a block holds: its own device comes back with another block."""

UNMEASURED = {"profile_calibrated": "never calibrated", "profile_identified": "mass not identified"}
"""Details of an agent that say when its device was measured, each with the text where it never was."""


class HeldDevice(NamedTuple):
    """The device at one side."""

    kind: DeviceKind
    model: str  # of a robot partner its name
    serial: str
    remark: str  # what of a haptic device was never measured; empty otherwise

    @property
    def text(self) -> str:
        """All of it in one line, such as ``haptic device: Touch, serial 1234 (never calibrated)``."""
        named = ", ".join(filter(None, (self.model, self.serial and f"serial {self.serial}")))
        return f"{WORDS[self.kind]}: {named or 'model not stated'}" + (f" ({self.remark})" if self.remark else "")

    def stand_in(self, *, haptics: bool) -> str:
        """Return in which way it stands in for a haptic device; empty if it is one, or if none is needed."""
        return "" if self.kind is DeviceKind.INPUT and not haptics else STAND_INS.get(self.kind, "")


def held_by(details: Mapping[str, str]) -> HeldDevice:
    """Return the device that an agent describes in the details of its `Hello`."""
    stated = details.get("kind", KINDS_BEFORE.get(details.get("device", ""), ""))
    kind = DeviceKind(stated) if stated in set(DeviceKind) else DeviceKind.UNDECLARED
    haptic = kind is DeviceKind.HAPTIC
    remark = ", ".join(text for key, text in UNMEASURED.items() if haptic and not details.get(key))
    shown = ("partner", "") if kind is DeviceKind.ROBOT else ("model", "serial")
    model, serial = (details.get(key, "")[:MAX_CHARACTERS] for key in shown)
    return HeldDevice(kind, model, serial, remark)


def device_stand_in(side: str, words: str) -> str:
    """Return the words that confirm what stands in for the device of a side."""
    return f"{side} device {words}"


def display_stand_in(side: str) -> str:
    """Return the words that confirm a display whose window nobody sees."""
    return f"{side} display off screen"
