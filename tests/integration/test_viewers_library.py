"""The channel for viewers, read by MCAP's library for JavaScript in the way of Foxglove's loader."""

import json
from pathlib import Path

import numpy as np
import pytest
from foreign_clients import run

from netboard.recording.format.channels import IDS, PLOTTED
from samples import random_rows, write_recording

pytestmark = [pytest.mark.integration, pytest.mark.slow, pytest.mark.timeout(240)]


def test_javascript_library_decodes_every_plotted_number(javascript_clients: Path, tmp_path: Path) -> None:
    rows = random_rows(300, seed=9)
    rows["tick"] = np.arange(300)
    rows["theta"] = rows["tick"] / 7
    rows["left_rendered"] = np.nan
    path = write_recording(tmp_path / "a.mcap", rows)
    read = json.loads(run(["node", "viewer.mjs", str(path)], javascript_clients))
    assert read["encodings"] == {topic: "json" if topic == "/plot" else "msgpack" for topic in IDS}
    assert read["types"] == {field.name: field.kind for field in PLOTTED}
    assert [message["values"]["tick"] for message in read["messages"]] == list(range(0, 300, 20))
    for message in read["messages"]:
        row = rows[message["values"]["tick"]]
        assert int(message["time"]) == row["time_ns"]
        assert message["values"]["theta"] == pytest.approx(row["theta"], rel=1e-6)
        assert "left_rendered" not in message["values"]
