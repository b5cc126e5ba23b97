"""USB ids of the supported devices, for the backends and the doctor.

deploy/udev/70-netboard.rules repeats these ids, because udev cannot import them; a test compares the two.
"""

Ids = tuple[int, int]
"""Vendor and product id of a USB device."""

TOUCH: dict[Ids, str] = {
    (0x2988, 0x0302): "Touch (USB)",
    (0x2988, 0x0304): "Touch (HID)",
    (0x0301, 0x2988): "Touch 3D Stylus",
}
"""Devices of the Touch family."""

FALCON: Ids = (0x0403, 0xCB48)
"""Novint Falcon (id of its FTDI chip)."""

SPACEMOUSE: dict[Ids, str] = {
    (0x046D, 0xC625): "SpacePilot",
    (0x046D, 0xC626): "SpaceNavigator",
    (0x046D, 0xC627): "SpaceExplorer",
    (0x046D, 0xC629): "SpacePilot Pro",
    (0x046D, 0xC62B): "SpaceMouse Pro",
    (0x256F, 0xC62E): "SpaceMouse Wireless (cable)",
    (0x256F, 0xC632): "SpaceMouse Pro Wireless",
    (0x256F, 0xC633): "SpaceMouse Enterprise",
    (0x256F, 0xC635): "SpaceMouse Compact",
    (0x256F, 0xC638): "SpaceMouse Pro Wireless (Bluetooth)",
    (0x256F, 0xC63A): "SpaceMouse Wireless",
    (0x256F, 0xC641): "SpaceMouse USB",
    (0x256F, 0xC652): "SpaceMouse (Universal Receiver)",
}
"""3Dconnexion devices with six axes."""

DEVICES: dict[Ids, str] = {**TOUCH, FALCON: "Falcon", **SPACEMOUSE}
"""All supported devices."""
