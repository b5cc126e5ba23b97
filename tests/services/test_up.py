"""`netboard up`: the processes it starts on a machine, and the order in which they end."""

import logging
import signal
import sys
from pathlib import Path
from threading import Timer

import pytest
from typer.testing import CliRunner

from netboard.base.config import SIDES, parse
from netboard.base.errors import NetboardError
from netboard.network.transport import channels, sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.launching import terminal
from netboard.nodes.launching.programs import session_commands
from netboard.nodes.operator import launcher
from netboard.nodes.operator.launcher import EndedProcess, Launcher
from netboard.services import up
from netboard.services.cli import app
from netboard.services.options import settings_of
from script_launcher import IGNORES_STOP, SLOW_STOP, ScriptLauncher

RIG = ["-c", "rig.toml"]


def test_station_starts_an_agent_and_a_display() -> None:
    assert session_commands(RIG, ["left"], server=None) == {
        "left agent": ["agent", "--side", "left", "-c", "rig.toml"],
        "left display": ["display", "--station", "left", "-c", "rig.toml"],
    }


@pytest.mark.parametrize("words", [["rig.toml"], ["-c", "rig.toml"], ["--config", "rig.toml"]])
def test_configuration_is_an_argument_or_an_option(words: list[str]) -> None:
    result = CliRunner().invoke(app, ["up", "--server", *words])
    assert (result.exit_code, result.stderr.partition(":")[2].partition(";")[0]) == (2, " rig.toml: no such file")
    result = CliRunner().invoke(app, ["up", "--server", "other.toml", *words])
    assert result.exit_code == 2


def test_server_starts_with_a_logger_and_gets_its_options() -> None:
    words = settings_of(None, ["block.trials=2"])
    assert session_commands(words, [], server=["--no-autostart", "--insecure"]) == {
        "logger": ["logger", "--set", "block.trials=2"],
        "server": ["server", "--no-autostart", "--insecure", "--set", "block.trials=2"],
    }


def test_whole_session_has_every_process_and_windows_off_screen_if_asked() -> None:
    commands = session_commands(RIG, SIDES, server=(), console=True, offscreen=True)
    assert list(commands) == [
        *("logger", "server", "left agent", "right agent", "left display", "right display", "console")
    ]
    assert {name for name, words in commands.items() if "--offscreen" in words} == {
        *("left display", "right display", "console")
    }


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("", ["logger", "server", "left agent", "right agent", "left display", "right display", "console"]),
        ("--no-console", ["logger", "server", "left agent", "right agent", "left display", "right display"]),
    ],
)
def test_up_alone_starts_everything(words: str, names: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    launches: list[terminal.Launch] = []

    def run(launch: terminal.Launch, stopping: object, console: object) -> int:
        launches.append(launch)
        return 0

    monkeypatch.setattr(terminal, "run", run)
    port = f"network.port={free_port()}"
    arguments = ["up", "--study", "pilot", "--dyad", "3", "--set", port, *words.split()]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    (launch,) = launches
    assert list(launch.commands) == names
    assert launch.commands["server"][:5] == ["server", "--study", "pilot", "--dyad", "3"]
    assert {block.session.dyad for block in launch.blocks} == {"D03"}


def test_plan_that_does_not_fit_is_refused_before_anything_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terminal, "run", None)
    words = f"up --study pilot --session 9 --set network.port={free_port()}"
    result = CliRunner().invoke(app, words.split())
    assert result.exit_code == 2
    assert "--session: found 9, expected 1 to" in result.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stop_interrupts_the_preparation(number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def compile_until_stopped(*given: object) -> int:
        signal.raise_signal(number)
        return 1

    monkeypatch.setattr(terminal, "compile_kernels", compile_until_stopped)
    words = ["--set", f"network.port={free_port()}", "--set", f"recording.directory={tmp_path}"]
    result = CliRunner().invoke(app, ["up", "--prepare", *words])
    assert result.exit_code == 1
    assert "interrupted" in result.stderr
    assert "compiled in" not in result.stdout


@pytest.mark.parametrize(
    ("words", "options"),
    [
        ("", []),
        ("--no-autostart --insecure", ["--insecure", "--no-autostart"]),
        ("--study paper --dyad 3", ["--study", "paper", "--dyad", "3", "--session", "1", "--seed", "1"]),
        (
            "--study pilot --session 2 --seed 7 --blocks 1 --trials 4 --resume --yes --autostart",
            [
                *("--study", "pilot", "--dyad", "1", "--session", "2", "--seed", "7", "--blocks", "1", "--trials", "4"),
                *("--resume", "--yes", "--autostart"),
            ],
        ),
    ],
)
def test_server_gets_the_options_of_its_session(
    words: str, options: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[dict[str, list[str]]] = []

    def supervise(wanted: dict[str, list[str]], stopping: object) -> int:
        started.append(wanted)
        return 0

    monkeypatch.setattr(launcher, "supervise", supervise)
    network = f"network.port={free_port()}"
    result = CliRunner().invoke(app, ["up", "--server", *words.split(), "--set", network])
    assert result.exit_code == 0, result.output
    assert started == [{"logger": ["logger", "--set", network], "server": ["server", *options, "--set", network]}]


@pytest.mark.parametrize(
    "words", ["--station left --study paper", "--station left --resume", "--server --resume", "--resume"]
)
def test_study_needs_a_server_and_resuming_a_confirmation(words: str) -> None:
    result = CliRunner().invoke(app, ["up", *words.split()])
    assert result.exit_code == 2
    assert "--resume: " in result.stderr


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("up --dyad 3 --trials 2 --offscreen", "--dyad, --trials"),
        ("up --server --session 1 --seed 1", "--session, --seed"),
        ("server --blocks 1", "--blocks"),
        ("demo --dyad 1 --no-displays", "--dyad"),
    ],
)
def test_part_of_a_study_is_not_named_without_the_study(words: str, named: str) -> None:
    """It would be ignored: the recordings would be those of another dyad, and of all trials."""
    result = CliRunner().invoke(app, words.split())
    assert result.exit_code == 2
    assert f"{named}: found without --study" in result.stderr


