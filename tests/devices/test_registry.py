"""Device backends by name: netboard's own and those of other packages."""

from pathlib import Path

import pytest

from netboard.base.config import Config
from netboard.base.device_kind import DeviceKind
from netboard.base.errors import ConfigError, DeviceNotFound
from netboard.base.tables.rig import Agent, Agents
from netboard.devices.contract import registry
from netboard.devices.contract.device import Device
from netboard.devices.simulated.virtual import VirtualTouch

PLUGIN = """
from netboard.devices.contract.device import Device

class Other(Device):
    def _open(self): ...
    def _read(self, now_ns): ...
    def _write(self, fx, fy, fz): ...
    def _close(self): ...

class Unfinished(Device):
    def _open(self): ...

NO_DEVICE = 3
"""

ENTRY_POINTS = """
[netboard.devices]
other = a_lab_plugin:Other
missing = a_lab_plugin:Missing
broken = a_lab_plugin_that_is_not_there:Other
faulty = a_faulty_lab_plugin:Other
unfinished = a_lab_plugin:Unfinished
no_device = a_lab_plugin:NO_DEVICE
virtual = a_lab_plugin:Other
"""


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a third-party distribution for this test."""
    (tmp_path / "a_lab_plugin.py").write_text(PLUGIN)
    (tmp_path / "a_faulty_lab_plugin.py").write_text("class Other(Device): ...")
    info = tmp_path / "a_lab_plugin-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: a-lab-plugin\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(tmp_path)


def test_virtual_device_is_registered() -> None:
    assert registry.find("virtual") is VirtualTouch
    assert "virtual" in registry.names()


def test_every_built_in_backend_can_be_loaded() -> None:
    assert all(issubclass(registry.find(name), Device) for name in registry.BACKENDS)


def test_unknown_backend_error_lists_available_ones() -> None:
    with pytest.raises(DeviceNotFound, match=r"'vitual'.*it has: .*virtual"):
        registry.find("vitual")


def test_make_creates_the_device_of_a_side() -> None:
    config = Config(agents=Agents(right=Agent(zero=0.01)))
    device = registry.make("right", config)
    assert isinstance(device, VirtualTouch)
    assert (device.side, device.agent.zero) == ("right", 0.01)


@pytest.mark.usefixtures("plugin")
def test_backends_of_other_packages_are_registered() -> None:
    assert "other" in registry.names()
    assert registry.find("other").__name__ == "Other"


@pytest.mark.usefixtures("plugin")
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("missing", "no attribute"),
        ("broken", "No module"),
        ("faulty", "NameError: name 'Device' is not defined"),
        ("unfinished", "must implement _close, _read, _write"),
        ("no_device", "is 3, expected a netboard.devices"),
    ],
)
def test_broken_backend_error_says_why(name: str, why: str) -> None:
    with pytest.raises(DeviceNotFound, match=why):
        registry.find(name)


@pytest.mark.usefixtures("plugin")
def test_two_backends_of_one_name_are_refused() -> None:
    """A laboratory's own driver must not be replaced by netboard's, or by that of another package."""
    with pytest.raises(
        DeviceNotFound, match=r"2 device backends 'virtual': netboard\S+:VirtualTouch and a_lab_plugin:Other"
    ):
        registry.find("virtual")


@pytest.mark.parametrize("key", ["stop_buttons", "consent_buttons"])
@pytest.mark.parametrize(
    ("name", "count"), [("falcon", 4), ("openhaptics", 4), ("spacemouse", 32), ("force_dimension", 32), ("haply", 3)]
)
def test_buttons_that_a_device_does_not_have_are_refused(name: str, count: int, key: str) -> None:
    def config(mask: int) -> Config:
        return Config(agents=Agents(left=Agent(name, **{key: mask})))

    registry.check(config(2**count - 1))
    with pytest.raises(ConfigError, match=rf"left\] {key}: found {2**count}, .* {2**count - 1}, because a {name} has"):
        registry.check(config(2**count))


def test_stand_in_takes_the_buttons_of_the_device_that_it_replaces() -> None:
    """So that a rig's file is rehearsed as it is."""
    registry.check(
        Config(agents=Agents(left=Agent("virtual", stop_buttons=2**22), right=Agent("mouse", stop_buttons=2)))
    )


def test_every_real_device_declares_its_buttons_and_how_it_is_selected() -> None:
    for backend in registry.BACKENDS.values():
        real = backend.kind in (DeviceKind.HAPTIC, DeviceKind.INPUT)
        assert real == bool(backend.selectors) == bool(backend.maker) == (backend.buttons is not None)
        assert real or not backend.usb
        assert bool(backend.unlisted) == (backend.lists_serials and bool(backend.usb))
