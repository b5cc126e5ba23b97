"""OpenHaptics devices over a fake of the vendor's library: the contract, and library faults."""

import logging
from collections.abc import Callable, Iterator
from itertools import cycle
from math import hypot
from pathlib import Path
from time import monotonic, monotonic_ns

import pytest
from contract import MS, DeviceContract

from libhd import FIRST, PATIENT, SECOND, STALL_NS, Fake, Opener, configured, made
from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.devices.contract import registry
from netboard.devices.contract.device import Box, Device
from netboard.devices.touch import find as hdfind
from netboard.devices.touch import library as hdrig
from netboard.devices.touch.api import Calibration, Capability, Error, Style
from netboard.devices.touch.device import LATE, REST_NS, SERVOS, TIRED, OpenHaptics

TIMEOUT = 60.0
"""What is waited for is there long before, on a busy machine too [s]."""
SHUTDOWN = ["stop", "unschedule", "disable 40512001"]


class OverTheFake(DeviceContract):
    """The contract, with a library that has a loop of its own."""

    servo = ""

    @pytest.fixture(autouse=True)
    def _library(self, fake: Fake) -> None:
        self.fake = fake

    def make(self, config: Config) -> Device:
        serial = SECOND if config.agents.left.zero else FIRST  # so that two can be open
        return OpenHaptics(
            "left", configured(config, library=self.fake.path, serial=serial, servo=self.servo, **PATIENT)
        )

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        self.fake.wait()
        right, up, near = self.fake.felt()
        return near, right, up

    def read_times(self) -> Iterator[int]:
        for _ in range(50):
            self.fake.wait(2)
            yield monotonic_ns()

    def unplug(self, device: Device) -> Callable[[], None]:
        self.fake.plug(False)
        return lambda: self.fake.plug(True)


class TestPythonServo(OverTheFake):
    servo = "python"


class TestServoInC(OverTheFake):
    servo = "c"


# --- what is there ---------------------------------------------------------------------------------------------


def test_the_library_shows_its_devices_and_nothing_is_left_open(fake: Fake) -> None:
    shown = OpenHaptics.present(configured(Config(), library=fake.path))
    assert {found.serial for found in shown} == {FIRST, SECOND}
    assert all(found.model for found in shown)
    assert not fake.is_open(FIRST)
    assert not fake.is_open(SECOND)
    assert "start" not in fake.said()


