"""The Falcon backend on a simulated USB bus with the real pyusb: contract, protocol, and faults."""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import hypot
from pathlib import Path

import pytest
from contract import MS, DeviceContract
from fake_falcon import FIRMWARE, Bus, Falcon
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.devices.contract.device import Device
from netboard.devices.falcon import device as backend
from netboard.devices.falcon import ftdi
from netboard.devices.falcon.kinematics import CENTRE
from netboard.devices.falcon.serial_protocol import GREEN, HOME, RED, Answer, answer_in, frame_of

NORMAL = [(9, 1), (3, 0x2), (0, 1), (0, 2)]
"""Requests that set the chip up for the program: latency, baud rate, purge."""

LOADING = [
    (0, 1),
    (0, 2),
    (9, 16),
    (3, 0x4138),
    (4, 8),
    (2, 0),
    (1, 0x200),
    (1, 0x100),
    (1, 0x101),
    (1, 0x100),
    (3, 0x15),
]
"""Requests that bring the loader up, and then give it speed."""


def configured(**options: object) -> Config:
    config = Config()
    left = replace(config.agents.left, options=options)
    return replace(config, agents=replace(config.agents, left=left))


@pytest.fixture
def plug(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Bus]:
    """Put devices on the bus."""

    def plug(*falcons: Falcon) -> Bus:
        bus = Bus(*falcons)
        monkeypatch.setattr("usb.backend.libusb1.get_backend", lambda find_library=None: bus)
        return bus

    return plug


@pytest.fixture
def falcon(plug: Callable[..., Bus]) -> Falcon:
    """One that is ready to be used, and on the bus."""
    there = Falcon()
    plug(there)
    return there


@pytest.fixture
def opened(falcon: Falcon) -> Iterator[Device]:
    """Its backend, open."""
    device = backend.Falcon("left", configured())
    device.open()
    yield device
    with contextlib.suppress(DeviceError):  # of one that a test has broken
        device.close()


class TestFalcon(DeviceContract):
    @pytest.fixture(autouse=True)
    def plugged(self, falcon: Falcon) -> None:
        self.falcon = falcon

    def make(self, config: Config) -> Device:
        return backend.Falcon("left", config)

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        return self.falcon.force

    def unplug(self, device: Device) -> Callable[[], None]:
        self.falcon.unplug()
        return self.falcon.plug_in


# --- what is said ------------------------------------------------------------------------------------------------

words = st.integers(-0x8000, 0x7FFF)


def test_a_frame_is_what_the_protocol_says() -> None:
    assert frame_of((0, 0, 0), 0) == b"<AAAAAAAAAAAAAA>"
    assert frame_of((0x1234, -1, -0x8000), RED | HOME) == b"<EDCBPPPPAAAI" + bytes([0x41 + 9]) + b"A>"


@given(st.tuples(words, words, words), st.integers(0, 7), st.integers(0, 15))
def test_an_answer_is_read_as_it_was_meant(counts: tuple, homed: int, buttons: int) -> None:
    frame = bytearray(frame_of(counts, 0))
    frame[13] = 0x41 + (homed << 4 | buttons)
    assert answer_in(bytes(frame)) == Answer(counts, homed == 7, buttons)


@given(st.binary(min_size=14, max_size=14))
def test_what_is_no_answer_is_none(inside: bytes) -> None:
    found = answer_in(b"<" + inside + b">")
    assert (found is not None) == (all(0x41 <= byte <= 0x50 for byte in inside[:12]) and 0x41 <= inside[12] <= 0xC0)


# --- position, buttons and force ---------------------------------------------------------------------------------


def test_the_scene_s_axes_are_the_falcon_s(opened: Device, falcon: Falcon) -> None:
    falcon.place = (CENTRE[0] + 0.01, CENTRE[1] + 0.02, CENTRE[2] + 0.03)
    opened.write(0.0, 0.0, 0.0)
    opened.read(MS)
    reading = opened.read(2 * MS)
    assert (reading.x, reading.y, reading.z) == pytest.approx((0.03, 0.01, 0.02), abs=1e-4)
    assert reading.ready


