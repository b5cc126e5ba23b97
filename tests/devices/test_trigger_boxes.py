"""Trigger boxes: codes out, pulses in, and clear words for a box that is absent, shut, busy or unplugged."""

import errno
import os
import struct
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from netboard.base.errors import ConfigError, DeviceLost, DeviceNotFound
from netboard.base.tables.triggers import Triggers
from netboard.benchmarks.loop.trigger_box import PtyBox
from netboard.devices.triggers import parallel, registry
from netboard.devices.triggers.box import TriggerBox, cannot_open
from netboard.devices.triggers.labjack import LabJackBox
from netboard.devices.triggers.parallel import ParallelPort
from netboard.devices.triggers.serial_port import SerialBox

SERIAL = Triggers(kind="serial")


def eventually(box: TriggerBox, expected: bytes) -> bytes:
    """Read until this much has come."""
    found, until = b"", time.monotonic() + 5
    while len(found) < len(expected) and time.monotonic() < until:
        found += box.read()
    return found


@pytest.fixture
def pty_box(tmp_path: Path) -> Iterator[PtyBox]:
    with PtyBox(tmp_path) as box:
        yield box


def test_serial_box_gets_one_byte_for_a_code_and_reports_its_input(pty_box: PtyBox) -> None:
    with SerialBox(replace(SERIAL, address=str(pty_box.address))) as box:
        for code in (200, 0, 3):
            box.write(code)
        assert eventually(box, b"\xc8\x03") == b"\xc8\x03"
        pty_box.send(b"\x07")
        assert eventually(box, b"\x07") == b"\x07"
        assert box.file >= 0
    pty_box.unplug()  # which takes what was written before
    assert pty_box.received == [0, 200, 0, 3, 0]  # it begins and ends with low lines


def test_lines_of_a_serial_box_are_low_after_an_error(pty_box: PtyBox) -> None:
    with suppress(KeyboardInterrupt), SerialBox(replace(SERIAL, address=str(pty_box.address))) as box:
        box.write(200)
        raise KeyboardInterrupt
    pty_box.unplug()
    assert pty_box.received == [0, 200, 0]


def test_serial_box_that_could_not_be_opened_is_not_locked(pty_box: PtyBox, monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    def take_no_bytes(port: object, codes: bytes) -> int:
        raise serial.SerialTimeoutException("Write timeout")

    box = SerialBox(replace(SERIAL, address=str(pty_box.address)))
    with monkeypatch.context() as patched:
        patched.setattr(serial.Serial, "write", take_no_bytes)
        with pytest.raises(DeviceNotFound, match="takes no bytes"):
            box.open()
    with box:
        box.write(1)
    pty_box.unplug()
    assert pty_box.received == [0, 1, 0]


def test_second_program_finds_the_serial_box_busy(pty_box: PtyBox) -> None:
    settings = replace(SERIAL, address=str(pty_box.address))
    with SerialBox(settings), pytest.raises(DeviceNotFound, match="used by another program"):
        SerialBox(settings).open()


def test_unplugged_serial_box_is_lost_for_writes_and_reads(pty_box: PtyBox) -> None:
    with SerialBox(replace(SERIAL, address=str(pty_box.address))) as box:
        pty_box.unplug()
        with pytest.raises(DeviceLost, match="was unplugged"):
            box.write(1)
        with pytest.raises(DeviceLost, match="was unplugged"):
            eventually(box, b"\x01")


@pytest.mark.parametrize(
    ("address", "words"),
    [("/dev/ttyNONE", "no such port; is the box plugged in"), ("/dev/null", "cannot be opened as a trigger box")],
)
def test_wrong_serial_port_is_named(address: str, words: str) -> None:
    with pytest.raises(DeviceNotFound, match=words):
        SerialBox(replace(SERIAL, address=address)).open()


def test_missing_permission_names_the_group(tmp_path: Path) -> None:
    port = tmp_path / "ttyACM0"
    port.touch()
    import grp

    group = grp.getgrgid(port.stat().st_gid).gr_name
    said = str(cannot_open(str(port), PermissionError(errno.EACCES, "Permission denied")))
    assert said == (
        f"no permission to open {port} of the group {group}: sudo usermod -aG {group} $USER, then log in again"
    )


# --- parallel port -----------------------------------------------------------------------------------------------


class PortDriver:
    """Stands in for the driver of a parallel port: its system calls."""

    def __init__(self) -> None:
        self.calls: list[tuple[int, Any]] = []
        self.edges = 2
        self.gone = False

    def __call__(self, file: int, request: int, argument: Any = 0) -> Any:
        if self.gone:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        self.calls.append((request, argument))
        if request == parallel.PPCLRIRQ:
            edges, self.edges = self.edges, 0
            return struct.pack("i", edges)
        return 0


def test_parallel_port_sets_its_data_lines_and_counts_edges(tmp_path: Path) -> None:
    (tmp_path / "parport0").touch()
    driver = PortDriver()
    with ParallelPort(Triggers(kind="parallel", address=str(tmp_path / "parport0")), driver) as box:
        assert box.read() == b""  # edges from before are no pulses
        box.write(0x81)
        driver.edges = 3
        assert box.read() == b"\1\1\1"
        driver.gone = True
        with pytest.raises(DeviceLost, match=r"parallel port .*parport0 has failed: Input/output error"):
            box.write(1)
    lines = [argument for request, argument in driver.calls if request == parallel.PPWDATA]
    assert lines == [b"\0", b"\x81"]
    assert [request for request, _ in driver.calls[:2]] == [parallel.PPEXCL, parallel.PPCLAIM]


def test_parallel_port_that_is_missing_or_claimed_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DeviceNotFound, match="no such port"):
        ParallelPort(Triggers(kind="parallel", address=str(tmp_path / "none"))).open()
    (tmp_path / "parport0").touch()
    busy = PortDriver()
    busy.gone = True
    with pytest.raises(DeviceNotFound, match="cannot be opened as a trigger box"):
        ParallelPort(Triggers(kind="parallel", address=str(tmp_path / "parport0")), busy).open()


