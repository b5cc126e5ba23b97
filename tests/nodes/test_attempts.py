"""The attempts of a session, with the real state machine and a journal on a real disk.

Board and ball are placed where they end a trial; all other events come from random commands.
"""

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from netboard.base.config import Config, parse
from netboard.base.errors import NetboardError
from netboard.base.tick import TICK, TICK_NS
from netboard.network.protocol.records import FrameRecord
from netboard.nodes.server.attempts import Attempts
from netboard.recording.recovery.journal_file import Journal
from netboard.stage.stage import make_stage
from netboard.task.journal.entries import (
    AttemptBegan,
    BlockEnded,
    Ended,
    Entry,
    Note,
    Opened,
    Resumed,
    read_lines,
)
from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.journal.progress import SessionProgress, progress_of
from netboard.task.trials.state_machine import TABLE, Cause, Phase
from session_model import HEADER, PLAN, Planned, check

NUMBERS = [planned.number for planned in PLAN]
FAR = 1.0
"""Position of a ball that has fallen off the board [m]."""


def config_of(block: Planned, *settings: str) -> Config:
    text = f"[block]\nnumber = {block.number}\nblocks = {len(PLAN)}\ntrials = {block.trials}\n"
    return parse(text, "test", ("session.dyad=D03", "session.consent=true", *settings))


class BlockRun:
    """A running block: what a session does with its stage and its attempts."""

    def __init__(self, attempts: Attempts, block: Planned, tick: int = 0, *settings: str) -> None:
        self.attempts, self.tick = attempts, tick
        self.config = config_of(block, *settings)
        self.stage = make_stage(self.config)
        self.state = self.stage.initial(**attempts.start_of(block.number))
        self.rows = np.zeros(64, TICK)
        self.decisions: list[tuple[str, dict[str, str]]] = []
        attempts.begin(self.config, tick)

    @property
    def now(self) -> Any:
        return self.state[0]

    @property
    def phase(self) -> Phase:
        return Phase(int(self.now["phase"]))

    def step(self, command: Cause = Cause.NONE, late_ns: int = 0) -> None:
        """Run one tick."""
        place = self.tick % len(self.rows)
        self.rows[place] = np.zeros((), TICK)
        row = self.rows[place]
        row["tick"], row["time_ns"], row["late_ns"] = self.tick, self.tick * TICK_NS, late_ns
        row["command"] = command or self.attempts.take_wanted(self.phase)
        self.stage.advance(self.state, self.rows, self.tick)
        cause = Cause(int(row["event"]))
        if cause:
            self.decisions += self.attempts.record_decision(self.rows, self.tick, self.now)
        self.tick += 1
        if self.tick % 10 == 0:
            self.attempts.poll(self.rows, self.tick)

    def until(self, *phases: Phase, late_ns: int = 0) -> None:
        """Run until a phase, with a level board and the ball in the target."""
        while self.phase not in phases:
            if self.phase in (Phase.LEVELLING, Phase.HOLDING):
                self.now["counted"] = 10**6
            if self.phase in (Phase.RUNNING, Phase.HOLDING):
                self.now["p"] = self.now["target"] * self.config.geometry.target_distance
            self.step(late_ns=late_ns)

    def succeed(self, late_ns: int = 0) -> None:
        self.until(Phase.RUNNING)
        self.until(Phase.LEVELLING, Phase.FINISHED, late_ns=late_ns)

    def fail(self) -> None:
        self.until(Phase.RUNNING)
        self.now["p"] = FAR
        self.step()
        self.step()

    def pause(self) -> None:
        self.step(Cause.PAUSE)

    def request(self, command: str, argument: str = "") -> None:
        """Request or veto a repeat, as an operator."""
        self.attempts.ask(command, argument, int(self.now["trial"]), self.phase)
        self.step(Cause.REPEAT if command == "repeat" else Cause.VETO)


