"""Force Dimension devices over a fake of the vendor's library: the contract, and the library's documented failures."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from time import monotonic_ns

import pytest
from fake_dhd import OMEGA, SIGMA, FakeDhd
from readings import read_until

from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.base.system import c_library
from netboard.devices.contract import registry
from netboard.devices.contract.device import Box, Device, Found
from netboard.devices.force_dimension import api, servo
from netboard.devices.force_dimension import device as force_dimension
from netboard.devices.force_dimension.api import DhdError, ForceOff
from netboard.devices.force_dimension.device import MODELS, REST_NS, ForceDimension
from netboard.devices.force_dimension.servo import DhdServo
from netboard.testing.device import DeviceContract
from waiting import until

STALL_NS = 20_000_000_000
"""Stall limit of the tests, which tolerates a busy machine [ns]."""


@pytest.fixture
def dhd(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeDhd]:
    monkeypatch.setattr(force_dimension, "STALL_NS", STALL_NS)
    monkeypatch.setattr(force_dimension, "FIRST_TICK_NS", STALL_NS)
    fake = FakeDhd()
    fake.reset()
    yield fake
    fake.reset()
    api.load(fake.path).open_here.clear()


def configured(config: Config, path: str, **options: object) -> Config:
    """Return a configuration whose left side has a Force Dimension device."""
    given = {"library": path, "force_timeout_ms": 200.0, **config.agents.left.options, **options}
    left = replace(config.agents.left, device="force_dimension", options=given)
    return replace(config, agents=replace(config.agents, left=left))


Opener = Callable[..., ForceDimension]


@pytest.fixture
def open_device(dhd: FakeDhd) -> Iterator[Opener]:
    def opened(serial: int = OMEGA, **options: object) -> ForceDimension:
        device = ForceDimension("left", configured(Config(), dhd.path, serial=str(serial), **options))
        device.open()
        return device

    yield opened
    force_dimension.release_all()


class TestForceDimension(DeviceContract):
    @pytest.fixture(autouse=True)
    def _use_fake_library(self, dhd: FakeDhd) -> None:
        self.dhd = dhd

    def make(self, config: Config) -> Device:
        serial = SIGMA if config.agents.left.zero else OMEGA  # so that two devices can be open
        return ForceDimension("left", configured(config, self.dhd.path, serial=str(serial)))

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        self.dhd.wait()
        return self.dhd.motor_force()

    def read_times(self) -> Iterator[int]:
        for _ in range(50):
            self.dhd.wait()
            yield monotonic_ns()

    def unplug(self, device: Device) -> Callable[[], None]:
        assert isinstance(device, ForceDimension)
        servo = device._servo
        assert servo is not None
        self.dhd.calls.fake_plug(OMEGA, 0)
        until(lambda: servo.ended)
        return lambda: self.dhd.calls.fake_plug(OMEGA, 1)


# --- connected devices -----------------------------------------------------------------------------------------------


def test_present_lists_devices_and_leaves_none_open(dhd: FakeDhd) -> None:
    assert ForceDimension.present(configured(Config(), dhd.path)) == (
        Found("omega.3", str(OMEGA)),
        Found("sigma.7", str(SIGMA)),
    )
    assert not dhd.calls.fake_open(OMEGA)


def test_open_device_keeps_running_while_others_are_listed(dhd: FakeDhd, open_device: Opener) -> None:
    device = open_device()
    assert ForceDimension.present(configured(Config(), dhd.path)) == (Found("sigma.7", str(SIGMA)),)
    dhd.wait()
    assert device.read(monotonic_ns()).ready


def test_device_of_another_program_is_not_listed(dhd: FakeDhd) -> None:
    dhd.calls.fake_use_elsewhere(OMEGA, 1)
    assert ForceDimension.present(configured(Config(), dhd.path)) == (Found("sigma.7", str(SIGMA)),)


def test_missing_library_error_says_where_it_was_searched() -> None:
    with pytest.raises(DeviceNotFound, match=r"cannot be loaded: tried /nowhere/libdhd\.so .*force-dimension\.md"):
        ForceDimension.present(configured(Config(), "/nowhere/libdhd.so"))


def test_library_in_the_folder_of_the_sdk_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    release = tmp_path / "lib" / "release" / "lin-x86_64-gcc"
    release.mkdir(parents=True)
    for name in ("libdhd.so.3.14.0", "libdhd.so.3.9.2", "libdhd.so.3.17.6", "libdrd.so.3.17.6"):
        (release / name).touch()
    monkeypatch.setenv("FDSDK", str(tmp_path))
    found = [place for place in api.places() if place.startswith(str(tmp_path))]
    assert found == [str(release / f"libdhd.so.{version}") for version in ("3.17.6", "3.14.0", "3.9.2")]


@pytest.mark.parametrize(
    ("serial", "refused"),
    [
        (
            "999",
            r"no Force Dimension device with serial number 999 can be opened \(DHD_ERROR_NO_DEVICE_FOUND \(5\): no ",
        ),
        ("", r"2 Force Dimension devices are connected, and which of them is meant is open; set the option serial"),
    ],
)
def test_device_that_is_not_meant_is_never_opened(dhd: FakeDhd, serial: str, refused: str) -> None:
    with pytest.raises(DeviceNotFound, match=refused):
        ForceDimension("left", configured(Config(), dhd.path, serial=serial)).open()
    assert not any(map(dhd.calls.fake_open, (OMEGA, SIGMA)))


def test_only_device_needs_no_serial_number(dhd: FakeDhd, open_device: Opener) -> None:
    dhd.calls.fake_plug(SIGMA, 0)
    device = ForceDimension("left", configured(Config(), dhd.path))
    assert device.open().serial == str(OMEGA)
    device.close()


def test_device_that_is_in_use_is_reported(dhd: FakeDhd, open_device: Opener) -> None:
    dhd.calls.fake_use_elsewhere(SIGMA, 1)
    with pytest.raises(DeviceNotFound, match=r"DHD_ERROR_DEVICE_IN_USE \(20\): device already in use"):
        open_device(SIGMA)
    open_device(OMEGA)
    with pytest.raises(DeviceNotFound, match="in use by this process"):
        open_device(OMEGA)
    assert dhd.calls.fake_open(OMEGA)


def test_serial_number_that_is_none_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"\[agents.left.options\] serial: found 'A1', expected a whole number"):
        ForceDimension("left", configured(Config(), "", serial="A1"))


# --- properties ------------------------------------------------------------------------------------------------------


def test_device_info_reports_the_limits_of_the_model(dhd: FakeDhd, open_device: Opener) -> None:
    omega, sigma = open_device(OMEGA).info, open_device(SIGMA).info
    assert (omega.model, omega.serial, omega.max_force, omega.continuous_force) == ("omega.3", "11311", 12.0, 3.0)
    assert omega.workspace == Box(-0.075, -0.075, -0.075, 0.075, 0.075, 0.075)
    assert sigma.workspace == pytest.approx(Box(-0.065, -0.095, -0.075, 0.085, 0.055, 0.075))
    assert omega.details == {
        "sdk_version": "3.17.5.0",
        "controller_version": "3.2",
        "effector_mass": "0.19 kg",
        "gravity_compensation": "on",
    }
    assert dhd.calls.fake_limit(OMEGA) == 12.0


def test_device_of_an_unknown_type_is_refused(dhd: FakeDhd, open_device: Opener) -> None:
    dhd.calls.fake_type(OMEGA, 81)
    with pytest.raises(DeviceError, match=r"'omega\.3' is of system type 81, expected one of 33, 34"):
        open_device()
    assert not dhd.calls.fake_open(OMEGA)


def test_falcon_is_the_only_one_without_serial_number(dhd: FakeDhd) -> None:
    dhd.calls.fake_plug(SIGMA, 0)
    dhd.calls.fake_type(OMEGA, force_dimension.FALCON)
    dhd.calls.fake_hide_serial(OMEGA)
    device = ForceDimension("left", configured(Config(), dhd.path))
    info = device.open()
    assert (info.serial, info.max_force) == ("Falcon", 8.0)
    device.close()
    dhd.calls.fake_type(0, 33)
    with pytest.raises(DeviceError, match="does not report its serial number"):
        device.open()


def test_every_model_has_plausible_limits() -> None:
    assert all(0 < model.max_force <= 20 and 0 < model.radius <= 0.15 for model in MODELS.values())


# --- positions and forces --------------------------------------------------------------------------------------------


def test_frame_of_the_library_is_the_scenes(dhd: FakeDhd, open_device: Opener) -> None:
    device = open_device()
    dhd.place((0.01, 0.02, 0.03), (0.1, 0.2, 0.3))
    reading = read_until(device, lambda reading: reading.z == 0.03)
    assert (reading.x, reading.y, reading.vx, reading.vy, reading.vz) == (0.01, 0.02, 0.1, 0.2, 0.3)
    read_until(device, lambda reading: dhd.motor_force() == (0.1, 0.2, 0.3), force=(0.1, 0.2, 0.3))


def test_upward_force_moves_the_hand_up(dhd: FakeDhd, open_device: Opener) -> None:
    assert read_until(open_device(), lambda reading: reading.z > 1e-4, force=(0.0, 0.0, 1.0)).x == 0.0


def test_buttons_form_a_bit_mask(dhd: FakeDhd, open_device: Opener) -> None:
    device = open_device()
    dhd.calls.fake_press(OMEGA, 5)
    assert read_until(device, lambda reading: reading.buttons != 0).buttons == 5


@pytest.mark.parametrize("on", [True, False])
def test_gravity_compensation_is_an_option(dhd: FakeDhd, open_device: Opener, on: bool) -> None:
    open_device(gravity=on)
    dhd.wait()
    assert (dhd.calls.fake_compensation(OMEGA) > 0) == on


def test_device_is_ready_only_inside_its_workspace(dhd: FakeDhd, open_device: Opener) -> None:
    device = open_device()
    dhd.place((0.0, 0.0, 0.07))
    assert read_until(device, lambda reading: reading.z == 0.07).ready
    dhd.place((0.05, 0.05, 0.05))  # in the box, outside of the sphere
    assert not read_until(device, lambda reading: reading.z == 0.05).ready


def test_old_force_is_cut_until_a_zero_force_is_set(dhd: FakeDhd, open_device: Opener) -> None:
    device = open_device(force_timeout_ms=2.0)
    device.write(0.0, 0.0, 1.0)
    read_until(device, lambda reading: not reading.ready)
    dhd.wait()
    assert dhd.motor_force() == (0.0, 0.0, 0.0)
    device.write(0.0, 0.0, 0.0)
    assert read_until(device, lambda reading: reading.ready)


# --- failures --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        (lambda calls: calls.fake_uncalibrate(OMEGA, 1), "not calibrated: put the grip into its rest position"),
        (lambda calls: calls.fake_power(OMEGA, 0), "no power: switch it on"),
    ],
)
def test_device_that_cannot_be_used_is_released_with_advice(
    dhd: FakeDhd, open_device: Opener, fault: Callable, why: str
) -> None:
    fault(dhd.calls)
    with pytest.raises(DeviceError, match=why):
        open_device()
    assert not dhd.calls.fake_open(OMEGA)
    assert not dhd.calls.fake_forces(OMEGA)


@pytest.mark.parametrize(
    "function",
    [
        *("dhdGetStatus", "dhdSetMaxForce", "dhdSetGravityCompensation", "dhdSetForce", "dhdEnableForce"),
        "dhdGetPosition",
    ],
)
def test_any_failure_while_opening_releases_the_device(dhd: FakeDhd, open_device: Opener, function: str) -> None:
    dhd.fail(function, DhdError.ERROR_DHC_BUSY)
    with pytest.raises(DeviceError, match=r"DHD_ERROR_DHC_BUSY \(3\)"):
        open_device()
    assert not dhd.calls.fake_open(OMEGA)
    dhd.fail("", 0)
    assert read_until(open_device(), lambda reading: reading.ready)


@pytest.mark.parametrize("function", ["dhdGetPosition", "dhdGetLinearVelocity", "dhdSetForce", "dhdGetStatus"])
@pytest.mark.parametrize("code", [DhdError.ERROR_COM, DhdError.ERROR_DEVICE_NOT_READY, DhdError.ERROR_TIMEOUT, 99])
def test_error_in_a_trial_loses_the_device_and_leaves_no_force(
    dhd: FakeDhd, open_device: Opener, function: str, code: int
) -> None:
    kind: type[DeviceError] = DeviceTimeout if code == DhdError.ERROR_TIMEOUT else DeviceLost
    device = open_device()
    device.write(0.0, 0.0, 1.0)
    dhd.wait()
    dhd.fail(function, code)
    if (function, code) == ("dhdGetLinearVelocity", DhdError.ERROR_TIMEOUT):  # too few positions for an estimate
        dhd.wait()
        assert device.read(monotonic_ns()).ready
    else:
        with pytest.raises(kind, match=rf"{function}: .* \({int(code)}\): "):
            read_until(device, lambda reading: False)
    device.close()
    assert dhd.motor_force() == (0.0, 0.0, 0.0)
    assert not dhd.calls.fake_open(OMEGA)


def test_closed_device_is_braked(dhd: FakeDhd, open_device: Opener) -> None:
    open_device().close()
    assert dhd.calls.fake_braked(OMEGA)


def test_device_is_released_at_the_interpreters_exit(dhd: FakeDhd, open_device: Opener) -> None:
    open_device().write(0.0, 0.0, 1.0)
    dhd.wait()
    force_dimension.release_all()
    assert dhd.motor_force() == (0.0, 0.0, 0.0)
    assert not dhd.calls.fake_open(OMEGA)


def test_velocity_that_stays_unknown_loses_the_device(dhd: FakeDhd, open_device: Opener) -> None:
    """It would count as rest, and nothing would cut the force of a hand that is too fast."""
    device = open_device()
    dhd.calls.fake_blind(1)
    with pytest.raises(DeviceTimeout, match="dhdGetLinearVelocity"):
        read_until(device, lambda reading: False)
    device.close()
    assert dhd.motor_force() == (0.0, 0.0, 0.0)


def test_stalled_transfers_lose_the_device(dhd: FakeDhd, open_device: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    device = open_device()
    monkeypatch.setattr(force_dimension, "STALL_NS", 50_000_000)
    dhd.calls.fake_stall(1)
    with pytest.raises(DeviceTimeout, match="stalled for"):
        read_until(device, lambda reading: False)
    monkeypatch.setattr(force_dimension, "FIRST_TICK_NS", 50_000_000)
    braked: list[bool] = []
    close = DhdServo.close

    def noted(servo: DhdServo, within_ns: int) -> bool:
        braked.append(bool(dhd.calls.fake_braked(OMEGA)))
        return close(servo, within_ns)

    monkeypatch.setattr(DhdServo, "close", noted)
    device.close()  # a device that is lost anyway
    assert braked == [True], "the motors must be stopped before anything is waited for"
    dhd.calls.fake_stall(0)


@pytest.mark.parametrize("cause", [ForceOff.VELOCITY, ForceOff.WATCHDOG])
def test_forces_that_the_controller_switches_off_return_after_a_pause(
    dhd: FakeDhd, open_device: Opener, caplog: pytest.LogCaptureFixture, cause: ForceOff
) -> None:
    device = open_device()
    dhd.calls.fake_force_off(OMEGA, cause)
    reading = read_until(device, lambda reading: not reading.ready)
    assert caplog.messages == [f"the device has switched its forces off: {cause.name.lower()}"]
    assert caplog.records[0].levelno == logging.WARNING
    device._watch(1 + cause, reading.stamp_ns + REST_NS // 2)
    assert not dhd.calls.fake_forces(OMEGA)
    device._watch(1 + cause, monotonic_ns() + 2 * REST_NS)
    assert read_until(device, lambda reading: reading.ready)


@pytest.mark.parametrize("cause", [ForceOff.BUTTON, ForceOff.DEADMAN, 77])
def test_forces_that_a_person_switches_off_stay_off(dhd: FakeDhd, open_device: Opener, cause: int) -> None:
    device = open_device()
    dhd.calls.fake_force_off(OMEGA, cause)
    read_until(device, lambda reading: not reading.ready)
    device._watch(1 + cause, monotonic_ns() + 10 * REST_NS)
    assert not dhd.calls.fake_forces(OMEGA)


def test_backend_is_registered() -> None:
    assert registry.find("force_dimension") is ForceDimension


def test_on_windows_the_device_is_refused_in_words_and_released(
    dhd: FakeDhd, open_device: Opener, monkeypatch: pytest.MonkeyPatch
) -> None:
    servo.compiled.cache_clear()
    monkeypatch.setattr(c_library, "HAS_POSIX", False)
    said = "the servo of Force Dimension devices is not for Windows: .*; connect the device to a computer with Linux"
    with pytest.raises(DeviceNotFound, match=said):
        open_device()
    monkeypatch.undo()
    assert not api.load(dhd.path).open_here
    servo.compiled.cache_clear()
