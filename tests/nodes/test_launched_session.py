"""The processes of a session over machines: what follows from each end, and the order in which they stop."""

import sys
from pathlib import Path

import pytest
from fake_machine import FakeMachine

from netboard.nodes.launching.machines import LocalMachine, last_lines
from netboard.nodes.launching.session import MAX_FAILURES, RESTART_SECONDS, LaunchedSession, UnaskedEnd
from netboard.nodes.launching.terminal import failures
from script_launcher import IGNORES_STOP, SLOW_STOP, ScriptLauncher
from waiting import until

PLACES = {"logger": "here", "server": "here", "left agent": "left", "left display": "left", "console": "here"}


class Launched:
    """A session over two machines, and what it reported."""

    def __init__(self) -> None:
        self.here, self.left = FakeMachine(), FakeMachine()
        self.ends: list[UnaskedEnd] = []
        self.now = 0.0
        machines = {"here": self.here, "left": self.left}
        self.session = LaunchedSession(machines, PLACES, self.ends.append, clock=lambda: self.now)
        self.session.start()

    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.session.poll()


@pytest.fixture
def launched() -> Launched:
    return Launched()


def test_processes_start_in_order_each_on_its_machine(launched: Launched) -> None:
    assert launched.here.started == ["logger", "server", "console"]
    assert launched.left.started == ["left agent", "left display"]
    assert launched.session.running == list(PLACES)


def test_failed_agent_is_named_with_the_end_of_its_log_and_started_again(launched: Launched) -> None:
    launched.left.end("left agent", 1, "one\n\nthe device is gone\n")
    launched.wait(0.1)
    (end,) = launched.ends
    assert str(end) == "the left agent ended with exit code 1; it is started again"
    assert end.log == ("one", "the device is gone")
    launched.wait(0.1)
    assert launched.left.started.count("left agent") == 1
    launched.wait(RESTART_SECONDS)
    assert launched.left.started.count("left agent") == 2
    assert len(launched.ends) == 1
    assert not launched.session.broken


def test_agent_that_keeps_failing_is_left_and_the_session_goes_on(launched: Launched) -> None:
    for _ in range(MAX_FAILURES + 1):
        launched.left.end("left agent", -9)
        launched.wait(0.1)
        launched.wait(RESTART_SECONDS)
    assert launched.left.started.count("left agent") == 1 + MAX_FAILURES
    assert str(launched.ends[-1]) == (
        "the left agent was killed by signal 9; it is not started again; all others go on"
    )
    assert launched.session.broken == {"left agent"}
    assert not launched.session.stopping
    launched.session.restart("left agent")
    assert launched.session.running == list(PLACES)
    assert not launched.session.broken


def test_broken_process_that_runs_again_is_broken_no_more(launched: Launched) -> None:
    launched.left.end("left agent", 2)
    launched.wait(0.1)
    assert launched.session.broken == {"left agent"}
    launched.left.start("left agent")  # by another console
    launched.wait(0.1)
    assert not launched.session.broken


@pytest.mark.parametrize(
    ("name", "code"), [("console", 0), ("left display", 0), ("console", 1), ("console", 2), ("left agent", 2)]
)
def test_end_of_a_process_without_the_server_stops_nothing(launched: Launched, name: str, code: int) -> None:
    machine = launched.left if PLACES[name] == "left" else launched.here
    machine.end(name, code)
    launched.wait(0.1)
    launched.wait(RESTART_SECONDS)
    assert name not in launched.session.running
    assert not launched.session.stopping
    assert launched.session.broken == ({name} if code else set())


@pytest.mark.parametrize(("name", "code"), [("server", 0), ("server", 1), ("server", 2)])
def test_end_of_the_server_stops_all_in_order(launched: Launched, name: str, code: int) -> None:
    launched.here.end(name, code)
    launched.wait(0.1)
    assert launched.session.stopping
    assert launched.session.broken == ({name} if code else set())
    asked = [set(launched.here.asked) | set(launched.left.asked)]
    while not launched.session.over:
        launched.here.let_stop()
        launched.left.let_stop()
        launched.wait(0.1)
        asked.append(set(launched.here.asked) | set(launched.left.asked))
    first = {"left agent", "left display", "console"} - {name}
    groups = [first, first | {"server"} - {name}, set(PLACES) - {name}]
    assert [found for at, found in enumerate(asked) if found not in asked[:at]] == list(
        dict.fromkeys(map(frozenset, groups))
    )


def test_stop_asks_the_server_only_when_agents_have_ended(launched: Launched) -> None:
    launched.session.stop()
    launched.wait(0.1)
    launched.left.let_stop()
    launched.wait(0.1)
    assert "server" not in launched.here.asked  # the console still runs
    launched.here.let_stop()
    launched.wait(0.1)
    assert launched.here.asked == ["console", "server"]
    assert not launched.ends


def test_processes_that_vanish_with_their_station_are_started_again(launched: Launched) -> None:
    launched.wait(0.1)
    launched.left.trouble = "the left station does not answer"
    launched.left.processes.clear()
    launched.wait(0.1)
    assert not launched.ends
    launched.left.trouble = ""
    launched.wait(0.1)
    assert [str(end) for end in launched.ends] == [
        f"the left {program} is gone, as if its station was restarted; it is started again"
        for program in ("agent", "display")
    ]
    launched.wait(RESTART_SECONDS)
    assert launched.left.started.count("left agent") == 2
    assert launched.session.running == list(PLACES)
    assert len(launched.ends) == 2


def test_processes_that_were_stopped_may_vanish(launched: Launched) -> None:
    launched.wait(0.1)
    launched.session.stop()
    launched.wait(0.1)
    launched.left.processes.clear()
    launched.wait(0.1)
    assert not launched.ends


def test_crash_just_before_the_stop_and_a_silent_station_are_failures(launched: Launched) -> None:
    launched.here.end("logger", 1)
    launched.wait(0.1)
    launched.left.processes.clear()
    launched.session.stop()
    while not launched.session.over:
        launched.wait(0.1)
        launched.here.let_stop()
    found = failures(launched.session)
    assert list(found) == ["logger", "left agent", "left display"]
    assert found["left agent"] is None


# --- this machine ------------------------------------------------------------------------------------------------


def await_phase(machine: LocalMachine, name: str, phase: str) -> None:
    until(lambda: machine.processes[name].phase == phase, machine.poll, lambda: machine.processes)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_local_machine_reports_processes_and_their_logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commands = {"server": [SLOW_STOP], "left agent": ["print('on'); raise SystemExit(3)"], "console": [IGNORES_STOP]}
    with LocalMachine(commands, ScriptLauncher(tmp_path, {})) as machine:
        for name in commands:
            machine.start(name)
        await_phase(machine, "left agent", "ended")
        assert machine.processes["left agent"].code == 3
        assert machine.processes["server"].phase == "running"
        assert machine.processes["server"].log_bytes == 3
        machine.stop("server")
        assert machine.processes["server"].phase == "stopping"
        await_phase(machine, "server", "stopped")
        assert (machine.processes["server"].code, machine.tail("server")) == (0, "on\ndone\n")
        monkeypatch.setattr("netboard.nodes.launching.machines.HURRIED_SECONDS", 0.0)
        machine.stop("console")
        machine.hurry()
        await_phase(machine, "console", "stopped")
        assert machine.processes["console"].code == -9
        machine.start("left agent")
        await_phase(machine, "left agent", "ended")
        assert machine.tail("left agent") == "on\non\n"


def test_last_lines_skip_empty_ones() -> None:
    assert last_lines("a\n\nb  \nc\n\n", 2) == ["b", "c"]
