"""A session of a study on real processes: form, blocks and files, and a server that is killed repeatedly."""

import json
import random
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import sampling
from netboard.base.config import parse
from netboard.base.errors import NetboardError
from netboard.base.safeguards import Safeguard
from netboard.base.tables.experiment import Session
from netboard.base.tables.questionnaires import ANSWERS, UNANSWERED
from netboard.benchmarks.harness.rig import Rig
from netboard.network.protocol.control import FORM_AWAITED, Status
from netboard.nodes.operator.operator import Operator
from netboard.nodes.server.blocks import BlockSequence
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording
from netboard.task.journal.entries import AttemptBegan, AttemptEnded, BlockBegan, read_lines
from netboard.task.plans.plan import config_of, plan_of, seated
from netboard.task.studies.study import paper_study

pytestmark = [pytest.mark.integration, pytest.mark.slow, pytest.mark.timeout(600)]

QUICK = (
    "task.level_time=0.02",
    "quality.excluded_share=1.0",
    "task.level_angle_deg=8.0",
    "task.level_rate_deg_s=90.0",
    "task.level_height=0.05",
    "task.hold_time=0.02",
    "geometry.target_distance=0.08",
    "geometry.target_width=0.15",
)
"""Trials of about a second."""

PILOT = ("session.pilot=true",)
STUDY = ("--study", "paper", "--dyad", "3")
ASKED = """
name = "asked"
block.trials = 1
[orders]
main = "2 dyadic"
[kinds.dyadic]
[questionnaires.opinion]
after = ["dyadic"]
form = "person"
wait = 3600
"""
"""A study whose second block waits for answers at the displays."""

KILLS, SUCCESS_EVERY = (50, 10) if sampling.ALL else (3, 2)
"""Number of kills, and how often the server first completes a trial, so that it progresses on a slow machine [1]."""
FROM_START, FROM_ANSWER = 2.0, 2.5
"""Longest random times before the other kills, from the start or the first answer of the server [s]."""


@pytest.fixture(scope="module", autouse=True)
def kernels() -> None:
    """Compile the kernels before the processes start, because compiling may take longer than their timeouts."""
    plan = plan_of(paper_study(), 1, 3)
    config = seated(parse("", "rig", (*QUICK, *PILOT)), plan)
    BlockSequence([config_of(config, plan.sessions[0], number) for number in range(1, 19)])


def journal(rig: Rig) -> Path:
    (path,) = Path(rig.config.recording.directory).glob("*.journal.jsonl")
    return path


def entries_of(rig: Rig) -> tuple[Any, ...]:
    return read_lines(journal(rig).read_bytes(), "journal").entries


STAND_INS = "left device simulated, right device simulated"
"""Words that confirm the devices of these sessions."""

FORM = {"participant_a": "P07", "participant_b": "P08", "seat_a": "left"}


def open_session(rig: Rig) -> Operator:
    """Start a session, fill in its form, arm the devices and return its operator."""
    rig.start("logger", "logger", "--once")
    rig.start("server", "server", *STUDY)
    rig.start_stations()
    rig.until(lambda s: not s.opened and len(s.peers) >= 3)
    operator = rig.operator
    assert operator.do("open", json.dumps(FORM | {"consent": True})).accepted
    rig.until(lambda s: len(s.devices) == 2)
    assert operator.do("confirm", STAND_INS).accepted
    assert operator.do("arm").accepted
    rig.until(lambda s: not s.waiting_for)
    return operator


def wait_and_resume(rig: Rig, condition: Callable[[Status], bool]) -> Status:
    """Wait for a condition, and resume trials that a slow machine has paused."""
    while True:
        status = rig.until(lambda s: condition(s) or (s.phase == "paused" and not s.waiting_for))
        if condition(status):
            return status
        rig.operator.do("resume")


