"""The benchmark of the display: statistics of frames, and a short run with a process that sends views."""

from dataclasses import replace

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.base.tables.rig import Display, Network
from netboard.benchmarks.loop.display import ShownFrames, height_at, lateness
from netboard.network.transport.ports import free_port

NONE = np.zeros(0, np.int64)


@pytest.mark.parametrize("late_ms", [0.0, 4.0, -2.0])
def test_display_delay_is_estimated(late_ms):
    painted = np.arange(0, 5_000_000_000, 16_666_667)
    heights = np.array([height_at(int(at - late_ms * 1e6))[0] for at in painted])
    delay, off = lateness(ShownFrames(NONE, NONE, NONE, painted, heights, 0.0, 0))
    assert delay * 1e3 == pytest.approx(late_ms, abs=0.02)
    assert off < 5e-4


@pytest.mark.slow
@pytest.mark.integration
def test_frames_of_a_short_run_are_measured(monkeypatch):
    pytest.importorskip("PySide6.QtWidgets", reason="Qt's libraries cannot be loaded here", exc_type=ImportError)
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    from netboard.benchmarks.loop.display import measure

    config = replace(Config(), network=Network(port=free_port()), display=Display(width=400, height=240))
    shown = measure(config, 0.5, moving=True)
    assert shown.painted.size > 0
    assert (shown.sent_to_received > 0).all()
    assert (shown.received_to_painted > 0).all()
