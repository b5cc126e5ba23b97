"""Run a netboard command in a process whose monotonic clock is skewed.

    python skewed.py STEPS OFFSET_NS PPM SINCE_NS STEP_NS python -m netboard.services.cli agent --side left ...

The clock is OFFSET_NS ahead at SINCE_NS on the machine's clock, runs PPM fast, and is stepped by STEP_NS at each
SIGUSR1. The machine's clock before and after each step is appended to the file STEPS.
"""

import ctypes
import signal
import sys
import time
from pathlib import Path
from typing import Any

from llvmlite import binding

import netboard.base.clock


class SkewedClock:
    """A clock with an offset and a rate error relative to the machine's clock."""

    def __init__(self, offset_ns: int, ppm: float, since_ns: int) -> None:
        self.offset_ns, self.ppm, self.since_ns = offset_ns, ppm, since_ns

    def offset(self, machine_ns: int) -> int:
        """Offset to the machine's clock at this time of the machine's clock [ns]."""
        return self.offset_ns + round((machine_ns - self.since_ns) * self.ppm * 1e-6)

    def now_ns(self) -> int:
        """Time of the skewed clock [ns]."""
        machine_ns = time.monotonic_ns()
        return machine_ns + self.offset(machine_ns)

    def for_kernels(self) -> Any:
        """A replacement for the C library's ``clock_gettime``, which kernels call."""

        @ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, ctypes.POINTER(ctypes.c_int64))
        def clock_gettime(which: int, time_s_ns: Any) -> int:
            time_s_ns[0], time_s_ns[1] = divmod(self.now_ns(), 1_000_000_000)
            return 0

        return clock_gettime


def main() -> None:
    """Run the command."""
    steps, (offset_ns, ppm, since_ns, step_ns), command = Path(sys.argv[1]), map(float, sys.argv[2:6]), sys.argv[9:]
    clock = SkewedClock(int(offset_ns), ppm, int(since_ns))

    def step(number: int, frame: object) -> None:
        before_ns = time.monotonic_ns()
        clock.offset_ns += int(step_ns)
        with steps.open("a") as file:
            file.write(f"{before_ns} {time.monotonic_ns()}\n")

    signal.signal(signal.SIGUSR1, step)
    netboard.base.clock.now_ns = clock.now_ns  # before any module imports the function
    for_kernels = clock.for_kernels()
    binding.add_symbol("clock_gettime", ctypes.cast(for_kernels, ctypes.c_void_p).value)

    from netboard.services import cli

    sys.argv[1:] = command
    cli.main()


if __name__ == "__main__":
    main()