# --- LabJack -----------------------------------------------------------------------------------------------------


class ScriptedLjm:
    """Stands in for the wrapper of LJM: registers by name."""

    class LJMError(Exception):
        """Its error."""

    def __init__(self) -> None:
        self.registers = {"DIO_ANALOG_ENABLE": 0xF0F}
        self.opened: list[str] = []
        self.gone = False

    def openS(self, device: str, connection: str, identifier: str) -> int:
        self._answer()
        self.opened.append(identifier)
        return 7

    def eReadName(self, handle: int, name: str) -> float:
        self._answer()
        return float(self.registers[name])

    def eWriteName(self, handle: int, name: str, value: float) -> None:
        self._answer()
        self.registers[name] = int(value)

    def close(self, handle: int) -> None:
        self._answer()
        self.opened.clear()

    def _answer(self) -> None:
        if self.gone:
            raise self.LJMError("LJME_RECONNECT_FAILED")


def test_labjack_shows_codes_at_its_eio_lines() -> None:
    ljm = ScriptedLjm()
    with LabJackBox(Triggers(kind="labjack", address="470012345"), ljm) as box:
        assert ljm.opened == ["470012345"]
        assert ljm.registers == {"DIO_ANALOG_ENABLE": 0x00F, "EIO_DIRECTION": 0xFF, "EIO_STATE": 0}
        box.write(129)
        assert ljm.registers["EIO_STATE"] == 129
        ljm.gone = True
        with pytest.raises(DeviceLost, match="LabJack 470012345 has failed: LJME_RECONNECT_FAILED"):
            box.write(1)
    with pytest.raises(DeviceNotFound, match="cannot be opened: LJME_RECONNECT_FAILED"):
        LabJackBox(Triggers(kind="labjack"), ljm).open()


def test_labjack_without_ljm_says_what_to_install() -> None:
    from ctypes.util import find_library

    if find_library("LabJackM"):
        pytest.skip("this machine has LJM")
    with pytest.raises(DeviceNotFound, match="LabJack's installer brings"):
        LabJackBox(Triggers(kind="labjack")).open()


# --- registry ----------------------------------------------------------------------------------------------------


def test_unknown_box_and_loopback_without_input_are_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"\[triggers\] kind: this machine has no trigger box 'serail'.* did you mean"
    ):
        registry.require_known(Triggers(kind="serail"))
    with pytest.raises(ConfigError, match=r"\[triggers\] loopback: .* a labjack box has no input"):
        registry.require_known(Triggers(kind="labjack", loopback=True))
    registry.require_known(Triggers())
    assert {"labjack", "parallel", "serial", "simulated"} <= {*registry.names()}


def test_simulated_box_says_so_and_returns_codes() -> None:
    with registry.make(Triggers(kind="simulated", loopback=True)) as box:
        assert box.simulated
        assert "no hardware" in box.text
        box.write(5)
        box.write(0)
        assert box.read() == b"\x05"
        assert box.read() == b""
