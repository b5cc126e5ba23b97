"""The Falcon backend on a simulated USB bus with the real pyusb: contract, protocol, and faults."""

import contextlib
import errno
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import hypot
from pathlib import Path

import pytest
import usb.core
from fake_falcon import FIRMWARE, Bus, Falcon
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.devices.contract.device import Device
from netboard.devices.falcon import device as backend
from netboard.devices.falcon import ftdi
from netboard.devices.falcon.kinematics import CENTRE
from netboard.devices.falcon.serial_protocol import GREEN, HOME, RED, FalconReply, answer_in, frame_of
from netboard.testing.device import MS, DeviceContract

NORMAL = [(9, 1), (3, 0x2), (0, 1), (0, 2)]
"""Requests that set the chip up for the firmware: latency, baud rate, purge."""

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
"""Requests that start the boot loader, then raise its baud rate."""


def configured(**options: object) -> Config:
    config = Config()
    left = replace(config.agents.left, options=options)
    return replace(config, agents=replace(config.agents, left=left))


@pytest.fixture
def plug(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Bus]:
    """Return a function that puts devices on the bus."""

    def plug(*falcons: Falcon) -> Bus:
        bus = Bus(*falcons)
        monkeypatch.setattr("usb.backend.libusb1.get_backend", lambda find_library=None: bus)
        return bus

    return plug


@pytest.fixture
def falcon(plug: Callable[..., Bus]) -> Falcon:
    """A Falcon on the bus, ready for use."""
    connected = Falcon()
    plug(connected)
    return connected


@pytest.fixture
def opened(falcon: Falcon) -> Iterator[Device]:
    """The open backend of that Falcon."""
    device = backend.Falcon("left", configured())
    device.open()
    yield device
    with contextlib.suppress(DeviceError):  # the test may have broken the device
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


# --- frames ------------------------------------------------------------------------------------------------------

int16 = st.integers(-0x8000, 0x7FFF)


def test_frame_encodes_forces_and_flags() -> None:
    assert frame_of((0, 0, 0), 0) == b"<AAAAAAAAAAAAAA>"
    assert frame_of((0x1234, -1, -0x8000), RED | HOME) == b"<EDCBPPPPAAAI" + bytes([0x41 + 9]) + b"A>"


@given(st.tuples(int16, int16, int16), st.integers(0, 7), st.integers(0, 15))
def test_response_decodes_to_counts_homing_and_buttons(counts: tuple, homed: int, buttons: int) -> None:
    frame = bytearray(frame_of(counts, 0))
    frame[13] = 0x41 + (homed << 4 | buttons)
    assert answer_in(bytes(frame)) == FalconReply(counts, homed == 7, buttons)


@given(st.binary(min_size=14, max_size=14))
def test_only_well_formed_responses_are_decoded(inside: bytes) -> None:
    found = answer_in(b"<" + inside + b">")
    assert (found is not None) == (all(0x41 <= byte <= 0x50 for byte in inside[:12]) and 0x41 <= inside[12] <= 0xC0)


# --- position, buttons and force ---------------------------------------------------------------------------------


def test_falcon_axes_map_to_scene_axes(opened: Device, falcon: Falcon) -> None:
    falcon.place = (CENTRE[0] + 0.01, CENTRE[1] + 0.02, CENTRE[2] + 0.03)
    opened.write(0.0, 0.0, 0.0)
    opened.read(MS)
    reading = opened.read(2 * MS)
    assert (reading.x, reading.y, reading.z) == pytest.approx((0.03, 0.01, 0.02), abs=1e-4)
    assert reading.ready


def test_motors_render_the_written_force(opened: Device, falcon: Falcon) -> None:
    for k, by in enumerate([(0.0, 0.0, 0.0), (0.02, 0.01, -0.03), (-0.03, 0.03, 0.02)]):
        falcon.place = tuple(c + d for c, d in zip(CENTRE, by, strict=True))
        opened.read((2 * k + 1) * MS)
        opened.read((2 * k + 2) * MS)
        opened.write(0.5, -1.0, 1.5)
        assert falcon.force == pytest.approx((0.5, -1.0, 1.5), abs=0.02)