@pytest.mark.parametrize("transport", ["tcp", "ipc"])
def test_up_refuses_to_start_if_another_server_listens(transport: str) -> None:
    network = parse("", "test", (f"network.port={free_port()}", f"network.transport={transport}")).network
    with up.free_address(network):
        pass
    with sockets.open_context() as context:
        endpoint = channels.addresses(network).listen(channels.MOTION)
        server = sockets.motion_server(context, endpoint)
        with pytest.raises(NetboardError, match="another server listens on"), up.free_address(network):
            pass
        server.socket.close()


def test_unavailable_bind_address_is_reported_by_the_server() -> None:
    network = parse("", "test", ("network.bind=192.0.2.7",)).network
    refused = pytest.raises(NetboardError, match=r"cannot listen on .*192\.0\.2\.7")
    with up.free_address(network), sockets.open_context() as context, refused:
        sockets.motion_server(context, channels.addresses(network).listen(channels.MOTION))


@pytest.mark.parametrize("bind", ["127.0.0.1", "*"])
def test_up_refuses_to_start_while_another_one_starts_its_server(bind: str) -> None:
    network = parse("", "test", (f"network.port={free_port()}", f"network.bind={bind}")).network
    with up.free_address(network):
        with pytest.raises(NetboardError, match="another server listens on"), up.free_address(network):
            pass
        with sockets.open_context() as context:
            server = sockets.motion_server(context, channels.addresses(network).listen(channels.MOTION))
            server.socket.close()
    with up.free_address(network):
        pass


@pytest.mark.slow
@pytest.mark.parametrize(("words", "code"), [("--version", 0), ("fly", 1)])
def test_end_of_one_process_stops_the_others(
    words: str, code: int, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    stopped: list[tuple[str, ...]] = []

    class RecordingLauncher(Launcher):
        """A launcher that records which processes it stops."""

        def stop(self, *names: str) -> list[EndedProcess]:
            stopped.append(names)
            return super().stop(*names)

    monkeypatch.setattr("netboard.nodes.operator.launcher.Launcher", RecordingLauncher)
    long_running = ["agent", "--side", "left", "--set", "network.port=1025"]
    with caplog.at_level(logging.INFO):
        wanted = {"server": [words], "left agent": long_running, "left display": long_running}
        assert launcher.supervise(wanted, lambda: False) == code
    assert f"the server ended with exit code {2 if code else 0}; stopping the others" in caplog.text
    assert stopped[:3] == [("left agent", "left display"), ("server",), ()]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("dyad", ["", " 2"])  # a benchmark may run several dyads
def test_second_ctrl_c_leaves_no_process_and_keeps_the_order(
    dyad: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("netboard.nodes.operator.launcher.HURRIED_SECONDS", 0.2)
    with ScriptLauncher(tmp_path, {}) as processes:
        processes.start(f"logger{dyad}", SLOW_STOP)
        processes.start("server", SLOW_STOP)
        processes.start(f"left agent{dyad}", SLOW_STOP)
        processes.start("left display", IGNORES_STOP)
        Timer(0.2, signal.raise_signal, [signal.SIGINT]).start()
        assert [str(ended) for ended in processes.stop_all()] == ["the left display was killed by signal 9: on"]
    logs = [processes.log_of(name) for name in (f"left agent{dyad}", "server", f"logger{dyad}")]
    ended = [log.stat().st_mtime_ns for log in logs if log is not None]
    assert ended == sorted(ended)
    assert logs[-1] is not None
    assert logs[-1].read_text().endswith("done\n")


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_ctrl_z_does_not_suspend_the_supervision(monkeypatch: pytest.MonkeyPatch) -> None:
    handlers = []

    def supervise(wanted: object, stopping: object) -> int:
        handlers.append(signal.getsignal(signal.SIGTSTP))
        return 0

    monkeypatch.setattr(launcher, "supervise", supervise)
    assert CliRunner().invoke(app, ["up", "--station", "left"]).exit_code == 0
    assert handlers == [signal.SIG_IGN]
