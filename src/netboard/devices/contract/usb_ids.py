"""USB ids of the devices that people hold: what the backends look for and the doctor knows by name.

Everything that must know them reads them here; deploy/udev/70-netboard.rules, which cannot, has the same, and a test
compares the two.
"""

Ids = tuple[int, int]
"""Vendor and product of a USB device."""

TOUCH: dict[Ids, str] = {
    (0x2988, 0x0302): "Touch (USB)",
    (0x2988, 0x0304): "Touch (HID)",
    (0x0301, 0x2988): "Touch 3D Stylus",
}
"""Devices of the Touch family."""

FALCON: Ids = (0x0403, 0xCB48)
"""The Novint Falcon, or rather the FTDI chip in it."""

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
"""3Dconnexion's devices with six axes."""

DEVICES: dict[Ids, str] = {**TOUCH, FALCON: "Falcon", **SPACEMOUSE}
"""All of them."""
