"""The SpaceMouse: the contract, its reports, the movement of the stylus, and faults."""

import sys
from collections.abc import Callable
from dataclasses import replace
from math import hypot

import pytest
from contract import MS, DeviceContract
from fake_hid import Cap, FakeHid
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceLost, DeviceNotFound
from netboard.devices.contract.device import Device
from netboard.devices.spacemouse import RELEASE_TIMEOUT_NS, SPACEMOUSE, SpaceMouse

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
    """Plug caps in."""
    return lambda *caps: monkeypatch.setitem(sys.modules, "hid", FakeHid(*caps))  # type: ignore[arg-type]


@pytest.fixture
def cap(plug: Plug) -> Cap:
    """One that is plugged in."""
    there = Cap()
    plug(there)
    return there


class TestSpaceMouse(DeviceContract):
    @pytest.fixture(autouse=True)
    def plugged(self, cap: Cap) -> None:
        self.cap = cap

    def make(self, config: Config) -> Device:
        return SpaceMouse("left", config)

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        return (0.0, 0.0, 0.0)

    def unplug(self, device: Device) -> Callable[[], None]:
        self.cap.plugged = False
        return lambda: setattr(self.cap, "plugged", True)


# --- reports -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("apart", [True, False])
@pytest.mark.parametrize(
    ("pushed", "moved"),
    [((FULL, 0, 0), (0, 1, 0)), ((0, FULL, 0), (1, 0, 0)), ((0, 0, FULL), (0, 0, -1)), ((0, 0, -FULL), (0, 0, 1))],
)
def test_axes_are_those_of_the_scene(plug: Plug, apart: bool, pushed: tuple, moved: tuple) -> None:
    """Right on the wire is y, towards the person is x, down is against z; in both families of reports."""
    cap = Cap(rotates_apart=apart)
    plug(cap)
    with mouse(speed=0.1) as device:
        cap.push(*pushed, rx=200, ry=-100, rz=50)
        device.read(MS)
        reading = device.read(11 * MS)
        assert (reading.vx, reading.vy, reading.vz) == pytest.approx([0.1 * part for part in moved])
        assert (reading.x, reading.y, reading.z) == pytest.approx([0.001 * part for part in moved])


def test_a_recorded_report_is_understood(cap: Cap) -> None:
    """x = 100, y = -200, z = 350; then buttons 1 and 2, then none."""
    with mouse(dead_zone=0, expo=0, speed=0.35) as device:
        cap.reports += [[0x01, 0x64, 0x00, 0x38, 0xFF, 0x5E, 0x01], [0x02, 0, 0, 0, 0, 0, 0], [0x03, 0x03, 0x00]]
        reading = device.read(MS)
        assert (reading.vx, reading.vy, reading.vz) == pytest.approx((-0.2, 0.1, -0.35))
        assert reading.buttons == 3
        cap.reports.append([0x03, 0x00, 0x00])
        assert device.read(2 * MS).buttons == 0


def test_many_buttons_are_one_mask(cap: Cap) -> None:
    with mouse() as device:
        cap.press(1 << 26 | 1, size=6)
        assert device.read(MS).buttons == 1 << 26 | 1


def test_all_that_has_come_is_read_and_the_last_counts(cap: Cap) -> None:
    with mouse(speed=0.1) as device:
        for push in (10, 200, FULL):
            cap.push(push, 0, 0)
        assert device.read(MS).vy == pytest.approx(0.1)
        assert not cap.reports


@pytest.mark.slow
@given(st.lists(st.lists(st.integers(0, 255), min_size=1, max_size=20), max_size=20))
def test_no_report_breaks_it(reports: list) -> None:
    cap = Cap()
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "hid", FakeHid(cap))  # type: ignore[arg-type]
        with mouse(workspace=0.02) as device:
            for k, report in enumerate(reports):
                cap.reports.append(report)
                reading = device.read(k * 8 * MS)
                assert max(map(abs, (reading.x, reading.y, reading.z))) <= 0.02
                assert hypot(reading.vx, reading.vy, reading.vz) <= 3**0.5 * 0.15 + 1e-12


# --- how a push moves the stylus ---------------------------------------------------------------------------------


def test_a_cap_at_rest_moves_nothing(cap: Cap) -> None:
    """Not even one whose middle is a little off, however long."""
    with mouse() as device:
        for k in range(5000):
            cap.push(20, -20, 15)
            reading = device.read(k * MS)
        assert (reading.x, reading.y, reading.z) == (0.0, 0.0, 0.0)


def test_a_push_steers_and_letting_go_stops(cap: Cap) -> None:
    with mouse(speed=0.1) as device:
        device.read(0)
        for k in range(1, 101):
            cap.push(0, 0, -FULL)
            device.read(k * MS)
        cap.push(0, 0, 0)
        there = device.read(101 * MS)
        assert there.z == pytest.approx(0.01, abs=2e-4)
        assert there.vz == 0.0
        assert device.read(5000 * MS).z == there.z


@given(st.integers(-FULL, FULL), st.integers(-FULL, FULL))
def test_a_larger_push_is_never_slower_and_both_ways_are_alike(one: int, other: int) -> None:
    device = mouse()
    small, large = sorted((one, other))
    assert device._share(small) <= device._share(large)
    assert device._share(-one) == -device._share(one)
    assert -1.0 <= device._share(one) <= 1.0


