"""Haply devices over a scripted stand-in for the vendor's service: the contract, and the service's failures."""

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from time import monotonic_ns

import pytest
from fake_haply import FakeHaplyService
from readings import read_until

from netboard.base.config import Config
from netboard.base.errors import DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.base.tables.rig import Agent, Agents
from netboard.devices import haply
from netboard.devices.contract import registry
from netboard.devices.contract.device import Box, Device, Found
from netboard.devices.haply import Haply, MalformedMessage, force_command, state_of
from netboard.devices.setup import listing
from netboard.testing.device import DeviceContract
from waiting import until

PATIENCE_NS = 20_000_000_000


@pytest.fixture
def service(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeHaplyService]:
    monkeypatch.setattr(haply, "STALL_NS", PATIENCE_NS)
    for name in ("CONNECT_S", "ANSWER_S"):
        monkeypatch.setattr(haply, name, 1e-9 * PATIENCE_NS)
    fake = FakeHaplyService()
    yield fake
    fake.stop()


def configured(config: Config, url: str, **options: object) -> Config:
    """Return a configuration whose left side has a Haply device."""
    given = {"url": url, "force_timeout_ms": 200.0, "serial": "049D", **config.agents.left.options, **options}
    left = replace(config.agents.left, device="haply", options=given)
    return replace(config, agents=replace(config.agents, left=left))


Opener = Callable[..., Haply]


@pytest.fixture
def open_device(service: FakeHaplyService) -> Iterator[Opener]:
    made: list[Haply] = []

    def opened(**options: object) -> Haply:
        made.append(Haply("left", configured(Config(), service.url, **options)))
        made[-1].open()
        return made[-1]

    yield opened
    for device in made:
        if device._link is not None:
            device._link.close()


class TestHaply(DeviceContract):
    @pytest.fixture(autouse=True)
    def _use_fake_service(self, service: FakeHaplyService) -> None:
        self.service = service

    def make(self, config: Config) -> Device:
        serial = "04EA" if config.agents.left.zero else "049D"
        return Haply("left", configured(config, self.service.url, serial=serial))

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        if device._link is not None:
            self.service.wait()
        right, forward, up = self.service.force()
        return 0.0 - forward, right, up

    def read_times(self) -> Iterator[int]:
        for _ in range(50):
            if not self.service.unplugged:
                self.service.wait(2)
            yield monotonic_ns()

    def unplug(self, device: Device) -> Callable[[], None]:
        link = device._link if isinstance(device, Haply) else None
        assert link is not None
        self.service.unplugged.add("049D")
        until(lambda: link.fault is not None)
        return self.service.unplugged.clear


# --- connected devices -----------------------------------------------------------------------------------------------


def test_present_lists_the_devices_of_the_service(service: FakeHaplyService) -> None:
    service.devices["04EA"]["config"]["type"] = "minverse"
    assert Haply.present(configured(Config(), service.url)) == (Found("Inverse3", "049D"), Found("Minverse", "04EA"))


def test_doctor_tells_the_devices_of_two_sides_apart(
    service: FakeHaplyService, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "names", lambda: ("haply",))  # the others have nothing to say of it

    def config(*serials: str) -> Config:
        sides = [Agent("haply", options={"url": service.url, "serial": serial}) for serial in serials]
        return Config(agents=Agents(left=sides[0], right=sides[1]))

    found = listing.configured(config("049D", "04EA"), "red", tmp_path)
    assert [(one.colour, one.found) for one in found] == [
        ("green", "Inverse3, serial 049D"),
        ("green", "Inverse3, serial 04EA"),
    ]
    assert [one.colour for one in listing.configured(config("049D", "049D"), "red", tmp_path)] == ["red", "red"]
    missing, _ = listing.configured(config("0000", "04EA"), "red", tmp_path)
    assert missing.found == "no haply device with serial '0000' is connected"


def test_service_that_does_not_run_is_reported() -> None:
    with pytest.raises(DeviceNotFound, match=r"does not answer at ws://127\.0\.0\.1:9 .*docs/how-to/haply\.md"):
        Haply.present(configured(Config(), "ws://127.0.0.1:9"))


def test_address_that_is_none_is_reported() -> None:
    with pytest.raises(DeviceNotFound, match="does not answer at localhost:10001"):
        Haply("left", configured(Config(), "localhost:10001")).open()


def test_missing_library_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "websockets.sync.client", None)
    with pytest.raises(DeviceNotFound, match=r"websockets is not installed .*netboard\[devices\]"):
        Haply.present(Config())