def test_the_motors_give_the_force_that_was_written(opened: Device, falcon: Falcon) -> None:
    for k, by in enumerate([(0.0, 0.0, 0.0), (0.02, 0.01, -0.03), (-0.03, 0.03, 0.02)]):
        falcon.place = tuple(c + d for c, d in zip(CENTRE, by, strict=True))
        opened.read((2 * k + 1) * MS)
        opened.read((2 * k + 2) * MS)
        opened.write(0.5, -1.0, 1.5)
        assert falcon.force == pytest.approx((0.5, -1.0, 1.5), abs=0.02)


def test_a_force_that_is_too_large_keeps_its_direction(opened: Device, falcon: Falcon) -> None:
    for force in ((100.0, 0.0, 0.0), (0.0, 80.0, 0.0), (0.0, -30.0, 70.0), (9.0, 9.0, -9.0)):
        opened.write(*force)
        opened.read(MS)
        assert max(map(abs, falcon.commands)) <= backend.MAX_COMMAND
        size = hypot(*falcon.force)
        assert 5.0 < size <= backend.MAX_FORCE
        scaled = tuple(part / hypot(*force) * size for part in force)
        assert falcon.force == pytest.approx(scaled, abs=0.01)


def test_the_force_is_scaled_for_the_motors_one_has(falcon: Falcon) -> None:
    with backend.Falcon("left", configured(torque_scale=5000)) as device:
        device.write(1.0, 0.0, 0.0)
        assert falcon.force == pytest.approx((0.5, 0.0, 0.0), abs=0.02)


def test_the_grip_s_buttons_are_told(opened: Device, falcon: Falcon) -> None:
    falcon.buttons = 0b0110
    opened.read(MS)
    assert opened.read(2 * MS).buttons == 0b0110


def test_a_reading_sends_the_force_if_nobody_else_did(opened: Device, falcon: Falcon) -> None:
    opened.write(0.0, 0.0, 1.0)
    opened.read(MS)
    falcon.commands = (0, 0, 0)
    opened.read(2 * MS)
    assert falcon.force == pytest.approx((0.0, 0.0, 1.0), abs=0.01)


def test_one_millisecond_takes_one_frame(opened: Device, falcon: Falcon) -> None:
    before = falcon.frames
    for k in range(1, 101):
        opened.read(k * MS)
        opened.write(0.0, 0.0, 0.1)
    assert falcon.frames - before <= 101


def test_a_fast_grip_is_followed(opened: Device, falcon: Falcon) -> None:
    speed = 0.2
    for k in range(1, 100):
        falcon.place = (CENTRE[0], CENTRE[1] + speed * k * 1e-3 - 0.01, CENTRE[2])
        opened.write(0.0, 0.0, 0.0)
        reading = opened.read(k * MS)
    assert reading.vz == pytest.approx(speed, rel=0.05)
    assert (reading.vx, reading.vy) == pytest.approx((0.0, 0.0), abs=0.02)


# --- homing ------------------------------------------------------------------------------------------------------


def test_without_zero_there_is_no_force_and_the_lamp_is_red(plug: Callable[..., Bus]) -> None:
    falcon = Falcon(homed=False)
    plug(falcon)
    with backend.Falcon("left", configured()) as device:
        for k in range(1, 4):
            assert not device.read(k * MS).ready
            device.write(0.0, 0.0, 2.0)
            assert (falcon.commands, falcon.flags) == ((0, 0, 0), RED | HOME)
        falcon.homed = (True, True, False)
        device.read(5 * MS)
        assert not device.read(6 * MS).ready
        falcon.homed = (True, True, True)
        device.read(7 * MS)
        reading = device.read(8 * MS)
        assert reading.ready
        assert (reading.vx, reading.vy, reading.vz) == (0.0, 0.0, 0.0)
        device.write(0.0, 0.0, 2.0)
        assert falcon.force == pytest.approx((0.0, 0.0, 2.0), abs=0.01)
        assert falcon.flags == GREEN


