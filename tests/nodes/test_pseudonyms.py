"""Pseudonyms of a real session belong to one dyad, and are no defaults; the folder's files tell who has had which."""

from dataclasses import replace
from pathlib import Path

import pytest
from stepped_session import SteppedSession
from typer.testing import CliRunner

from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Session
from netboard.network.transport import sockets
from netboard.nodes.server.pseudonyms import Use, require_own_pseudonyms, uses_in
from netboard.services.cli import app

REAL = Session(name="S01", dyad="D03", participant_a="P07", participant_b="P08", consent=True)
USED = Use("P07", "D02", "S02", "2026-11-27", Path("recordings/D02_S02.journal.jsonl"))


def test_pseudonym_of_another_dyad_is_refused_with_who_has_it_since_when() -> None:
    with pytest.raises(ConfigError, match="participant_a") as raised:
        require_own_pseudonyms(REAL, (USED,))
    for words in ("P07", "D02", "S02", "2026-11-27", "recordings/D02_S02.journal.jsonl"):
        assert words in str(raised.value)
    with pytest.raises(ConfigError, match="participant_b"):
        require_own_pseudonyms(replace(REAL, participant_a="P1", participant_b="p07"), (USED,))


@pytest.mark.parametrize("fields", [{"pilot": True}, {"consent": False}, {"dyad": "D02"}])
def test_pilot_or_the_same_dyad_may_have_it_again(fields: dict[str, object]) -> None:
    require_own_pseudonyms(replace(REAL, **fields), (USED,))  # type: ignore[arg-type]


@pytest.mark.parametrize("fields", [{"participant_a": "A"}, {"participant_b": "B"}, {"participant_b": "P07"}])
def test_defaults_and_one_pseudonym_for_both_are_refused(fields: dict[str, str]) -> None:
    with pytest.raises(ConfigError, match="expected"):
        require_own_pseudonyms(replace(REAL, **fields), ())


def test_form_with_the_pseudonym_of_another_dyad_is_refused(tmp_path: Path, context: sockets.Context) -> None:
    form = '{"participant_a": "P07", "participant_b": "P08", "consent": true}'
    first = SteppedSession(tmp_path, context, pilot=False)
    assert first.do("open", form)[0]
    first.close()
    second = SteppedSession(tmp_path, context, "session.dyad=D09", pilot=False)
    accepted, reason = second.do("open", form)
    assert not accepted
    assert "which dyad D01 has in session S01 of 20" in reason
    assert not (tmp_path / "D09_S01.journal.jsonl").exists()
    default = second.do("open", '{"participant_a": "A", "participant_b": "P10", "consent": true}')
    assert default[1].startswith('participant_a: found "A", the default')
    assert second.do("open", form.replace("P07", "P09").replace("P08", "P10"))[0]
    second.close()


def test_single_block_with_default_pseudonyms_is_refused(tmp_path: Path) -> None:
    words = ["server", "--set", "session.consent=true", "--set", f"recording.directory={tmp_path}"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 2
    assert "the default" in result.stderr


def test_unreadable_files_are_named_and_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "D01_S01.journal.jsonl").write_text("damaged")
    (tmp_path / "x.mcap").write_bytes(b"damaged")
    assert uses_in(tmp_path) == ()
    assert "D01_S01.journal.jsonl" in caplog.text
    assert "x.mcap" in caplog.text
    assert uses_in(tmp_path / "none") == ()