@pytest.mark.parametrize("inventory", ["no JSON", "[]", '{"inverse3": {}}', '{"inverse3": [{"id": 1}]}'])
def test_malformed_inventory_is_reported(service: FakeHaplyService, inventory: str) -> None:
    service.inventory = inventory
    with pytest.raises(DeviceNotFound, match="inventory"):
        Haply("left", configured(Config(), service.url)).open()


@pytest.mark.parametrize(
    ("serial", "unplugged", "refused"),
    [
        ("", (), "2 devices Haply are connected, and which of them is meant is open: Inverse3 049D; Inverse3 04EA"),
        ("0000", (), "there is no Haply with serial '0000'; there are: Inverse3 049D"),
        ("", ("049D", "04EA"), "lists no Inverse3: is it plugged in"),
    ],
)
def test_device_that_is_not_meant_is_never_opened(
    service: FakeHaplyService, serial: str, unplugged: tuple[str, ...], refused: str
) -> None:
    service.unplugged.update(unplugged)
    with pytest.raises(DeviceNotFound, match=refused):
        Haply("left", configured(Config(), service.url, serial=serial)).open()
    assert service.updates == 0


@pytest.mark.parametrize(
    ("part", "key", "value", "refused"),
    [
        ("status", "in_use", True, "in use by another program"),
        ("status", "power_supply", False, "no power"),
        ("status", "calibrated", False, "not calibrated: let it calibrate itself"),
        ("config", "preset", "defaults", "has the preset 'defaults', expected one of arm_front_centered"),
        ("config", "basis", {"permutation": "XZY"}, "expected the permutation XYZ"),
    ],
)
def test_device_that_cannot_be_used_is_refused_with_advice(
    service: FakeHaplyService, part: str, key: str, value: object, refused: str
) -> None:
    service.devices["049D"][part][key] = value
    with pytest.raises(DeviceError, match=refused):
        Haply("left", configured(Config(), service.url)).open()
    assert service.updates == 0


# --- positions and forces --------------------------------------------------------------------------------------------


def test_device_info_reports_the_limits_of_the_model(service: FakeHaplyService, open_device: Opener) -> None:
    info = open_device().info
    assert (info.model, info.serial, info.max_force, info.continuous_force) == ("Inverse3", "049D", 2.0, 0.5)
    assert info.workspace == Box(-0.1, -0.1, -0.1, 0.1, 0.1, 0.1)
    assert info.details == {
        "preset": '"arm_front_centered"',
        "handedness": '"right"',
        "gravity_compensation": '{"enabled": true, "scaling_factor": 1.0}',
    }
    service.devices["04EA"]["config"]["type"] = "minverse"
    assert open_device(serial="04EA").info.workspace == Box(-0.04, -0.04, -0.04, 0.04, 0.04, 0.04)


def test_axes_of_the_service_map_to_those_of_the_scene(service: FakeHaplyService, open_device: Opener) -> None:
    """Right, forward, up become y, -x, z."""
    device = open_device()
    service.devices["049D"]["state"]["cursor_velocity"] = {"x": 0.1, "y": 0.2, "z": 0.3}
    service.place(0.01, 0.02, 0.03)
    reading = read_until(device, lambda reading: reading.z == 0.03)
    assert (reading.x, reading.y) == (-0.02, 0.01)
    assert (reading.vx, reading.vy, reading.vz) == (-0.2, 0.1, 0.3)
    read_until(device, lambda reading: service.force() == (0.2, -0.1, 0.3), force=(0.1, 0.2, 0.3))


def test_upward_force_moves_the_hand_up(open_device: Opener) -> None:
    assert read_until(open_device(), lambda reading: reading.z > 5e-3, force=(0.0, 0.0, 1.5)).y == 0.0


def test_buttons_are_those_of_the_chosen_grip(service: FakeHaplyService, open_device: Opener) -> None:
    def grip(name: str, **pressed: bool) -> dict:
        return {"device_id": name, "state": {"buttons": {"a": False, "b": False, "c": False, **pressed}}}

    service.grips = [grip("G1", a=True), grip("G2", a=True, c=True)]
    device = open_device(grip="G2")
    assert read_until(device, lambda reading: reading.buttons != 0).buttons == 0b101
    service.grips = []
    assert read_until(device, lambda reading: reading.buttons == 0)


