"""An FTDI serial chip on USB, through pyusb.

This module knows the chip's requests and packets, and turns bus errors into messages. A device that is missing, in use
or not permitted raises `DeviceNotFound`; one that has disappeared since raises `DeviceLost`. The module does not know
the protocol on the serial line.

pyusb needs the system library libusb-1.0; both are looked up only when a device is opened.
"""

import contextlib
import errno
from array import array
from collections.abc import Iterator
from typing import Any

from netboard.base.errors import DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.devices.contract.selection import only

PACKET = 64
"""Size of a packet; the first two bytes of a received packet are the line state [B]."""

PAYLOAD = PACKET - 2
"""Largest payload of a received packet [B]."""

INTERFACE = 0
OUT, IN = 0x02, 0x81
VENDOR_OUT = 0x40  # bmRequestType of USB: a vendor's request, to the device
REQUEST_MS = 1000
"""Timeout of a request [ms]."""

# Requests and their values.
RESET, MODEM, FLOW, BAUD, DATA, LATENCY = 0, 1, 2, 3, 4, 9
PURGE_RECEIVED, PURGE_SENT = 1, 2
DTR_LOW, DTR_HIGH, RTS_LOW = 0x0100, 0x0101, 0x0200
NO_FLOW_CONTROL = 0
EIGHT_BITS = 8
"""Eight data bits, no parity, one stop bit."""

RULES = (
    "install deploy/udev/70-netboard.rules, join the group netboard, plug it in again; see docs/how-to/two-stations.md"
)
"""Advice for a device that may not be opened."""


def _pyusb() -> Any:
    """Import pyusb."""
    try:
        import usb.core  # noqa: PLC0415
        import usb.util  # noqa: PLC0415
    except ImportError as error:
        raise DeviceNotFound(f"pyusb is not installed ({error}): pip install 'netboard[devices]'") from error
    return usb


def plugged_in(ids: tuple[int, int]) -> list[Any]:
    """List the devices on the bus without opening them."""
    usb = _pyusb()
    try:
        return list(usb.core.find(find_all=True, idVendor=ids[0], idProduct=ids[1]))
    except usb.core.NoBackendError as error:
        raise DeviceNotFound("pyusb finds no libusb: apt-get install libusb-1.0-0") from error
    except usb.core.USBError as error:  # as when a device is plugged in or out at this moment
        raise DeviceNotFound(f"pyusb cannot list the USB devices: {error}") from error


def find(ids: tuple[int, int], what: str, serial: str, path: str) -> Any:
    """Find the only device on the bus with this serial number and at this port; empty: any."""
    connected = plugged_in(ids)
    if not connected:
        raise DeviceNotFound(f"no {what} ({ids[0]:04x}:{ids[1]:04x}) is plugged into USB")
    fitting: list[Any] = []
    others: list[Any] = []
    for device in connected:
        fits = path in ("", port_of(device)) and (not serial or serial_of(device) == serial)
        (fitting if fits else others).append(device)
    try:
        return only(fitting, connected, what, {"serial": serial, "path": path}, _described)
    except DeviceNotFound as error:
        others += fitting
        if not serial or all(map(serial_of, connected)):
            raise
        raise DeviceNotFound(f"{error}; a serial number that cannot be read may lack permission: {RULES}") from error
    finally:
        for device in others:
            _pyusb().util.dispose_resources(device)


def _described(device: Any) -> str:
    """Describe a device for an operator who has to select one."""
    return f"serial {serial_of(device)!r}, path {port_of(device)!r}"


def port_of(device: Any) -> str:
    """Return the USB port of a device, as Linux names it: its bus, and the ports from there."""
    return f"{device.bus}-{'.'.join(map(str, device.port_numbers or ()))}"


def serial_of(device: Any) -> str:
    """Return the serial number of a device; empty if it has none or cannot be read."""
    usb = _pyusb()
    try:
        return device.serial_number or ""
    except (usb.core.USBError, ValueError):  # pyusb raises ValueError if it cannot read the languages of the device
        return ""


class Chip:
    """The chip of one device, claimed for this process; closing it returns it to its previous driver."""

    def __init__(self, device: Any, what: str) -> None:
        self._usb = _pyusb()
        self._device = device
        self._what = what
        self._room = array("B", bytes(PACKET))
        self._had_driver = False
        try:
            self._claim()
        except self._usb.core.USBError as error:
            self.close()
            raise DeviceNotFound(self._refused(error)) from error

    def _claim(self) -> None:
        """Claim the interface, detaching the kernel's serial driver if necessary."""
        with contextlib.suppress(NotImplementedError):  # systems without kernel drivers
            if self._device.is_kernel_driver_active(INTERFACE):
                self._device.detach_kernel_driver(INTERFACE)
                self._had_driver = True
        self._usb.util.claim_interface(self._device, INTERFACE)

    def _refused(self, error: OSError) -> str:
        """Explain why the device could not be opened, and what to do."""
        if error.errno == errno.EACCES:
            return f"no permission to open the {self._what}: {RULES}"
        if error.errno == errno.EBUSY:
            return f"the {self._what} is used by another program: close that program first"
        return f"the {self._what} cannot be opened: {error}"

    @contextlib.contextmanager
    def _translated_errors(self) -> Iterator[None]:
        """Convert bus errors into device errors with a message."""
        try:
            yield
        except self._usb.core.USBTimeoutError as error:
            raise DeviceTimeout(f"the {self._what} accepts no data: is its power supply plugged in?") from error
        except self._usb.core.USBError as error:
            raise DeviceLost(f"the {self._what} was disconnected: {error}; was its USB plug pulled out?") from error

    def request(self, request: int, value: int) -> None:
        """Set a parameter of the chip."""
        with self._translated_errors():
            self._device.ctrl_transfer(VENDOR_OUT, request, value, 0, None, REQUEST_MS)

    def purge(self) -> None:
        """Discard received data and data not yet sent."""
        self.request(RESET, PURGE_RECEIVED)
        self.request(RESET, PURGE_SENT)

    def send(self, data: bytes, patience_ms: int = REQUEST_MS) -> None:
        """Send bytes over the line."""
        with self._translated_errors():
            taken = self._device.write(OUT, data, patience_ms)
        if taken != len(data):
            raise DeviceTimeout(f"the {self._what} took {taken} of {len(data)} bytes")

    def receive(self, patience_ms: int) -> bytes:
        """Receive the payload of one packet.

        An idle chip sends an empty packet whenever its latency timer expires, so the call seldom takes longer than
        that.

        Returns at most `PAYLOAD` bytes; none for an empty packet or no packet.
        """
        try:
            with self._translated_errors():
                size = self._device.read(IN, self._room, patience_ms)
        except DeviceTimeout:
            return b""
        return self._room[2:size].tobytes()

    def close(self) -> None:
        """Release the device; ignore errors of a disconnected one."""
        with contextlib.suppress(self._usb.core.USBError):
            self._usb.util.release_interface(self._device, INTERFACE)
            if self._had_driver:
                self._device.attach_kernel_driver(INTERFACE)
        self._usb.util.dispose_resources(self._device)
