"""The SpaceMouse: the contract, reports, movement of the stylus, and faults."""

import sys
from collections.abc import Callable
from dataclasses import replace
from math import hypot

import pytest
from fake_hid import FakeHid, FakeSpaceMouse
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceLost, DeviceNotFound
from netboard.devices.contract.device import Device
from netboard.devices.spacemouse import RELEASE_TIMEOUT_NS, SPACEMOUSE, SpaceMouse
from netboard.testing.device import MS, DeviceContract

FULL = 350
Plug = Callable[..., None]


def configured(**options: object) -> Config:
    config = Config()
    left = replace(config.agents.left, options=options)
    return replace(config, agents=replace(config.agents, left=left))


def mouse(**options: object) -> SpaceMouse:
    return SpaceMouse("left", configured(**options))


@pytest.fixture
def plug(monkeypatch: pytest.MonkeyPatch) -> Plug:
    """Return a function that plugs caps in."""
    return lambda *caps: monkeypatch.setitem(sys.modules, "hid", FakeHid(*caps))  # type: ignore[arg-type]


@pytest.fixture
def cap(plug: Plug) -> FakeSpaceMouse:
    """A cap that is plugged in."""
    connected = FakeSpaceMouse()
    plug(connected)
    return connected


class TestSpaceMouse(DeviceContract):
    @pytest.fixture(autouse=True)
    def plugged(self, cap: FakeSpaceMouse) -> None:
        self.cap = cap

    def make(self, config: Config) -> Device:
        return SpaceMouse("left", config)

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        return (0.0, 0.0, 0.0)

    def unplug(self, device: Device) -> Callable[[], None]:
        self.cap.plugged = False
        return lambda: setattr(self.cap, "plugged", True)


# --- reports -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("separate", [True, False])
@pytest.mark.parametrize(
    ("pushed", "moved"),
    [((FULL, 0, 0), (0, 1, 0)), ((0, FULL, 0), (1, 0, 0)), ((0, 0, FULL), (0, 0, -1)), ((0, 0, -FULL), (0, 0, 1))],
)
def test_pushes_map_to_scene_axes(plug: Plug, separate: bool, pushed: tuple, moved: tuple) -> None:
    """On the wire, right is y, towards the person is x, and down is -z; in both report formats."""
    cap = FakeSpaceMouse(separate_rotation=separate)
    plug(cap)
    with mouse(speed=0.1) as device:
        cap.push(*pushed, rx=200, ry=-100, rz=50)
        device.read(MS)
        reading = device.read(11 * MS)
        assert (reading.vx, reading.vy, reading.vz) == pytest.approx([0.1 * part for part in moved])
        assert (reading.x, reading.y, reading.z) == pytest.approx([0.001 * part for part in moved])


def test_recorded_report_is_decoded(cap: FakeSpaceMouse) -> None:
    """x = 100, y = -200, z = 350; then buttons 1 and 2, then none."""
    with mouse(dead_zone=0, expo=0, speed=0.35) as device:
        cap.reports += [[0x01, 0x64, 0x00, 0x38, 0xFF, 0x5E, 0x01], [0x02, 0, 0, 0, 0, 0, 0], [0x03, 0x03, 0x00]]
        reading = device.read(MS)
        assert (reading.vx, reading.vy, reading.vz) == pytest.approx((-0.2, 0.1, -0.35))
        assert reading.buttons == 3
        cap.reports.append([0x03, 0x00, 0x00])
        assert device.read(2 * MS).buttons == 0


def test_long_button_report_is_one_bit_mask(cap: FakeSpaceMouse) -> None:
    with mouse() as device:
        cap.press(1 << 26 | 1, size=6)
        assert device.read(MS).buttons == 1 << 26 | 1


def test_read_consumes_all_reports_and_uses_the_latest(cap: FakeSpaceMouse) -> None:
    with mouse(speed=0.1) as device:
        for push in (10, 200, FULL):
            cap.push(push, 0, 0)
        assert device.read(MS).vy == pytest.approx(0.1)
        assert not cap.reports


@pytest.mark.slow
@given(st.lists(st.lists(st.integers(0, 255), min_size=1, max_size=20), max_size=20))
def test_arbitrary_reports_keep_position_and_velocity_in_bounds(reports: list) -> None:
    cap = FakeSpaceMouse()
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "hid", FakeHid(cap))  # type: ignore[arg-type]
        with mouse(workspace=0.02) as device:
            for k, report in enumerate(reports):
                cap.reports.append(report)
                reading = device.read(k * 8 * MS)
                assert max(map(abs, (reading.x, reading.y, reading.z))) <= 0.02
                assert hypot(reading.vx, reading.vy, reading.vz) <= 3**0.5 * 0.15 + 1e-12


