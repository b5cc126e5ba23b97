"""Loading a file for replay."""

import numpy as np
import pytest

from made_recordings import recorded, two_trials
from netboard.base.errors import RecordingError
from netboard.recording.replay.loading import load


def test_recording_is_loaded_with_progress_reports(tmp_path):
    progress = []
    path = recorded(tmp_path, two_trials())
    recording = load(path, progress.append)
    np.testing.assert_array_equal(recording.ticks, two_trials())
    assert recording.name == path.name
    assert progress[-1] == 10_000


def test_empty_or_missing_recording_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="no tick"):
        load(recorded(tmp_path, two_trials()[:0]))
    with pytest.raises(RecordingError, match="cannot be read"):
        load(tmp_path / "absent.mcap")