def open_attempts(path: Path) -> Attempts:
    attempts = Attempts(lambda config: Journal.create(path, HEADER))
    attempts.open(config_of(PLAN[0]), "run 1")
    return attempts


def entries_of(path: Path) -> list[Entry]:
    return list(read_lines(path.read_bytes(), str(path)).entries)


def progress_in(path: Path) -> SessionProgress:
    return progress_of(HEADER, entries_of(path), PLAN, str(path))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "D03_S01.journal.jsonl"


def outcomes(attempts: Attempts) -> list[tuple[int, int, int, str]]:
    return [row[:4] for row in attempts.outcomes(0).attempts]


def test_outcome_of_every_attempt_is_journaled(path: Path) -> None:
    attempts = open_attempts(path)
    block_run = BlockRun(attempts, PLAN[2])
    block_run.step(Cause.START)
    block_run.fail()
    block_run.succeed()
    block_run.step(Cause.ABORT)
    block_run.pause()
    block_run.step(Cause.RESUME)
    block_run.step(Cause.SKIP)
    block_run.until(Phase.RUNNING)
    block_run.step(Cause.FAULT)
    block_run.step(Cause.SKIP)
    block_run.step(Cause.RESUME)
    block_run.succeed()
    assert block_run.phase == Phase.FINISHED
    expected = [
        *((3, 1, 1, "fell"), (3, 1, 2, "success")),
        *((3, 2, 1, "aborted"), (3, 2, 2, "paused"), (3, 2, 3, "skipped")),
        *((3, 3, 1, "paused"), (3, 3, 1, "skipped")),
        (3, 4, 1, "success"),
    ]
    assert outcomes(attempts) == expected
    assert [(details["trial"], details["outcome"]) for _, details in block_run.decisions] == [
        (str(row[1]), row[3]) for row in expected
    ]
    assert len(attempts.completions) == 2
    assert attempts.best == min(attempts.completions)
    attempts.close()
    entries = entries_of(path)
    assert isinstance(entries[0], Opened)
    assert entries[0].form["dyad"] == "D03"
    assert entries[-2:] == [BlockEnded(3, "finished"), Ended("the session was ended")]
    begun = [(entry.trial, entry.attempt) for entry in entries if isinstance(entry, AttemptBegan)]
    assert begun == [(1, 1), (1, 2), (2, 1), (2, 2), (2, 3), (3, 1), (4, 1)]


@pytest.mark.parametrize("paused", [False, True])
def test_last_trial_can_be_skipped(path: Path, paused: bool) -> None:
    attempts = open_attempts(path)
    block_run = BlockRun(attempts, PLAN[1])
    block_run.step(Cause.START)
    if paused:
        block_run.pause()
    block_run.step(Cause.SKIP)
    assert block_run.phase == Phase.FINISHED
    assert outcomes(attempts)[-1] == (2, 1, 1, "skipped")
    attempts.close()
    assert entries_of(path)[-2] == BlockEnded(2, "finished")


def test_stopped_block_is_not_done_but_given_up_block_is(path: Path) -> None:
    attempts = open_attempts(path)
    block_run = BlockRun(attempts, PLAN[0])
    block_run.step(Cause.START)
    block_run.succeed()
    block_run.step(Cause.STOP)
    assert outcomes(attempts)[-1] == (1, 2, 1, "aborted")
    attempts.give_up()
    BlockRun(attempts, PLAN[1], block_run.tick).step(Cause.START)
    attempts.close()
    progress = progress_in(path)
    assert (progress.done, progress.block, progress.begun) == ((1,), 2, True)
    ends = [entry for entry in entries_of(path) if isinstance(entry, BlockEnded)]
    assert ends == [BlockEnded(1, "stopped"), BlockEnded(1, "given_up")]


