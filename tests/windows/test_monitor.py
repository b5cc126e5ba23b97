"""The monitor window of a device."""

from pathlib import Path

import numpy as np
import pytest

from netboard.base.errors import DeviceLost, NetboardError
from netboard.devices.contract.device import Reading

AT_REST = Reading(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, True)


def moving():
    """Readings of an oscillating stylus."""
    k = 0
    while True:
        t = k * 0.004
        z, vz = 0.03 * np.sin(6 * t), 0.18 * np.cos(6 * t)
        yield Reading(round(t * 1e9), 0.004, 0.01 * np.cos(2 * t), z, 0.0, -0.02 * np.sin(2 * t), vz, 5, True)
        k += 1


@pytest.fixture
def window(app):
    from netboard.windows.monitor import MonitorWindow

    readings = moving()
    made = MonitorWindow(lambda: next(readings), "a test")
    made.show()
    yield made
    made.close()
    app.processEvents()


def test_monitor_plots_the_last_seconds_of_the_stylus(window) -> None:
    from netboard.windows.monitor import KEPT, SECONDS

    for _ in range(KEPT + 700):
        window.take()
    window.redraw()
    for line in window._lines:
        times, values = line.getData()
        assert len(times) == len(values) == KEPT
        assert times[-1] == 0.0
        assert np.all(np.diff(times) > 0)
        assert times[0] >= -SECONDS
    heights = window._lines[2].getData()[1]
    assert np.abs(heights).max() == pytest.approx(30.0, rel=0.01)
    assert "buttons: 0, 2" in window.words.text()


def test_lost_device_ends_the_monitor_with_its_error(app) -> None:
    from netboard.windows.monitor import run

    def lost() -> Reading:
        raise DeviceLost("the cable is out")

    with pytest.raises(DeviceLost, match="cable"):
        run(lost, "a test", lambda: False)


def test_monitor_stops_on_request_and_saves_a_screenshot_once(app, tmp_path: Path) -> None:
    from netboard.windows.monitor import run

    picture = tmp_path / "monitor.png"
    readings = moving()
    run(lambda: next(readings), "a test", lambda: True, picture)
    assert picture.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(NetboardError, match="exists"):
        run(lambda: next(readings), "a test", lambda: True, picture)


def test_reading_text_has_position_buttons_and_readiness() -> None:
    from netboard.windows.monitor import in_words

    words = in_words(AT_REST._replace(z=0.0123, buttons=2, ready=False))
    assert "+12.30" in words
    assert "buttons: 1 " in words
    assert "NOT ready" in words