def test_one_that_this_process_uses_goes_on_while_the_others_are_looked_for(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    shown = OpenHaptics.present(configured(Config(), library=fake.path))
    assert [found.serial for found in shown] == [SECOND]
    fake.wait()
    assert device.read(monotonic_ns()).ready


def test_without_the_library_it_is_said_what_is_missing() -> None:
    with pytest.raises(DeviceNotFound, match=r"cannot be loaded: tried /nowhere/libHD\.so"):
        OpenHaptics.present(configured(Config(), library="/nowhere/libHD.so"))


# --- axes, units, what is told ------------------------------------------------------------------------------------


def test_it_is_a_backend_of_netboard() -> None:
    assert registry.find("openhaptics") is OpenHaptics


def test_right_up_and_near_become_the_scene_s_axes_in_metres(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    fake.place((10.0, 20.0, 30.0), (100.0, 200.0, 300.0))  # right, up, near
    reading = device.read(monotonic_ns())
    assert (reading.x, reading.y, reading.z) == pytest.approx((0.030, 0.010, 0.020))
    assert (reading.vx, reading.vy, reading.vz) == pytest.approx((0.3, 0.1, 0.2))


def test_forces_go_along_the_same_axes(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    device.write(0.1, 0.2, 0.3)  # near, right, up
    fake.wait()
    assert fake.felt() == pytest.approx((0.2, 0.3, 0.1))


def test_a_hand_that_is_pushed_up_goes_up(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    device.write(0.0, 0.0, 1.0)
    fake.wait(20)
    reading = device.read(monotonic_ns())
    assert reading.z > 1e-4
    assert (reading.x, reading.y) == (0.0, 0.0)


def test_a_stamp_is_of_the_monotonic_clock(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    before = monotonic_ns()
    fake.wait()
    assert before < device.read(monotonic_ns()).stamp_ns < monotonic_ns()


def test_no_sample_is_later_than_its_reading(open_one: Opener) -> None:
    device = open_one()
    assert device.read(5 * MS).stamp_ns == 5 * MS


def test_buttons_are_bits(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    fake.press(3)
    assert device.read(monotonic_ns()).buttons == 3


def test_what_the_device_says_of_itself_is_told(open_one: Opener) -> None:
    info = open_one().info
    assert (info.model, info.serial) == ("Touch", FIRST)
    assert (info.max_force, info.continuous_force, info.resolution) == (3.3, 0.88, 0.055e-3)
    assert info.workspace == pytest.approx(Box(-0.035, -0.08, -0.06, 0.035, 0.08, 0.06))
    said = dict(info.details)
    assert said.pop("max_damping").startswith("not told: HD_INVALID_ENUM (0x0100")
    assert said.pop("servo") in SERVOS
    assert said == {
        "name": "Default Device",
        "hd_version": "3.30.0",
        "vendor": "nobody, in fact",
        "driver_version": "4.3.2",
        "firmware_version": "1.9",
        "max_stiffness": "0.5 on the library's scale",
        "max_workspace": "-210 -110 -85 210 205 130 mm",
        "usable_workspace": "-80 -60 -35 80 60 35 mm",
        "velocity_limit": "850 mm/s",
        "impulse_limit": "0.05 N/ms",
        "ramping_rate": "33 N/s",
        "update_rate": "1000 Hz",
        **{limit.name.lower(): "on" for limit in hdfind.LIMITS},
    }


def test_the_library_s_own_limits_are_on(open_one: Opener, fake: Fake) -> None:
    open_one()
    for what in (Capability.FORCE_OUTPUT, Capability.ONE_FRAME_LIMIT, *hdfind.LIMITS):
        assert fake.enabled(what), what.name


def test_a_limit_that_the_device_lacks_is_told_and_no_obstacle(fake: Fake, caplog: pytest.LogCaptureFixture) -> None:
    fake.fail("hdEnable", Error.INVALID_ENUM, after=3)
    device = made(fake)
    details = device.open().details
    assert details["software_velocity_limit"].startswith("off: HD_INVALID_ENUM")
    assert "does without HD_SOFTWARE_VELOCITY_LIMIT" in caplog.text


# --- which device -------------------------------------------------------------------------------------------------


def test_a_device_is_found_by_its_serial_number(fake: Fake) -> None:
    device = made(fake, serial=SECOND)
    assert device.open().model == "Touch X"
    assert (fake.is_open(FIRST), fake.is_open(SECOND)) == (False, True)


def test_names_of_the_driver_s_folder_are_tried(fake: Fake, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake.name("By the window", SECOND)
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "By the window.config").touch()
    monkeypatch.setenv("GTDD_HOME", str(tmp_path))
    assert made(fake, serial=SECOND).open().serial == SECOND


def test_a_serial_number_goes_before_a_name(fake: Fake) -> None:
    assert made(fake, serial=SECOND, name="Default Device").open().serial == SECOND


def test_a_device_is_found_by_its_name(fake: Fake) -> None:
    assert made(fake, name="Right Device").open().serial == SECOND


def test_without_either_the_usual_names_are_tried(fake: Fake) -> None:
    fake.name("Default PHANToM")
    fake.calls.fake_refuse_null(1)
    assert made(fake).open().serial == FIRST


def test_at_last_the_library_chooses(fake: Fake) -> None:
    fake.name("Anything")
    info = made(fake).open()
    assert (info.serial, info.details["name"]) == (FIRST, "the library's default")


def test_what_is_there_is_listed_where_the_wanted_one_is_not(fake: Fake) -> None:
    with pytest.raises(DeviceNotFound) as found:
        made(fake, serial="12345").open()
    said = str(found.value)
    assert "no haptic device with serial number 12345" in said
    assert f'"Default Device" (Touch, serial {FIRST})' in said
    assert f'"Right Device" (Touch X, serial {SECOND})' in said
    assert 'not there: "Default PHANToM", "Left Device"' in said
    assert said.count("HD_DEVICE_FAULT (0x0300, internal -28") == 1
    assert "docs/how-to/touch.md" in said
    assert not fake.is_open(FIRST)
    assert not fake.is_open(SECOND)


def test_another_name_is_not_tried_for_a_named_one(fake: Fake) -> None:
    with pytest.raises(DeviceNotFound, match='no haptic device named "Left Device"'):
        made(fake, name="Left Device").open()
    assert fake.said() == []


def test_a_device_in_use_is_said_to_be(fake: Fake) -> None:
    made(fake).open()
    with pytest.raises(DeviceNotFound, match=r'"Default Device" \(in use by this process\)'):
        made(fake, "right", serial=FIRST).open()
    assert fake.is_open(FIRST)


# --- calibration and inkwell --------------------------------------------------------------------------------------


@pytest.mark.parametrize("style", [Style.CALIBRATION_AUTO, Style.CALIBRATION_INKWELL])
def test_a_calibration_is_brought_up_to_date_without_force(open_one: Opener, fake: Fake, style: Style) -> None:
    fake.calibration(Calibration.CALIBRATION_NEEDS_UPDATE, style)
    device = open_one()
    assert device.read(monotonic_ns()).ready
    assert f"calibrate {FIRST} {style}" in fake.said()


@pytest.mark.parametrize(
    ("state", "style", "todo"),
    [
        (Calibration.CALIBRATION_NEEDS_MANUAL_INPUT, Style.CALIBRATION_INKWELL, "put the stylus into its inkwell"),
        (Calibration.CALIBRATION_NEEDS_MANUAL_INPUT, Style.CALIBRATION_AUTO, "move the stylus slowly to all ends"),
        (Calibration.CALIBRATION_NEEDS_MANUAL_INPUT, Style.CALIBRATION_ENCODER_RESET, "with the vendor's tool"),
        (Calibration.CALIBRATION_NEEDS_UPDATE, Style.CALIBRATION_ENCODER_RESET, "with the vendor's tool"),
    ],
)
def test_an_operator_is_told_how_to_calibrate(fake: Fake, state: Calibration, style: Style, todo: str) -> None:
    fake.calibration(state, style)
    with pytest.raises(DeviceError, match=rf"not calibrated \(HD_{state.name}\): .*{todo}"):
        made(fake).open()
    assert not [line for line in fake.said() if line.startswith("calibrate")]
    assert not fake.is_open()


def test_a_calibration_that_never_comes_is_not_waited_for(fake: Fake) -> None:
    fake.calibration(Calibration.CALIBRATION_NEEDS_UPDATE, Style.CALIBRATION_INKWELL)
    rig = hdrig.rig_of(fake.path)
    device = made(fake)
    fake.fail("hdUpdateCalibration", Error.SUCCESS)
    pauses: list[float] = []
    calibrate = hdfind.calibrate
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "netboard.devices.touch.device.calibrate", lambda rig, opened: calibrate(rig, opened, pauses.append)
        )
        with pytest.raises(DeviceError, match="not calibrated"):
            device.open()
    assert sum(pauses) == pytest.approx(hdfind.CALIBRATE_S)
    assert not rig.uses("Default Device")


def test_a_docked_stylus_is_not_ready(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    fake.dock(True)
    assert not device.read(monotonic_ns()).ready
    fake.dock(False)
    assert device.read(monotonic_ns()).ready


def test_outside_of_the_usable_workspace_it_is_not_ready(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    fake.place((0.0, 60.1, 0.0))
    assert not device.read(monotonic_ns()).ready
    fake.place((0.0, 59.9, 0.0))
    assert device.read(monotonic_ns()).ready


# --- errors -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("code", sorted(TIRED))
def test_what_a_hand_or_a_warm_motor_causes_takes_the_readiness_for_a_while(
    open_one: Opener, fake: Fake, code: Error, caplog: pytest.LogCaptureFixture
) -> None:
    device = open_one()
    fake.error(code, 4)
    now = monotonic_ns()
    assert not device.read(now).ready
    assert f"HD_{code.name} (0x{code:04x}, internal 4, handle" in caplog.text
    fake.wait()
    assert not device.read(now + 1).ready
    assert device._tired_ns == now
    device._tired_ns = now - REST_NS
    assert device.read(monotonic_ns()).ready


@pytest.mark.parametrize("code", [*sorted(set(Error) - TIRED - {Error.SUCCESS}), 0x0999])
def test_every_other_error_is_the_end_of_it(open_one: Opener, fake: Fake, code: int) -> None:
    device = open_one()
    fake.error(code, -28)
    kind = DeviceTimeout if code in LATE else DeviceLost
    name = f"HD_{Error(code).name}" if code in set(Error) else "an unknown error"
    with pytest.raises(kind, match=rf"{name} \(0x{code:04x}, internal -28, handle \d+\)"):
        device.read(monotonic_ns())
    fake.said()
    device.close()
    assert fake.said() == SHUTDOWN


def test_all_errors_of_a_tick_are_named(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    fake.error(Error.COMM_ERROR, -28)
    fake.error(Error.DEVICE_FAULT)
    fake.error(Error.WARM_MOTORS)
    with pytest.raises(DeviceLost, match=r"HD_COMM_ERROR .*; HD_DEVICE_FAULT"):
        device.read(monotonic_ns())


def test_an_error_without_a_handle_is_everybody_s(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    fake.error(Error.COMM_ERROR, handle=0)
    with pytest.raises(DeviceLost):
        device.read(monotonic_ns())


def test_a_complaint_that_stays_is_logged_once(open_one: Opener, fake: Fake, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    device = open_one()
    for _ in range(5):
        fake.error(Error.WARM_MOTORS)
        device.read(monotonic_ns())
    assert caplog.text.count("HD_WARM_MOTORS") == 1


def test_errors_without_an_end_are_the_end(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    fake.calls.fake_pin_errors(1)
    fake.wait()
    with pytest.raises(DeviceLost, match="HD_DEVICE_FAULT"):
        device.read(monotonic_ns())
    fake.calls.fake_pin_errors(0)


def test_a_servo_that_stands_still_is_found(open_one: Opener, fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hdrig, "SETTLE_NS", MS)
    device = open_one()
    fake.calls.fake_stall(1)
    stamp = device.read(monotonic_ns()).stamp_ns
    assert device.read(stamp + STALL_NS).stamp_ns >= stamp
    fake.said()
    with pytest.raises(DeviceTimeout, match="stalled for"):
        device.read(monotonic_ns() + STALL_NS + MS)
    device.close()
    assert fake.said() == SHUTDOWN


def test_a_device_that_is_not_seen_to_take_its_zero_is_said_to_be_lost_and_released(
    open_one: Opener, fake: Fake, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = open_one()
    fake.calls.fake_stall(1)
    monkeypatch.setattr(hdrig, "SETTLE_NS", MS)
    with pytest.raises(DeviceLost, match="zero force"):
        device.close()
    assert not fake.is_open()
    fake.calls.fake_stall(0)
    device.open()
    assert device.read(monotonic_ns()).ready


# --- the force ----------------------------------------------------------------------------------------------------


def test_a_force_that_is_not_renewed_is_cut_and_comes_back_from_zero_only(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert fake.felt() == (0.0, 1.0, 0.0)
    assert device._servo is not None
    device._servo.put((0.0, 1.0, 0.0), monotonic_ns() - 201 * MS)  # the last one, so much later
    fake.wait()
    assert fake.felt() == (0.0, 0.0, 0.0)
    assert not device.read(monotonic_ns()).ready
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert fake.felt() == (0.0, 0.0, 0.0)
    device.write(0.0, 0.0, 0.0)
    fake.wait()
    assert device.read(monotonic_ns()).ready
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert fake.felt() == (0.0, 1.0, 0.0)


def test_a_force_too_large_keeps_its_direction(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    device.write(3.0, 4.0, 12.0)
    fake.wait()
    right, up, near = fake.felt()
    assert hypot(right, up, near) == pytest.approx(3.3)
    assert (right / near, up / near) == pytest.approx((4 / 3, 12 / 3))


def test_no_force_is_made_of_two(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    felt: set[tuple[float, float, float]] = set()
    forces, end = cycle(1e-3 * k for k in range(1000)), monotonic() + TIMEOUT
    while len(felt) <= 50:
        assert monotonic() < end, "the servo loop does not turn"
        force = next(forces)
        device.write(force, force, force)
        felt.add(fake.felt())
    assert all(right == up == near for right, up, near in felt)


# --- options -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{"servo": "rust"}, {"force_timeout_ms": 0.5}, {"resolution": -1.0}])
def test_wrong_options_are_named(fake: Fake, options: dict[str, str | float]) -> None:
    (name,) = options
    with pytest.raises(ConfigError, match=rf"\[agents\.left\.options\] {name}: found"):
        made(fake, **options)