def test_counts_that_no_pose_has_leave_the_grip_where_it_was(opened: Device, falcon: Falcon) -> None:
    here = opened.read(MS)
    opened.write(0.0, 0.0, 1.0)
    falcon.spoil = lambda answer: b"<" + frame_of((30000, 0, 0), 0)[1:13] + answer[13:]
    opened.read(2 * MS)
    reading = opened.read(3 * MS)
    assert not reading.ready
    assert (reading.x, reading.y, reading.z) == (here.x, here.y, here.z)
    opened.write(0.0, 0.0, 1.0)
    assert (falcon.commands, falcon.flags) == ((0, 0, 0), RED)


# --- the line ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("chunk", [1, 5, 15, 16, 62])
def test_answers_may_come_in_pieces(opened: Device, falcon: Falcon, chunk: int) -> None:
    falcon.chunk = chunk
    falcon.place = (CENTRE[0], CENTRE[1] + 0.01, CENTRE[2])
    opened.write(0.0, 0.0, 0.0)
    opened.read(MS)
    assert opened.read(2 * MS).z == pytest.approx(0.01, abs=1e-4)


@pytest.mark.parametrize(
    "garbage", [b"\x00\xff\x13", b"<", b"<<<<", b">>>", b"<AAAA>", b"<AAAAAAAAAAAA\xffA>", bytes(range(0x20, 0x60))]
)
def test_noise_before_an_answer_is_passed_over(opened: Device, falcon: Falcon, garbage: bytes) -> None:
    falcon.spoil = lambda answer: garbage + answer
    falcon.place = (CENTRE[0], CENTRE[1] + 0.01, CENTRE[2])
    opened.write(0.0, 0.0, 0.0)
    opened.read(MS)
    assert opened.read(2 * MS).z == pytest.approx(0.01, abs=1e-4)


@given(st.lists(st.binary(max_size=40), max_size=8), st.integers(1, 62))
def test_whatever_the_line_does_the_next_good_answer_is_understood(noise: list, chunk: int) -> None:
    falcon = Falcon()
    with pytest.MonkeyPatch.context() as patch:
        bus = Bus(falcon)
        patch.setattr("usb.backend.libusb1.get_backend", lambda find_library=None: bus)
        with backend.Falcon("left", configured()) as device:
            falcon.chunk = chunk
            for k, bytes_ in enumerate(noise, 1):
                falcon.spoil = lambda answer, bytes_=bytes_: bytes_ + answer[:7] if len(bytes_) % 2 else bytes_ + answer
                try:
                    device.read(k * MS)
                except DeviceTimeout:
                    continue
            falcon.spoil = bytes
            falcon.place = (CENTRE[0], CENTRE[1] + 0.01, CENTRE[2])
            device.write(0.0, 0.0, 0.0)
            device.read(20 * MS)
            assert device.read(21 * MS).z == pytest.approx(0.01, abs=1e-4)


def test_a_lost_byte_costs_one_frame(opened: Device, falcon: Falcon) -> None:
    lost = iter([True])
    falcon.spoil = lambda answer: answer[:6] + answer[7:] if next(lost, False) else answer
    opened.write(0.0, 0.0, 1.0)
    assert opened.read(MS).ready
    assert falcon.force == pytest.approx((0.0, 0.0, 1.0), abs=0.01)


def test_two_forces_in_a_millisecond_are_both_answered(opened: Device, falcon: Falcon) -> None:
    opened.write(0.0, 0.0, 0.5)
    opened.write(0.0, 0.0, 1.0)
    opened.read(MS)
    assert falcon.force == pytest.approx((0.0, 0.0, 1.0), abs=0.01)
    falcon.place = (CENTRE[0], CENTRE[1] + 0.01, CENTRE[2])
    assert opened.read(2 * MS).z == pytest.approx(0.01, abs=1e-4)


def test_a_silent_falcon_is_a_timeout(opened: Device, falcon: Falcon) -> None:
    falcon.spoil = lambda answer: b""
    with pytest.raises(DeviceTimeout, match="does not answer any more: is its power supply plugged in"):
        opened.read(MS)


def test_no_wait_is_endless(falcon: Falcon, plug: Callable[..., Bus]) -> None:
    bus = plug(falcon)
    with backend.Falcon("left", configured()) as device:
        device.read(MS)
    assert bus.timeouts
    assert all(0 < timeout <= 1000 for timeout in bus.timeouts)


