"""The shipped recording is whole, and every tick of it is computed again with the same bits."""

from pathlib import Path

import pytest

from netboard.base.errors import NetboardError
from netboard.recording.files.example import copy_example
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording


@pytest.mark.slow
def test_example_verifies(tmp_path: Path) -> None:
    copy_example(tmp_path / "example.mcap")
    with Recording(tmp_path / "example.mcap") as recording:
        assert verify_recording(recording).identical


def test_example_overwrites_nothing(tmp_path: Path) -> None:
    (tmp_path / "example.mcap").write_text("mine", encoding="utf-8")
    with pytest.raises(NetboardError, match="already exists"):
        copy_example(tmp_path / "example.mcap")
    assert (tmp_path / "example.mcap").read_text(encoding="utf-8") == "mine"