def test_excessive_force_is_scaled_and_keeps_its_direction(opened: Device, falcon: Falcon) -> None:
    for force in ((100.0, 0.0, 0.0), (0.0, 80.0, 0.0), (0.0, -30.0, 70.0), (9.0, 9.0, -9.0)):
        opened.write(*force)
        opened.read(MS)
        assert max(map(abs, falcon.commands)) <= backend.MAX_COMMAND
        size = hypot(*falcon.force)
        assert 5.0 < size <= backend.MAX_FORCE
        scaled = tuple(part / hypot(*force) * size for part in force)
        assert falcon.force == pytest.approx(scaled, abs=0.01)


def test_torque_scale_option_scales_the_motor_commands(falcon: Falcon) -> None:
    with backend.Falcon("left", configured(torque_scale=5000)) as device:
        device.write(1.0, 0.0, 0.0)
        assert falcon.force == pytest.approx((0.5, 0.0, 0.0), abs=0.02)


def test_grip_buttons_are_reported(opened: Device, falcon: Falcon) -> None:
    falcon.buttons = 0b0110
    opened.read(MS)
    assert opened.read(2 * MS).buttons == 0b0110


def test_read_without_a_new_write_resends_the_last_force(opened: Device, falcon: Falcon) -> None:
    opened.write(0.0, 0.0, 1.0)
    opened.read(MS)
    falcon.commands = (0, 0, 0)
    opened.read(2 * MS)
    assert falcon.force == pytest.approx((0.0, 0.0, 1.0), abs=0.01)


def test_each_millisecond_takes_at_most_one_frame(opened: Device, falcon: Falcon) -> None:
    before = falcon.frames
    for k in range(1, 101):
        opened.read(k * MS)
        opened.write(0.0, 0.0, 0.1)
    assert falcon.frames - before <= 101


def test_velocity_of_a_moving_grip_is_estimated(opened: Device, falcon: Falcon) -> None:
    speed = 0.2
    for k in range(1, 100):
        falcon.place = (CENTRE[0], CENTRE[1] + speed * k * 1e-3 - 0.01, CENTRE[2])
        opened.write(0.0, 0.0, 0.0)
        reading = opened.read(k * MS)
    assert reading.vz == pytest.approx(speed, rel=0.05)
    assert (reading.vx, reading.vy) == pytest.approx((0.0, 0.0), abs=0.02)


# --- homing ------------------------------------------------------------------------------------------------------


def test_unhomed_falcon_renders_no_force_and_lights_red(plug: Callable[..., Bus]) -> None:
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


def test_impossible_encoder_counts_keep_the_position_and_stop_the_force(opened: Device, falcon: Falcon) -> None:
    here = opened.read(MS)
    opened.write(0.0, 0.0, 1.0)
    falcon.corrupt = lambda answer: b"<" + frame_of((30000, 0, 0), 0)[1:13] + answer[13:]
    opened.read(2 * MS)
    reading = opened.read(3 * MS)
    assert not reading.ready
    assert (reading.x, reading.y, reading.z) == (here.x, here.y, here.z)
    opened.write(0.0, 0.0, 1.0)
    assert (falcon.commands, falcon.flags) == ((0, 0, 0), RED)


# --- serial line -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("chunk", [1, 5, 15, 16, 62])
def test_response_in_several_chunks_is_assembled(opened: Device, falcon: Falcon, chunk: int) -> None:
    falcon.chunk = chunk
    falcon.place = (CENTRE[0], CENTRE[1] + 0.01, CENTRE[2])
    opened.write(0.0, 0.0, 0.0)
    opened.read(MS)
    assert opened.read(2 * MS).z == pytest.approx(0.01, abs=1e-4)


@pytest.mark.parametrize(
    "garbage", [b"\x00\xff\x13", b"<", b"<<<<", b">>>", b"<AAAA>", b"<AAAAAAAAAAAA\xffA>", bytes(range(0x20, 0x60))]
)
def test_noise_before_a_response_is_skipped(opened: Device, falcon: Falcon, garbage: bytes) -> None:
    falcon.corrupt = lambda answer: garbage + answer
    falcon.place = (CENTRE[0], CENTRE[1] + 0.01, CENTRE[2])
    opened.write(0.0, 0.0, 0.0)
    opened.read(MS)
    assert opened.read(2 * MS).z == pytest.approx(0.01, abs=1e-4)


