"""Device listing on simulated machines."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from simulated import Puppet

from netboard.base.config import Config
from netboard.base.errors import DeviceNotFound
from netboard.base.tables.rig import Agent, Agents
from netboard.devices.contract import registry
from netboard.devices.contract.device import Device, Found
from netboard.devices.setup import listing, udev, usb


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A machine with a hub and a Touch (HID) with the serial number 42."""
    for name, text in {
        "usb1/idVendor": "1d6b",
        "usb1/idProduct": "0002",
        "1-1/idVendor": "2988",
        "1-1/idProduct": "0304",
        "1-1/serial": "42",
        "1-1/uevent": "DEVNAME=bus/usb/001/004",
        "1-1/1-1:1.0/0003:2988:0304.0001/hidraw/hidraw3/dev": "242:3",
    }.items():
        path = tmp_path / "sys/bus/usb/devices" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n")
    for node in ("hidraw3", "bus/usb/001/004"):
        (tmp_path / "dev" / node).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "dev" / node).write_text("")
    return tmp_path


class TwoListed(Puppet):
    """A backend whose library lists two devices."""

    @classmethod
    def present(cls, config: Config) -> tuple[Found, ...]:
        return Found("Touch (vendor's name)", "42"), Found("Touch (vendor's name)", "43")


class LibraryMissing(Puppet):
    """A backend whose library is missing."""

    @classmethod
    def present(cls, config: Config) -> tuple[Found, ...]:
        raise DeviceNotFound("libHD.so is not there")


@pytest.fixture
def backends(monkeypatch: pytest.MonkeyPatch) -> dict[str, type[Device]]:
    """The registered backends: none until a test adds one."""
    known: dict[str, type[Device]] = {}
    monkeypatch.setattr(registry, "names", lambda: tuple(sorted(known)))
    monkeypatch.setattr(registry, "find", lambda name: known[name])
    return known


def test_accessible_device_is_listed(machine: Path, backends: dict) -> None:
    (device,) = listing.listing(Config(), machine).devices
    assert (device.model, device.serial, device.usb, device.place) == ("Touch (HID)", "42", "2988:0304", "1-1")
    assert (device.shut, device.advice, device.seen_by) == ((), "", ("/sys",))


