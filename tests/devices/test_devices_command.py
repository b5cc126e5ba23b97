"""The commands ``netboard devices``; the long ones run in simulated time."""

import json
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from simulated import AT_REST, Puppet, SimulatedTime, configured
from typer.testing import CliRunner, Result

from netboard.base.config import Config
from netboard.base.errors import NetboardError
from netboard.base.process.stopping import STOP_SIGNALS
from netboard.devices.contract import profile
from netboard.devices.contract.device import Box, Device, DeviceInfo, Reading
from netboard.devices.contract.profile import Identity, Placement, Profile
from netboard.devices.setup.excitation import Chirp
from netboard.nodes.operator import device_commands as commands
from netboard.services.cli import app

runner = CliRunner()


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")


def devices(*words: str) -> Result:
    return runner.invoke(app, ["devices", *words])


@pytest.mark.slow
def test_list_shows_backends_as_text_and_json() -> None:
    result = devices("list")
    assert "virtual" in result.output
    assert "available" in result.output
    report = json.loads(devices("list", "--json").output)
    assert {"name": "virtual", "usable": True, "trouble": ""} in report["backends"]


def test_list_fails_if_a_device_cannot_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usb_device = tmp_path / "sys/bus/usb/devices/1-1"
    usb_device.mkdir(parents=True)
    for name, text in {"idVendor": "2988", "idProduct": "0302", "uevent": "DEVNAME=bus/usb/001/002"}.items():
        (usb_device / name).write_text(text)
    node = tmp_path / "dev/bus/usb/001/002"
    node.parent.mkdir(parents=True)
    node.write_text("")
    assert commands.show_list(Config(), as_json=False, root=tmp_path) == 0
    monkeypatch.setattr("netboard.devices.setup.usb.os.access", lambda node, how: False)
    assert commands.show_list(Config(), as_json=False, root=tmp_path) == 1


def test_test_command_reports_findings_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    code = commands.examine(
        configured(held=True), "left", seconds=2.0, force=0.0, yes=False, as_json=True, loop_clock=SimulatedTime()
    )
    assert code == 0
    report = json.loads(capsys.readouterr().out)
    assert report["serial"] == "virtual-left"
    assert len(report["findings"]) == 8
    config = configured(friction=0.1)
    time = SimulatedTime()
    assert commands.examine(config, "left", seconds=2.0, force=0.3, yes=True, as_json=True, loop_clock=time) == 0
    assert json.loads(capsys.readouterr().out)["findings"][-1]["name"] == "force to movement"


@pytest.mark.slow
def test_identify_writes_a_profile_only_for_a_free_device(capsys: pytest.CaptureFixture[str]) -> None:
    chirp = Chirp(seconds=6.0)
    common = {"yes": True, "replace_it": False, "as_json": False, "chirp": chirp}
    held = configured(held=True)
    assert commands.identify(held, "left", held=True, loop_clock=SimulatedTime(), **common) == 0
    assert not Path("profiles").exists()
    assert commands.identify(configured(), "left", held=False, loop_clock=SimulatedTime(), **common) == 0
    found = profile.load(Path("profiles"), "virtual-left")
    assert found is not None
    assert found.mechanics.mass == pytest.approx(0.045, rel=0.1)
    assert found.mechanics.friction == pytest.approx(0.26, rel=0.1)
    assert "chirp" in found.mechanics.identified
    assert "profiles/virtual-left.toml: written" in capsys.readouterr().out


def test_identify_saves_no_mass_that_it_could_not_identify() -> None:
    """A hand holds the stylus, which the command was not told."""
    with pytest.raises(NetboardError, match=r"could not be identified.*nothing was saved.*--held"):
        commands.identify(
            configured(held=True),
            "left",
            held=False,
            yes=True,
            replace_it=False,
            as_json=True,
            loop_clock=SimulatedTime(),
        )
    assert not Path("profiles").exists()


