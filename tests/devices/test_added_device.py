"""The backend that docs/how-to/add-a-device.md shows: it passes the contract, with a vendor's library made here."""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from netboard.base.config import Config
from netboard.devices.contract.device import Device
from netboard.testing.device import DeviceContract

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "add-a-device.md"


class Arm:
    """A device that does not move, and can be unplugged."""

    serial, there = "1234", True

    def __init__(self) -> None:
        self.set = (0.0, 0.0, 0.0)

    def state(self) -> tuple[float, ...]:
        self.answer()
        return 0.0, 0.01, 0.02, 0.0, 0.0, 0.0

    def force(self, *force: float) -> None:
        self.answer()
        self.set = force

    def answer(self) -> None:
        if not Arm.there:
            raise OSError("no such device")

    def buttons(self) -> int:
        return 0

    def homed(self) -> bool:
        return True

    def disconnect(self) -> None:
        """Leave the force as it is: zero, unless it was unreachable."""


class TestAddedDevice(DeviceContract):
    @pytest.fixture(autouse=True)
    def vendor(self, monkeypatch: pytest.MonkeyPatch) -> None:
        vendor = ModuleType("vendor")
        vendor.connect = self.connect  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "vendor", vendor)
        monkeypatch.setattr(Arm, "there", True)

    def connect(self, serial: str) -> Arm:
        self.arm = Arm()
        self.arm.answer()
        return self.arm

    def make(self, config: Config) -> Device:
        (code,) = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
        page = ModuleType("mydevice")
        names: dict[str, Any] = page.__dict__
        exec(code, names)
        made: Device = names["MyDevice"]("left", config)
        return made

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        x, y, z = self.arm.set
        return x, y, z

    def unplug(self, device: Device) -> Callable[[], None]:
        Arm.there = False

        def plug_in() -> None:
            Arm.there = True

        return plug_in