@pytest.mark.sampled(1, of="whole sessions")
def test_block_requires_a_completed_form_and_armed_devices(tmp_path: Path) -> None:
    with Rig(tmp_path, QUICK) as rig:
        rig.start("logger", "logger", "--once")
        rig.start("server", "server", *STUDY)
        rig.start_stations()
        status = rig.until(lambda s: not s.opened and len(s.peers) >= 3)
        assert (status.study, status.dyad, status.block, status.blocks, status.armed) == ("paper", "D03", 1, 18, False)
        operator = rig.operator
        assert operator.do("start").reason == "the session is not open: fill in its form first (open)"
        assert "consent" in operator.do("open", json.dumps(FORM)).reason
        assert not list(Path(rig.config.recording.directory).glob("*.journal.jsonl"))
        assert operator.do("open", json.dumps(FORM | {"consent": True})).accepted
        status = rig.until(
            lambda s: {"the left device to be armed", "the right device to be armed"} <= set(s.waiting_for)
        )
        assert not any(station.safeguards & Safeguard.ARMED for station in status.stations)
        assert operator.do("start").reason == "cannot start: the devices are not armed (arm)"
        assert operator.do("arm").accepted
        status = rig.until(lambda s: len(s.waiting_for) == 1)
        assert operator.do("start").reason == f"cannot start: waiting for {status.waiting_for[0]}"
        assert operator.do("confirm", STAND_INS).accepted
        rig.until(lambda s: not s.waiting_for)
        assert operator.do("start").accepted
        rig.finish()
        header = read_lines(journal(rig).read_bytes(), "journal").header
    assert (header.participants, header.consent, header.pilot) == (("P07", "P08"), True, False)


@pytest.mark.sampled(1, of="whole sessions")
def test_operator_commands_control_the_blocks_of_a_session(tmp_path: Path) -> None:
    with Rig(tmp_path, QUICK) as rig:
        operator = open_session(rig)
        assert operator.do("start").accepted
        status = wait_and_resume(
            rig, lambda s: s.successes >= 1 and bool(s.recordings) and s.recordings[0].written_bytes > 0
        )
        assert "block01" in status.recordings[0].file
        assert operator.do("repeat", "1").reason == "trial 1 is repeated at the end of the block"
        assert rig.until(lambda s: s.trials == 61).block == 1
        assert operator.do("veto", "1").accepted
        assert rig.until(lambda s: s.trials == 60).block == 1
        assert operator.do("note", '{"text": "sneezed", "tick": 7}').accepted
        wait_and_resume(rig, lambda s: s.phase in ("levelling", "running", "holding"))
        rig.until(lambda s: operator.do("pause").accepted or s.phase == "paused")  # not in the tick between trials
        rig.until(lambda s: s.phase == "paused")
        assert operator.do("skip").accepted
        assert operator.do("next").accepted
        status = rig.until(lambda s: s.block == 2 and s.phase == "idle")
        assert status.label == "bimanual B, haptics off"
        rig.until(lambda s: not s.waiting_for)
        assert operator.do("start").accepted
        wait_and_resume(rig, lambda s: s.successes >= 1)
        first, second = rig.finish()
        outcomes = Counter(entry.outcome for entry in entries_of(rig) if isinstance(entry, AttemptEnded))
    assert outcomes["success"] >= 2
    assert outcomes["skipped"] == 1
    for number, path in enumerate((first, second), start=1):
        with Recording(path) as recording:
            config = parse(recording.config_text)
            assert verify_recording(recording).identical
            events = list(recording.events())
        assert (config.block.number, config.session.participant_a, config.session.consent) == (number, "P07", True)
        assert events[0].name == "block_began"
        assert path.name.endswith(f"block{number:02d}.mcap")
    with Recording(first) as recording:
        commands = [event.details for event in recording.events() if event.name == "command"]
    assert {"repeat", "veto", "note", "pause", "skip", "next", "start"} <= {command["name"] for command in commands}


@pytest.mark.sampled(1, of="whole sessions")
def test_session_started_before_is_not_restarted(tmp_path: Path) -> None:
    with Rig(tmp_path, (*QUICK, *PILOT)) as rig:
        rig.start("logger", "logger")
        rig.start("server", "server", *STUDY)
        rig.until(lambda s: s.opened)
        rig.operator.command("end")
        assert rig.wait("server") in (0, 1)
        before = journal(rig).read_bytes()
        rig.start("server", "server", *STUDY)
        assert rig.wait("server") == 2
        assert "was started before. Continue it with netboard server --resume" in rig.output_of("server")
        assert journal(rig).read_bytes() == before


