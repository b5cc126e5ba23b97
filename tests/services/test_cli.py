"""The command line: accepted arguments, output, errors and lazy imports."""

import errno
import inspect
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterable
from importlib import resources
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import version
from pathlib import Path
from typing import get_args

import pytest
from typer.testing import CliRunner

import rehearsed
from netboard.base.config import Config, parse, played_sides
from netboard.base.tables.experiment import MAX_TRIALS
from netboard.network.protocol import control
from netboard.services.cli import MODULES, CommandTable, app
from netboard.services.control import control as control_command
from netboard.services.demo import demo_settings
from netboard.services.options import MOST_SEED, MOST_TRIALS

runner = CliRunner()
COMMANDS = (
    *(
        "server",
        "agent",
        "display",
        "logger",
        "replay",
        "demo",
        "info",
        "trace",
        "recover",
        "config",
        "simulate",
        "bench",
    ),
    *("up", "status", "doctor", "keys", "devices", "cohort", "power"),
)
GOLDEN = Path(__file__).parents[1] / "data" / "recordings" / "format-4.mcap"

BENCHES = ("physics", "stability", "loop", "servo", "soak", "display", "recording")


@pytest.fixture(autouse=True)
def _run_in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")


def test_name_that_the_terminal_cannot_show_is_printed_as_its_code(tmp_path: Path) -> None:
    folder = tmp_path / "\u65e5\u672c"
    folder.mkdir()
    (folder / "a.mcap").write_bytes(GOLDEN.read_bytes())
    result = subprocess.run(
        [sys.executable, "-m", "netboard.services.cli", "info", str(folder / "a.mcap")],
        capture_output=True,
        check=False,
        env=os.environ | {"PYTHONIOENCODING": "latin-1"},
    )
    said = [line for line in result.stderr.splitlines() if not line.startswith(b"compiling kernels")]
    assert (result.returncode, said) == (0, [])
    assert b"\\u65e5\\u672c" in result.stdout


def test_help_lists_every_command() -> None:
    result = runner.invoke(app, ["--help"])
    assert result.exit_code == 0
    for command in COMMANDS:
        assert f" {command} " in result.output


@pytest.mark.parametrize(
    "command",
    [
        *COMMANDS,
        *("config check", "config show", "config init", "keys init", "keys add", "keys list", "keys revoke"),
        *(f"bench {name}" for name in BENCHES),
        *(f"devices {name}" for name in ("list", "test", "identify", "monitor", "calibrate")),
    ],
)
def test_every_command_has_help_with_examples(command: str) -> None:
    result = runner.invoke(app, [*command.split(), "--help"])
    assert result.exit_code == 0
    assert (
        command in {"config", "bench", "keys", "devices"}
        or f"netboard {command}" in result.output.partition("Examples:")[2]
    )


def test_no_arguments_show_the_help() -> None:
    assert "Usage: netboard" in runner.invoke(app, []).output


def test_control_accepts_exactly_the_commands_of_the_protocol() -> None:
    accepted = get_args(get_args(inspect.signature(control_command).parameters["command"].annotation)[0])
    page = (resources.files("netboard.network.protocol") / "PROTOCOL.md").read_text()
    tables = re.findall(r"^\| command \|.*\n\| ---.*\n((?:\|.*\n)+)", page, re.MULTILINE)
    listed = {
        name for table in tables for row in table.splitlines() for name in re.findall(r"`(\w+)`", row.split("|")[1])
    }
    assert accepted == control.COMMANDS
    assert listed == set(control.COMMANDS), "the tables of commands in PROTOCOL.md, section 8"


def test_version_option_prints_netboard_and_python_versions() -> None:
    result = runner.invoke(app, ["--version"])
    assert result.exit_code == 0
    assert result.output.startswith(f"netboard {version('netboard')} (Python 3.")


@pytest.mark.parametrize(
    "words", ["fly", "agent", "agent --side up", "display", "demo --trials 0", "demo --haptics so", "demo --play me"]
)
def test_wrong_usage_exits_with_2(words: str) -> None:
    assert runner.invoke(app, words.split()).exit_code == 2


