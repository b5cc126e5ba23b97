"""Whether windows appear on a screen: off screen only where that was asked for."""

import os
import sys

import pytest

from netboard.base.errors import NetboardError
from netboard.base.process import display_server
from netboard.base.process.display_server import asked_offscreen, choose_screen, no_screen, require_screen

NO_X_SERVER = ":4711"


@pytest.fixture(autouse=True)
def no_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in (display_server.PLATFORM, *display_server.SCREENS, "SSH_CONNECTION", "INVOCATION_ID"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize(
    ("variable", "advice"),
    [
        ("", "run it in a terminal of the desktop session"),
        ("SSH_CONNECTION", "over ssh, name the screen (DISPLAY=:0 netboard ...)"),
        ("INVOCATION_ID", "a service must start after the desktop session"),
    ],
)
def test_missing_screen_is_an_error_that_says_what_to_do(
    variable: str, advice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if variable:
        monkeypatch.setenv(variable, "given")
    with pytest.raises(NetboardError, match="there is no screen") as raised:
        require_screen()
    assert advice in str(raised.value)
    assert str(raised.value).endswith("--offscreen")
    assert "\n" not in str(raised.value)


def test_unreachable_screen_is_named_before_qt_ends_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("PySide6.QtGui", reason="Qt's libraries cannot be loaded here", exc_type=ImportError)
    monkeypatch.setenv("DISPLAY", NO_X_SERVER)
    found = no_screen()
    assert found is not None
    assert (
        found.why == f"the screen DISPLAY={NO_X_SERVER} cannot be opened (could not connect to display {NO_X_SERVER})"
    )
    assert "reinstall" not in f"{found}".casefold()


def test_screens_of_the_computer_are_listed(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("PySide6.QtGui", reason="Qt's libraries cannot be loaded here", exc_type=ImportError)
    monkeypatch.setattr(display_server, "X_SOCKETS", tmp_path)
    for name in ("X1", "X0"):
        (tmp_path / name).touch()
    monkeypatch.setenv("DISPLAY", ":4712")
    found = no_screen()
    assert found is not None
    assert found.advice == "screens of this computer: :0, :1"


@pytest.mark.parametrize("platform", ["offscreen", "offscreen:configfile=screens.json", "minimal"])
def test_users_own_setting_asks_for_windows_off_screen(platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(display_server.PLATFORM, platform)
    require_screen()
    assert asked_offscreen() == f"QT_QPA_PLATFORM={platform}"


def test_offscreen_option_sets_the_platform(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(display_server.PLATFORM, "xcb")
    assert not asked_offscreen()
    choose_screen(True)
    assert os.environ[display_server.PLATFORM] == "offscreen"
    require_screen()
