"""What the launcher shows: its badge, rows, advice, notices, and forms that are made from declarations."""

from dataclasses import replace

import pytest

from fakes import STATUS
from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.network.protocol.station import ProcessStatus
from netboard.nodes.ports.emergency import AWAITING_RELEASE
from netboard.windows.launcher.control import LauncherMemory, SessionChoice
from netboard.windows.launcher.model import (
    FADE_S,
    LaunchFacts,
    LaunchStage,
    Notices,
    advice,
    badge,
    bytes_in_words,
    edited_while_running,
    rows,
    session_line,
)
from netboard.windows.launcher.settings_form import (
    changed_text,
    checked,
    fields_of,
    form_tables,
    keeps_all,
    text_of,
)
from netboard.windows.operator.words import Tone

RUNNING = LaunchFacts(LaunchStage.RUNNING, places={"server": "here"}, status=STATUS, silence=0.1)


@pytest.mark.parametrize(
    ("facts", "words", "tone"),
    [
        (LaunchFacts(), "READY TO START", Tone.PLAIN),
        (LaunchFacts(problem="no such study"), "NOT READY", Tone.WATCH),
        (LaunchFacts(LaunchStage.PREPARING), "PREPARING", Tone.WATCH),
        (replace(RUNNING, status=None), "STARTING", Tone.WATCH),
        (replace(RUNNING, status=replace(STATUS, opened=False)), "WAITING FOR THE FORM", Tone.WATCH),
        (replace(RUNNING, status=replace(STATUS, opened=True)), "READY FOR THE BLOCK", Tone.GOOD),
        (replace(RUNNING, status=replace(STATUS, opened=True, waiting_for=("the logger",))), "WAITING", Tone.WATCH),
        (replace(RUNNING, status=replace(STATUS, opened=True, phase="holding")), "TRIAL RUNNING", Tone.GOOD),
        (replace(RUNNING, status=replace(STATUS, waiting_for=(AWAITING_RELEASE,))), "EMERGENCY STOP", Tone.BAD),
        (replace(RUNNING, silence=9.0), "NO REPLY FROM THE SERVER", Tone.BAD),
        (replace(RUNNING, broken=frozenset(["left agent"])), "FAILED: left agent", Tone.BAD),
        (replace(RUNNING, troubles={"left station": "silent"}), "A STATION DOES NOT ANSWER", Tone.BAD),
        (replace(RUNNING, stage=LaunchStage.STOPPING), "STOPPING: 0 still running", Tone.WATCH),
    ],
)
def test_badge_has_one_state(facts: LaunchFacts, words: str, tone: Tone) -> None:
    found = badge(facts)
    assert (found.words, found.tone) == (words, tone)
    assert advice(facts)


def status(phase: str, code: int | None = None) -> ProcessStatus:
    return ProcessStatus("server", phase, code, 7, 12.3, 2048)


@pytest.mark.parametrize(
    ("process", "words"),
    [
        (status("running"), "running"),
        (status("stopping"), "stopping"),
        (status("stopped", 0), "stopped"),
        (status("ended", 0), "done"),
        (status("ended", 2), "failed, exit code 2"),
        (status("ended", -9), "killed by signal 9"),
    ],
)
def test_row_says_how_a_process_is(process: ProcessStatus, words: str) -> None:
    (row,) = rows(replace(RUNNING, processes={"server": process}))
    assert (row.state.words, row.detail) == (words, "12 s, log 2.0 kB")
    assert row.runs == (process.code is None)


def test_check_with_findings_has_not_failed() -> None:
    facts = LaunchFacts(tasks={"check": "here"}, processes={"check": status("ended", 3)})
    assert [row.state.words for row in rows(facts)] == ["done, read its log"]


def test_rows_of_a_silent_station_are_marked_as_last_seen() -> None:
    facts = replace(RUNNING, troubles={"here": "silent"}, tasks={"doctor": "here"})
    assert [row.state.words for row in rows(facts)] == ["not reached", "not reached"]
    assert rows(replace(facts, processes={"server": status("running")}))[0].state.words == "last seen running"
    assert advice(facts) == "silent"


