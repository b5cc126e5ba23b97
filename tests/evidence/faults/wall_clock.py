"""A wall clock that can be set for some processes without changing the clock of the machine.

A small preloaded C library replaces the functions that read the wall clock, and adds an offset that it reads from a
file. The monotonic clock is unchanged. The test therefore finds code that uses the wrong clock; it cannot test how the
kernel reacts when its clock is set.
"""

import shutil
import struct
import subprocess
from pathlib import Path

from netboard.base.errors import NetboardError

_SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>

static volatile long long *shift;

__attribute__((constructor)) static void open_shift(void) {
    const char *path = getenv("NETBOARD_WALL_CLOCK");
    int file = path ? open(path, O_RDONLY) : -1;
    void *at = file < 0 ? MAP_FAILED : mmap(0, sizeof *shift, PROT_READ, MAP_SHARED, file, 0);
    if (at != MAP_FAILED) shift = at;
}

static long long shifted(void) { return shift ? *shift : 0; }

int clock_gettime(clockid_t id, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *)) dlsym(RTLD_NEXT, "clock_gettime");
    int failed = real(id, now);
    if (!failed && (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE)) now->tv_sec += shifted();
    return failed;
}

int gettimeofday(struct timeval *now, void *zone) {
    struct timespec then;
    (void) zone;
    if (clock_gettime(CLOCK_REALTIME, &then)) return -1;
    now->tv_sec = then.tv_sec;
    now->tv_usec = then.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *now) {
    struct timespec then;
    clock_gettime(CLOCK_REALTIME, &then);
    if (now) *now = then.tv_sec;
    return then.tv_sec;
}
"""


def refusal() -> str:
    """Return why this machine cannot compile the library, or an empty string if it can."""
    return "" if shutil.which("cc") else "there is no C compiler"


class WallClock:
    """The wall clock of the processes that are started with `environment`."""

    def __init__(self, folder: Path) -> None:
        source, library = folder / "wall_clock.c", folder / "wall_clock.so"
        source.write_text(_SOURCE, encoding="utf-8")
        command = ["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl"]
        compiler = subprocess.run(command, capture_output=True, text=True, check=False)
        if compiler.returncode:
            raise NetboardError(f"cannot compile the wall clock library: {compiler.stderr.strip()}")
        self._file = folder / "wall_clock.shift"
        self._file.write_bytes(struct.pack("<q", 0))
        self.environment = {"LD_PRELOAD": str(library), "NETBOARD_WALL_CLOCK": str(self._file)}

    def set(self, seconds: int) -> None:
        """Set the offset of the wall clock from that of the machine [s]."""
        with self._file.open("r+b") as file:
            file.write(struct.pack("<q", seconds))
