"""FORMAT.md is correct: its tables are current, its keys are those of the file, and its snippet runs."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from format_tables import FORMAT, renewed

from netboard.recording.format.channels import FORMAT_VERSION
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


@pytest.mark.slow
def test_reading_snippet_runs(tmp_path: Path) -> None:
    rows = random_rows(30)
    rows["p"] = rows["tick"] / 7
    path = write_recording(tmp_path / "a.mcap", rows)
    (snippet,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert len([line for line in snippet.splitlines() if line]) <= 23
    ran = subprocess.run([sys.executable, "-c", snippet, str(path)], check=True, capture_output=True, text=True)
    lines = [line.split() for line in ran.stdout.splitlines()]
    assert [int(line[0]) for line in lines] == list(range(30))
    assert [float(line[3]) for line in lines] == rows["p"].tolist()
