"""A station's service and the machine that uses it: over loopback, with keys, and only for declared processes."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.devices.setup import usb
from netboard.network import keys
from netboard.network.protocol.station import ProcessStatus, StationReport, StationRequest
from netboard.network.transport import sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.launching import remote
from netboard.nodes.launching.machines import LocalMachine
from netboard.nodes.launching.preparation import missing_steps
from netboard.nodes.launching.remote import RemoteMachine
from netboard.nodes.launching.session import LaunchedSession, UnaskedEnd
from netboard.nodes.launching.station import StationService, changing_state, ring_of, station_commands
from netboard.nodes.launching.terminal import failures
from netboard.services.cli import app
from script_launcher import SLOW_STOP, ScriptLauncher

SECONDS = 20.0


def config_of(keys_folder: Path, port: int) -> Config:
    overrides = (f"network.keys={keys_folder}", "stations.left=127.0.0.1", f"stations.port={port}")
    return parse("", "test", overrides)


@dataclass
class Both:
    """A station's service, and the server's machine."""

    service: StationService
    far: RemoteMachine
    near: sockets.Context

    def until(self, condition: Callable[[], object]) -> None:
        end = time.monotonic() + SECONDS
        while not condition():
            assert time.monotonic() < end, (self.far.trouble, self.far.processes)
            self.service.step(0.001)
            self.far.poll()


@pytest.fixture
def made(tmp_path: Path) -> tuple[Config, Config]:
    """Configurations of the server's machine and of the station."""
    server = config_of(tmp_path / "server", free_port())
    for step in missing_steps(server, ("right",), ()):
        step.do()
    return server, config_of(tmp_path / "for-left", server.stations.port)


@pytest.fixture
def both(tmp_path: Path, made: tuple[Config, Config]) -> Iterator[Both]:
    server, station = made
    commands = {"left agent": [SLOW_STOP], "left display": ["print('on'); print('no screen'); raise SystemExit(1)"]}
    with (
        LocalMachine(commands, ScriptLauncher(tmp_path, {})) as machine,
        sockets.open_context() as near,
        sockets.open_context() as away,
    ):
        service = StationService(station, "left", ring_of(station, "left"), machine, away, {"computer": "lab-pc-2"})
        made_both = Both(service, RemoteMachine(server, "left", near), near)
        yield made_both
        made_both.far.close()


@pytest.mark.slow
def test_station_starts_reports_and_stops_its_processes(both: Both) -> None:
    far = both.far
    far.start("left agent")
    both.until(lambda: "left agent" in far.processes)
    assert far.processes["left agent"].phase == "running"
    assert far.state["computer"] == "lab-pc-2"
    assert "free disk" in far.state
    far.start("left display")
    both.until(lambda: "left display" in far.processes and far.processes["left display"].phase == "ended")
    assert far.processes["left display"].code == 1
    assert far.tail("left display") == "on\nno screen\n"
    far.stop("left agent")
    both.until(lambda: far.processes["left agent"].phase == "stopped")
    assert far.processes["left agent"].code == 0
    assert far.trouble == ""


@pytest.fixture
def ended(both: Both) -> Both:
    """A station whose display has ended by itself before the session, and would not do so again."""
    both.far.start("left display")
    both.until(lambda: "left display" in both.far.processes and both.far.processes["left display"].phase == "ended")
    both.service._machine.commands = {name: [SLOW_STOP] for name in both.service._machine.commands}
    return both


@pytest.mark.parametrize("known", [True, False])
def test_end_before_a_session_is_no_end_in_it(ended: Both, made: tuple[Config, Config], known: bool) -> None:
    """The service outlives sessions, and reports how a process ended until it is started again."""
    if not known:
        ended.far.close()
        ended.far = RemoteMachine(made[0], "left", ended.near)
    places = dict.fromkeys(("left agent", "left display"), "left station")
    ends: list[UnaskedEnd] = []
    session = LaunchedSession({"left station": ended.far}, places, ends.append)
    session.start()
    ended.until(lambda: session.poll() or session.running == list(places))
    assert not ends
    assert not failures(session)


