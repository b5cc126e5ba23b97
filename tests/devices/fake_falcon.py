"""A simulated Falcon at pyusb's backend interface, below the real pyusb.

`Falcon` is the device: an FTDI chip with its requests and packets, behind it the boot loader, and the firmware once it
is loaded. `Bus` is the backend that pyusb calls. If the set-up is wrong, this Falcon does not respond, like a real one.
"""

import errno
from array import array
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import usb.backend
import usb.core

from netboard.devices.falcon import kinematics

PAYLOAD = 62
FIRMWARE = bytes(range(256)) * 3 + b"the end"
LANGUAGES, PRODUCT, SERIAL = 0, 2, 3
ENDPOINTS = (0x81, 0x02)


class Falcon:
    """One device; ``loaded``: its firmware is loaded already, ``homed``: its encoders are homed."""

    def __init__(self, serial: str = "FALCON1", loaded: bool = True, homed: bool = True) -> None:
        self.serial = serial
        self.loaded = loaded
        self.homed = (homed,) * 3
        self.powered = self.plugged = True
        self.permitted = True
        self.used_by_another = False
        self.has_driver = True
        self.claimed = False
        self.place = kinematics.CENTRE
        self.buttons = 0
        self.commands = (0, 0, 0)
        self.flags = 0
        self.frames = 0
        self.firmware = FIRMWARE
        self.wrong_echoes = 0  # number of wrong echoes left
        self.runs = True  # whether the loaded file is working firmware
        self.chunk = PAYLOAD
        self.corrupt: Callable[[bytes], bytes] = bytes  # corruption of a response on the line
        self.requests: list[tuple[int, int]] = []
        self.setting: dict[int, int] = {}
        self.modem_lines = 0
        self._received = bytearray()
        self._pending = bytearray()
        self._image = bytearray()
        self._loading = False

    @property
    def force(self) -> tuple[float, float, float]:
        """Force on the hand in the scene's frame, by the principle of virtual work [N]."""
        torque = np.array(self.commands) * -1e-4
        columns = np.array(kinematics.jacobian(kinematics.inverse(self.place), self.place))
        right, up, out = np.linalg.solve(columns, torque)
        return float(out), float(right), float(up)

    def unplug(self) -> None:
        """Pull the USB plug; the power supply stays connected."""
        self.plugged = self.claimed = False
        self.commands = (0, 0, 0)

    def plug_in(self) -> None:
        """Replug USB; the kernel's driver claims the device first."""
        self.plugged = self.has_driver = True

    def switch_off(self) -> None:
        """Disconnect the power supply."""
        self.powered = self.loaded = False

    def switch_on(self) -> None:
        """Reconnect the power supply; the homing is lost."""
        self.powered = True
        self.homed = (False,) * 3

    def request(self, request: int, value: int) -> None:
        """Handle a control request to the chip."""
        self.requests.append((request, value))
        if request == 0 and value == 1:
            self._pending.clear()
        elif request == 0 and value == 2:
            self._received.clear()
        elif request == 1:
            previous = self.modem_lines
            mask = value >> 8
            self.modem_lines = (previous & ~mask) | (value & mask)
            if self.modem_lines & 1 and not previous & 1:  # DTR from low to high resets it into its boot loader
                self.loaded = self._loading = False
        else:
            self.setting[request] = value

    def write(self, data: bytes) -> None:
        """Receive bytes from the host."""
        if not self.powered:
            return
        self._received += data
        if self.loaded:
            self._respond()
        else:
            self._boot()

    def read(self) -> bytes:
        """Return a packet: the line status, then pending bytes."""
        payload = bytes(self._pending[: self.chunk])
        del self._pending[: self.chunk]
        return b"\x31\x60" + payload

    def _respond(self) -> None:
        """Respond to complete frames, as the firmware does."""
        if self.setting.get(3) != 0x2:
            return
        while (begin := self._received.find(b"<")) >= 0 and len(self._received) >= begin + 16:
            frame = bytes(self._received[begin : begin + 16])
            if frame[15:] != b">":
                del self._received[: begin + 1]
                continue
            del self._received[: begin + 16]
            self._execute(frame)
            self._pending += self.corrupt(self._response())

    def _execute(self, frame: bytes) -> None:
        self.frames += 1
        nibbles = [byte - 0x41 for byte in frame[1:15]]
        assert all(0 <= nibble < 16 for nibble in nibbles)
        words = [sum(nibbles[at + k] << 4 * k for k in range(4)) for at in (0, 4, 8)]
        first, second, third = (word - 0x10000 if word & 0x8000 else word for word in words)
        self.commands, self.flags = (first, second, third), nibbles[12]

    def _response(self) -> bytes:
        words = [count & 0xFFFF for count in kinematics.encoders_at(kinematics.inverse(self.place))]
        flags = sum(1 << 4 + k for k in range(3) if self.homed[k]) | self.buttons
        nibbles = [word >> 4 * k & 0xF for word in words for k in range(4)]
        return bytes((0x3C, *(nibble + 0x41 for nibble in nibbles), flags + 0x41, 0x41, 0x3E))

    def _boot(self) -> None:
        """Behave as the boot loader: reply to the greeting, then echo."""
        slow = {9: 16, 3: 0x4138, 4: 8, 2: 0}
        if not self._loading and b"\n\x43\r" in self._received:
            if self.modem_lines == 1 and slow.items() <= self.setting.items():
                self._pending += b"\x00\n\x44\x2c\r"
                self._loading = True
            self._received.clear()
        elif self._loading and self.modem_lines == 0 and self.setting.get(3) == 0x15:
            self._echo()

    def _echo(self) -> None:
        received, self._received = bytes(self._received), bytearray()
        if received == b"\x41":
            self._image.clear()
        elif received == b"\n\x43\r":
            return
        else:
            self._image += received
            if self.wrong_echoes and len(self._image) > 200:
                self.wrong_echoes -= 1
                self._loading = False
                received = received[:-1] + bytes([received[-1] ^ 1])
        self._pending += received
        if len(self._image) == len(self.firmware):
            self.loaded = self.runs and self._image == self.firmware