@given(st.lists(st.binary(max_size=40), max_size=8), st.integers(1, 62))
def test_next_valid_response_is_decoded_after_any_line_noise(noise: list, chunk: int) -> None:
    falcon = Falcon()
    with pytest.MonkeyPatch.context() as patch:
        bus = Bus(falcon)
        patch.setattr("usb.backend.libusb1.get_backend", lambda find_library=None: bus)
        with backend.Falcon("left", configured()) as device:
            falcon.chunk = chunk
            for k, bytes_ in enumerate(noise, 1):
                falcon.corrupt = lambda answer, bytes_=bytes_: (
                    bytes_ + answer[:7] if len(bytes_) % 2 else bytes_ + answer
                )
                try:
                    device.read(k * MS)
                except DeviceTimeout:
                    continue
            falcon.corrupt = bytes
            falcon.place = (CENTRE[0], CENTRE[1] + 0.01, CENTRE[2])
            device.write(0.0, 0.0, 0.0)
            device.read(20 * MS)
            assert device.read(21 * MS).z == pytest.approx(0.01, abs=1e-4)


def test_lost_byte_costs_only_one_frame(opened: Device, falcon: Falcon) -> None:
    lost = iter([True])
    falcon.corrupt = lambda answer: answer[:6] + answer[7:] if next(lost, False) else answer
    opened.write(0.0, 0.0, 1.0)
    assert opened.read(MS).ready
    assert falcon.force == pytest.approx((0.0, 0.0, 1.0), abs=0.01)


def test_two_writes_within_a_millisecond_keep_responses_in_step(opened: Device, falcon: Falcon) -> None:
    opened.write(0.0, 0.0, 0.5)
    opened.write(0.0, 0.0, 1.0)
    opened.read(MS)
    assert falcon.force == pytest.approx((0.0, 0.0, 1.0), abs=0.01)
    falcon.place = (CENTRE[0], CENTRE[1] + 0.01, CENTRE[2])
    assert opened.read(2 * MS).z == pytest.approx(0.01, abs=1e-4)


def test_silent_falcon_raises_device_timeout(opened: Device, falcon: Falcon) -> None:
    falcon.corrupt = lambda answer: b""
    with pytest.raises(DeviceTimeout, match="no longer answers: is its power supply plugged in"):
        opened.read(MS)


def test_every_usb_transfer_has_a_finite_timeout(falcon: Falcon, plug: Callable[..., Bus]) -> None:
    bus = plug(falcon)
    with backend.Falcon("left", configured()) as device:
        device.read(MS)
    assert bus.timeouts
    assert all(0 < timeout <= 1000 for timeout in bus.timeouts)


def test_unplugged_falcon_raises_device_lost(opened: Device, falcon: Falcon) -> None:
    falcon.unplug()
    with pytest.raises(DeviceLost, match="was its USB plug pulled out"):
        opened.write(0.0, 0.0, 0.0)
    with pytest.raises(DeviceLost, match="the Falcon was disconnected"):
        opened.read(MS)


def test_close_releases_the_interface_and_reattaches_the_kernel_driver(falcon: Falcon) -> None:
    device = backend.Falcon("left", configured())
    device.open()
    assert falcon.claimed
    assert not falcon.has_driver
    device.write(1.0, 1.0, 1.0)
    device.close()
    assert falcon.commands == (0, 0, 0)
    assert not falcon.claimed
    assert falcon.has_driver


# --- finding the device ------------------------------------------------------------------------------------------


def test_only_falcon_is_opened_by_default(plug: Callable[..., Bus]) -> None:
    plug(Falcon("A"))
    with backend.Falcon("left", configured()) as device:
        assert device.info.serial == "A"


@pytest.mark.parametrize(
    ("serials", "options", "given"),
    [(("A", "B"), {}, "Falcon are"), (("A", "A"), {"serial": "A"}, "Falcon with serial 'A' are"), (("", ""), {}, "Fa")],
)
def test_none_of_several_falcons_is_opened_by_chance(
    plug: Callable[..., Bus], serials: tuple[str, ...], options: dict[str, str], given: str
) -> None:
    falcons = tuple(Falcon(serial) for serial in serials)
    plug(*falcons)
    with pytest.raises(DeviceNotFound, match=rf"^2 devices {given}.*'1-1'; .*'1-2'; set one of .*serial, path"):
        backend.Falcon("left", configured(**options)).open()
    assert not any(falcon.claimed for falcon in falcons)


