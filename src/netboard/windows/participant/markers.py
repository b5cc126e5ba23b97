"""Event markers for amplifiers (EEG, EMG): sent when the first frame of a phase has been painted.

There are three outlets: none, a Lab Streaming Layer (LSL) stream, or a serial port that gets one byte per event.
`CODES` lists the events and their bytes.
"""

import os
import platform
from collections.abc import Callable
from typing import Protocol

from netboard.base.config import Side
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.system.device_files import open_serial

CODES = {
    "idle": 1,
    "levelling": 2,
    "running": 3,
    "holding": 4,
    "succeeded": 5,
    "failed": 6,
    "paused": 7,
    "finished": 8,
    "away": 9,
    "blank": 10,
}
"""Byte of each event: a phase that begins, or a screen that goes blank because no view arrives."""


class Markers(Protocol):
    """An outlet for markers."""

    def mark(self, event: str) -> None:
        """Send the marker of an event of `CODES` now; raise NetboardError if that fails."""

    def close(self) -> None:
        """Close the outlet."""


class NoMarkers:
    """No markers."""

    def mark(self, event: str) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


class LslMarkers:
    """An LSL outlet with one channel of strings, of type ``Markers``, named ``netboard.left`` or ``netboard.right``.

    Its source id names this computer and the server: a recorder that loses the stream continues with one of the same
    source id, which must not be that of another dyad.
    """

    def __init__(self, station: Side, server: str) -> None:
        try:
            import pylsl  # noqa: PLC0415  (optional, and slow to load)
        except (ImportError, RuntimeError) as error:
            raise ConfigError(
                '[display] markers: found "lsl", which needs pylsl and the library liblsl: '
                f'pip install "netboard[lsl]" ({error})'
            ) from None
        name = f"netboard.{station}"
        info = pylsl.StreamInfo(
            name, "Markers", 1, pylsl.IRREGULAR_RATE, pylsl.cf_string, f"{name}@{platform.node()}:{server}"
        )
        self._push: Callable[[list[str]], None] = pylsl.StreamOutlet(info).push_sample

    def mark(self, event: str) -> None:
        """Push the event's name."""
        self._push([event])

    def close(self) -> None:
        """Do nothing: the outlet ends with the process."""


class SerialMarkers:
    """A serial port that gets one byte per event."""

    def __init__(self, port: str) -> None:
        self._port = port
        try:
            self._file = open_serial(port)
        except OSError as error:
            raise ConfigError(
                f"[display] markers: found {port!r}, expected none, lsl or a serial port ({error.strerror})"
            ) from None

    def mark(self, event: str) -> None:
        """Write the event's byte without blocking."""
        try:
            os.write(self._file, bytes([CODES[event]]))
        except OSError as error:
            raise NetboardError(f"the marker {event!r} was not sent: {self._port}: {error.strerror}") from None

    def close(self) -> None:
        """Close the port."""
        os.close(self._file)


def open_markers(outlet: str, station: Side, server: str) -> Markers:
    """Open the outlet of a display of a server: ``none``, ``lsl`` or a serial port, as in ``[display] markers``."""
    match outlet:
        case "none":
            return NoMarkers()
        case "lsl":
            return LslMarkers(station, server)
    return SerialMarkers(outlet)