class Handle:
    """Handle of an open device; every operation on an unplugged device fails."""

    def __init__(self, falcon: Falcon) -> None:
        self._falcon = falcon
        self.claimed = False
        assert self.falcon

    @property
    def falcon(self) -> Falcon:
        if not self._falcon.plugged:
            raise usb.core.USBError("No such device (it may have been disconnected)", -4, errno.ENODEV)
        return self._falcon

    def claim(self) -> None:
        falcon = self.falcon
        if falcon.has_driver or falcon.used_by_another or falcon.claimed:
            raise usb.core.USBError("Resource busy", -6, errno.EBUSY)
        falcon.claimed = self.claimed = True

    def release(self) -> None:
        if self.claimed:
            self._falcon.claimed = self.claimed = False


class Bus(usb.backend.IBackend):
    """USB backend that pyusb takes for the one of this machine."""

    def __init__(self, *falcons: Falcon) -> None:
        super().__init__()
        self.falcons = falcons
        self.timeouts: list[int] = []

    def enumerate_devices(self) -> list[Falcon]:
        return [falcon for falcon in self.falcons if falcon.plugged]

    def get_parent(self, dev: Falcon) -> None:
        return None

    def get_device_descriptor(self, dev: Falcon) -> SimpleNamespace:
        return SimpleNamespace(
            bLength=18,
            bDescriptorType=1,
            bcdUSB=0x0200,
            bDeviceClass=0,
            bDeviceSubClass=0,
            bDeviceProtocol=0,
            bMaxPacketSize0=8,
            idVendor=0x0403,
            idProduct=0xCB48,
            bcdDevice=0x0400,
            iManufacturer=0,
            iProduct=PRODUCT,
            iSerialNumber=SERIAL if dev.serial else 0,
            bNumConfigurations=1,
            address=4 + self.falcons.index(dev),
            bus=1,
            port_number=1 + self.falcons.index(dev),
            port_numbers=(1 + self.falcons.index(dev),),
            speed=2,
        )

    def get_configuration_descriptor(self, dev: Falcon, config: int) -> SimpleNamespace:
        if config > 0:
            raise IndexError(config)
        return SimpleNamespace(
            bLength=9,
            bDescriptorType=2,
            wTotalLength=32,
            bNumInterfaces=1,
            bConfigurationValue=1,
            iConfiguration=0,
            bmAttributes=0x80,
            bMaxPower=45,
            extra_descriptors=[],
        )

    def get_interface_descriptor(self, dev: Falcon, intf: int, alt: int, config: int) -> SimpleNamespace:
        if intf > 0 or alt > 0:
            raise IndexError(intf)
        return SimpleNamespace(
            bLength=9,
            bDescriptorType=4,
            bInterfaceNumber=0,
            bAlternateSetting=0,
            bNumEndpoints=2,
            bInterfaceClass=255,
            bInterfaceSubClass=255,
            bInterfaceProtocol=255,
            iInterface=0,
            extra_descriptors=[],
        )

    def get_endpoint_descriptor(self, dev: Falcon, ep: int, intf: int, alt: int, config: int) -> SimpleNamespace:
        return SimpleNamespace(
            bLength=7,
            bDescriptorType=5,
            bEndpointAddress=ENDPOINTS[ep],
            bmAttributes=2,
            wMaxPacketSize=64,
            bInterval=0,
            bRefresh=0,
            bSynchAddress=0,
            extra_descriptors=[],
        )

    def open_device(self, dev: Falcon) -> Handle:
        if not dev.permitted:
            raise usb.core.USBError("Access denied (insufficient permissions)", -3, errno.EACCES)
        return Handle(dev)

    def close_device(self, dev_handle: Handle) -> None:
        dev_handle.release()

    def get_configuration(self, dev_handle: Handle) -> int:
        return 1

    def is_kernel_driver_active(self, dev_handle: Handle, intf: int) -> bool:
        return dev_handle.falcon.has_driver

    def detach_kernel_driver(self, dev_handle: Handle, intf: int) -> None:
        dev_handle.falcon.has_driver = False

    def attach_kernel_driver(self, dev_handle: Handle, intf: int) -> None:
        assert not dev_handle.falcon.claimed
        dev_handle.falcon.has_driver = True

    def claim_interface(self, dev_handle: Handle, intf: int) -> None:
        dev_handle.claim()

    def release_interface(self, dev_handle: Handle, intf: int) -> None:
        assert dev_handle.falcon
        dev_handle.release()

    def ctrl_transfer(
        self, dev_handle: Handle, kind: int, request: int, value: int, index: int, data: array, timeout: int
    ) -> int:
        falcon = dev_handle.falcon
        if (kind, request) == (0x80, 6):
            return _text(falcon, value & 0xFF, data)
        assert (kind, index, len(data), dev_handle.claimed) == (0x40, 0, 0, True)
        falcon.request(request, value)
        return 0

    def bulk_write(self, dev_handle: Handle, ep: int, intf: int, data: array, timeout: int) -> int:
        assert (ep, intf, dev_handle.claimed) == (0x02, 0, True)
        self.timeouts.append(timeout)
        dev_handle.falcon.write(data.tobytes())
        return len(data)

    def bulk_read(self, dev_handle: Handle, ep: int, intf: int, buff: array, timeout: int) -> int:
        assert (ep, intf, dev_handle.claimed, len(buff)) == (0x81, 0, True, 64)
        self.timeouts.append(timeout)
        packet = dev_handle.falcon.read()
        buff[: len(packet)] = array("B", packet)
        return len(packet)


def _text(falcon: Falcon, index: int, buffer: array) -> int:
    """Write a string descriptor of the device; return its length."""
    body = (
        b"\x09\x04"
        if index == LANGUAGES
        else {PRODUCT: "FALCON HAPTIC", SERIAL: falcon.serial}[index].encode("utf-16-le")
    )
    descriptor = bytes((len(body) + 2, 3)) + body
    buffer[: len(descriptor)] = array("B", descriptor)
    return len(descriptor)
