"""A demo whose robot partner has let go says so, and ends where nobody attends it."""

from dataclasses import replace
from math import nan
from pathlib import Path

import pytest

from fakes import STATUS
from netboard.base.safeguards import PARTNER_LET_GO, Safeguard
from netboard.network.protocol.control import DeviceStatus, StationStatus, Status
from netboard.nodes.operator import demo, standstill
from netboard.nodes.operator.launcher import Launcher
from netboard.nodes.operator.standstill import LET_GO_PATIENCE_S, LET_GO_SHOWN_S, PATIENCE_S, Standstill

LOGS = Path("logs")


def status(
    phase: str = "paused", kind: str = "robot", bits: Safeguard = Safeguard.NOT_READY, rest: float = 0.0
) -> Status:
    stations = (StationStatus("left", 0.0, 1, 0.0, 0, 0), StationStatus("right", nan, int(bits), 0.0, 0, 0))
    devices = (DeviceStatus("left", "pointer", "", "", ""), DeviceStatus("right", kind, "bad", "", ""))
    return replace(STATUS, phase=phase, rest=rest, stations=stations, devices=devices, notice="paused: something")


def after(seconds: float, *statuses: Status) -> Standstill:
    found = Standstill(LOGS)
    for number, one in enumerate(statuses):
        found.add(one, seconds * number / max(len(statuses) - 1, 1))
    return found


@pytest.mark.parametrize("phase", ["idle", "paused"])
def test_partner_that_let_go_is_reported_once_with_its_log(phase: str) -> None:
    found = after(LET_GO_SHOWN_S, status(phase), status(phase))
    said = found.news(LET_GO_SHOWN_S)
    assert said.startswith(
        f"right side: {PARTNER_LET_GO}: {LOGS / 'right-agent.log'}\nno trial of this block can go on"
    )
    assert found.news(LET_GO_SHOWN_S + 1.0) == ""
    assert found.verdict(LET_GO_PATIENCE_S - 0.1) == ""
    assert found.verdict(LET_GO_PATIENCE_S) == f"ended after 10 s without a trial: {PARTNER_LET_GO}"


@pytest.mark.parametrize(
    "other",
    [status(kind="pointer"), status(kind="hidden"), status(bits=Safeguard.ARMED)],
    ids=["player", "blinded", "ready"],
)
def test_other_standstill_has_more_patience_and_names_its_cause(other: Status) -> None:
    found = after(PATIENCE_S, other, other)
    assert found.news(PATIENCE_S) == ""
    assert found.verdict(PATIENCE_S - 0.1) == ""
    assert found.verdict(PATIENCE_S) == "ended after 180 s without a trial: paused: something"


@pytest.mark.parametrize("between", [status("running"), status("idle", rest=30.0)], ids=["trial", "rest"])
def test_patience_begins_again_with_each_trial_and_rest(between: Status) -> None:
    found = after(1000.0, status(), between, status())
    assert found.verdict(1000.0) == ""
    assert found.news(1000.0 + LET_GO_SHOWN_S)


class OperatorOfLetGo:
    """Answers each question with a session whose partner has let go."""

    def ask(self, seconds: float) -> Status:
        return status()


def test_unattended_demo_ends_in_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(standstill, "LET_GO_PATIENCE_S", 0.0)
    ended = demo.watch(
        OperatorOfLetGo(),  # type: ignore[arg-type]
        Launcher(tmp_path, {}),
        lambda: False,
        Standstill(tmp_path),
        played=False,
        attended=False,
    )
    assert ended is demo.BlockEnd.FAILED
    assert PARTNER_LET_GO in capsys.readouterr().out