def test_an_unplugged_falcon_is_lost(opened: Device, falcon: Falcon) -> None:
    falcon.unplug()
    with pytest.raises(DeviceLost, match="was its USB plug pulled out"):
        opened.write(0.0, 0.0, 0.0)
    with pytest.raises(DeviceLost, match="the Falcon is gone"):
        opened.read(MS)


def test_closing_gives_the_kernel_its_driver_back(falcon: Falcon) -> None:
    device = backend.Falcon("left", configured())
    device.open()
    assert falcon.claimed
    assert not falcon.has_driver
    device.write(1.0, 1.0, 1.0)
    device.close()
    assert falcon.commands == (0, 0, 0)
    assert not falcon.claimed
    assert falcon.has_driver


# --- finding it --------------------------------------------------------------------------------------------------


def test_the_first_one_is_opened(plug: Callable[..., Bus]) -> None:
    plug(Falcon("A"), Falcon("B"))
    with backend.Falcon("left", configured()) as device:
        assert device.info.serial == "A"


def test_two_are_told_apart_by_their_numbers(plug: Callable[..., Bus]) -> None:
    first, second = Falcon("A"), Falcon("B")
    plug(first, second)
    with backend.Falcon("left", configured(serial="B")) as device:
        assert device.info.serial == "B"
        assert not first.claimed
        with backend.Falcon("left", configured(serial="A")):
            assert first.claimed


def test_a_wrong_number_says_which_there_are(plug: Callable[..., Bus]) -> None:
    plug(Falcon("B"), Falcon("A"))
    with pytest.raises(DeviceNotFound, match=r"serial number 'C' is plugged in; there are: A, B$"):
        backend.Falcon("left", configured(serial="C")).open()


def test_one_without_a_number_is_called_by_its_place(plug: Callable[..., Bus]) -> None:
    plug(Falcon(""))
    with backend.Falcon("left", configured()) as device:
        assert device.info.serial == "USB 1-4"


def test_none_at_all_is_said(plug: Callable[..., Bus]) -> None:
    plug()
    with pytest.raises(DeviceNotFound, match=r"no Falcon \(0403:cb48\) is plugged into USB"):
        backend.Falcon("left", configured()).open()


def test_without_permission_it_says_how_to_get_it(plug: Callable[..., Bus]) -> None:
    falcon = Falcon()
    falcon.permitted = False
    plug(falcon)
    with pytest.raises(
        DeviceNotFound, match=r"no permission to open the Falcon: install deploy/udev/70-netboard.rules"
    ):
        backend.Falcon("left", configured()).open()
    with pytest.raises(DeviceNotFound, match=r"there are: one whose number cannot be read; install deploy/udev"):
        backend.Falcon("left", configured(serial="FALCON1")).open()


def test_one_in_use_is_left_alone(falcon: Falcon) -> None:
    falcon.used_by_another = True
    with pytest.raises(DeviceNotFound, match="used by another program"):
        backend.Falcon("left", configured()).open()
    assert falcon.has_driver
    assert falcon.frames == 0


def test_without_libusb_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("libusb1", "libusb0", "openusb"):
        monkeypatch.setattr(f"usb.backend.{name}.get_backend", lambda find_library=None: None)
    with pytest.raises(DeviceNotFound, match=r"apt-get install libusb-1\.0-0"):
        backend.Falcon("left", configured()).open()


def test_without_pyusb_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "usb.core", None)
    with pytest.raises(DeviceNotFound, match=r"netboard\[devices\]"):
        backend.Falcon("left", configured()).open()


def test_wrong_options_are_named() -> None:
    with pytest.raises(ConfigError, match=r"agents\.left\.options\] torque_scale: found -1"):
        backend.Falcon("left", configured(torque_scale=-1))


# --- firmware ----------------------------------------------------------------------------------------------------


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """What its owner says is the firmware."""
    path = tmp_path / "falcon.bin"
    path.write_bytes(FIRMWARE)
    return path


def test_one_that_is_loaded_is_only_talked_to(falcon: Falcon) -> None:
    with backend.Falcon("left", configured()) as device:
        assert device.info.details["firmware"] == "was loaded before"
    assert falcon.requests == [(0, 1), (0, 2), *NORMAL]


