"""An export format and a study of another package are used by their names, as netboard's own are."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from netboard.base.errors import ConfigError
from netboard.recording.export.formats import names, writer_of
from netboard.services.cli import app
from netboard.task.studies import library
from netboard.testing.difficult_recording import make_rows, write

MODULE = '''
from netboard.recording.files.reader import Recording

STUDY = """{study}"""

def write(recordings, folder, progress):
    for path in recordings:
        with Recording(path) as recording:
            (folder / f"{{path.stem}}.txt").write_text(str(len(recording.ticks())))
        progress(path.stem, 1, 1)
'''
ENTRY_POINTS = """[netboard.export_formats]
count = lab_plugin_of_tests:write
study = lab_plugin_of_tests:STUDY
csv = lab_plugin_of_tests:write
[netboard.studies]
ours = lab_plugin_of_tests:STUDY
writer = lab_plugin_of_tests:write
"""


@pytest.fixture(autouse=True)
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a distribution for this test."""
    (tmp_path / "lab_plugin_of_tests.py").write_text(MODULE.format(study=library.text_of("pilot")))
    info = tmp_path / "lab_plugin_of_tests-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab-plugin-of-tests\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(tmp_path)


def test_added_export_format_is_used_by_its_name(tmp_path: Path) -> None:
    recording = write(tmp_path / "S01.mcap", make_rows(1))
    result = CliRunner().invoke(app, ["export", str(recording), "--to", "count", "-o", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "out" / "S01.txt").read_text() == "299"
    assert "count" in names()


def test_entries_that_cannot_be_used_are_refused_in_words() -> None:
    with pytest.raises(ConfigError, match=r"2 export formats 'csv': .* and lab_plugin_of_tests:write; expected one"):
        writer_of("csv")
    with pytest.raises(ConfigError, match=r"the export format 'study' is '.*expected a function"):
        writer_of("study")
    with pytest.raises(ConfigError, match=r"the study 'writer' is <function.*expected a text in TOML"):
        library.text_of("writer")


def test_added_study_is_used_by_its_name() -> None:
    own, added = (
        CliRunner().invoke(app, ["plan", "show", "--study", name, "--dyads", "2", "--dyad", "1"])
        for name in ("pilot", "ours")
    )
    assert added.exit_code == 0, added.output
    assert added.output.splitlines()[2:] == own.output.splitlines()[2:]