LONG = "x" * 300


@pytest.mark.parametrize(
    "words",
    [
        f"recover {LONG}.mcap",
        f"export {GOLDEN} --to csv -o {LONG}",
        f"check {LONG}.mcap",
        f"sessions {LONG}",
        f"replay {GOLDEN} --offscreen --screenshot {LONG}.png",
        f"whatif {GOLDEN} -o {LONG}.mcap",
        f"whatif {GOLDEN} --figure {LONG}.png",
        f"plan check {LONG}",
    ],
)
def test_file_name_that_is_too_long_is_one_line_that_names_it(words: str) -> None:
    result = runner.invoke(app, words.split())
    assert result.exit_code == 1
    assert re.fullmatch(rf"netboard: {LONG}[^\n]*: File name too long\n", result.stderr)


@pytest.mark.skipif(os.name == "nt", reason="no such limit there")
@pytest.mark.parametrize(
    "words",
    [
        "config init new",
        "keys init --set network.keys=keys",
        "cohort paper -o new",
        f"replay {GOLDEN} --offscreen --screenshot new.png",
        f"explain {GOLDEN} --trial 1 -o new.png",
    ],
)
def test_full_disk_leaves_no_empty_file(words: str) -> None:
    """A limit of the kernel replaces the full disk."""
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, limits[1]))
    try:
        result = runner.invoke(app, words.split())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert result.exit_code in (1, 2)
    assert re.search("^netboard: [^\n]*: cannot be written", result.stderr)
    assert [path for path in Path().rglob("*") if path.name != "keys"] == []


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (EOFError("marshal data too short"), "EOFError('marshal data too short')"),
        (BrokenPipeError(errno.EPIPE, "Broken pipe"), "BrokenPipeError(32, 'Broken pipe')"),
        (ValueError("wrong"), "ValueError: wrong"),
    ],
)
@pytest.mark.parametrize("debug", [(), ("--debug",)])
def test_unexpected_error_is_never_hidden(error: Exception, told: str, debug: tuple[str, ...]) -> None:
    """Typer itself would print "Aborted." for the first, and nothing for the second."""
    script = f"""
from netboard.services import cli, configuration
def fail(*_):
    raise {error!r}
configuration.load = fail
cli.main()
"""
    command = [sys.executable, "-c", script, *debug, "config", "show"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert told in done.stderr
    assert "Traceback" in done.stderr
    assert "Aborted" not in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="a pipe cannot be asked there")
def test_reader_that_has_enough_ends_the_command_silently() -> None:
    command = [sys.executable, "-u", "-m", "netboard.services.cli", "config", "show"]
    shown = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert shown.stdout is not None
    shown.stdout.close()
    _, told = shown.communicate()
    assert (shown.returncode, told) == (1, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("words", ["config show", "--help", "config --help"])
def test_output_to_a_full_disk_is_one_line(words: str) -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        command = [sys.executable, "-m", "netboard.services.cli", *words.split()]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "netboard: the output cannot be written: the disk is full\n")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not delete the folder of a process")
def test_deleted_working_folder_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    result = runner.invoke(app, ["demo", "--no-displays"])
    assert (result.exit_code, result.stderr) == (1, "netboard: this folder has been deleted; change to another one\n")


def loaded_by(statement: str, names: Iterable[str]) -> list[str]:
    """Return which of these modules a new process has loaded after a statement about the table of commands."""
    script = f"import sys; from netboard.services.cli import CommandTable; {statement}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    modules = done.stdout.split()
    return [name for name in names if name in modules]


def test_importing_all_commands_loads_no_heavy_module() -> None:
    heavy = ("zmq", "numba", "numpy", "PySide6", "pyqtgraph", "mcap", "scipy", "netboard.nodes", "netboard.stage.stage")
    assert loaded_by("dict(CommandTable())", (*heavy, "netboard.services.server")) == ["netboard.services.server"]