@pytest.mark.parametrize("path", ["1-1", "1-2"])
def test_falcons_with_equal_serial_numbers_are_selected_by_usb_port(plug: Callable[..., Bus], path: str) -> None:
    falcons = Falcon("A"), Falcon("A")
    plug(*falcons)
    with backend.Falcon("left", configured(serial="A", path=path)):
        assert [falcon.claimed for falcon in falcons] == [path == "1-1", path == "1-2"]


def test_falcon_is_selected_by_serial_number(plug: Callable[..., Bus]) -> None:
    first, second = Falcon("A"), Falcon("B")
    plug(first, second)
    with backend.Falcon("left", configured(serial="B")) as device:
        assert device.info.serial == "B"
        assert not first.claimed
        with backend.Falcon("left", configured(serial="A")):
            assert first.claimed


def test_unknown_serial_number_error_lists_connected_ones(plug: Callable[..., Bus]) -> None:
    plug(Falcon("B"), Falcon("A"))
    with pytest.raises(DeviceNotFound, match=r"no Falcon with serial 'C'; there are: serial 'B', .*'A', path '1-2'$"):
        backend.Falcon("left", configured(serial="C")).open()


def test_falcon_without_serial_number_is_identified_by_its_usb_port(plug: Callable[..., Bus]) -> None:
    plug(Falcon(""))
    with backend.Falcon("left", configured()) as device:
        assert device.info.serial == "USB 1-4"


def test_missing_falcon_is_reported(plug: Callable[..., Bus]) -> None:
    plug()
    with pytest.raises(DeviceNotFound, match=r"no Falcon \(0403:cb48\) is plugged into USB"):
        backend.Falcon("left", configured()).open()


def test_bus_that_changes_while_it_is_listed_is_reported(plug: Callable[..., Bus], falcon: Falcon) -> None:
    def fail() -> list[Falcon]:
        raise usb.core.USBError("Input/Output Error", -1, errno.EIO)

    plug(falcon).enumerate_devices = fail
    with pytest.raises(DeviceNotFound, match=r"pyusb cannot list the USB devices: .*Input/Output Error"):
        backend.Falcon("left", configured()).open()


def test_missing_permission_error_points_to_the_udev_rules(plug: Callable[..., Bus]) -> None:
    falcon = Falcon()
    falcon.permitted = False
    plug(falcon)
    with pytest.raises(
        DeviceNotFound, match=r"no permission to open the Falcon: install deploy/udev/70-netboard.rules"
    ):
        backend.Falcon("left", configured()).open()
    with pytest.raises(DeviceNotFound, match=r"there are: serial '', path '1-1'; a serial .*: install deploy/udev"):
        backend.Falcon("left", configured(serial="FALCON1")).open()


def test_falcon_used_by_another_program_is_left_alone(falcon: Falcon) -> None:
    falcon.used_by_another = True
    with pytest.raises(DeviceNotFound, match="used by another program"):
        backend.Falcon("left", configured()).open()
    assert falcon.has_driver
    assert falcon.frames == 0


def test_missing_libusb_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("libusb1", "libusb0", "openusb"):
        monkeypatch.setattr(f"usb.backend.{name}.get_backend", lambda find_library=None: None)
    with pytest.raises(DeviceNotFound, match=r"apt-get install libusb-1\.0-0"):
        backend.Falcon("left", configured()).open()


def test_missing_pyusb_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "usb.core", None)
    with pytest.raises(DeviceNotFound, match=r"netboard\[devices\]"):
        backend.Falcon("left", configured()).open()


def test_error_names_invalid_option() -> None:
    with pytest.raises(ConfigError, match=r"agents\.left\.options\] torque_scale: found -1"):
        backend.Falcon("left", configured(torque_scale=-1))


# --- firmware ----------------------------------------------------------------------------------------------------


@pytest.fixture
def firmware_file(tmp_path: Path) -> Path:
    """A file with the firmware, to be given as an option."""
    path = tmp_path / "falcon.bin"
    path.write_bytes(FIRMWARE)
    return path


def test_loaded_falcon_is_not_loaded_again(falcon: Falcon) -> None:
    with backend.Falcon("left", configured()) as device:
        assert device.info.details["firmware"] == "was loaded before"
    assert falcon.requests == [(0, 1), (0, 2), *NORMAL]


