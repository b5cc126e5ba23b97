"""A fake of Force Dimension's libdhd, compiled from stand_in_libdhd.c, and its controls."""

import ctypes
from ctypes import c_char_p, c_double, c_int, c_uint
from functools import cache
from pathlib import Path
from time import monotonic, sleep

import pytest

from netboard.base import kernel_cache
from netboard.devices.servo.compiling import CannotCompile, compiled_library

SOURCE = Path(__file__).with_name("stand_in_libdhd.c")

OMEGA, SIGMA = 11311, 20202
"""Serial numbers of the two fake devices, an omega.3 and a sigma.7."""

PATIENCE_S = 60.0


@cache
def fake_library() -> str:
    """Compile the fake library; skip the test without a compiler."""
    try:
        strict = ("-Wall", "-Wextra", "-Werror", "-pthread", "-lm")
        return str(compiled_library(kernel_cache.folder(), SOURCE, *strict))
    except CannotCompile as error:
        if "cannot be" in str(error):  # there is a compiler, and it fails
            raise
        pytest.skip(f"the fake libdhd {error}")


class FakeDhd:
    """Controls of the fake library."""

    def __init__(self) -> None:
        self.path = fake_library()
        self.calls = ctypes.CDLL(self.path)
        self._triple = c_double * 3
        for name, takes in {
            "place": (c_int, self._triple, self._triple),
            "motor_force": (c_int, self._triple),
            "press": (c_int, c_uint),
            "fail": (c_char_p, c_int, c_int),
            "blind": (c_int,),
        }.items():
            getattr(self.calls, f"fake_{name}").argtypes = takes
        for name in ("limit", "compensation"):
            getattr(self.calls, f"fake_{name}").restype = c_double

    def reset(self) -> None:
        self.calls.fake_reset()

    def wait(self, count: int = 8) -> None:
        """Wait until the servo has made this many transfers."""
        target, deadline = self.calls.fake_transfers() + count, monotonic() + PATIENCE_S
        while self.calls.fake_served() and self.calls.fake_transfers() < target:
            if monotonic() > deadline:
                raise TimeoutError("the servo makes no transfers")
            sleep(2e-4)

    def motor_force(self, serial: int = OMEGA) -> tuple[float, float, float]:
        """Return the motor force of a device without gravity compensation [N]."""
        buffer = self._triple()
        self.calls.fake_motor_force(serial, buffer)
        return buffer[0], buffer[1], buffer[2]

    def place(self, x: tuple[float, ...], v: tuple[float, ...] = (0, 0, 0), serial: int = OMEGA) -> None:
        self.calls.fake_place(serial, self._triple(*x), self._triple(*v))
        self.wait()

    def fail(self, function: str, code: int, after: int = 0) -> None:
        self.calls.fake_fail(function.encode(), code, after)