def test_looking_up_a_command_imports_no_other_one() -> None:
    modules = [f"netboard.services.{MODULES.get(name, name)}" for name in CommandTable()]
    assert loaded_by("CommandTable()['agent']", modules) == ["netboard.services.agent"]


def test_shell_completion_lists_matching_commands() -> None:
    environment = {
        **os.environ,
        "_NETBOARD_COMPLETE": "complete_bash",
        "COMP_WORDS": "netboard de",
        "COMP_CWORD": "1",
    }
    script = "import sys; sys.argv = ['netboard']; from netboard.services.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["demo", "devices"]


# --- configuration -----------------------------------------------------------------------------------------------


def test_config_init_writes_the_valid_defaults() -> None:
    assert runner.invoke(app, ["config", "init"]).exit_code == 0
    checked = runner.invoke(app, ["config", "check"])
    assert checked.exit_code == 0
    assert checked.output.startswith("netboard.toml: valid (dyadic, 60 trials, ")
    shown = runner.invoke(app, ["config", "show"])
    assert parse(shown.output) == Config()


def test_config_init_never_overwrites_a_file() -> None:
    Path("rig.toml").write_text("mine", encoding="utf-8")
    result = runner.invoke(app, ["config", "init", "rig.toml"])
    assert result.exit_code == 2
    assert "rig.toml: already exists" in result.stderr
    assert Path("rig.toml").read_text(encoding="utf-8") == "mine"


def test_config_init_reports_a_missing_folder() -> None:
    result = runner.invoke(app, ["config", "init", "nowhere/rig.toml"])
    assert result.exit_code == 1
    assert result.stderr == "netboard: nowhere/rig.toml: cannot be written: No such file or directory\n"


def test_defaults_apply_without_a_configuration_file() -> None:
    assert runner.invoke(app, ["config", "check"]).output.startswith("defaults: valid")
    assert parse(runner.invoke(app, ["config", "show"]).output) == Config()


def test_configuration_file_may_have_a_byte_order_mark() -> None:
    """Some editors of Windows write one."""
    Path("rig.toml").write_text("[block]\ntrials = 7\n", encoding="utf-8-sig")
    result = runner.invoke(app, ["config", "show", "-c", "rig.toml"])
    assert result.exit_code == 0, result.output
    assert "trials = 7" in result.output


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there is no file without an end here")
@pytest.mark.parametrize("command", [["config", "check", "-c"], ["plan", "check"]])
def test_file_without_an_end_is_refused(command: list[str]) -> None:
    result = runner.invoke(app, [*command, "/dev/zero"])
    assert result.exit_code == 2
    assert result.stderr.startswith("netboard: /dev/zero: cannot be read: File too large, expected at most ")


def test_options_override_the_configuration_file_of_the_folder() -> None:
    Path("netboard.toml").write_text("[block]\ntrials = 4\nseed = 9\n", encoding="utf-8")
    block = parse(runner.invoke(app, ["config", "show", "--set", "block.trials=5"]).output).block
    assert (block.trials, block.seed) == (5, 9)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "rig.toml: no such file; create it with: netboard config init rig.toml"),
        (b"[block]\ntrails = 4", "rig.toml: [block] trails: unknown key; did you mean trials"),
        (b"\xff\xfe", "rig.toml: line 1: is not UTF-8; save the file as UTF-8"),
    ],
)
@pytest.mark.parametrize("command", ["config check", "server", "agent --side left", "demo", "logger"])
def test_invalid_configuration_file_prints_one_line_and_exits_with_2(
    content: bytes | None, words: str, command: str
) -> None:
    if content is not None:
        Path("rig.toml").write_bytes(content)
    result = runner.invoke(app, [*command.split(), "-c", "rig.toml"])
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith(f"netboard: {words}")
    assert result.stderr.count("\n") == 1


def test_debug_option_raises_the_original_exception() -> None:
    result = runner.invoke(app, ["--debug", "config", "check", "-c", "rig.toml"])
    assert result.exit_code == 1
    assert type(result.exception).__name__ == "ConfigError"