def test_device_is_ready_only_inside_its_workspace(service: FakeHaplyService, open_device: Opener) -> None:
    device = open_device()
    assert read_until(device, lambda reading: reading.ready)
    service.place(0.07, 0.07, 0.07)  # in the box, outside of the sphere
    assert not read_until(device, lambda reading: reading.z == 0.07).ready


@pytest.mark.parametrize("key", ["ready", "calibrated", "power_supply"])
def test_device_is_ready_only_if_the_service_says_so(service: FakeHaplyService, open_device: Opener, key: str) -> None:
    device = open_device()
    service.devices["049D"]["status"][key] = False
    read_until(device, lambda reading: not reading.ready)
    service.devices["049D"]["status"][key] = True
    read_until(device, lambda reading: reading.ready)


def test_old_force_is_sent_as_zero_until_a_zero_force_is_set(service: FakeHaplyService, open_device: Opener) -> None:
    device = open_device(force_timeout_ms=2.0)
    device.write(0.0, 0.0, 1.0)
    read_until(device, lambda reading: not reading.ready)
    service.wait()
    assert service.force() == (0.0, 0.0, 0.0)
    device.write(0.0, 0.0, 0.0)
    assert read_until(device, lambda reading: reading.ready)


# --- failures --------------------------------------------------------------------------------------------------------


def test_unplugged_device_is_lost(service: FakeHaplyService, open_device: Opener) -> None:
    device = open_device()
    service.unplugged.add("049D")
    with pytest.raises(DeviceLost, match="no longer lists the device 049D: was it unplugged"):
        read_until(device, lambda reading: False)
    device.close()


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        ("{", "no JSON"),
        ("[1]", "expected an object, found list"),
        ('{"inverse3": [{"device_id": "049D"}]}', "state: expected an object, found None"),
        (
            '{"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"x": NaN}}, "status": {}}]}',
            "cursor_position: expected three numbers",
        ),
        (
            '{"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"x": %s}}, "status": {}}]}'
            % ("9" * 400),
            "cursor_position: expected three numbers",
        ),
        ("[" * 100_000, "no JSON .lists or objects are nested too deeply"),
    ],
)
def test_malformed_message_loses_the_device_and_leaves_no_force(
    service: FakeHaplyService, open_device: Opener, answer: str, why: str
) -> None:
    device = open_device()
    device.write(0.0, 0.0, 1.0)
    service.wait()
    service.answer = answer
    with pytest.raises(DeviceLost, match=f"not as documented: {why}"):
        read_until(device, lambda reading: False)
    until(lambda: service.force() == (0.0, 0.0, 0.0))
    device.close()


def test_service_that_hangs_up_loses_the_device(service: FakeHaplyService, open_device: Opener) -> None:
    device = open_device()
    service.hang_up.set()
    with pytest.raises(DeviceLost, match="the connection to Haply's service has ended"):
        read_until(device, lambda reading: False)
    device.close()


def test_service_that_answers_late_is_a_timeout(
    service: FakeHaplyService, open_device: Opener, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = open_device()
    monkeypatch.setattr(haply, "STALL_NS", 50_000_000)
    monkeypatch.setattr(haply, "ANSWER_S", 0.1)
    service.answering.clear()
    with pytest.raises(DeviceTimeout, match="has not answered for"):
        read_until(device, lambda reading: False)
    service.answering.set()


def test_service_that_never_answers_is_not_opened(service: FakeHaplyService, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(haply, "ANSWER_S", 0.05)
    service.answering.clear()
    device = Haply("left", configured(Config(), service.url))
    with pytest.raises(DeviceTimeout, match=r"has not answered for 0\.05 s"):
        device.open()
    service.answering.set()


# --- messages --------------------------------------------------------------------------------------------------------


def test_force_command_is_as_documented() -> None:
    assert json.loads(force_command("049D", (1.0, 2.0, 3.0))) == {
        "inverse3": [
            {"device_id": "049D", "commands": {"set_cursor_force": {"values": {"x": 1.0, "y": 2.0, "z": 3.0}}}}
        ]
    }


@pytest.mark.parametrize("value", [None, "0.1", float("inf"), [1]])
def test_vector_without_three_finite_numbers_is_malformed(value: object) -> None:
    vector = {"x": 0.0, "y": value, "z": 0.0}
    state = {"cursor_position": vector, "cursor_velocity": vector}
    with pytest.raises(MalformedMessage, match="expected three numbers"):
        state_of({"inverse3": [{"device_id": "A", "state": state, "status": {}}]}, "A", "", 0)


def test_backend_is_registered_as_haply() -> None:
    assert registry.find("haply") is Haply
