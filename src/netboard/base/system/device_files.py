"""Files of devices, such as a parallel or a serial port, and the calls that set them up.

POSIX: device files, termios and ioctl. Windows: the name of a serial port, and its settings (DCB); there are no ioctls.
"""

import errno
import os
import sys
from collections.abc import Callable

from netboard.base.system.windows import Kernel32, SerialSettings, kernel32

if sys.platform != "win32":
    import fcntl
    import termios
    import tty

BAUD = 115_200
"""Rate of a port for markers [1/s]."""


def open_device(path: str) -> int:
    """Open a device file for reading and writing, without waiting; return its number."""
    if sys.platform == "win32":
        raise OSError(errno.ENOSYS, "not offered on win32")
    return os.open(path, os.O_RDWR | os.O_NONBLOCK)


def ioctl(descriptor: int, request: int, argument: bytes | int = 0) -> bytes | int:
    """Call ioctl with a number, or a buffer, and return what that then has."""
    if sys.platform == "win32":
        raise OSError(errno.ENOSYS, "not offered on win32")
    return fcntl.ioctl(descriptor, request, argument)


def open_serial(port: str) -> int:
    """Open a serial port for writing single bytes, without waiting: 115200 baud, 8 data bits, no parity, one stop bit.

    Returns the number of its file. Raises `OSError`.
    """
    if sys.platform == "win32":
        import msvcrt  # noqa: PLC0415  (only there)

        descriptor = os.open(f"\\\\.\\{port}", os.O_WRONLY | os.O_BINARY)
        _set_up(descriptor, lambda: set_up_windows_port(msvcrt.get_osfhandle(descriptor), kernel32()))
    else:
        # Otherwise the port could become this process's controlling terminal, and opening waits for a carrier.
        descriptor = os.open(port, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
        _set_up(descriptor, lambda: _set_up_posix_port(descriptor))
    return descriptor


def _set_up(descriptor: int, how: Callable[[], None]) -> None:
    """Set a port up; close it if that fails."""
    try:
        how()
    except OSError:
        os.close(descriptor)
        raise


def _set_up_posix_port(descriptor: int) -> None:
    """Set a port's mode by termios."""
    if sys.platform != "win32":
        try:
            tty.setraw(descriptor)
            settings = termios.tcgetattr(descriptor)
            settings[2] |= termios.CLOCAL
            settings[4] = settings[5] = termios.B115200
            termios.tcsetattr(descriptor, termios.TCSANOW, settings)
        except termios.error as error:
            raise OSError(errno.ENOTTY, f"is no serial port ({error})") from error


def set_up_windows_port(handle: int, api: Kernel32) -> None:
    """Set a port's mode by a DCB."""
    settings = SerialSettings()
    settings[0] = len(settings)  # DCBlength
    api.succeed("BuildCommDCBW", f"baud={BAUD} parity=N data=8 stop=1", settings)
    api.succeed("SetCommState", handle, settings)