@pytest.mark.parametrize("address", ["0.0.0.0", "192.168.1.5", "::", "*", "rig.lab"])
def test_server_requires_keys_or_insecure_beyond_loopback(address: str) -> None:
    open_to_all = ["server", "--set", f"network.bind={address}"]
    result = runner.invoke(app, open_to_all)
    assert result.exit_code == 2
    assert result.stderr == "netboard: keys/server.key: does not exist; make it with: netboard keys init\n"
    result = runner.invoke(app, [*open_to_all, "--set", "network.curve=off"])
    assert result.exit_code == 2
    assert f'[network] bind: found "{address}"' in result.stderr
    assert "--insecure" in result.stderr


def test_served_replay_requires_keys_or_insecure_beyond_loopback() -> None:
    open_to_all = ["replay", "none.mcap", "--serve", "--set", "network.bind=0.0.0.0", "--set", "network.curve=off"]
    result = runner.invoke(app, open_to_all)
    assert result.exit_code == 2
    assert '[network] bind: found "0.0.0.0"' in result.stderr
    assert result.stderr.endswith("On an isolated network, add --insecure\n")
    result = runner.invoke(app, [*open_to_all, "--insecure"])
    assert result.exit_code == 2
    assert "none.mcap" in result.stderr


def test_demo_options_are_converted_to_settings() -> None:
    settings = demo_settings(trials=2, haptics="off", bimanual=True, seed=7, directory=Path("a b"))
    config = parse("", "defaults", settings)
    assert (config.block.trials, config.block.haptics, config.block.seed) == (2, False, 7)
    assert config.block.configuration == "bimanual"
    assert config.recording.directory == "a b"


@pytest.mark.parametrize(
    ("play", "sides"), [(None, ()), ("left", ("left",)), ("right", ("right",)), ("both", ("left", "right"))]
)
def test_play_option_of_the_demo_is_converted_to_settings(play: str | None, sides: tuple[str, ...]) -> None:
    settings = demo_settings(trials=2, haptics="on", bimanual=False, seed=1, directory=Path(), play=play)
    config = parse("", "defaults", settings)
    assert played_sides(config) == sides
    assert config.agents.right.options == ({"input": "keys"} if play == "both" else {})


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ("--play left --no-displays", "needs a window to play in"),
        ("--play right --bimanual", "expected --play both"),
    ],
)
def test_contradictory_play_options_are_refused(words: str, problem: str) -> None:
    result = runner.invoke(app, ["demo", *words.split()])
    assert result.exit_code == 2
    assert problem in result.stderr


def test_contradiction_with_the_demos_own_options_is_not_blamed_on_set() -> None:
    result = runner.invoke(app, ["demo", "--bimanual", "--no-displays", "--set", "block.left=robot"])
    assert result.exit_code == 2
    assert result.stderr.startswith("netboard: defaults with the options of netboard demo: [block] left, right: ")