def test_inaccessible_device_is_listed_with_its_udev_rule(
    machine: Path, backends: dict, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("netboard.devices.setup.usb.os.access", lambda node, how: node.name != "hidraw3")
    (device,) = listing.listing(Config(), machine).devices
    assert device.shut == (str(machine / "dev/hidraw3"),)
    assert "deploy/udev/70-netboard.rules" in device.advice
    assert 'ATTRS{idVendor}=="2988", ATTRS{idProduct}=="0304", GROUP="netboard"' in device.advice


def test_every_product_of_a_vendor_may_be_a_device(tmp_path: Path, backends: dict) -> None:
    """The USB ids of Force Dimension's models are not published."""
    (device,) = listing.listing(Config(), plugged(tmp_path, "1451:0499", ("",))).devices
    assert (device.model, device.usb) == ("Force Dimension device", "1451:0499")
    assert usb.is_driven(registry.BACKENDS["force_dimension"], "1451", "0499")
    assert not usb.is_driven(registry.BACKENDS["falcon"], "1451", "0499")
    assert 'ATTR{idVendor}=="1451", GROUP="netboard"' in udev.rules_for("1451", "0499")


def test_usb_and_library_entries_are_merged_by_serial_number(machine: Path, backends: dict) -> None:
    backends["touch"] = TwoListed
    first, second = listing.listing(Config(), machine).devices
    assert (first.model, first.serial, first.place) == ("Touch (vendor's name)", "42", "1-1")
    assert first.seen_by == ("/sys", "touch")
    assert (second.serial, second.place, second.seen_by) == ("43", "", ("touch",))


def test_devices_without_serial_number_are_never_merged(backends: dict) -> None:
    devices = listing.joined([], "one", [Found("A", ""), Found("B", "")])
    assert [each.model for each in devices] == ["A", "B"]


def test_unusable_backend_is_listed_with_its_reason(tmp_path: Path, backends: dict) -> None:
    (tmp_path / "sys/bus/usb/devices").mkdir(parents=True)
    backends.update(plain=Puppet, silent=LibraryMissing)
    found = listing.listing(Config(), tmp_path)
    assert found.devices == ()
    assert found.backends == (
        listing.BackendState("plain", ""),
        listing.BackendState("silent", "libHD.so is not there"),
    )


@pytest.mark.parametrize(
    ("backend", "serial", "colour", "found"),
    [
        (TwoListed, "42", "yellow", "Touch (vendor's name), serial 42, at 1-1: both sides would use it"),
        (TwoListed, "", "red", "2 devices fit: Touch (vendor's name), serial 42"),
        (TwoListed, "44", "yellow", "no openhaptics device with serial '44' is connected"),
        (LibraryMissing, "42", "yellow", "libHD.so is not there"),
    ],
)
def test_configured_device_and_its_library_must_be_here(
    machine: Path,
    backends: dict,
    monkeypatch: pytest.MonkeyPatch,
    backend: type[Device],
    serial: str,
    colour: str,
    found: str,
) -> None:
    backends["openhaptics"] = backend
    monkeypatch.setattr(registry, "make", lambda side, config: None)
    agent = Agent("openhaptics", options={"serial": serial})
    left, right = listing.configured(Config(agents=Agents(left=agent, right=agent)), "yellow", machine)
    assert (left.name, right.name) == ("left device", "right device")
    assert left.colour == right.colour == colour
    assert left.found.startswith(found)


def test_device_that_the_vendors_library_does_not_list_is_yellow(
    machine: Path, backends: dict, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A driver from before the Touch (HID) leaves the library's list empty, and so does an agent that uses it."""
    backends.update(openhaptics=Puppet, virtual=Puppet)
    monkeypatch.setattr(registry, "make", lambda side, config: None)
    config = Config(agents=Agents(left=Agent("openhaptics", options={"serial": "42"})))
    left, _ = listing.configured(config, "red", machine)
    assert (left.colour, left.found) == (
        "yellow",
        "Touch (HID), serial 42, at 1-1: its vendor's library does not list it",
    )
    assert "driver is missing or older than the device" in left.advice
    assert "docs/how-to/touch.md" in left.advice


def plugged(tmp_path: Path, ids: str, serials: tuple[str, ...]) -> Path:
    """A machine with devices of one kind at the ports 1-1, 1-2, ..."""
    vendor, _, product = ids.partition(":")
    for k, serial in enumerate(serials, 1):
        folder = tmp_path / f"sys/bus/usb/devices/1-{k}"
        folder.mkdir(parents=True)
        for name, text in {"idVendor": vendor, "idProduct": product, "serial": serial, "uevent": ""}.items():
            (folder / name).write_text(f"{text}\n")
    return tmp_path


SAME, CHANCE, CLEAR = "both sides would use it", "which of them is used is chance", "at 1-"
PORTS = ({"path": "1-1"}, {"path": "1-2"})
NUMBERS = ({"serial": "A"}, {"serial": "B"})


@pytest.mark.parametrize(("backend", "ids"), [("spacemouse", "256f:c635"), ("falcon", "0403:cb48")])
@pytest.mark.parametrize(
    ("serials", "options", "colours", "words"),
    [
        (("", ""), PORTS, ("green", "green"), CLEAR),
        (("A", "A"), PORTS, ("yellow", "yellow"), "so both use one profile, A"),
        (("A", "B"), NUMBERS, ("green", "green"), CLEAR),
        (("A", "A"), ({"serial": "A"}, {"serial": "A"}), ("red", "red"), CHANCE),
        (("A", "A"), ({}, {}), ("red", "red"), CHANCE),
        (("", ""), ({}, {}), ("red", "red"), CHANCE),
        (("A", "B"), ({}, {}), ("red", "red"), CHANCE),
        (("A", "B"), ({"serial": "A"}, {}), ("green", "red"), "1-1"),
        (("A", "B"), ({"serial": "A"}, {"serial": "A"}), ("red", "red"), SAME),
        (("A", "B"), ({"serial": "A"}, {"path": "1-1"}), ("red", "red"), SAME),
        (("A",), ({}, {}), ("red", "red"), SAME),
        (("A", "B"), ({"serial": "A", "path": "1-2"}, {"serial": "B"}), ("red", "green"), ""),
    ],
)
def test_side_is_green_only_if_one_device_fits_it_and_not_the_other(
    tmp_path: Path,
    backends: dict,
    monkeypatch: pytest.MonkeyPatch,
    backend: str,
    ids: str,
    serials: tuple[str, ...],
    options: tuple[dict, dict],
    colours: tuple[str, str],
    words: str,
) -> None:
    backends[backend] = Puppet
    monkeypatch.setattr(registry, "make", lambda side, config: None)
    left, right = (Agent(backend, options=given) for given in options)
    config = Config(agents=Agents(left=left, right=right))
    found = listing.configured(config, "red", plugged(tmp_path, ids, serials))
    assert tuple(one.colour for one in found) == colours
    assert all(words in one.found for one in found)
    assert all(("[agents.<side>.options]" in one.advice) == (one.colour == "red") for one in found if words)
    assert all(("[agents] profiles" in one.advice) == (one.colour == "yellow") for one in found)


@pytest.mark.parametrize(
    ("serials", "options", "colour"),
    [(("A",), {}, "green"), (("A",), {"serial": "A"}, "yellow"), (("A", "B"), {}, "red"), ((), {}, "yellow")],
)
def test_other_side_may_be_at_another_machine(
    tmp_path: Path,
    backends: dict,
    monkeypatch: pytest.MonkeyPatch,
    serials: tuple[str, ...],
    options: dict,
    colour: str,
) -> None:
    """One device without options is each station's own; one serial number for both sides is doubtful."""
    backends["spacemouse"] = Puppet
    monkeypatch.setattr(registry, "make", lambda side, config: None)
    (tmp_path / "sys/bus/usb/devices").mkdir(parents=True)
    agent = Agent("spacemouse", options=options)
    config = Config(agents=Agents(left=agent, right=agent))
    found = listing.configured(config, "yellow", plugged(tmp_path, "256f:c635", serials))
    assert [one.colour for one in found] == [colour, colour]


@pytest.mark.parametrize(
    ("left", "right", "colour"), [("Left Device", "Right Device", "green"), ("Left Device", "Left Device", "red")]
)
def test_names_of_the_vendors_tool_select_devices(
    tmp_path: Path, backends: dict, monkeypatch: pytest.MonkeyPatch, left: str, right: str, colour: str
) -> None:
    backends["openhaptics"] = TwoListed
    monkeypatch.setattr(registry, "make", lambda side, config: None)
    (tmp_path / "sys/bus/usb/devices").mkdir(parents=True)
    sides = [Agent("openhaptics", options={"name": name}) for name in (left, right)]
    found = listing.configured(Config(agents=Agents(left=sides[0], right=sides[1])), "red", tmp_path)
    assert [one.colour for one in found] == [colour, colour]


# --- without /sys --------------------------------------------------------------------------------------------------


class NoLibusb(Exception):
    """What pyusb raises without libusb."""


def usb_library(*devices: tuple[int, int], missing: bool = False) -> SimpleNamespace:
    def find(find_all: bool) -> list[SimpleNamespace]:
        if missing:
            raise NoLibusb
        return [SimpleNamespace(idVendor=v, idProduct=p, bus=1, address=k) for k, (v, p) in enumerate(devices)]

    return SimpleNamespace(find=find, NoBackendError=NoLibusb, USBError=OSError)


def hid_library(*devices: tuple[int, int, str | None]) -> SimpleNamespace:
    rows = [{"vendor_id": v, "product_id": p, "serial_number": s} for v, p, s in devices for _ in range(2)]
    return SimpleNamespace(enumerate=lambda: rows)


@pytest.fixture
def libraries(monkeypatch: pytest.MonkeyPatch):
    def install(usb: object, hid: object) -> None:
        monkeypatch.setitem(sys.modules, "usb.core", usb)
        for name in ("hid", "hidraw"):
            monkeypatch.setitem(sys.modules, name, hid)

    return install


def test_pyusb_and_hidapi_entries_are_merged(tmp_path: Path, backends: dict, libraries) -> None:
    libraries(usb_library((0x2988, 0x0304), (0x0403, 0xCB48), (0x1D6B, 2)), hid_library((0x2988, 0x0304, "42")))
    found = listing.listing(Config(), tmp_path)
    assert found.remarks == ()
    touch, falcon = found.devices
    assert (touch.model, touch.serial, touch.seen_by) == ("Touch (HID)", "42", ("pyusb", "hidapi"))
    assert (falcon.model, falcon.serial, falcon.place) == ("Falcon", "", "bus 1 address 1")


def test_two_devices_of_the_same_model_stay_separate(tmp_path: Path, backends: dict, libraries) -> None:
    ids = (0x2988, 0x0304)
    libraries(usb_library(ids, ids), hid_library((*ids, "42"), (*ids, "43")))
    assert [each.serial for each in listing.listing(Config(), tmp_path).devices] == ["42", "43"]


def test_missing_usb_libraries_are_reported(tmp_path: Path, backends: dict, libraries) -> None:
    libraries(None, None)
    remarks = listing.listing(Config(), tmp_path).remarks
    assert [remark.split()[0] for remark in remarks] == ["pyusb", "hidapi"]
    assert all("extra devices" in remark for remark in remarks)


def test_pyusb_without_libusb_is_reported(libraries) -> None:
    libraries(usb_library(missing=True), None)
    with pytest.raises(DeviceNotFound, match="libusb"):
        usb.by_pyusb()
