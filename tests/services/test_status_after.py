"""The server may end with an accepted command; otherwise its silence is an error."""

from dataclasses import replace

import pytest
from typer.testing import CliRunner

from fakes import STATUS
from netboard.base.errors import NetboardError
from netboard.base.tables.rig import Network
from netboard.network.protocol.control import Reply, Status
from netboard.nodes.operator import shell
from netboard.nodes.operator.operator import Operator
from netboard.services.cli import app


class Asked(Operator):
    """An operator whose server gives these answers in turn, and then the last one again, or none."""

    def __init__(self, *answers: Status | None) -> None:
        self._answers = list(answers)

    def ask(self, seconds: float) -> Status | None:
        return self._answers.pop(0) if len(self._answers) > 1 else self._answers[0]

    def attend(self, seconds: float) -> None:
        """Nothing else arrives."""


def test_server_that_ended_with_an_accepted_command_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shell, "ANSWER_SECONDS", 0.0)
    network, done = Network(), Reply(1, True, "")
    assert shell.status_after(Asked(None), network, done) is None
    with pytest.raises(NetboardError, match="no server answers"):
        shell.status_after(Asked(None), network, Reply(1, False, "refused"))


def test_status_after_a_command_is_that_of_the_server() -> None:
    assert shell.status_after(Asked(STATUS), Network(), Reply(1, True, "")) is STATUS


RUNNING = replace(STATUS, tick=500, phase="running")
STALLED = replace(STATUS, tick=900, phase="paused", notice="paused: the server stalled for 25 ms")


def test_waiting_for_a_phase_ends_with_a_pause_and_its_reason() -> None:
    operator = Asked(RUNNING, RUNNING, STALLED)
    found = shell.wait(operator, Network(), "finished", None, lambda: False)
    assert shell.state_text(found) == "the trial is paused: the server stalled for 25 ms"


def test_pause_that_a_command_has_just_ended_does_not_end_the_wait() -> None:
    finished = replace(STATUS, tick=2000, phase="finished")
    operator = Asked(STALLED, STALLED, replace(RUNNING, tick=950), finished)
    assert shell.wait(operator, Network(), "finished", None, lambda: False) is finished


@pytest.mark.parametrize(
    ("words", "code"),
    [("seek -2 --json", 1), ("step -10", 1), ("seek -1e-1", 1), ("seek -2 --jsn", 2)],
)
def test_negative_number_is_an_argument_of_a_command(words: str, code: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shell, "ANSWER_SECONDS", 0.0)
    result = CliRunner().invoke(app, ["control", *words.split(), "--set", "network.port=21009"])
    assert (result.exit_code, "no server answers" in result.output) == (code, code == 1)
