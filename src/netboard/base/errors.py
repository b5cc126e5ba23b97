"""The exceptions of netboard.

::

    NetboardError                what a caller may want to catch
    ├── ConfigError              what was asked for is wrong: a setting, an option, or an output that exists
    ├── DeviceError              a haptic device failed
    │   ├── DeviceNotFound       it is not there, or its driver is not
    │   ├── DeviceLost           it was there and is gone
    │   └── DeviceTimeout        it did not answer in time (also a TimeoutError)
    ├── WireError                the peer broke the protocol; never our own mistake
    └── RecordingError           a recording cannot be written, read or trusted
        └── NoRecording          a file or folder that was named is not there, or is none (also a ConfigError)

Our own misuse is a ``ValueError`` or ``TypeError``. Expected conditions (a lost frame, a deadline miss, a clamped
force, an aborted trial) are values, events or counters, never exceptions.
"""

from collections.abc import Iterator
from contextlib import contextmanager


class NetboardError(Exception):
    """Base of all exceptions that netboard raises deliberately."""


class ConfigError(NetboardError):
    """A setting, an option or the name of an output is wrong; the message says which, and what was expected."""


class DeviceError(NetboardError):
    """A haptic device failed."""


class DeviceNotFound(DeviceError):
    """The device or its driver is missing."""


class DeviceLost(DeviceError):
    """The device has stopped answering."""


class DeviceTimeout(DeviceError, TimeoutError):
    """The device did not answer in time."""


class WireError(NetboardError):
    """A peer violated the protocol."""


class RecordingError(NetboardError):
    """A recording cannot be written, read or trusted."""


class NoRecording(RecordingError, ConfigError):
    """What was named as a recording does not exist, or is none."""


def unreadable(path: object, error: OSError) -> RecordingError:
    """Return the error of a recording that cannot be read: wrong input if it is not there, else a fault.

    Parameters
    ----------
    path : object
        File or folder, as the message names it.
    error : OSError
        Why it cannot be read.

    Returns
    -------
    RecordingError
        To be raised.
    """
    kind = NoRecording if isinstance(error, FileNotFoundError | NotADirectoryError) else RecordingError
    return kind(f"{path}: cannot be read: {error.strerror or error}")


@contextmanager
def writing(path: object, kind: type[NetboardError] = RecordingError) -> Iterator[None]:
    """Convert an error of the disk into one that names what cannot be written.

    Parameters
    ----------
    path : object
        File or folder, as the message names it.
    kind : type
        Class of the exception to raise.
    """
    try:
        yield
    except OSError as error:
        raise kind(f"{path}: cannot be written: {error.strerror or error}") from error
