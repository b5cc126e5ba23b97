"""The clock of all stamps and deadlines: monotonic, of this machine, never stepped, and finer than a microsecond.

POSIX: CLOCK_MONOTONIC. Windows: the performance counter, because Python's monotonic clock there counts in steps of
15.6 ms before Python 3.13. Kernels read the same clock by `netboard.network.transport.waiting`, to the nanosecond.
"""

import sys
import time

if sys.platform == "win32":
    monotonic_ns = time.perf_counter_ns
else:
    monotonic_ns = time.monotonic_ns
