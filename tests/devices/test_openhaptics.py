"""OpenHaptics devices over a fake of the vendor's library: the contract, and library faults."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import cycle
from math import hypot, inf, nan
from pathlib import Path
from time import monotonic, monotonic_ns

import pytest
from numba import typeof

from libhd import FIRST, PATIENT, SECOND, STALL_NS, Fake, Opener, configured, make_device
from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.devices.contract import registry
from netboard.devices.contract.device import Box, Device
from netboard.devices.touch import find
from netboard.devices.touch import library as touch_library
from netboard.devices.touch.api import Calibration, Capability, Error, Library, Parameter, Style
from netboard.devices.touch.device import LATE, REST_NS, SERVOS, TIRED, OpenHaptics
from netboard.testing.device import MS, DeviceContract

TIMEOUT = 60.0
"""Longest wait of a test; ample even on a busy machine [s]."""
SHUTDOWN = ["stop", "unschedule", "disable 40512001"]


class FakeLibraryContract(DeviceContract):
    """The contract, with a library that has its own servo loop."""

    servo = ""

    @pytest.fixture(autouse=True)
    def _use_fake_library(self, fake: Fake) -> None:
        self.fake = fake

    def make(self, config: Config) -> Device:
        serial = SECOND if config.agents.left.zero else FIRST  # so that two devices can be open
        return OpenHaptics(
            "left", configured(config, library=self.fake.path, serial=serial, servo=self.servo, **PATIENT)
        )

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        self.fake.wait()
        right, up, near = self.fake.motor_force()
        return near, right, up

    def read_times(self) -> Iterator[int]:
        for _ in range(50):
            self.fake.wait(2)
            yield monotonic_ns()

    def unplug(self, device: Device) -> Callable[[], None]:
        self.fake.plug(False)
        return lambda: self.fake.plug(True)


class TestPythonServo(FakeLibraryContract):
    servo = "python"


class TestServoInC(FakeLibraryContract):
    servo = "c"


# --- connected devices -----------------------------------------------------------------------------------------


def test_present_lists_devices_and_leaves_none_open(fake: Fake) -> None:
    listed = OpenHaptics.present(configured(Config(), library=fake.path))
    assert {found.serial for found in listed} == {FIRST, SECOND}
    assert all(found.model for found in listed)
    assert not fake.is_open(FIRST)
    assert not fake.is_open(SECOND)
    assert "start" not in fake.call_log()


def test_open_device_keeps_running_while_others_are_listed(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    listed = OpenHaptics.present(configured(Config(), library=fake.path))
    assert [found.serial for found in listed] == [SECOND]
    fake.wait()
    assert device.read(monotonic_ns()).ready


def test_missing_library_is_reported() -> None:
    with pytest.raises(DeviceNotFound, match=r"cannot be loaded: tried /nowhere/libHD\.so"):
        OpenHaptics.present(configured(Config(), library="/nowhere/libHD.so"))


# --- axes, units, device information ------------------------------------------------------------------------------


def test_backend_is_registered_as_openhaptics() -> None:
    assert registry.find("openhaptics") is OpenHaptics


def test_positions_map_to_scene_axes_in_metres(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    fake.place((10.0, 20.0, 30.0), (100.0, 200.0, 300.0))  # right, up, near
    reading = device.read(monotonic_ns())
    assert (reading.x, reading.y, reading.z) == pytest.approx((0.030, 0.010, 0.020))
    assert (reading.vx, reading.vy, reading.vz) == pytest.approx((0.3, 0.1, 0.2))


def test_forces_map_to_the_axes_of_the_library(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    device.write(0.1, 0.2, 0.3)  # near, right, up
    fake.wait()
    assert fake.motor_force() == pytest.approx((0.2, 0.3, 0.1))


def test_upward_force_moves_the_hand_up(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    device.write(0.0, 0.0, 1.0)
    fake.wait(20)
    reading = device.read(monotonic_ns())
    assert reading.z > 1e-4
    assert (reading.x, reading.y) == (0.0, 0.0)


def test_time_stamps_use_the_monotonic_clock(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    before = monotonic_ns()
    fake.wait()
    assert before < device.read(monotonic_ns()).stamp_ns < monotonic_ns()


def test_time_stamp_is_never_later_than_the_reading(open_device: Opener) -> None:
    device = open_device()
    assert device.read(5 * MS).stamp_ns == 5 * MS


def test_buttons_form_a_bit_mask(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    fake.press(3)
    assert device.read(monotonic_ns()).buttons == 3


def test_device_info_reports_the_properties_from_the_library(open_device: Opener) -> None:
    info = open_device().info
    assert (info.model, info.serial) == ("Touch", FIRST)
    assert (info.max_force, info.continuous_force, info.resolution) == (3.3, 0.88, 0.055e-3)
    assert info.workspace == pytest.approx(Box(-0.035, -0.08, -0.06, 0.035, 0.08, 0.06))
    details = dict(info.details)
    assert details.pop("max_damping").startswith("not reported: HD_INVALID_ENUM (0x0100")
    assert details.pop("servo") in SERVOS
    assert details == {
        "name": "Default Device",
        "hd_version": "3.30.0",
        "vendor": "fake vendor",
        "driver_version": "4.3.2",
        "firmware_version": "1.9",
        "max_stiffness": "0.5 on the library's scale",
        "max_workspace": "-210 -110 -85 210 205 130 mm",
        "usable_workspace": "-80 -60 -35 80 60 35 mm",
        "velocity_limit": "850 mm/s",
        "impulse_limit": "0.05 N/ms",
        "ramping_rate": "33 N/s",
        "update_rate": "1000 Hz",
        **{limit.name.lower(): "on" for limit in find.LIMITS},
    }


def test_safety_limits_of_the_library_are_enabled(open_device: Opener, fake: Fake) -> None:
    open_device()
    for what in (Capability.FORCE_OUTPUT, Capability.ONE_FRAME_LIMIT, *find.LIMITS):
        assert fake.enabled(what), what.name


def test_unsupported_library_limit_is_reported_and_tolerated(fake: Fake, caplog: pytest.LogCaptureFixture) -> None:
    fake.fail("hdEnable", Error.INVALID_ENUM, after=3)
    device = make_device(fake)
    details = device.open().details
    assert details["software_velocity_limit"].startswith("off: HD_INVALID_ENUM")
    assert "does without HD_SOFTWARE_VELOCITY_LIMIT" in caplog.text


@pytest.mark.parametrize("what", [Parameter.NOMINAL_MAX_FORCE, Parameter.NOMINAL_MAX_CONTINUOUS_FORCE])
@pytest.mark.parametrize("force", [nan, inf, -0.1])
def test_device_whose_greatest_force_is_none_is_refused(
    fake: Fake, what: Parameter, force: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    doubles = Library.doubles
    monkeypatch.setattr(
        Library, "doubles", lambda hd, which, count: (force,) if which == what else doubles(hd, which, count)
    )
    with pytest.raises(DeviceError, match=rf"HD_{what.name} of {force:g} N; expected a number of at least 0"):
        make_device(fake).open()
    assert not fake.is_open()
    assert "start" not in fake.call_log()


# --- device selection ---------------------------------------------------------------------------------------------


def test_device_is_found_by_serial_number(fake: Fake) -> None:
    device = make_device(fake, serial=SECOND)
    assert device.open().model == "Touch X"
    assert (fake.is_open(FIRST), fake.is_open(SECOND)) == (False, True)


def test_names_in_the_driver_folder_are_tried(fake: Fake, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake.name("By the window", SECOND)
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "By the window.config").touch()
    monkeypatch.setenv("GTDD_HOME", str(tmp_path))
    assert make_device(fake, serial=SECOND).open().serial == SECOND


def test_serial_number_takes_precedence_over_name(fake: Fake) -> None:
    assert make_device(fake, serial=SECOND, name="Default Device").open().serial == SECOND


def test_device_is_found_by_name(fake: Fake) -> None:
    assert make_device(fake, name="Right Device").open().serial == SECOND


def test_usual_names_are_tried_without_serial_number_or_name(fake: Fake) -> None:
    fake.name("Default PHANToM")
    fake.calls.fake_refuse_null(1)
    assert make_device(fake).open().serial == FIRST


def test_default_device_of_the_library_is_the_last_resort(fake: Fake) -> None:
    fake.name("Anything")
    info = make_device(fake).open()
    assert (info.serial, info.details["name"]) == (FIRST, "the library's default")


def test_missing_device_error_lists_connected_devices(fake: Fake) -> None:
    with pytest.raises(DeviceNotFound) as found:
        make_device(fake, serial="12345").open()
    message = str(found.value)
    assert "no haptic device with serial number 12345" in message
    assert f'"Default Device" (Touch, serial {FIRST})' in message
    assert f'"Right Device" (Touch X, serial {SECOND})' in message
    assert 'not found: "Default PHANToM", "Left Device"' in message
    assert message.count("HD_DEVICE_FAULT (0x0300, internal -28") == 1
    assert "docs/how-to/touch.md" in message
    assert not fake.is_open(FIRST)
    assert not fake.is_open(SECOND)


def test_missing_named_device_is_not_replaced_by_another(fake: Fake) -> None:
    with pytest.raises(DeviceNotFound, match='no haptic device named "Left Device"'):
        make_device(fake, name="Left Device").open()
    assert fake.call_log() == []


def test_device_in_use_is_reported(fake: Fake) -> None:
    make_device(fake).open()
    with pytest.raises(DeviceNotFound, match=r'"Default Device" \(in use by this process\)'):
        make_device(fake, "right", serial=FIRST).open()
    assert fake.is_open(FIRST)


# --- calibration and inkwell --------------------------------------------------------------------------------------


@pytest.mark.parametrize("style", [Style.CALIBRATION_AUTO, Style.CALIBRATION_INKWELL])
def test_calibration_is_updated_without_force(open_device: Opener, fake: Fake, style: Style) -> None:
    fake.calibration(Calibration.CALIBRATION_NEEDS_UPDATE, style)
    device = open_device()
    assert device.read(monotonic_ns()).ready
    assert f"calibrate {FIRST} {style}" in fake.call_log()


@pytest.mark.parametrize(
    ("state", "style", "instruction"),
    [
        (Calibration.CALIBRATION_NEEDS_MANUAL_INPUT, Style.CALIBRATION_INKWELL, "put the stylus into its inkwell"),
        (Calibration.CALIBRATION_NEEDS_MANUAL_INPUT, Style.CALIBRATION_AUTO, "move the stylus slowly to all ends"),
        (Calibration.CALIBRATION_NEEDS_MANUAL_INPUT, Style.CALIBRATION_ENCODER_RESET, "with the vendor's tool"),
        (Calibration.CALIBRATION_NEEDS_UPDATE, Style.CALIBRATION_ENCODER_RESET, "with the vendor's tool"),
    ],
)
def test_calibration_error_says_what_to_do(fake: Fake, state: Calibration, style: Style, instruction: str) -> None:
    fake.calibration(state, style)
    with pytest.raises(DeviceError, match=rf"not calibrated \(HD_{state.name}\): .*{instruction}"):
        make_device(fake).open()
    assert not [line for line in fake.call_log() if line.startswith("calibrate")]
    assert not fake.is_open()


def test_waiting_for_calibration_ends_at_its_timeout(fake: Fake) -> None:
    fake.calibration(Calibration.CALIBRATION_NEEDS_UPDATE, Style.CALIBRATION_INKWELL)
    rig = touch_library.rig_of(fake.path)
    device = make_device(fake)
    fake.fail("hdUpdateCalibration", Error.SUCCESS)
    pauses: list[float] = []
    calibrate = find.calibrate
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "netboard.devices.touch.device.calibrate", lambda rig, opened: calibrate(rig, opened, pauses.append)
        )
        with pytest.raises(DeviceError, match="not calibrated"):
            device.open()
    assert sum(pauses) == pytest.approx(find.CALIBRATE_S)
    assert not rig.uses("Default Device")


def test_docked_stylus_is_not_ready(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    fake.dock(True)
    assert not device.read(monotonic_ns()).ready
    fake.dock(False)
    assert device.read(monotonic_ns()).ready


def test_stylus_outside_the_usable_workspace_is_not_ready(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    fake.place((0.0, 60.1, 0.0))
    assert not device.read(monotonic_ns()).ready
    fake.place((0.0, 59.9, 0.0))
    assert device.read(monotonic_ns()).ready


# --- errors -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("code", sorted(TIRED))
def test_recoverable_error_makes_the_device_unready_for_a_while(
    open_device: Opener, fake: Fake, code: Error, caplog: pytest.LogCaptureFixture
) -> None:
    device = open_device()
    fake.error(code, 4)
    now = monotonic_ns()
    assert not device.read(now).ready
    assert f"HD_{code.name} (0x{code:04x}, internal 4, handle" in caplog.text
    fake.wait()
    assert not device.read(now + 1).ready
    assert device._state[0]["rested_ns"] == now + REST_NS
    device._state["rested_ns"] = now
    assert device.read(monotonic_ns()).ready


@pytest.mark.parametrize("code", [*sorted(set(Error) - TIRED - {Error.SUCCESS}), 0x0999])
def test_every_other_error_is_fatal_and_close_releases_the_device(open_device: Opener, fake: Fake, code: int) -> None:
    device = open_device()
    fake.error(code, -28)
    kind = DeviceTimeout if code in LATE else DeviceLost
    name = f"HD_{Error(code).name}" if code in set(Error) else "an unknown error"
    with pytest.raises(kind, match=rf"{name} \(0x{code:04x}, internal -28, handle \d+\)"):
        device.read(monotonic_ns())
    fake.call_log()
    device.close()
    assert fake.call_log() == SHUTDOWN


def test_all_fatal_errors_of_a_tick_are_reported(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    fake.error(Error.COMM_ERROR, -28)
    fake.error(Error.DEVICE_FAULT)
    fake.error(Error.WARM_MOTORS)
    with pytest.raises(DeviceLost, match=r"HD_COMM_ERROR .*; HD_DEVICE_FAULT"):
        device.read(monotonic_ns())


def many_errors(fake: Fake) -> None:
    """Report a fatal error, and then more warnings than a servo keeps."""
    fake.error(Error.COMM_ERROR, -28)
    handle = fake.calls.fake_handle(FIRST.encode())
    for _ in range(3):
        for _ in range(100):
            fake.calls.fake_error(Error.WARM_MOTORS, 4, handle)
        fake.wait(4)


def test_fatal_error_is_not_forgotten_for_many_warnings(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    many_errors(fake)
    with pytest.raises(DeviceLost, match="failed: more errors at once than can be kept, so some are lost"):
        device.read(monotonic_ns())


@pytest.mark.parametrize("happens", [many_errors, lambda fake: fake.error(Error.COMM_ERROR, -28)])
@pytest.mark.parametrize("servo", SERVOS)
def test_error_during_the_calibration_keeps_the_force_off(
    fake: Fake, servo: str, happens: Callable[[Fake], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    enabled: list[object] = []
    monkeypatch.setattr("netboard.devices.touch.device.calibrate", lambda *_: happens(fake))
    monkeypatch.setattr("netboard.devices.touch.device.enable", lambda *_: enabled.append(True) or {})
    with pytest.raises(DeviceLost):
        make_device(fake, servo=servo).open()
    assert enabled == []
    assert not fake.is_open()


def test_error_without_a_handle_affects_every_device(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    fake.error(Error.COMM_ERROR, handle=0)
    with pytest.raises(DeviceLost):
        device.read(monotonic_ns())


def test_persistent_warning_is_logged_once(open_device: Opener, fake: Fake, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    device = open_device()
    for _ in range(5):
        fake.error(Error.WARM_MOTORS)
        device.read(monotonic_ns())
    assert caplog.text.count("HD_WARM_MOTORS") == 1


def test_endless_errors_raise_device_lost(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    fake.calls.fake_pin_errors(1)
    fake.wait()
    with pytest.raises(DeviceLost, match="HD_DEVICE_FAULT"):
        device.read(monotonic_ns())
    fake.calls.fake_pin_errors(0)


def test_stalled_servo_raises_device_timeout(open_device: Opener, fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(touch_library, "SETTLE_NS", MS)
    device = open_device()
    fake.calls.fake_stall(1)
    stamp = device.read(monotonic_ns()).stamp_ns
    assert device.read(stamp + STALL_NS).stamp_ns >= stamp
    fake.call_log()
    with pytest.raises(DeviceTimeout, match="stalled for"):
        device.read(monotonic_ns() + STALL_NS + MS)
    device.close()
    assert fake.call_log() == SHUTDOWN


def test_close_without_confirmed_zero_force_raises_and_releases_the_device(
    open_device: Opener, fake: Fake, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = open_device()
    fake.calls.fake_stall(1)
    monkeypatch.setattr(touch_library, "SETTLE_NS", MS)
    with pytest.raises(DeviceLost, match="zero force"):
        device.close()
    assert not fake.is_open()
    fake.calls.fake_stall(0)
    device.open()
    assert device.read(monotonic_ns()).ready


# --- the force ----------------------------------------------------------------------------------------------------


def test_expired_force_is_cut_and_resumes_only_after_zero_force(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert fake.motor_force() == (0.0, 1.0, 0.0)
    fake.wait(300)  # longer than the timeout of 200 ms
    assert fake.motor_force() == (0.0, 0.0, 0.0)
    assert not device.read(monotonic_ns()).ready
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert fake.motor_force() == (0.0, 0.0, 0.0)
    device.write(0.0, 0.0, 0.0)
    fake.wait()
    assert device.read(monotonic_ns()).ready
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert fake.motor_force() == (0.0, 1.0, 0.0)


@pytest.mark.parametrize("part", [nan, inf, -inf])
def test_servo_cuts_a_force_that_is_not_finite(open_device: Opener, fake: Fake, part: float) -> None:
    device = open_device()
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert device._servo is not None
    device._servo.put((0.0, 1.0, part))
    fake.wait()
    assert fake.motor_force() == (0.0, 0.0, 0.0)
    assert not device.read(monotonic_ns()).ready
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert fake.motor_force() == (0.0, 0.0, 0.0)
    device.write(0.0, 0.0, 0.0)
    fake.wait()
    assert device.read(monotonic_ns()).ready


def test_closing_servo_renders_zero_whatever_is_set(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert device._servo is not None
    device._servo.close()
    for force in (1.0, 0.0, 1.0):
        device.write(0.0, 0.0, force)
        fake.wait()
        assert fake.motor_force() == (0.0, 0.0, 0.0)
        assert not device.read(monotonic_ns()).ready


def test_excessive_force_is_scaled_and_keeps_its_direction(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    device.write(3.0, 4.0, 12.0)
    fake.wait()
    right, up, near = fake.motor_force()
    assert hypot(right, up, near) == pytest.approx(3.3)
    assert (right / near, up / near) == pytest.approx((4 / 3, 12 / 3))


def test_servo_never_mixes_the_components_of_two_forces(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    rendered: set[tuple[float, float, float]] = set()
    forces, end = cycle(1e-3 * k for k in range(1000)), monotonic() + TIMEOUT
    while len(rendered) <= 50:
        assert monotonic() < end, "the servo loop does not run"
        force = next(forces)
        device.write(force, force, force)
        rendered.add(fake.motor_force())
    assert all(right == up == near for right, up, near in rendered)


# --- options -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{"servo": "rust"}, {"force_timeout_ms": 0.5}, {"resolution": -1.0}])
def test_error_names_invalid_option(fake: Fake, options: dict[str, str | float]) -> None:
    (name,) = options
    with pytest.raises(ConfigError, match=rf"\[agents\.left\.options\] {name}: found"):
        make_device(fake, **options)


def test_user_without_a_home_folder_has_the_shared_configuration_only(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("GTDD_HOME", raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    assert find.config_folders() == [Path("/usr/share/3DSystems/config")]


# --- compiled access ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("velocity", ["device", "kalman"])
def test_kernels_of_a_device_are_known_before_it_is_opened(fake: Fake, velocity: str) -> None:
    device = make_device(fake, servo="c")
    device.agent = replace(device.agent, velocity=velocity)
    before = device.compiled_unopened
    assert not fake.is_open()
    device.open()
    now = device.compiled
    assert before is not None
    assert now is not None
    assert (before.read, before.write, before.live) == (now.read, now.write, now.live)
    assert typeof(before.parts) == typeof(now.parts)
    device.close()


def test_device_with_a_servo_in_python_has_no_kernels_to_compile(fake: Fake) -> None:
    assert make_device(fake, servo="python").compiled_unopened is None