def test_start_that_is_refused_shows_no_earlier_end(ended: Both, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(name: str) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(ended.service._machine, "start", full)
        ended.far.start("left display")
        ended.until(lambda: ended.far.refused)
    assert not ended.far.processes
    ended.far.start("left display")
    ended.until(lambda: ended.far.processes)
    assert ended.far.processes["left display"].phase == "running"


def test_station_keeps_nothing_of_the_last_stop(made: tuple[Config, Config]) -> None:
    """A process of the second session is not forgotten at once when its station falls silent."""
    now = 1
    with sockets.open_context() as context:
        far = RemoteMachine(made[0], "left", context, lambda: now)
        status = ProcessStatus("left agent", "running", None, 7, 0.0, 0)
        far.stop("left agent")  # of which the station knows nothing yet
        far._take(StationReport("left", "", {}, (status,), {}, ""), now)
        far.stop("left agent")
        far.start("left agent")
        now = int(60e9)
        far.poll()
        assert "does not answer" in far.trouble
        assert far.processes == {"left agent": status}
        far.close()


@pytest.mark.parametrize(
    "request_", [StationRequest("start", "sh -c true"), StationRequest("stop", ""), StationRequest("start", "server")]
)
def test_station_refuses_what_it_does_not_declare(both: Both, request_: StationRequest) -> None:
    report = both.service.answer(request_)
    assert report.refused == f"{request_.process!r} is no process of this station; it has left agent, left display"
    assert report.processes == ()


def test_device_test_waits_for_the_agent(tmp_path: Path, made: tuple[Config, Config]) -> None:
    _, station = made
    assert set(station_commands("left", (), offscreen=False)) == {
        *("left agent", "left display", "left doctor", "left device test")
    }
    commands = {"left agent": [SLOW_STOP], "left device test": [SLOW_STOP]}
    with LocalMachine(commands, ScriptLauncher(tmp_path, {})) as machine, sockets.open_context() as context:
        service = StationService(station, "left", ring_of(station, "left"), machine, context, {})
        assert service.answer(StationRequest("start", "left agent")).refused == ""
        refused = service.answer(StationRequest("start", "left device test")).refused
    assert refused == "the left agent has the device; stop it first"


@pytest.mark.parametrize(
    ("vendor", "product", "name"), [("1451", "0403", "Force Dimension device"), ("0403", "cb48", "Falcon")]
)
def test_state_names_the_devices_that_are_plugged_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, vendor: str, product: str, name: str
) -> None:
    device = tmp_path / "sys/bus/usb/devices/1-2"
    device.mkdir(parents=True)
    for file, text in {"idVendor": vendor, "idProduct": product, "serial": "7"}.items():
        (device / file).write_text(f"{text}\n")
    monkeypatch.setattr(usb, "ROOT", tmp_path)
    assert changing_state(config_of(tmp_path / "keys", 5560), "left")["USB devices"] == f"{name} 7"


def test_station_goes_on_when_a_start_fails_and_its_folder_is_gone(
    both: Both, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(name: str) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(both.service._machine, "start", full)
    folder = tmp_path / "removed"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    report = both.service.answer(StationRequest("start", "left agent"))
    assert report.refused == "cannot start the left agent: [Errno 28] No space left on device"
    assert report.machine["free disk"] == "unknown: the working folder cannot be read: No such file or directory"


def test_station_admits_only_its_own_server(
    both: Both, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Another rig's server knows the station's public key, and still has the wrong key of its own."""
    folder = tmp_path / "server"
    foreign = tmp_path / "foreign"
    keys.init(foreign)
    (foreign / keys.LIST).write_text((folder / keys.LIST).read_text())
    monkeypatch.setattr(remote, "SILENCE_NS", 300_000_000)
    with sockets.open_context() as context:
        port = both.service._config.stations.port
        stranger = RemoteMachine(config_of(foreign, port), "left", context)
        stranger.start("left agent")
        end = time.monotonic() + SECONDS
        while "its key is not that of the server" not in caplog.text or not stranger.trouble:
            assert time.monotonic() < end
            both.service.step(0.001)
            stranger.poll()
        stranger.close()
    assert "the left station does not answer at 127.0.0.1" in stranger.trouble
    assert not stranger.processes
    assert both.service.answer(StationRequest("report", "")).processes == ()


def test_station_without_an_address_or_a_key_is_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["station", "--side", "right", "--set", f"network.keys={tmp_path}"])
    assert result.exit_code == 2
    assert '[stations] right: found ""' in result.stderr
    settings = ["--set", "stations.left=127.0.0.1", "--set", f"network.keys={tmp_path / 'none'}"]
    result = CliRunner().invoke(app, ["station", "--side", "left", *settings])
    assert result.exit_code == 2
    assert "netboard keys add station left" in result.stderr


def test_preparation_makes_the_keys_of_a_station_once(tmp_path: Path) -> None:
    config = config_of(tmp_path / "keys", 5560)
    steps = []
    for step in missing_steps(config, ("right",), ("-c", "rig.toml")):
        step.do()
        steps.append(step.command)
    assert steps[:2] == [
        "netboard keys init -c rig.toml",
        f"netboard keys add station left --to {tmp_path / 'for-left'} -c rig.toml",
    ]
    assert [step.what for step in missing_steps(config, ("right",), ())] == []
    keys.revoke(tmp_path / "keys", "station.left")
    with sockets.open_context() as context, pytest.raises(ConfigError, match="no valid key of the left station"):
        RemoteMachine(config, "left", context)
