"""A fake of the module ``hid`` of hidapi: the part of its interface that netboard uses, with simulated devices."""

from collections import deque
from typing import Any


class FakeSpaceMouse:
    """A SpaceMouse; ``path``: its name for hidapi, ``separate_rotation``: rotations have a separate report.

    ``usages``: hidapi knows them.
    """

    def __init__(
        self,
        vendor: int = 0x256F,
        product: int = 0xC635,
        serial: str = "CAP1",
        path: bytes = b"1-2:1.0",
        separate_rotation: bool = True,
        usages: bool = True,
    ) -> None:
        self.ids = (vendor, product)
        self.serial, self.path = serial, path
        self.separate_rotation, self.usages = separate_rotation, usages
        self.plugged = self.permitted = True
        self.lamp = False
        self.opened = 0
        self.reports: deque[list[int]] = deque()

    def push(self, x: int, y: int, z: int, rx: int = 0, ry: int = 0, rz: int = 0) -> None:
        """Queue reports of a push, with the axes and signs of the wire protocol."""
        translation = [byte for word in (x, y, z) for byte in word.to_bytes(2, "little", signed=True)]
        rotation = [byte for word in (rx, ry, rz) for byte in word.to_bytes(2, "little", signed=True)]
        if self.separate_rotation:
            self.reports += [[1, *translation], [2, *rotation]]
        else:
            self.reports.append([1, *translation, *rotation])

    def press(self, buttons: int, size: int = 2) -> None:
        """Queue a report of the pressed buttons."""
        self.reports.append([3, *buttons.to_bytes(size, "little")])

    def entries(self) -> list[dict[str, Any]]:
        """Return what hidapi enumerates: the cap, and an unrelated interface."""
        entry = {
            "path": self.path,
            "vendor_id": self.ids[0],
            "product_id": self.ids[1],
            "serial_number": self.serial,
            "release_number": 0x0100,
            "manufacturer_string": "3Dconnexion",
            "product_string": "SpaceMouse",
            "usage_page": int(self.usages),
            "usage": 8 * self.usages,
            "interface_number": 0,
            "bus_type": 1,
        }
        return [{**entry, "path": self.path + b"x", "usage_page": 0xFF00, "usage": 1}, entry] if self.plugged else []


class device:  # noqa: N801 - as hidapi calls it
    """An open device, as in hidapi."""

    hid: "FakeHid"

    def __init__(self) -> None:
        self._cap: FakeSpaceMouse | None = None

    def open_path(self, path: bytes) -> None:
        caps = [cap for cap in self.hid.caps if cap.path == path and cap.plugged and cap.permitted]
        if not isinstance(path, bytes) or not caps:
            raise OSError("open failed")
        self._cap = caps[0]
        self._cap.opened += 1

    def set_nonblocking(self, flag: int) -> int:
        assert flag == 1
        self._open_cap()
        return 0

    def read(self, max_length: int, timeout_ms: int = 0) -> list[int]:
        cap = self._open_cap()
        assert timeout_ms == 0
        if not cap.plugged:
            raise OSError("read error")
        return cap.reports.popleft()[:max_length] if cap.reports else []

    def write(self, buff: list[int]) -> int:
        cap = self._open_cap()
        if not cap.plugged:
            return -1
        assert buff[0] == 4
        cap.lamp = bool(buff[1])
        return len(buff)

    def close(self) -> None:
        if self._cap is not None:
            self._cap.opened -= 1
            self._cap = None

    def _open_cap(self) -> FakeSpaceMouse:
        if self._cap is None:
            raise ValueError("not open")
        return self._cap


class FakeHid:
    """The module, with the devices that are plugged in."""

    def __init__(self, *caps: FakeSpaceMouse) -> None:
        self.caps = caps
        self.device = type("device", (device,), {"hid": self})

    def enumerate(self, vendor_id: int = 0, product_id: int = 0) -> list[dict[str, Any]]:
        keyboard = {"path": b"1-1:1.0", "vendor_id": 0x046D, "product_id": 0xC31C, "serial_number": ""}
        return [{**keyboard, "usage_page": 1, "usage": 6}, *(entry for cap in self.caps for entry in cap.entries())]