def test_firmware_is_loaded_with_the_documented_requests(plug: Callable[..., Bus], firmware_file: Path) -> None:
    falcon = Falcon(loaded=False, homed=False)
    plug(falcon)
    with backend.Falcon("left", configured(firmware=str(firmware_file))) as device:
        assert device.info.details["firmware"] == "falcon.bin, attempt 1"
        assert not device.read(MS).ready
    asked = falcon.requests[falcon.requests.index((9, 16)) - 2 :]
    assert asked == [*LOADING, *NORMAL]


@pytest.mark.parametrize("failures", [1, 9])
def test_loading_is_retried_after_a_wrong_echo(plug: Callable[..., Bus], firmware_file: Path, failures: int) -> None:
    falcon = Falcon(loaded=False)
    falcon.wrong_echoes = failures
    plug(falcon)
    with backend.Falcon("left", configured(firmware=str(firmware_file))) as device:
        assert device.info.details["firmware"] == f"falcon.bin, attempt {failures + 1}"
        assert device.read(MS).ready


def test_loading_fails_after_ten_attempts(plug: Callable[..., Bus], firmware_file: Path) -> None:
    falcon = Falcon(loaded=False)
    falcon.wrong_echoes = 10
    plug(falcon)
    with pytest.raises(DeviceNotFound, match=r"in 10 attempts: .*other data than was sent, at byte 186 of 775"):
        backend.Falcon("left", configured(firmware=str(firmware_file))).open()
    assert not falcon.claimed


def test_unloaded_falcon_without_firmware_option_is_reported(plug: Callable[..., Bus]) -> None:
    falcon = Falcon(loaded=False)
    plug(falcon)
    with pytest.raises(DeviceNotFound, match=r"has no firmware: name the file .* in the option firmware"):
        backend.Falcon("left", configured()).open()
    assert not falcon.claimed
    assert falcon.has_driver


def test_error_without_power_asks_for_the_power_supply(plug: Callable[..., Bus], firmware_file: Path) -> None:
    falcon = Falcon()
    falcon.switch_off()
    plug(falcon)
    with pytest.raises(DeviceNotFound, match=r"10 attempts: the Falcon does not reply: is its power supply plugged in"):
        backend.Falcon("left", configured(firmware=str(firmware_file))).open()


def test_firmware_that_does_not_run_is_reported(plug: Callable[..., Bus], firmware_file: Path) -> None:
    falcon = Falcon(loaded=False)
    falcon.runs = False
    plug(falcon)
    with pytest.raises(DeviceNotFound, match=r"does not run: is .*falcon\.bin really the Falcon's firmware"):
        backend.Falcon("left", configured(firmware=str(firmware_file))).open()


@pytest.mark.parametrize(("content", "why"), [(None, "cannot be read: No such file"), (b"", "it has 0 bytes")])
def test_error_names_unreadable_or_empty_firmware_file(
    plug: Callable[..., Bus], tmp_path: Path, content: bytes | None, why: str
) -> None:
    plug(Falcon(loaded=False))
    path = tmp_path / "other.bin"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DeviceNotFound, match=rf"other\.bin .*{why}"):
        backend.Falcon("left", configured(firmware=str(path))).open()


def test_power_failure_requires_homing_again(opened: Device, falcon: Falcon) -> None:
    opened.read(MS)
    falcon.switch_off()
    with pytest.raises(DeviceTimeout):
        opened.read(2 * MS)
    falcon.switch_on()
    falcon.loaded = True
    opened.read(3 * MS)
    assert not opened.read(4 * MS).ready


def test_partial_usb_write_raises_device_timeout(falcon: Falcon, plug: Callable[..., Bus]) -> None:
    bus = plug(falcon)
    with backend.Falcon("left", configured()) as device:
        whole = bus.bulk_write
        bus.bulk_write = lambda *args: 7
        with pytest.raises(DeviceTimeout, match="took 7 of 16 bytes"):
            device.write(0.0, 0.0, 0.0)
        bus.bulk_write = whole


def test_unplugged_chip_can_be_closed(falcon: Falcon) -> None:
    chip = ftdi.Chip(ftdi.find((0x0403, 0xCB48), "Falcon", "", ""), "Falcon")
    falcon.unplug()
    chip.close()
    assert not falcon.claimed