@pytest.mark.sampled(1, of="whole sessions")
def test_questionnaire_after_a_block_is_announced_and_recorded(tmp_path: Path) -> None:
    questionnaire = "workload: hand out the form"
    with Rig(tmp_path, (*QUICK, "block.trials=1", f'block.questionnaires="{questionnaire}"')) as rig:
        rig.start_all()
        assert rig.until(lambda s: s.phase == "finished").notice == f"ask now: {questionnaire}"
        (path,) = rig.finish()
    with Recording(path) as recording:
        assert [event.details for event in recording.events() if event.name == "questionnaire"] == [
            {"text": questionnaire}
        ]


@pytest.mark.sampled(1, of="whole sessions")
def test_session_goes_on_without_answers_at_a_dead_display_if_the_operator_skips_them(tmp_path: Path) -> None:
    (tmp_path / "asked.toml").write_text(ASKED, encoding="utf-8")
    with Rig(tmp_path, (*QUICK, *PILOT)) as rig:
        rig.start("logger", "logger", "--once")
        rig.start("server", "server", "--study", str(tmp_path / "asked.toml"), "--autostart")
        rig.start_stations(displays=True)
        wait_and_resume(rig, lambda s: FORM_AWAITED in s.notice)
        rig.kill("right display")
        rig.start("control", "control", "skip_form")
        assert rig.wait("control") == 0
        assert "goes on without answers from left and right" in rig.output_of("control")
        rig.until(lambda s: s.block == 2)
        assert rig.stop("left display") == 0
        recordings = rig.finish()
    events = []
    for path in recordings:
        with Recording(path) as recording:
            assert verify_recording(recording).identical
            events += recording.events()
    missing = [event.details for event in events if event.name == UNANSWERED]
    skipped = [(one["station"], one["block"]) for one in missing if one.get("skipped_by")]
    assert skipped == [("left", "1"), ("right", "1")]
    answers = [event.details for event in events if event.name == ANSWERS]
    assert [(one["station"], one["block"], one["complete"]) for one in answers] == [("left", "1", "false")]


@pytest.mark.sampled(1, of="whole sessions")
def test_operator_skips_to_the_next_block_without_agents(tmp_path: Path) -> None:
    with Rig(tmp_path, (*QUICK, *PILOT)) as rig:
        rig.start("logger", "logger")
        rig.start("server", "server", *STUDY)
        rig.until(lambda s: s.opened)
        for block in (2, 3):
            assert rig.operator.do("next").accepted
            rig.until(lambda s, block=block: s.block == block and s.phase == "idle")  # type: ignore[misc]


def run_and_kill(rig: Rig, number: int, chance: random.Random) -> None:
    """Let a server run for a random time, and kill it."""
    if number % SUCCESS_EVERY == 0:
        wait_for_another_success(rig)
    elif chance.random() < 0.5:
        rig.until(lambda s: True)
        time.sleep(chance.uniform(0.0, FROM_ANSWER))
    else:
        time.sleep(chance.uniform(0.3, FROM_START))
    assert rig.running["server"].poll() is None, rig.output_of("server")[-2000:]
    rig.kill("server")


def wait_for_another_success(rig: Rig) -> None:
    """Wait until the server reports one more success than the journal has now."""
    done = len({(entry.block, entry.trial) for entry in entries_of(rig) if is_success(entry)})
    rig.until(lambda s: len({row[:2] for row in attempts(rig) if row[3] == "success"}) > done)


@pytest.mark.sampled(1, of="whole sessions")
def test_repeatedly_killed_server_resumes_the_plan_with_correct_counts(tmp_path: Path) -> None:
    chance = sampling.chance("kills")
    with Rig(tmp_path, (*QUICK, *PILOT, "network.require_logger=false")) as rig:
        rig.start_stations()
        rig.start("server", "server", *STUDY, "--autostart", "--trials", "2")
        rig.until(lambda s: s.successes >= 1)
        rig.kill("server")
        for kill in range(KILLS - 1):
            before = entries_of(rig)
            rig.start("server", "server", *STUDY, "--autostart", "--trials", "2", "--resume", "--yes")
            run_and_kill(rig, kill, chance)
            after = entries_of(rig)
            assert after[: len(before)] == before, f"kill {kill}"
            check_resumption(before, after)
        rig.start("server", "server", *STUDY, "--autostart", "--trials", "2", "--resume", "--yes")
        wait_for_another_success(rig)
        found = entries_of(rig)
    check_plan(found)