def test_firmware_is_loaded_by_the_book(plug: Callable[..., Bus], file: Path) -> None:
    falcon = Falcon(loaded=False, homed=False)
    plug(falcon)
    with backend.Falcon("left", configured(firmware=str(file))) as device:
        assert device.info.details["firmware"] == "falcon.bin, attempt 1"
        assert not device.read(MS).ready
    asked = falcon.requests[falcon.requests.index((9, 16)) - 2 :]
    assert asked == [*LOADING, *NORMAL]


@pytest.mark.parametrize("failures", [1, 9])
def test_loading_is_tried_again(plug: Callable[..., Bus], file: Path, failures: int) -> None:
    falcon = Falcon(loaded=False)
    falcon.echoes_wrongly = failures
    plug(falcon)
    with backend.Falcon("left", configured(firmware=str(file))) as device:
        assert device.info.details["firmware"] == f"falcon.bin, attempt {failures + 1}"
        assert device.read(MS).ready


def test_loading_is_given_up_after_ten_times(plug: Callable[..., Bus], file: Path) -> None:
    falcon = Falcon(loaded=False)
    falcon.echoes_wrongly = 10
    plug(falcon)
    with pytest.raises(DeviceNotFound, match=r"in 10 attempts: .*something else than was sent, at byte 186 of 775"):
        backend.Falcon("left", configured(firmware=str(file))).open()
    assert not falcon.claimed


def test_without_a_file_it_says_that_one_is_needed(plug: Callable[..., Bus]) -> None:
    falcon = Falcon(loaded=False)
    plug(falcon)
    with pytest.raises(DeviceNotFound, match=r"no program in it: give the file .* as the option firmware"):
        backend.Falcon("left", configured()).open()
    assert not falcon.claimed
    assert falcon.has_driver


def test_without_power_it_says_so(plug: Callable[..., Bus], file: Path) -> None:
    falcon = Falcon()
    falcon.switch_off()
    plug(falcon)
    with pytest.raises(DeviceNotFound, match=r"10 attempts: the Falcon does not reply: is its power supply plugged in"):
        backend.Falcon("left", configured(firmware=str(file))).open()


def test_a_file_that_is_no_firmware_is_suspected(plug: Callable[..., Bus], file: Path) -> None:
    falcon = Falcon(loaded=False)
    falcon.runs = False
    plug(falcon)
    with pytest.raises(DeviceNotFound, match=r"does not run: is .*falcon\.bin really the Falcon's firmware"):
        backend.Falcon("left", configured(firmware=str(file))).open()


@pytest.mark.parametrize(("content", "why"), [(None, "cannot be read: No such file"), (b"", "it has 0 bytes")])
def test_a_useless_file_is_named(plug: Callable[..., Bus], tmp_path: Path, content: bytes | None, why: str) -> None:
    plug(Falcon(loaded=False))
    path = tmp_path / "other.bin"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DeviceNotFound, match=rf"other\.bin .*{why}"):
        backend.Falcon("left", configured(firmware=str(path))).open()


def test_power_that_fails_in_between_costs_the_zero(opened: Device, falcon: Falcon) -> None:
    opened.read(MS)
    falcon.switch_off()
    with pytest.raises(DeviceTimeout):
        opened.read(2 * MS)
    falcon.switch_on()
    falcon.loaded = True
    opened.read(3 * MS)
    assert not opened.read(4 * MS).ready


def test_what_cannot_be_sent_whole_is_a_timeout(falcon: Falcon, plug: Callable[..., Bus]) -> None:
    bus = plug(falcon)
    with backend.Falcon("left", configured()) as device:
        whole = bus.bulk_write
        bus.bulk_write = lambda *args: 7
        with pytest.raises(DeviceTimeout, match="took 7 of 16 bytes"):
            device.write(0.0, 0.0, 0.0)
        bus.bulk_write = whole


def test_a_chip_can_be_closed_when_it_is_gone(falcon: Falcon) -> None:
    chip = ftdi.Chip(ftdi.find((0x0403, 0xCB48), "", "Falcon"), "Falcon")
    falcon.unplug()
    chip.close()
    assert not falcon.claimed