def test_flagged_trial_is_repeated_at_the_end_of_the_block(path: Path) -> None:
    attempts = open_attempts(path)
    block_run = BlockRun(
        attempts, PLAN[0], 0, "quality.repeat=flagged", "quality.late_ticks=0", "quality.start_tilt_deg=80"
    )
    block_run.step(Cause.START)
    block_run.succeed()
    flags = [row[5] for row in attempts.finished]
    block_run.succeed(late_ns=10**6)
    assert "late_ticks" in attempts.finished[-1].flags.split(",")
    assert "late_ticks" not in flags[0]
    extra = int(block_run.now["extra"])
    assert extra == len([row for row in attempts.finished if row[5]])
    while block_run.phase != Phase.FINISHED:
        block_run.succeed()
    repeats = [row[6] for row in attempts.finished if row[6]]
    assert repeats == [row[1] for row in attempts.finished[:3] if row[5]]
    attempts.close()
    progress = progress_in(path)
    assert 1 in progress.done


def test_operator_may_request_and_veto_repeats(path: Path) -> None:
    attempts = open_attempts(path)
    block_run = BlockRun(attempts, PLAN[0])
    with pytest.raises(NetboardError, match="no trial is done"):
        block_run.request("repeat")
    block_run.step(Cause.START)
    block_run.succeed()
    block_run.succeed()
    block_run.request("repeat")
    block_run.request("repeat", "1")
    with pytest.raises(NetboardError, match="is already to be repeated"):
        block_run.request("repeat", "2")
    for argument in ("x", "\u00b2", "9" * 5000):
        with pytest.raises(NetboardError, match=f'found "{argument}", expected the number of a trial'):
            block_run.request("veto", argument)
    assert block_run.now["extra"] == 2
    block_run.request("veto")
    assert block_run.now["extra"] == 1
    block_run.succeed()
    block_run.succeed()
    assert block_run.phase == Phase.FINISHED
    assert attempts.finished[-1][1:4:2] == (4, "success")
    assert attempts.finished[-1].repeats == 2
    attempts.close()


def test_session_without_a_journal_keeps_its_outcomes() -> None:
    attempts = Attempts()
    attempts.open(config_of(PLAN[1]), "run")
    block_run = BlockRun(attempts, PLAN[1])
    block_run.step(Cause.START)
    block_run.succeed()
    attempts.note("all well", block_run.tick)
    assert outcomes(attempts) == [(2, 1, 1, "success")]
    assert (attempts.trouble, attempts.opened, attempts.start_of(2)) == ("", False, {})
    assert attempts.counts("left") == attempts.counts("right")
    attempts.close()


def test_existing_session_is_not_started_again(path: Path) -> None:
    open_attempts(path).close()
    with pytest.raises(NetboardError, match="this session was started before"):
        open_attempts(path)


def test_missing_samples_are_counted_and_frames_accepted(path: Path) -> None:
    attempts = open_attempts(path)
    assert attempts.counts("left") == (0, 0)
    attempts.painted(FrameRecord(0, "left", 0, 0, 0, 0))
    block_run = BlockRun(attempts, PLAN[0])
    block_run.step(Cause.START)
    block_run.until(Phase.RUNNING)
    for _ in range(20):
        block_run.now["p"] = 0.0
        block_run.step()
        attempts.painted(FrameRecord(0, "left", block_run.tick, 0, 0, 0))
    attempts.poll(block_run.rows, block_run.tick)
    assert attempts.counts("left") == attempts.counts("right") == (20, 0)
    attempts.close()


def test_outcomes_are_paged() -> None:
    attempts = Attempts()
    attempts.finished += [(1, k, 1, "success", 1.0, "", 0) for k in range(450)]
    received = []
    while len(received) < len(attempts.finished):
        page = attempts.outcomes(len(received))
        assert page.first == len(received)
        assert 0 < len(page.attempts) <= 200
        received += page.attempts
    assert received == attempts.finished
    assert attempts.outcomes(10**9).attempts == ()
    assert attempts.outcomes(-5).first == 0


# --- killed and resumed at random -----------------------------------------------------------------------------------


