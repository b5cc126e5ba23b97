"""Blocks are rehearsed by one function: table or JSON, with recordings or without, shortened as asked."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from netboard.base.config import Config
from netboard.base.errors import NetboardError
from netboard.nodes.rehearsal import session as rehearsal
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording


def blocks(trials: int = 1) -> list[Config]:
    default = Config()
    dyadic = replace(default.block, trials=trials, number=1, blocks=2)
    bimanual = replace(dyadic, number=2, configuration="bimanual", force="none", catch=(1, 9), label="alone")
    return [replace(default, block=block) for block in (dyadic, bimanual)]


@pytest.mark.slow
def test_a_table_tells_what_came_of_the_blocks(capsys: pytest.CaptureFixture[str]) -> None:
    assert rehearsal.rehearse_blocks(blocks(), 1, 1, folder=None) == 0
    said = capsys.readouterr().out
    assert "alone" in said
    assert "2 blocks, 2 successful trials" in said
    assert "x real time" in said


@pytest.mark.slow
def test_recordings_are_whole_and_json_names_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert rehearsal.rehearse_blocks(blocks(), 1, 1, folder=tmp_path / "new", as_json=True) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["ticks"] == sum(block["ticks"] for block in told["blocks"])
    assert told["real_time_factor"] > 0
    for block in told["blocks"]:
        with Recording(Path(block["recording"])) as recording:
            assert verify_recording(recording).checked == block["ticks"]
    assert len(list((tmp_path / "new").iterdir())) == 2
    with pytest.raises(NetboardError, match="block01"):
        rehearsal.rehearse_blocks(blocks(), 1, 1, folder=tmp_path / "new")
