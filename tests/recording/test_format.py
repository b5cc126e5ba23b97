"""FORMAT.md is correct: its tables are current, its keys are those of the file, and its snippet runs."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from format_tables import FORMAT, renewed

from netboard.recording.files.reader import Recording
from netboard.recording.format.channels import FORMAT_VERSION
from rehearsed_study import rehearse
from samples import metadata, random_rows, write_recording

TEXT = FORMAT.read_text(encoding="utf-8")


def test_format_tables_are_up_to_date() -> None:
    assert renewed(TEXT) == TEXT, "run: python tests/recording/format_tables.py"


def test_documented_version_equals_that_of_the_code() -> None:
    assert f"Format version {FORMAT_VERSION}\n" in TEXT


def test_every_metadata_key_is_listed() -> None:
    (row,) = re.findall(r"^\| `netboard`, at the start \| (.*) \|$", TEXT, re.MULTILINE)
    listed = [name for name in re.findall(r"`(\w+)`", row) if name not in ("true", "false")]
    assert listed == list(metadata())


(SNIPPET,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


@pytest.mark.slow
def test_reading_snippet_runs(tmp_path: Path) -> None:
    rows = random_rows(30)
    rows["p"] = rows["tick"] / 7
    path = write_recording(tmp_path / "a.mcap", rows)
    assert len([line for line in SNIPPET.splitlines() if line]) <= 23
    ran = subprocess.run([sys.executable, "-c", SNIPPET, str(path)], check=True, capture_output=True, text=True)
    lines = [line.split() for line in ran.stdout.splitlines()]
    assert [int(line[0]) for line in lines] == list(range(30))
    assert [float(line[3]) for line in lines] == rows["p"].tolist()


def test_reading_snippet_gives_every_column_to_the_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also at the ends of batches, where a predicted column has no row before or after."""
    (path,) = rehearse(tmp_path / "study", 1, (9,), 1)
    batches: list[dict[str, np.ndarray]] = []
    *reading, loop, printing = SNIPPET.rstrip().splitlines()
    assert "print" in printing
    program = "\n".join([*reading, loop.partition("for")[0] + "batches.append(ticks)"])
    monkeypatch.setattr(sys, "argv", ["", str(path)])
    exec(program, {"batches": batches})
    assert len(batches) > 2
    with Recording(path) as recording:
        rows = recording.ticks()
    for name in rows.dtype.names or ():
        assert np.concatenate([batch[name] for batch in batches]).tobytes() == rows[name].tobytes(), name
