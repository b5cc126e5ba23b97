"""What `netboard up` starts on a machine, and in which order it all ends."""

import logging
from pathlib import Path

import pytest

from netboard.errors import ConfigError
from netboard.nodes.launcher import Ended, Launcher
from netboard.services import up

RIG = Path("rig.toml")


def test_a_station_has_an_agent_and_a_display() -> None:
    assert up.processes(RIG, (), server=False, station="left") == {
        "left agent": ["agent", "--side", "left", "-c", "rig.toml"],
        "left display": ["display", "--station", "left", "-c", "rig.toml"],
    }


def test_the_server_has_its_logger_and_its_options() -> None:
    wanted = up.processes(None, ["block.trials=2"], server=True, station=None, autostart=False, insecure=True)
    assert wanted == {
        "logger": ["logger", "--set", "block.trials=2"],
        "server": ["server", "--no-autostart", "--insecure", "--set", "block.trials=2"],
    }


def test_one_machine_for_all() -> None:
    wanted = up.processes(None, (), server=True, station="both")
    assert list(wanted) == ["logger", "server", "left agent", "right agent", "left display", "right display"]
    assert {command[0] for command in wanted.values()} == set(up.STOP_ORDER)


def test_nothing_at_all_is_a_mistake() -> None:
    with pytest.raises(ConfigError, match="--server, --station"):
        up.processes(None, (), server=False, station=None)


@pytest.mark.slow
@pytest.mark.parametrize(("words", "code"), [("--version", 0), ("fly", 1)])
def test_a_process_that_ends_takes_the_others_with_it(
    words: str, code: int, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    stopped: list[tuple[str, ...]] = []

    class Watched(Launcher):
        """A launcher that notes what it is told to stop."""

        def stop(self, *names: str) -> list[Ended]:
            stopped.append(names)
            return super().stop(*names)

    monkeypatch.setattr(up, "Launcher", Watched)
    monkeypatch.setattr(up, "speak", lambda name: None)
    patient = ["agent", "--side", "left", "--set", "network.port=1025"]
    with caplog.at_level(logging.INFO):
        assert up.main({"server": [words], "left agent": patient}) == code
    assert f"the server ended with exit code {2 if code else 0}; stopping the others" in caplog.text
    assert stopped[:4] == [(), ("left agent",), ("server",), ()]
