"""Loading the program into a Novint Falcon, which forgets it when it loses its power.

The program is Novint's, and its licence lets nobody pass it on: whoever owns a Falcon has it on its disc, and names the
file. The Falcon echoes each block. Loading is known to fail now and then, so it is tried up to `ATTEMPTS` times.
"""

from pathlib import Path

from netboard.base.errors import DeviceNotFound, DeviceTimeout
from netboard.devices.falcon import ftdi
from netboard.devices.falcon.serial_protocol import Link

ATTEMPTS = 10
"""Times that loading is tried [1]."""

LARGEST = 1_000_000
"""A file larger than this is not the program [B]."""

LATENCY_MS = 16
"""Latency timer of the chip while loading [ms]."""

PATIENCE_MS = 100
"""Longest wait for a packet while loading [ms]."""

QUIET = 30
"""Packets without a byte of the echo after which a block counts as lost [1]."""

SLOW_BAUD = 0x4138
"""Divisor of 3 MHz for 9600 baud: 312.5."""

LOADING_BAUD = 0x15
"""Divisor of 3 MHz for about 140 kbaud, at which the program is sent."""

CALL, REPLY = b"\n\x43\r", b"\n\x44\x2c\r"
"""How the loader is called, and what it replies."""

CALLS = 100
"""Times that it is called [1]."""

READY = b"\x41"
"""What is said before the program, and echoed."""

NO_FIRMWARE = (
    "the Falcon has no program in it: give the file with Novint's firmware as the option firmware; "
    "see docs/how-to/falcon.md. If it had one a moment ago, is its power supply plugged in?"
)


def image_of(name: str) -> bytes:
    """Read the file with the program."""
    try:
        image = Path(name).expanduser().read_bytes()
    except OSError as error:
        raise DeviceNotFound(f"the Falcon's firmware {name} cannot be read: {error.strerror}") from error
    if not 0 < len(image) <= LARGEST:
        raise DeviceNotFound(f"{name} is not the Falcon's firmware: it has {len(image)} bytes")
    return image


def ensure(chip: ftdi.Chip, link: Link, name: str) -> str:
    """See to it that the program runs."""
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
    why = failure or f"it took the file, but does not run: is {name} really the Falcon's firmware?"
    raise DeviceNotFound(f"the Falcon's firmware could not be loaded in {ATTEMPTS} attempts: {why}")


def _load(chip: ftdi.Chip, image: bytes) -> str:
    """Load the program once; why that failed, empty if it did not."""
    try:
        if not _call(chip):
            return "the Falcon does not reply: is its power supply plugged in?"
        chip.request(ftdi.MODEM, ftdi.DTR_LOW)
        chip.request(ftdi.BAUD, LOADING_BAUD)
        if not _echoes(chip, READY):
            return "the Falcon replies, but is not ready to load: unplug its power supply for a moment"
        for at in range(0, len(image), ftdi.PAYLOAD):
            if not _echoes(chip, image[at : at + ftdi.PAYLOAD]):
                return (
                    f"the Falcon received something else than was sent, at byte {at} of {len(image)}: try another cable"
                )
    except DeviceTimeout as error:
        return str(error)
    return ""


def _call(chip: ftdi.Chip) -> bool:
    """Reset the Falcon into its loader and call that until it replies."""
    chip.purge()
    chip.request(ftdi.LATENCY, LATENCY_MS)
    chip.request(ftdi.BAUD, SLOW_BAUD)
    chip.request(ftdi.DATA, ftdi.EIGHT_BITS)
    chip.request(ftdi.FLOW, ftdi.NO_FLOW_CONTROL)
    chip.request(ftdi.MODEM, ftdi.RTS_LOW)
    chip.request(ftdi.MODEM, ftdi.DTR_LOW)
    chip.request(ftdi.MODEM, ftdi.DTR_HIGH)
    heard = b""
    for _ in range(CALLS):
        chip.send(CALL)
        heard += chip.receive(PATIENCE_MS)
        if REPLY in heard:
            return any(not chip.receive(PATIENCE_MS) for _ in range(CALLS))  # replies to earlier calls are on their way
    return False


def _echoes(chip: ftdi.Chip, block: bytes) -> bool:
    """Send a block; whether it comes back as it is."""
    chip.send(block)
    heard, quiet = b"", 0
    while len(heard) < len(block) and quiet < QUIET:
        more = chip.receive(PATIENCE_MS)
        heard += more
        quiet = 0 if more else quiet + 1
    return heard == block
