"""A whole session in which no process of netboard sees libzmq's functions, as on Windows: complete, and to the bit."""

from pathlib import Path

import numpy as np
import pytest

from hidden_libzmq import PROOF, hiding_environment
from netboard.benchmarks.harness.rig import Rig
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording
from netboard.task.trials.state_machine import Phase

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(300)]

SETTINGS = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "network.sample_timeout_ms=1000",
    "block.trials=50",
)


def test_session_through_pyzmq_is_recorded_completely_and_verifies(tmp_path: Path) -> None:
    with Rig(tmp_path, SETTINGS, hiding_environment(tmp_path)) as rig:
        rig.start_all(displays=True)
        running = rig.until(lambda s: s.phase == "running" and {"display.left", "display.right"} <= set(s.peers))
        rig.until(lambda s: s.tick > running.tick + 3000)
        rig.kill("left agent")
        rig.until(lambda s: s.phase == "paused")
        rig.start_agent("left")
        again = rig.until(lambda s: s.phase == "running")
        rig.until(lambda s: s.tick > again.tick + 500)
        (path,) = rig.finish()
        for name in ("left agent", "right agent", "left display", "right display"):
            assert rig.stop(name) == 0
        for name in ("server", "left agent", "right agent"):
            assert PROOF in rig.output_of(name), f"the {name} saw libzmq"
    with Recording(path) as recording:
        ticks = recording.ticks()
        assert verify_recording(recording).identical
    assert ticks["tick"].tolist() == list(range(len(ticks)))
    live = ticks[(ticks["left_live"] == 1) & (ticks["right_live"] == 1) & (ticks["phase"] == Phase.RUNNING)]
    assert len(live) > 500
    for side in ("left", "right"):
        assert np.nan_to_num(live[f"{side}_rendered"]).any()
        assert np.any(live[f"{side}_loop_ns"] > 0)
