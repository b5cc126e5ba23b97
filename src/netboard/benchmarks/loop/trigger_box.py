"""A stand-in for a serial trigger box: a pseudo-terminal whose other end behaves like a box, in a thread (POSIX).

It returns a byte for each code that is not 0, as a box does whose output is wired to its input. It can be slow, lose
pulses, be unplugged and come back under the same name.
"""

import os
import select
import threading
import time
from pathlib import Path
from typing import Self


class PtyBox:
    """A serial box at ``address``. ``delay``: to the returned byte [s]; ``drops``: one pulse of this many is lost."""

    def __init__(self, folder: Path, delay: float = 0.0, drops: int = 0) -> None:
        self.address = folder / "ttyBOX"
        self.received: list[int] = []
        self._delay, self._drops = delay, drops
        self._risen = 0
        self._main = -1

    def __enter__(self) -> Self:
        self.plug_in()
        return self

    def __exit__(self, *error: object) -> None:
        if self._main >= 0:
            self.unplug()

    def plug_in(self) -> None:
        """Appear at the address."""
        import tty  # not on Windows

        self._main, other = os.openpty()
        tty.setraw(other)
        self.address.unlink(missing_ok=True)
        self.address.symlink_to(os.ttyname(other))
        self._other = other  # kept open: a read of the main end would fail until a program has opened the port
        self._stop, self._stopped = os.pipe()
        self._thread = threading.Thread(target=self._work, args=(self._main, self._stop), daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        """Vanish: the program at the other end gets errors from now on."""
        os.close(self._stopped)
        self._thread.join()
        self.address.unlink()
        for file in (self._other, self._main, self._stop):
            os.close(file)
        self._main = -1

    def send(self, codes: bytes) -> None:
        """Report input pulses."""
        os.write(self._main, codes)

    def _work(self, main: int, stop: int) -> None:
        """Take all bytes that were written, also those from before the stop."""
        while main in (ready := select.select([main, stop], (), ())[0]) or stop not in ready:
            if main in ready:
                for code in os.read(main, 64):
                    self._take(code)

    def _take(self, code: int) -> None:
        self.received.append(code)
        if code == 0:
            return
        self._risen += 1
        if not (self._drops and self._risen % self._drops == 0):
            time.sleep(self._delay)
            os.write(self._main, bytes((code,)))