# --- movement of the stylus --------------------------------------------------------------------------------------


def test_cap_at_rest_does_not_move_the_stylus(cap: FakeSpaceMouse) -> None:
    """A cap whose rest position is slightly off does not move the stylus, even after a long time."""
    with mouse() as device:
        for k in range(5000):
            cap.push(20, -20, 15)
            reading = device.read(k * MS)
        assert (reading.x, reading.y, reading.z) == (0.0, 0.0, 0.0)


def test_push_moves_the_stylus_and_release_stops_it(cap: FakeSpaceMouse) -> None:
    with mouse(speed=0.1) as device:
        device.read(0)
        for k in range(1, 101):
            cap.push(0, 0, -FULL)
            device.read(k * MS)
        cap.push(0, 0, 0)
        stopped = device.read(101 * MS)
        assert stopped.z == pytest.approx(0.01, abs=2e-4)
        assert stopped.vz == 0.0
        assert device.read(5000 * MS).z == stopped.z


@given(st.integers(-FULL, FULL), st.integers(-FULL, FULL))
def test_speed_is_a_monotonic_and_odd_function_of_the_push(one: int, other: int) -> None:
    device = mouse()
    small, large = sorted((one, other))
    assert device._share(small) <= device._share(large)
    assert device._share(-one) == -device._share(one)
    assert -1.0 <= device._share(one) <= 1.0