def resume_attempts(path: Path, run: int) -> Attempts:
    journal, header, entries, torn = Journal.reopen(path)
    assert (header, torn) == (HEADER, b"")
    attempts = Attempts(journal=journal, progress=progress_of(HEADER, entries, PLAN, str(path)))
    attempts.open(config_of(PLAN[0]), f"run {run}")
    return attempts


def try_request(block_run: BlockRun, chance: random.Random, command: str) -> None:
    trial = str(chance.randint(1, 5))
    if Cause.REPEAT in TABLE[block_run.phase]:
        try:
            block_run.request(command, trial)
        except NetboardError:
            return


ACTIONS: tuple[Callable[[BlockRun, random.Random], object], ...] = (
    lambda run, chance: run.step(),
    lambda run, chance: run.succeed(chance.choice((0, 10**6))) if run.phase == Phase.LEVELLING else run.step(),
    lambda run, chance: run.succeed() if run.phase == Phase.LEVELLING else run.step(Cause.RESUME),
    lambda run, chance: run.fail() if run.phase == Phase.LEVELLING else run.step(Cause.RESUME),
    lambda run, chance: run.until(Phase.RUNNING) if run.phase == Phase.LEVELLING else run.step(Cause.START),
    lambda run, chance: run.step(chance.choice((Cause.ABORT, Cause.SKIP, Cause.PAUSE, Cause.FAULT))),
    lambda run, chance: try_request(run, chance, "repeat"),
    lambda run, chance: try_request(run, chance, "veto"),
    lambda run, chance: run.attempts.note("ä note", run.tick),
)


def require_journal_matches_state(path: Path, block_run: BlockRun) -> None:
    """Check that the journal of a running block agrees with its state."""
    progress, now = progress_in(path), block_run.now
    journaled = (progress.block, progress.trial, progress.successes, progress.failures, progress.extra)
    extra = int(now["extra"]) + block_run.attempts.wanted
    assert journaled == (
        block_run.config.block.number,
        now["trial"],
        now["successes"],
        now["failures"],
        extra,
    )
    assert list(progress.completions) == pytest.approx(block_run.attempts.completions)
    under_way = [*block_run.attempts.finished]
    if block_run.phase in (Phase.LEVELLING, Phase.RUNNING, Phase.HOLDING):
        assert progress.under_way == (journaled[0], now["trial"], now["attempt"])
        under_way.append(AttemptOutcome(*progress.under_way, "incomplete", float("nan"), "", 0))
    assert repr(list(progress.outcomes)) == repr(under_way)


@pytest.mark.parametrize("seed", range(20))
def test_killed_session_resumes_at_any_point(path: Path, seed: int) -> None:
    chance = random.Random(seed)
    attempts, run, tick = open_attempts(path), 1, 0
    settings = ("quality.repeat=flagged", "quality.late_ticks=0", "quality.start_tilt_deg=80")
    while (progress := attempts._progress) is None or not progress.complete:
        number = progress.block if progress is not None else NUMBERS[0]
        for planned in PLAN[number - 1 :]:
            block_run = BlockRun(attempts, planned, tick, *settings)
            steps_left = chance.randint(5, 60)
            while block_run.phase != Phase.FINISHED and steps_left:
                chance.choice(ACTIONS)(block_run, chance)
                steps_left -= 1
            if not steps_left and block_run.phase != Phase.FINISHED:
                break
            tick = block_run.tick
        attempts._journal.close()  # type: ignore[union-attr]
        if block_run.phase != Phase.FINISHED:
            require_journal_matches_state(path, block_run)
        check(entries_of(path), progress_in(path))
        run += 1
        attempts = resume_attempts(path, run)
        assert attempts.opened
    attempts.close()
    entries = entries_of(path)
    assert [entry.run for entry in entries if isinstance(entry, Opened | Resumed)] == [
        f"run {k}" for k in range(1, run + 1)
    ]
    check(entries, progress_in(path))
    assert all(isinstance(entry, Note | Ended | Resumed) for entry in entries[-2:])