def test_session_line_states_bytes_on_disk() -> None:
    assert session_line(replace(RUNNING, on_disk=1_500_000)) == "S01 D01, block 1 of 1, trial 1; 1.5 MB on disk"
    assert session_line(LaunchFacts()) == "0 bytes on disk"
    assert bytes_in_words(999) == "999 bytes"


def test_successes_fade_and_refusals_stay_until_they_are_read() -> None:
    notices = Notices()
    notices.add("started", 0.0, stays=False)
    notices.add("refused", 0.0, stays=True)
    notices.add("refused", 1.0, stays=True)
    assert [notice.words for notice in notices.visible(FADE_S / 2)] == ["started", "refused"]
    assert [notice.words for notice in notices.visible(100 * FADE_S)] == ["refused"]
    notices.read()
    assert notices.visible(100 * FADE_S) == []
    notices.read()


def test_edited_study_is_explained() -> None:
    assert edited_while_running("a", "a", "study.toml") == ""
    words = edited_while_running("a", "b", "study.toml")
    assert words.startswith("study.toml was changed. The running session keeps the study that it started with")


# --- forms -------------------------------------------------------------------------------------------------------


def test_forms_have_every_key_with_unit_and_help() -> None:
    found = [field for table in form_tables() for field in fields_of(Config(), table)]
    assert all(field.help and field.usual for field in found)
    by_name = {(".".join(field.path), field.key.name): field for field in found}
    force = by_name["safety", "max_force"]
    assert (force.text, force.unit, force.help) == (
        "3.0",
        "N",
        "largest force at the stylus (norm); a number > 0 and <= 40 [N]",
    )
    assert by_name["network", "transport"].choices == ("tcp", "ipc")
    assert by_name["display", "smooth"].choices == ("false", "true")
    assert "openhaptics" in by_name["agents.left", "device"].choices
    assert by_name["session", "study"].suggestions[:1] == ("paper",)


@pytest.mark.parametrize(
    ("table", "key", "entry", "text"),
    [
        ("network", "port", "6000", "[network]\nport = 6000\n"),
        ("network", "host", "10.77.0.1", '[network]\nhost = "10.77.0.1"\n'),
        ("agents.left", "options", '{serial = "12"}', '[agents.left]\noptions = {"serial" = "12"}\n'),
        ("triggers", "codes", '{"level haptics=on" = 5}', '[triggers]\ncodes = {"level haptics=on" = 5}\n'),
        ("network", "port", "5550", "\n"),
    ],
)
def test_form_writes_only_what_differs_from_the_defaults(table: str, key: str, entry: str, text: str) -> None:
    found = [field for one in form_tables() for field in fields_of(Config(), one)]
    (field,) = (field for field in found if (".".join(field.path), field.key.name) == (table, key))
    changed = changed_text("", field, entry)
    assert changed == text
    assert text_of(parse(changed)) == changed


def test_form_refuses_what_the_declaration_refuses() -> None:
    found = [field for one in form_tables() for field in fields_of(Config(), one)]
    (field,) = (field for field in found if field.key.name == "port" and field.path == ("network",))
    with pytest.raises(ConfigError, match=r"\[network\] port: found 80, expected a whole number >= 1024"):
        changed_text("", field, "80")


def test_remembered_choice_reads_back() -> None:
    memory = LauncherMemory(SessionChoice("rig.toml", "pilot", 3, resume=True))
    assert checked(LauncherMemory, text_of(memory), "memory") == memory
    with pytest.raises(ConfigError, match="dyad"):
        checked(LauncherMemory, "[session]\ndyad = 0", "memory")


def test_form_says_that_comments_are_lost() -> None:
    assert keeps_all("[network]\nport = 6000\n", "rig.toml", "rig.toml.bak") == ""
    assert (
        keeps_all("# ours\n", "a/rig.toml", "rig.toml.bak")
        == "a/rig.toml had comments, which stay only in rig.toml.bak"
    )