def test_expo_is_finer_in_the_middle_and_as_fast_at_the_end() -> None:
    straight, bent = mouse(expo=0), mouse(expo=1)
    assert straight._share(FULL) == bent._share(FULL) == bent._share(2 * FULL) == 1.0
    assert bent._share(FULL // 3) < straight._share(FULL // 3) / 4


def test_the_stylus_stays_in_its_box(cap: Cap) -> None:
    with mouse(workspace=0.03) as device:
        for k in range(1000):
            cap.push(FULL, FULL, FULL)
            reading = device.read(k * MS)
        assert (reading.x, reading.y, reading.z) == (0.03, 0.03, -0.03)
        assert (reading.vx, reading.vy, reading.vz) == (0.0, 0.0, 0.0)
        assert reading.ready
        cap.push(0, 0, -FULL)
        assert device.read(1010 * MS).z > -0.03


def test_in_position_mode_it_goes_where_it_is_pushed_and_comes_back(cap: Cap) -> None:
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


def test_a_push_that_is_not_reported_any_more_has_ended(cap: Cap) -> None:
    with mouse() as device:
        cap.push(FULL, 0, 0)
        assert device.read(MS).vy > 0
        assert device.read(MS + RELEASE_TIMEOUT_NS).vy > 0
        assert device.read(2 * MS + RELEASE_TIMEOUT_NS).vy == 0.0


def test_a_long_pause_between_readings_is_no_leap(cap: Cap) -> None:
    with mouse(speed=1.0) as device:
        device.read(0)
        cap.push(FULL, 0, 0)
        assert device.read(10_000 * MS).y == pytest.approx(0.05)


def test_opened_again_it_begins_in_the_middle(cap: Cap) -> None:
    device = mouse()
    with device:
        cap.push(FULL, 0, 0)
        device.read(MS)
        assert device.read(20 * MS).y > 0
    with device:
        assert device.read(21 * MS).y == 0.0


# --- finding it, and losing it -----------------------------------------------------------------------------------


@pytest.mark.parametrize("ids", SPACEMOUSE)
def test_every_model_is_known_by_name(plug: Plug, ids: tuple[int, int]) -> None:
    plug(Cap(*ids))
    with mouse() as device:
        assert device.info.model == f"3Dconnexion {SPACEMOUSE[ids]}"
        assert device.info.max_force == 0.0


def test_two_are_told_apart_by_serial_or_path(plug: Plug) -> None:
    first, second = Cap(serial="A", path=b"1-1:1.0"), Cap(serial="B", path=b"1-2:1.0")
    plug(first, second)
    with mouse(serial="B") as device:
        assert device.info.serial == "B"
        assert (first.opened, second.opened) == (0, 1)
    with mouse(path="1-1:1.0") as device:
        assert device.info.serial == "A"


def test_one_without_a_number_is_known_by_its_path(plug: Plug) -> None:
    plug(Cap(serial=""))
    with mouse() as device:
        assert device.info.serial == "1-2:1.0"


def test_a_wrong_choice_says_what_there_is(cap: Cap) -> None:
    with pytest.raises(
        DeviceNotFound, match=r"with serial 'X'; there are: SpaceMouse Compact, serial 'CAP1', path '1-2:1"
    ):
        mouse(serial="X").open()
    with pytest.raises(DeviceNotFound, match=r"with serial 'CAP1' and path 'nowhere'"):
        mouse(serial="CAP1", path="nowhere").open()


def test_none_is_said(plug: Plug) -> None:
    plug()
    with pytest.raises(DeviceNotFound, match="no SpaceMouse is plugged in"):
        mouse().open()


def test_without_permission_it_says_how_to_get_it(cap: Cap) -> None:
    cap.permitted = False
    with pytest.raises(
        DeviceNotFound, match=r"SpaceMouse Compact at 1-2:1\.0 cannot be opened .*udev/70-netboard\.rules"
    ):
        mouse().open()


def test_one_that_is_pulled_out_is_lost(cap: Cap) -> None:
    device = mouse()
    device.open()
    cap.plugged = False
    with pytest.raises(DeviceLost, match="was its plug pulled out"):
        device.read(MS)
    device.close()
    assert cap.opened == 0


def test_the_lamp_is_lit_while_it_is_in_use(cap: Cap) -> None:
    with mouse():
        assert cap.lamp
    assert not cap.lamp
    with mouse(lamp=False):
        assert not cap.lamp


def test_without_hidapi_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hid", None)  # type: ignore[arg-type]
    with pytest.raises(DeviceNotFound, match=r"netboard\[devices\]"):
        mouse().open()


def test_another_package_of_that_name_is_told_from_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hid", type(sys)("hid"))
    with pytest.raises(DeviceNotFound, match="pip install hidapi"):
        mouse().open()


def test_hidapi_has_what_the_fake_has() -> None:
    import hid

    assert isinstance(hid.enumerate(), list)
    with pytest.raises(OSError, match="open failed"):
        hid.device().open_path(b"nowhere")
    assert {"open_path", "set_nonblocking", "read", "write", "close"} <= set(dir(hid.device))


@pytest.mark.parametrize(
    ("options", "message"), [({"mode": "force"}, '"rate" or "position"'), ({"dead_zone": 1}, ">= 0 and < 1")]
)
def test_wrong_options_are_named(options: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=rf"agents\.left\.options.*{message}"):
        mouse(**options)