def test_playing_without_a_screen_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    compiled: list[object] = []
    monkeypatch.setattr("netboard.nodes.launching.kernels.compile_kernels", lambda *given: compiled.append(given))
    result = runner.invoke(app, ["demo", "--play", "left"])
    assert result.exit_code == 1
    assert not compiled
    assert "playing needs a window, but there is no screen" in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "command",
    [
        "display --station left",
        "display --list-screens",
        "display --calibrate",
        "console",
        f"replay {GOLDEN}",
        "devices monitor --side left",
        "bench display --quick",
    ],
)
def test_windows_without_a_screen_are_refused(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    result = runner.invoke(app, command.split())
    assert result.exit_code == 1
    assert "there is no screen" in result.stderr
    assert "--offscreen" in result.stderr
    assert result.stderr.count("\n") == 1


TAKE_FILES = """
analyse -o out
analyse none.mcap --settings
check
cohort -o out
config check
demo --config
demo --study
display --station left --config
explain --trial 1 -o a.png
export --to csv -o out
import -o out
import --manifest
info
plan check
power -o out
recover
replay
replay --headless
replay --markers
replay --serve
replay --verify
server --config
server --study
session rehearse
sessions
simulate -o out.csv --input
simulate -i none.csv -o out.csv --scene
trace
up --server --config
up --server --study
whatif --set physics.g=9
""".strip().splitlines()
"""Every command that takes a file or a folder, with what it needs before its name."""


@pytest.mark.parametrize("command", TAKE_FILES)
def test_missing_file_prints_one_line_and_exits_with_2(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    name = "none.csv" if command.startswith(("import -o", "simulate -o")) else "none.mcap"
    result = runner.invoke(app, [*command.split(), name])
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("netboard: none."), result.stderr
    assert result.stderr.count("\n") == 1, result.stderr
    assert not list(tmp_path.iterdir())


def test_config_check_refuses_a_scene_too_stiff_for_the_tick() -> None:
    result = runner.invoke(
        app,
        ["config", "check", "--set", "physics.c_h=50", "--set", "physics.method=rk4", "--set", "physics.substeps=1"],
    )
    assert result.exit_code == 2
    assert "too stiff" in result.output


def test_config_check_refuses_unknown_devices_and_options_of_both_sides() -> None:
    wrong = ("agents.left.device=vitual", "agents.right.device=mouse", "agents.right.options.stifness=200")
    result = runner.invoke(app, ["config", "check", *(word for one in wrong for word in ("--set", one))])
    assert result.exit_code == 2
    left, right = result.stderr.splitlines()
    assert "[agents.left] device: this machine has no device backend 'vitual'; it has: " in left
    assert right.startswith("[agents.right.options] stifness: unknown key; did you mean stiffness")


@pytest.mark.parametrize("file", ["authorized.toml", "server.key", "agent.left.key"])
def test_config_check_refuses_keys_that_a_server_or_an_agent_would_refuse(file: str) -> None:
    check = ["config", "check", "--set", "network.curve=on"]
    assert runner.invoke(app, check).exit_code == 0, "there are no keys yet"
    for words in (["init"], ["add", "agent", "left"]):
        assert runner.invoke(app, ["keys", *words]).exit_code == 0
    assert runner.invoke(app, check).exit_code == 0
    path = Path(Config().network.keys) / file
    path.write_text("secret = 1\n", encoding="utf-8")
    result = runner.invoke(app, check)
    assert result.exit_code == 2
    assert f"{path}: " in result.stderr
    assert runner.invoke(app, ["config", "check"]).exit_code == 0, "keys are not in use on one machine"


def test_name_too_long_for_a_recording_is_refused() -> None:
    result = runner.invoke(app, ["config", "check", "--set", "session.dyad=" + "d" * 81])
    assert result.exit_code == 2
    assert result.stderr == "netboard: defaults with --set: [session] dyad: found 81 characters, expected at most 80\n"


@pytest.mark.parametrize("words", ["control strat", "control start --until strat"])
def test_mistyped_choice_lists_what_is_possible(words: str) -> None:
    result = runner.invoke(app, words.split())
    assert result.exit_code == 2
    assert re.search(r"""Invalid value for '\S+':\s+found\s+"strat",\s+expected\s+one\s+of""", result.stderr)
    assert "paused" in result.stderr or "pause_after_trial" in result.stderr


@pytest.mark.parametrize("way", ["--headless", "--serve", "--markers", "--verify"])
def test_replay_without_a_window_refuses_a_screenshot(way: str) -> None:
    result = runner.invoke(app, ["replay", "none.mcap", way, "--screenshot", "a.png"])
    assert result.exit_code == 2
    assert result.stderr == f"netboard: --screenshot: found with {way}, which opens no window; expected one of them\n"


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize(
    ("command", "work"),
    [
        ("analyse recordings -o out", "netboard.analysis.report.analysing.analyse"),
        ("cohort paper -o out", "netboard.analysis.cohort.folder.make_cohort"),
        ("power paper -o out", "netboard.analysis.cohort.planning.answer"),
        ("simulate -i a.csv -o b.csv", "netboard.services.hand_simulation.simulate_files"),
        ("bench loop --quick -o out", "netboard.benchmarks.loop.bench.loop"),
    ],
)
def test_long_commands_clean_up_when_they_are_stopped(command: str, work: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """SIGTERM, as a batch system sends it, interrupts as Ctrl-C does: no temporary file and no process is left."""

    def stop(*given: object, **others: object) -> list[str]:
        os.kill(os.getpid(), signal.SIGTERM)
        raise AssertionError("not interrupted")

    def die(number: int, frame: object) -> None:
        raise AssertionError("ended without a clean-up")

    monkeypatch.setattr(work, stop)
    outside = signal.signal(signal.SIGTERM, die)
    try:
        result = runner.invoke(app, command.split())
        assert (result.exit_code, result.stderr) == (1, "netboard: interrupted\n"), result.exception
        assert signal.getsignal(signal.SIGTERM) is die
    finally:
        signal.signal(signal.SIGTERM, outside)


def test_config_check_takes_one_file_and_checks_the_recording_folder(tmp_path: Path) -> None:
    Path("rig.toml").write_text("[block]\ntrials = 6\n")
    for words in (["rig.toml"], ["-c", "rig.toml"]):
        result = runner.invoke(app, ["config", "check", *words])
        assert (result.exit_code, result.output.partition("(")[0]) == (0, "rig.toml: valid ")
    both = runner.invoke(app, ["config", "check", "rig.toml", "-c", "rig.toml"])
    assert (both.exit_code, "expected one of them" in both.output) == (2, True)
    Path("taken").write_text("a file")
    for folder, reason in (
        ("taken", "Not a directory"),
        ("taken/deeper", "Not a directory"),
        ("/proc/recordings", "/proc"),
    ):
        result = runner.invoke(app, ["config", "check", "--set", f'recording.directory="{folder}"'])
        assert result.exit_code == 2
        assert f'[recording] directory: found "{folder}", expected a folder that can be written' in result.output
        assert reason in result.output
    assert {path.name for path in tmp_path.iterdir()} == {"rig.toml", "taken"}


@pytest.mark.parametrize(
    ("command", "module", "extra"),
    [
        ("explain rec.mcap --trial 1 -o sheet.png", "matplotlib", "analysis"),
        ("analyse rec.mcap --dask tcp://127.0.0.1:1", "distributed", "dask"),
        ("lsl", "pylsl", "lsl"),
        ("export rec.mcap --to nwb", "pynwb", "nwb"),
        ("export rec.mcap --to parquet", "pyarrow", "parquet"),
    ],
)
def test_missing_library_is_reported_with_its_install_command(
    command: str, module: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rehearsed.write(Path("rec.mcap"), rehearsed.rows())
    for name in [name for name in sys.modules if name.partition(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    result = runner.invoke(app, command.split())
    assert result.exit_code == 2, result.output
    assert f"netboard[{extra}]" in result.output
    assert "pip install" in result.output


@pytest.mark.parametrize(
    ("command", "where"),
    [
        ("keys init --set network.keys=FILE/keys", "FILE/keys"),
        ("keys add console --to FILE", "FILE"),
        (f"replay {GOLDEN} --screenshot FILE/new.png", "FILE/new.png"),
        ("bench physics -o FILE/new", "FILE/new"),
        ("import hands.csv --simulate -o FILE/new", "FILE/new"),
        ("import --manifest study.toml -o FILE/new", "FILE/new"),
    ],
)
def test_folder_that_cannot_be_made_is_one_line(command: str, where: str) -> None:
    """A file stands for a folder that is read-only."""
    assert runner.invoke(app, ["keys", "init"]).exit_code == 0
    Path("FILE").touch()
    Path("hands.csv").write_text("time,left_z,right_z\n" + "".join(f"{k / 100},0,0\n" for k in range(9)))
    Path("study.toml").write_text('simulate = true\n[[recording]]\nfile = "hands.csv"\n')
    result = runner.invoke(app, command.split())
    assert result.exit_code == 1
    assert f"netboard: {where}: cannot be written: " in result.stderr
    assert "name" not in Path("keys/authorized.toml").read_text().split()


def test_limit_without_an_end_is_refused() -> None:
    Path("S01.mcap").touch()
    result = runner.invoke(app, ["trace", "S01.mcap", "--late", "inf"])
    assert result.exit_code == 2
    assert 'found "inf", expected a number' in result.stderr


def test_qt_without_a_library_of_the_system_is_one_line(tmp_path: Path) -> None:
    broken = tmp_path / "PySide6"
    broken.mkdir()
    (broken / "__init__.py").touch()
    (broken / f"QtCore{EXTENSION_SUFFIXES[-1]}").write_text("cannot be loaded")
    places = os.pathsep.join((str(tmp_path), *sys.path))
    command = [sys.executable, "-m", "netboard.services.cli", "console", "--offscreen"]
    ran = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": places}, capture_output=True, text=True, timeout=60, check=False
    )
    assert ran.returncode == 2
    assert ran.stderr.startswith("netboard: QtCore cannot be loaded: ")
    assert ran.stderr.count("\n") == 1


def test_config_check_reads_the_files_that_it_names(tmp_path: Path) -> None:
    Path("words.toml").write_text("again = 1\n", encoding="utf-8")
    Path("play.csv").write_text("time,x,y,z\n0,0,0,0\n1_1,0,0,0\n", encoding="utf-8")
    Path("profiles").mkdir()
    Path("profiles/ABC.toml").write_text('[device]\nserial = "XYZ"\n', encoding="utf-8")
    settings = (
        "display.language=words.toml",
        "agents.left.device=playback",
        "agents.left.options.file=play.csv",
        "agents.right.device=playback",
        "agents.right.options.file=none.mcap",
        "block.force=unrelated",
        "block.unrelated=gone.mcap",
    )
    result = runner.invoke(app, ["config", "check", *(word for one in settings for word in ("--set", one))])
    assert result.exit_code == 2
    problems = result.stderr.splitlines()
    for problem in (
        'play.csv: line 3, column time: found "1_1", expected a number',
        "[agents.right] options: none.mcap: no such file",
        'profiles/ABC.toml: [device] serial: found "XYZ", expected "ABC"',
        "words.toml: again: ",
        '[block] unrelated: found "gone.mcap", which cannot be read',
    ):
        assert any(problem in line for line in problems), (problem, problems)


def test_config_check_refuses_a_missing_language_file() -> None:
    result = runner.invoke(app, ["config", "check", "--set", "display.language=klingon.toml"])
    assert result.exit_code == 2
    assert '[display] language: found "klingon.toml", expected en, de, fr, es, it or a file of texts' in result.stderr


def test_limits_of_options_are_those_of_the_settings() -> None:
    assert (MOST_TRIALS, MOST_SEED) == (MAX_TRIALS, 2**31 - 1)
    for option, value in (("--trials", MOST_TRIALS + 1), ("--seed", MOST_SEED + 1)):
        result = runner.invoke(app, ["demo", option, str(value)])
        assert result.exit_code == 2
        assert f"Invalid value for '{option}'" in result.stderr
        assert "--set" not in result.stderr


def test_keys_are_found_by_their_meaning() -> None:
    for name, meant in (("mass", "M (mass of the board; a number"), ("ball_mass", "m (mass of the ball; a number")):
        result = runner.invoke(app, ["config", "check", "--set", f"physics.{name}=1"])
        assert result.exit_code == 2
        assert f"[physics] {name}: unknown key; did you mean {meant}" in result.stderr


@pytest.mark.parametrize("option", ["--serve", "--screenshot=a.png", "--markers"])
def test_replay_does_not_begin_beyond_the_end(option: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    if option == "--screenshot=a.png":
        pytest.importorskip("PySide6")
    result = runner.invoke(app, ["replay", str(GOLDEN), option, "--at", "1000000"])
    assert result.exit_code == 2, result.output
    assert "--at: found" in result.stderr
    assert ("the length of" in result.stderr) == (option != "--markers")
    assert not Path("a.png").exists()