def attempts(rig: Rig) -> list[Any]:
    """All attempts that the server reports, including those before it was killed."""
    rig.operator.poll()
    return rig.operator.attempts


def is_success(entry: Any) -> bool:
    return isinstance(entry, AttemptEnded) and entry.outcome == "success"


def check_resumption(before: tuple[Any, ...], after: tuple[Any, ...]) -> None:
    """Check that a resumed server begins with the block, trial and attempt that follow from the earlier entries."""
    began = next((entry for entry in after[len(before) :] if isinstance(entry, BlockBegan)), None)
    if began is None:
        return  # killed before it began a block
    done = Counter(entry.block for entry in before if is_success(entry))
    block = next(number for number in range(1, 19) if done[number] < 2)
    trial = done[block] + 1
    earlier_attempts = [
        entry.attempt
        for entry in before
        if isinstance(entry, AttemptBegan) and entry.block == block and entry.trial == trial
    ]
    assert (began.block, began.trial) == (block, trial)
    assert began.attempt == max(earlier_attempts, default=0) + 1


def check_plan(entries: tuple[Any, ...]) -> None:
    """Check that no trial was completed twice or left out, and that no attempt number was reused."""
    successes = [(entry.block, entry.trial) for entry in entries if is_success(entry)]
    assert len(set(successes)) == len(successes)
    assert successes == sorted(successes)
    for block in {block for block, _ in successes}:
        trials = [trial for number, trial in successes if number == block]
        assert trials == list(range(1, len(trials) + 1))
        assert len(trials) == 2 or block == max(successes)[0]
    begun = [(entry.block, entry.trial, entry.attempt) for entry in entries if isinstance(entry, AttemptBegan)]
    assert len(set(begun)) == len(begun)
    assert max(successes)[0] > 1, "the session made too little progress to test anything"


@pytest.mark.sampled(1, of="whole sessions")
def test_blocks_of_a_killed_session_match_the_plan(tmp_path: Path) -> None:
    with Rig(tmp_path, (*QUICK, *PILOT)) as rig:
        rig.start("logger", "logger")
        rig.start_stations()
        rig.start("server", "server", *STUDY, "--autostart", "--blocks", "2", "--trials", "2")
        rig.until(lambda s: s.successes >= 1)
        rig.kill("server")
        rig.start("server", "server", *STUDY, "--autostart", "--blocks", "2", "--trials", "2", "--resume", "--yes")
        rig.until(lambda s: s.phase == "finished" and s.block == 2)
        rig.operator.command("end")
        assert rig.wait("server") == 0
        assert rig.stop("logger") == 0
        configs = {}
        for path in rig.recordings():
            with Recording(path) as recording:
                assert verify_recording(recording).identical
                configs[path.name] = parse(recording.config_text)
    plan = plan_of(paper_study(), 1, 3)
    base = replace(seated(rig.config, plan), session=replace(Session(), pilot=True, study="paper", dyad="D03"))
    expected = {number: config_of(base, plan.sessions[0], number).block for number in (1, 2)}
    assert len(configs) == 3
    for config in configs.values():
        block = expected[config.block.number]
        assert replace(config.block, trials=60, blocks=18, station=block.station) == block


@pytest.mark.sampled(1, of="whole sessions")
def test_resume_without_confirmation_is_refused(tmp_path: Path) -> None:
    with Rig(tmp_path, (*QUICK, *PILOT)) as rig:
        rig.start("logger", "logger")
        rig.start("server", "server", *STUDY)
        rig.until(lambda s: s.opened)
        rig.kill("server")
        rig.start("server", "server", *STUDY, "--resume")
        assert rig.wait("server") == 2
        assert "add --yes, or run it in a terminal" in rig.output_of("server")
        assert "resumes at block 1 of 18, trial 1 of 60 (0 done)" in rig.output_of("server")
        with pytest.raises(NetboardError):
            rig.until(lambda s: s.opened, seconds=1.0)
