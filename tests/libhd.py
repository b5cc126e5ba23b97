"""A fake of the vendor's libHD, compiled from src/netboard/benchmarks/loop/stand_in_libhd.c, and its controls."""

import atexit
import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from ctypes import c_char, c_char_p, c_double, c_int, c_int32, c_long, c_uint32
from dataclasses import replace
from functools import cache
from pathlib import Path
from time import monotonic, sleep

import pytest

import netboard
from netboard.base.config import Config, Side
from netboard.devices.touch.device import OpenHaptics

SOURCE = Path(netboard.__file__).parent / "benchmarks" / "loop" / "stand_in_libhd.c"

FIRST, SECOND = "40512001", "40512002"
"""Serial numbers of the two fake devices, "Default Device" and "Right Device"."""

PATIENCE_S = 60.0
STALL_NS = 5_000_000_000

PATIENT = {"force_timeout_ms": 200.0}
"""Options of a device on a busy machine."""

Opener = Callable[..., OpenHaptics]


@cache
def fake_library() -> Path:
    """Compile the fake library once per process; skip the test without a compiler."""
    compiler = os.environ.get("CC") or next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None or os.name != "posix":
        pytest.skip("the fake libHD is C for POSIX, and there is no C compiler here")
    folder = tempfile.mkdtemp(prefix="netboard-fake-libhd-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    library = Path(folder) / "libHD.so"
    flags = ("-O1", "-Wall", "-Wextra", "-Werror", "-std=gnu11", "-shared", "-fPIC", "-pthread")
    subprocess.run([compiler, *flags, "-o", str(library), str(SOURCE), "-lm"], check=True)
    return library


class Fake:
    """Controls of the fake library, or of a copy of it."""

    def __init__(self, path: Path | None = None) -> None:
        self.path = str(path or fake_library())
        self.calls = ctypes.CDLL(self.path)  # without the GIL: its servo thread may need it
        triple = c_double * 3
        self.calls.fake_ticks.restype = c_long
        self.calls.fake_decimal_point.restype = c_char
        self.calls.fake_handle.restype = c_uint32
        self.calls.fake_place.argtypes = (c_char_p, triple, triple)
        self.calls.fake_motor_force.argtypes = (c_char_p, triple)
        self.calls.fake_error.argtypes = (c_uint32, c_int32, c_uint32)
        self.calls.fake_fail.argtypes = (c_char_p, c_uint32, c_int)
        self.calls.fake_sway.argtypes = (c_double,)
        self.calls.fake_call_log.argtypes = (c_char_p, ctypes.c_size_t)
        self._triple = triple
        self._names: list[bytes] = []

    def reset(self) -> None:
        self.calls.fake_reset()

    def wait(self, ticks: int = 3) -> None:
        """Wait until the running servo has completed this many ticks."""
        target, deadline = self.calls.fake_ticks() + ticks, monotonic() + PATIENCE_S
        while self.calls.fake_running() and self.calls.fake_ticks() < target and monotonic() < deadline:
            sleep(2e-4)

    def motor_force(self, serial: str = FIRST) -> tuple[float, float, float]:
        """Return the motor force of a device, in the vendor's frame [N]."""
        buffer = self._triple()
        self.calls.fake_motor_force(serial.encode(), buffer)
        return buffer[0], buffer[1], buffer[2]

    def place(self, x: tuple[float, ...], v: tuple[float, ...] = (0, 0, 0), serial: str = FIRST) -> None:
        self.calls.fake_place(serial.encode(), self._triple(*x), self._triple(*v))
        self.wait()

    def plug(self, on: bool, serial: str = FIRST) -> None:
        self.calls.fake_plug(serial.encode(), on)

    def dock(self, on: bool, serial: str = FIRST) -> None:
        self.calls.fake_dock(serial.encode(), on)
        self.wait()

    def press(self, buttons: int, serial: str = FIRST) -> None:
        self.calls.fake_press(serial.encode(), buttons)
        self.wait()

    def name(self, name: str, serial: str = FIRST) -> None:
        self._names.append(name.encode())
        self.calls.fake_name(serial.encode(), self._names[-1])

    def calibration(self, state: int, style: int, serial: str = FIRST) -> None:
        self.calls.fake_calibration(serial.encode(), state, style)

    def error(self, code: int, internal: int = 0, handle: int | None = None) -> None:
        """Push an error on the stack, by default of the first device, and let the servo read it."""
        self.calls.fake_error(code, internal, self.calls.fake_handle(FIRST.encode()) if handle is None else handle)
        self.wait()

    def fail(self, function: str, code: int, after: int = 0) -> None:
        self.calls.fake_fail(function.encode(), code, after)

    def is_open(self, serial: str = FIRST) -> bool:
        return bool(self.calls.fake_open(serial.encode()))

    def enabled(self, what: int, serial: str = FIRST) -> bool:
        return bool(self.calls.fake_enabled(serial.encode(), what))

    def call_log(self) -> list[str]:
        """Return the calls since the previous call of this method."""
        buffer = ctypes.create_string_buffer(1 << 16)
        self.calls.fake_call_log(buffer, len(buffer))
        return buffer.value.decode().splitlines()


def configured(config: Config, side: Side = "left", **options: str | float) -> Config:
    """Return a configuration in which one side has an OpenHaptics device."""
    agent = config.agents.of(side)
    agent = replace(agent, device="openhaptics", options={**agent.options, **options})
    return replace(config, agents=replace(config.agents, **{side: agent}))


def make_device(fake: Fake, side: Side = "left", **options: str | float) -> OpenHaptics:
    """Return a device that uses the fake library, not yet open."""
    return OpenHaptics(side, configured(Config(), side, **{"library": fake.path, **PATIENT, **options}))
