"""Firmware upload to a Novint Falcon, which loses its firmware when powered off.

The firmware belongs to Novint, and its licence forbids redistribution. Owners of a Falcon have it on their disc, and
name the file in the options. The Falcon echoes each block. Uploads fail occasionally, so up to `ATTEMPTS` are made. The
sequence of requests, and the divisors, are libnifalcon's.
"""

from pathlib import Path

from netboard.base.errors import DeviceNotFound, DeviceTimeout
from netboard.devices.falcon import ftdi
from netboard.devices.falcon.serial_protocol import FalconLine

ATTEMPTS = 10
"""Largest number of uploads; libnifalcon's users report that the first often fails (its issues 24, 32, 45, 67) [1]."""

LARGEST = 1_000_000
"""Largest plausible size of the firmware file [B]."""

LATENCY_MS = 16
"""Latency timer of the FTDI chip during upload [ms]."""

PACKET_TIMEOUT_MS = 100
"""Timeout of a packet during upload [ms]."""

QUIET = 30
"""Number of packets without echo after which a block counts as lost [1]."""

SLOW_BAUD = 0x4138
"""Divisor of 3 MHz for 9600 baud: 312.5."""

LOADING_BAUD = 0x15
"""Divisor of 3 MHz for about 140 kbaud, the rate of the upload."""

CALL, REPLY = b"\n\x43\r", b"\n\x44\x2c\r"
"""Call to the boot loader, and its reply."""

CALLS = 100
"""Number of calls [1]."""

READY = b"\x41"
"""Byte sent before the firmware, and echoed."""

NO_FIRMWARE = (
    "the Falcon has no firmware: name the file with Novint's firmware in the option firmware; "
    "see docs/how-to/falcon.md. If it had firmware a moment ago, is its power supply plugged in?"
)


def image_of(name: str) -> bytes:
    """Read the firmware file."""
    try:
        image = Path(name).expanduser().read_bytes()
    except OSError as error:
        raise DeviceNotFound(f"the Falcon's firmware {name} cannot be read: {error.strerror}") from error
    if not 0 < len(image) <= LARGEST:
        raise DeviceNotFound(f"{name} is not the Falcon's firmware: it has {len(image)} bytes")
    return image


def ensure(chip: ftdi.Chip, link: FalconLine, name: str) -> str:
    """Make sure that the firmware runs, and return how it was loaded."""
    chip.purge()
    link.begin()
    if link.is_answered():
        return "was loaded before"
    if not name:
        raise DeviceNotFound(NO_FIRMWARE)
    image = image_of(name)
    for attempt in range(1, ATTEMPTS + 1):
        failure = _load(chip, image)
        link.begin()
        if not failure and link.is_answered():
            return f"{Path(name).name}, attempt {attempt}"
    why = failure or f"it accepted the file, but does not run: is {name} really the Falcon's firmware?"
    raise DeviceNotFound(f"the Falcon's firmware could not be loaded in {ATTEMPTS} attempts: {why}")


def _load(chip: ftdi.Chip, image: bytes) -> str:
    """Upload the firmware once; return the reason of a failure, or an empty string."""
    try:
        if not _call(chip):
            return "the Falcon does not reply: is its power supply plugged in?"
        chip.request(ftdi.MODEM, ftdi.DTR_LOW)
        chip.request(ftdi.BAUD, LOADING_BAUD)
        if not _echoes(chip, READY):
            return "the Falcon replies, but is not ready to load: unplug its power supply for a moment"
        for at in range(0, len(image), ftdi.PAYLOAD):
            if not _echoes(chip, image[at : at + ftdi.PAYLOAD]):
                return f"the Falcon received other data than was sent, at byte {at} of {len(image)}: try another cable"
    except DeviceTimeout as error:
        return str(error)
    return ""


def _call(chip: ftdi.Chip) -> bool:
    """Reset the Falcon into its boot loader and call it until it replies."""
    chip.purge()
    chip.request(ftdi.LATENCY, LATENCY_MS)
    chip.request(ftdi.BAUD, SLOW_BAUD)
    chip.request(ftdi.DATA, ftdi.EIGHT_BITS)
    chip.request(ftdi.FLOW, ftdi.NO_FLOW_CONTROL)
    chip.request(ftdi.MODEM, ftdi.RTS_LOW)
    chip.request(ftdi.MODEM, ftdi.DTR_LOW)
    chip.request(ftdi.MODEM, ftdi.DTR_HIGH)
    received = b""
    for _ in range(CALLS):
        chip.send(CALL)
        received += chip.receive(PACKET_TIMEOUT_MS)
        if REPLY in received:
            return any(not chip.receive(PACKET_TIMEOUT_MS) for _ in range(CALLS))  # drain replies to earlier calls
    return False


def _echoes(chip: ftdi.Chip, block: bytes) -> bool:
    """Send a block; return True if the echo is identical."""
    chip.send(block)
    received, quiet = b"", 0
    while len(received) < len(block) and quiet < QUIET:
        more = chip.receive(PACKET_TIMEOUT_MS)
        received += more
        quiet = 0 if more else quiet + 1
    return received == block