def test_expo_reduces_small_pushes_but_not_full_ones() -> None:
    linear, curved = mouse(expo=0), mouse(expo=1)
    assert linear._share(FULL) == curved._share(FULL) == curved._share(2 * FULL) == 1.0
    assert curved._share(FULL // 3) < linear._share(FULL // 3) / 4


def test_stylus_stays_in_its_workspace(cap: FakeSpaceMouse) -> None:
    with mouse(workspace=0.03) as device:
        for k in range(1000):
            cap.push(FULL, FULL, FULL)
            reading = device.read(k * MS)
        assert (reading.x, reading.y, reading.z) == (0.03, 0.03, -0.03)
        assert (reading.vx, reading.vy, reading.vz) == (0.0, 0.0, 0.0)
        assert reading.ready
        cap.push(0, 0, -FULL)
        assert device.read(1010 * MS).z > -0.03


def test_position_mode_follows_the_push_and_returns_to_the_centre(cap: FakeSpaceMouse) -> None:
    with mouse(mode="position", reach=0.04) as device:
        last = device.read(0)
        for k in range(1, 400):
            cap.push(0, 0, -FULL if k < 200 else 0)
            reading = device.read(k * MS)
            assert reading.z - last.z == pytest.approx((reading.vz + last.vz) / 2 * 1e-3, abs=1.1e-3)
            if k == 199:
                assert reading.z == pytest.approx(0.04, abs=1e-4)
            last = reading
        assert last.z == pytest.approx(0.0, abs=1e-4)


def test_push_without_further_reports_ends_at_the_timeout(cap: FakeSpaceMouse) -> None:
    with mouse() as device:
        cap.push(FULL, 0, 0)
        assert device.read(MS).vy > 0
        assert device.read(MS + RELEASE_TIMEOUT_NS).vy > 0
        assert device.read(2 * MS + RELEASE_TIMEOUT_NS).vy == 0.0


def test_long_pause_between_readings_causes_no_jump(cap: FakeSpaceMouse) -> None:
    with mouse(speed=1.0) as device:
        device.read(0)
        cap.push(FULL, 0, 0)
        assert device.read(10_000 * MS).y == pytest.approx(0.05)


def test_reopened_device_starts_at_the_centre(cap: FakeSpaceMouse) -> None:
    device = mouse()
    with device:
        cap.push(FULL, 0, 0)
        device.read(MS)
        assert device.read(20 * MS).y > 0
    with device:
        assert device.read(21 * MS).y == 0.0


# --- finding and losing the device -------------------------------------------------------------------------------


@pytest.mark.parametrize("ids", SPACEMOUSE)
def test_every_supported_model_is_named(plug: Plug, ids: tuple[int, int]) -> None:
    plug(FakeSpaceMouse(*ids))
    with mouse() as device:
        assert device.info.model == f"3Dconnexion {SPACEMOUSE[ids].name}"
        assert device.info.max_force == 0.0


def test_device_is_selected_by_serial_number_or_path(plug: Plug) -> None:
    first, second = FakeSpaceMouse(serial="A", path=b"1-1:1.0"), FakeSpaceMouse(serial="B", path=b"1-2:1.0")
    plug(first, second)
    with mouse(serial="B") as device:
        assert device.info.serial == "B"
        assert (first.opened, second.opened) == (0, 1)
    for path in ("1-1:1.0", "1-1"):
        with mouse(path=path) as device:
            assert device.info.serial == "A"


@pytest.mark.parametrize(
    ("serials", "options"), [(("A", "B"), {}), (("A", "A"), {"serial": "A"}), (("", ""), {}), (("", ""), {"path": ""})]
)
def test_none_of_several_devices_is_opened_by_chance(
    plug: Plug, serials: tuple[str, str], options: dict[str, str]
) -> None:
    caps = [FakeSpaceMouse(serial=serial, path=b"1-%d:1.0" % k) for k, serial in enumerate(serials, 1)]
    plug(*caps)
    with pytest.raises(
        DeviceNotFound, match=r"^2 devices SpaceMouse .*'1-1:1\.0'; .*'1-2:1\.0'; set one of .*serial, path"
    ):
        mouse(**options).open()
    assert [cap.opened for cap in caps] == [0, 0]


def test_device_with_several_interfaces_is_one_device(plug: Plug) -> None:
    """As hidapi lists it without usages."""
    interfaces = [FakeSpaceMouse(path=b"1-2:1.%d" % number, usages=False) for number in range(2)]
    plug(*interfaces)
    with mouse():
        assert [cap.opened for cap in interfaces] == [1, 0]


def test_device_without_serial_number_is_identified_by_its_path(plug: Plug) -> None:
    plug(FakeSpaceMouse(serial=""))
    with mouse() as device:
        assert device.info.serial == "1-2:1.0"


def test_unknown_device_error_lists_connected_ones(cap: FakeSpaceMouse) -> None:
    with pytest.raises(
        DeviceNotFound, match=r"with serial 'X'; there are: SpaceMouse Compact, serial 'CAP1', path '1-2:1"
    ):
        mouse(serial="X").open()
    with pytest.raises(DeviceNotFound, match=r"with serial 'CAP1' and path 'nowhere'"):
        mouse(serial="CAP1", path="nowhere").open()


def test_missing_spacemouse_is_reported(plug: Plug) -> None:
    plug()
    with pytest.raises(DeviceNotFound, match="no SpaceMouse is plugged in"):
        mouse().open()


def test_missing_permission_error_points_to_the_udev_rules(cap: FakeSpaceMouse) -> None:
    cap.permitted = False
    with pytest.raises(
        DeviceNotFound, match=r"SpaceMouse Compact at 1-2:1\.0 cannot be opened .*udev/70-netboard\.rules"
    ):
        mouse().open()


def test_unplugged_spacemouse_raises_device_lost(cap: FakeSpaceMouse) -> None:
    device = mouse()
    device.open()
    cap.plugged = False
    with pytest.raises(DeviceLost, match="was it unplugged"):
        device.read(MS)
    device.close()
    assert cap.opened == 0


def test_lamp_is_lit_while_the_device_is_open(cap: FakeSpaceMouse) -> None:
    with mouse():
        assert cap.lamp
    assert not cap.lamp
    with mouse(lamp=False):
        assert not cap.lamp


def test_missing_hidapi_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hid", None)  # type: ignore[arg-type]
    with pytest.raises(DeviceNotFound, match=r"netboard\[devices\]"):
        mouse().open()


def test_other_package_named_hid_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hid", type(sys)("hid"))
    with pytest.raises(DeviceNotFound, match="pip install hidapi"):
        mouse().open()


def test_hidapi_has_the_interface_of_the_fake() -> None:
    import hid

    assert isinstance(hid.enumerate(), list)
    with pytest.raises(OSError, match="open failed"):
        hid.device().open_path(b"nowhere")
    assert {"open_path", "set_nonblocking", "read", "write", "close"} <= set(dir(hid.device))


@pytest.mark.parametrize(
    ("options", "message"), [({"mode": "force"}, '"rate" or "position"'), ({"dead_zone": 1}, ">= 0 and < 1")]
)
def test_error_names_invalid_option(options: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=rf"agents\.left\.options.*{message}"):
        mouse(**options)