@pytest.mark.parametrize(
    ("buttons", "why"), [({"stop_buttons": 2}, "a stop button"), ({"consent_buttons": 1}, "must be held down")]
)
def test_test_command_obeys_the_buttons_of_the_stylus(
    buttons: dict[str, int], why: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    config = configured()
    left = replace(config.agents.left, **buttons)
    config = replace(config, agents=replace(config.agents, left=left))
    puppet = Puppet(config, AT_REST._replace(buttons=2))
    monkeypatch.setattr("netboard.devices.contract.registry.make", lambda side, given: puppet)
    common = {"seconds": 2.0, "force": 0.5, "yes": True, "as_json": True, "loop_clock": SimulatedTime()}
    assert commands.examine(config, "left", **common) == 1
    findings = json.loads(capsys.readouterr().out)["findings"]
    assert len(findings) == 9
    assert why in findings[-1]["found"]
    assert all(force == (0.0, 0.0, 0.0) for force in puppet.forces)


def test_no_force_is_rendered_outside_of_the_workspace_in_the_profile(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    place = Placement(zero_z=0.05, z_min=0.01, z_max=0.08)
    profile.save(Path("profiles"), Profile(Identity("Puppet", "puppet"), placement=place))
    device = Puppet(Config(), AT_REST)
    monkeypatch.setattr("netboard.devices.contract.registry.make", lambda side, config: device)
    common = {"yes": True, "as_json": True, "loop_clock": SimulatedTime()}
    assert commands.examine(Config(), "left", seconds=2.0, force=0.5, **common) == 1
    assert "outside of the workspace" in capsys.readouterr().out
    device.readings = [AT_REST._replace(z=0.05)]
    with pytest.raises(NetboardError, match="a workspace from 10 to 80 mm"):
        commands.identify(Config(), "left", held=False, replace_it=False, **common)
    assert not any(map(any, device.forces))


@pytest.mark.parametrize("words", ["test --side left --force 0.3", "identify --side left"])
def test_commands_that_move_the_device_require_consent(words: str) -> None:
    result = devices(*words.split())
    assert result.exit_code == 1
    assert "confirm with --yes" in result.output


def test_slew_limit_that_is_too_small_is_refused_before_consent_is_asked() -> None:
    result = devices("identify", "--side", "left", "--set", "safety.max_slew=1")
    assert (result.exit_code, "max_slew: found 1, expected at least" in result.output) == (2, True)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_stop_signal_while_the_motors_push_ends_with_zero_force(
    monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    made: list[Puppet] = []

    class StoppedDevice(Puppet):
        def _write(self, fx: float, fy: float, fz: float) -> None:
            super()._write(fx, fy, fz)
            if fz > 0.2:
                os.kill(os.getpid(), number)

    def make(side: str, config: Config) -> Device:
        made.append(StoppedDevice(config, AT_REST))
        return made[0]

    monkeypatch.setattr("netboard.devices.contract.registry.make", make)
    common = {"seconds": 2.0, "force": 0.3, "yes": True, "as_json": True, "loop_clock": SimulatedTime()}
    before = signal.signal(number, signal.SIG_DFL)  # with nohup, SIGHUP would be ignored
    try:
        with pytest.raises(KeyboardInterrupt):
            commands.examine(Config(), "left", **common)
    finally:
        signal.signal(number, before)
    assert max(force[2] for force in made[0].forces) > 0.2
    assert made[0].forces[-1] == (0.0, 0.0, 0.0)


def test_consent_requires_typing_the_exact_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    commands.ask_consent("this", False, lambda _: f' "{commands.CONSENT}" ')
    with pytest.raises(NetboardError, match="nothing was moved"):
        commands.ask_consent("this", False, lambda _: "yes")


def test_calibrate_set_writes_values_and_keeps_a_backup() -> None:
    result = devices("calibrate", "--side", "left", "--set", "placement.zero_z=0.02", "--set", "agents.left.zero=0.1")
    assert result.exit_code == 0, result.output
    assert devices("calibrate", "--side", "left", "--set", "placement.scale=1.5").exit_code == 0
    found = profile.load(Path("profiles"), "virtual-left")
    assert found is not None
    assert (found.placement.zero_z, found.placement.scale) == (0.02, 1.5)
    assert Path("profiles/virtual-left.toml.bak").exists()
    result = devices("calibrate", "--side", "left", "--set", "placement.scale=99")
    assert result.exit_code == 2
    assert "[placement] scale" in result.output
    assert devices("calibrate", "--side", "left", "--set", "placement.scale").exit_code == 2


@pytest.mark.parametrize(
    "words",
    ["monitor --side left --text --screenshot x.png", "calibrate --side left --zero-only --set placement.zero_z=0.02"],
)
def test_options_that_exclude_each_other_are_refused(words: str) -> None:
    result = devices(*words.split())
    assert result.exit_code == 2
    assert "expected one of them" in result.output
    assert not Path("profiles").exists()


class GuidedOperator:
    """An operator who holds the device at a list of positions, one per prompt."""

    def __init__(self, *places: tuple[float, float, float]) -> None:
        self.prompts: list[str] = []
        self._places = list(places)
        self.place = places[0]

    def __call__(self, prompt: str) -> str:
        self.prompts.append(prompt)
        self.place = self._places.pop(0)
        return ""


def test_calibrate_writes_measured_zero_and_workspace_to_the_profile(monkeypatch: pytest.MonkeyPatch) -> None:
    operator = GuidedOperator((0.01, 0.02, 0.03), (-0.05, -0.06, -0.02), (0.05, 0.06, 0.08))

    class HeldDevice(Puppet):
        def _read(self, now_ns: int):
            x, y, z = operator.place
            return AT_REST._replace(stamp_ns=now_ns, x=x, y=y, z=z)

    def make(side: str, config: Config) -> Device:
        return HeldDevice(config, AT_REST)

    monkeypatch.setattr("netboard.devices.contract.registry.make", make)
    common = {"given": {}, "replace_it": False, "ask": operator}
    assert commands.calibrate(Config(), "left", zero_only=False, yes=False, loop_clock=SimulatedTime(), **common) == 0
    assert [prompt.partition(",")[0] for prompt in operator.prompts] == [
        "Hold the stylus at the neutral height",
        "Hold the stylus at the lower far left corner of the workspace",
        "Hold the stylus at the upper near right corner of the workspace",
    ]
    found = profile.load(Path("profiles"), "puppet")
    assert found is not None
    place = found.placement
    assert (place.zero_x, place.zero_y, place.zero_z) == (0.01, 0.02, 0.03)
    assert place.box == (-0.05, -0.06, -0.02, 0.05, 0.06, 0.08)
    assert place.scale == pytest.approx(1.5)
    operator.place = (0.0, 0.0, 0.0)
    assert commands.calibrate(Config(), "left", zero_only=True, yes=True, loop_clock=SimulatedTime(), **common) == 0
    found = profile.load(Path("profiles"), "puppet")
    assert found is not None
    assert (found.placement.zero_z, found.placement.scale) == (0.0, pytest.approx(1.5))


@pytest.mark.parametrize(
    ("places", "room"),
    [([(0.0, 0.0, 0.095)], "-100 to 100 mm"), ([(0.0, 0.0, 0.0), (-0.05, -0.05, -0.006)], "-6 to 100 mm")],
)
def test_calibrate_refuses_too_small_a_room_before_the_next_position(
    places: list[tuple[float, float, float]], room: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    operator = GuidedOperator(*places)

    class HeldDevice(Puppet):
        def _read(self, now_ns: int) -> Reading:
            x, y, z = operator.place
            return AT_REST._replace(stamp_ns=now_ns, x=x, y=y, z=z)

    device = HeldDevice(Config(), AT_REST)
    monkeypatch.setattr("netboard.devices.contract.registry.make", lambda side, config: device)
    common = {"given": {}, "replace_it": False, "ask": operator, "loop_clock": SimulatedTime()}
    with pytest.raises(NetboardError, match=rf"{room}: the task needs at least 7.5 mm above and below"):
        commands.calibrate(Config(), "left", zero_only=False, yes=False, **common)
    assert len(operator.prompts) == len(places)


def test_calibrated_workspace_stays_within_that_of_the_device(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    operator = GuidedOperator((0.0, 0.0, 0.01), (-0.05, -0.06, -0.1), (0.05, 0.06, 0.2))

    class UsableDevice(Puppet):
        def _open(self) -> DeviceInfo:
            return replace(super()._open(), workspace=Box(-0.035, -0.08, -0.06, 0.035, 0.08, 0.06))

        def _read(self, now_ns: int) -> Reading:
            x, y, z = operator.place
            return AT_REST._replace(stamp_ns=now_ns, x=x, y=y, z=z)

    def make(side: str, config: Config) -> Device:
        return UsableDevice(config, AT_REST)

    monkeypatch.setattr("netboard.devices.contract.registry.make", make)
    left = replace(Config().agents.left, zero=0.1)
    config = replace(Config(), agents=replace(Config().agents, left=left))
    common = {"given": {}, "replace_it": False, "yes": False, "ask": operator, "loop_clock": SimulatedTime()}
    assert commands.calibrate(config, "left", zero_only=False, **common) == 0
    found = profile.load(Path("profiles"), "puppet")
    assert found is not None
    assert found.placement.box == (-0.035, -0.06, -0.06, 0.035, 0.06, 0.06)
    assert found.placement.scale == pytest.approx(0.075 / 0.05)
    said = capsys.readouterr().out
    assert "agents.left.zero, 0.1 m, is subtracted as well" in said
    assert "reaches" not in said
    operator = GuidedOperator((0.0, 0.0, 0.03))
    common["ask"] = operator
    assert commands.calibrate(config, "left", zero_only=True, **common) == 0
    assert "reaches 45 mm up and down from neutral, and the task needs 75 mm" in capsys.readouterr().out
    common["ask"] = GuidedOperator((0.0, 0.0, 0.055))
    operator = common["ask"]
    with pytest.raises(NetboardError, match="neutral height, 55 mm, is not well within the workspace, -60 to 60 mm"):
        commands.calibrate(config, "left", zero_only=True, **common)


def test_test_pushes_obey_the_largest_force_of_the_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    device = Puppet(Config(), AT_REST)
    monkeypatch.setattr("netboard.devices.contract.registry.make", lambda side, config: device)
    config = replace(Config(), safety=replace(Config().safety, max_force=0.5))
    common = {"seconds": 2.0, "yes": True, "as_json": True, "loop_clock": SimulatedTime()}
    commands.examine(config, "left", force=1.0, **common)
    assert max(abs(force[2]) for force in device.forces) == 0.5


def test_agent_introduction_includes_the_profile() -> None:
    from netboard.devices.simulated.virtual import VirtualTouch
    from netboard.nodes.agent.agent import introduction

    devices("calibrate", "--side", "left", "--set", "placement.zero_z=0.02")
    config = configured()
    with VirtualTouch("left", config) as device:
        details = introduction("left", config, device.info, {}).details
        assert details["profile_zero"] == "0.0 0.0 0.02 m"
        assert details["zero"] == "0.0 m"
        assert device.read(10**9).z == pytest.approx(-0.02)


def test_monitor_prints_readings_in_the_terminal() -> None:
    result = devices("monitor", "--side", "left", "--text", "--seconds", "0.3")
    assert result.exit_code == 0, result.output
    assert "virtual Touch virtual-left (left)" in result.output
    assert "ready for forces" in result.output
