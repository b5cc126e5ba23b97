"""A block that loses too many trials offers to repeat them, before the next block and before the session ends."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from stepped_session import SteppedSession

from netboard.base.tick import LATE_NS
from netboard.network.transport import sockets
from netboard.nodes.server.block_changes import PAGE_TICKS
from netboard.stage.curtain import Pause
from netboard.task.journal.entries import AttemptEnded, BlockEnded, Repeat, read_lines
from netboard.task.journal.progress import progress_of
from netboard.task.trials.state_machine import Phase

ONLY_LATE = ('quality.exclude=["late_ticks"]', "quality.late_ticks=0", "quality.excluded_share=0.4")
LOST = "2 of 2 trials will be excluded: deadline misses"


@pytest.fixture
def losing(tmp_path: Path, context: sockets.Context) -> Iterator[SteppedSession]:
    """A session that may lose two of five trials; every tick after `lose` is a deadline miss."""
    made = SteppedSession(tmp_path, context, *ONLY_LATE)
    yield made
    made.close()


def lose(stepped: SteppedSession) -> None:
    """Succeed in a trial whose ticks are all late."""
    stepped.until(Phase.RUNNING)
    stepped.late_ns = 2 * LATE_NS
    stepped.succeed()
    stepped.tick()
    stepped.late_ns = 0


def lose_block(stepped: SteppedSession) -> None:
    stepped.start()
    while stepped.phase != Phase.FINISHED:
        lose(stepped)


def test_block_that_lost_its_trials_waits_and_repeats_them_on_request(losing: SteppedSession) -> None:
    lose_block(losing)
    status = losing.session._answers.status()
    assert (status.lost, status.notice) == ((1, 2), LOST)
    losing.tick(2 * PAGE_TICKS)
    assert (losing.block, losing.phase) == (1, Phase.FINISHED)
    assert losing.state.view_notice == Pause.DECISION
    assert losing.do("repeat_lost") == (True, "2 trials are repeated at the end of the block")
    losing.tick(3)
    assert losing.phase == Phase.PAUSED
    status = losing.session._answers.status()
    assert (status.trial, status.trials, status.lost, status.repeats) == (3, 4, (), (2,))
    assert losing.state.view_notice == Pause.REPEATS
    assert losing.do("resume") == (True, "")
    losing.finish_block()
    found = [(one.trial, "late_ticks" in one.flags, one.repeats) for one in losing.state.attempts.finished]
    assert found == [(1, True, 0), (2, True, 0), (3, False, 1), (4, False, 2)]
    losing.tick(PAGE_TICKS + 1)
    assert (losing.block, losing.phase) == (2, Phase.IDLE)


def test_operator_may_go_on_without_the_repeats(losing: SteppedSession) -> None:
    lose_block(losing)
    assert losing.do("next") == (True, "")
    losing.tick(2)
    assert losing.block == 2
    assert losing.session._answers.status().lost == ()


def test_few_lost_trials_do_not_hold_up_the_session(losing: SteppedSession) -> None:
    losing.state.attempts._config = replace(
        losing.state.block.config, quality=replace(losing.state.block.config.quality, excluded_share=0.5)
    )
    losing.start()
    lose(losing)
    losing.finish_block()
    assert losing.session._answers.status().lost == (1,)
    losing.tick(PAGE_TICKS + 1)
    assert losing.block == 2


def test_last_block_offers_the_repeats_and_its_end_says_what_is_lost(losing: SteppedSession) -> None:
    for _ in range(2):
        losing.start()
        losing.finish_block()
        losing.tick(PAGE_TICKS + 1)
    lose_block(losing)
    assert losing.block == 3
    assert not losing.state.operators.armed
    assert losing.do("repeat", "2") == (True, "trial 2 is repeated at the end of the block")
    assert (losing.phase, losing.state.attempts.lost.trials) == (Phase.PAUSED, (1,))
    assert losing.do("resume") == (False, "cannot resume: the devices are not armed (arm)")
    assert losing.do("end") == (True, "1 of 2 trials will be excluded: deadline misses; they are not repeated")


def test_block_that_was_stopped_or_has_no_lost_trial_offers_no_repeat(losing: SteppedSession) -> None:
    losing.start()
    losing.finish_block()
    assert losing.do("repeat_lost") == (False, "there is no lost trial to repeat")
    losing.tick(PAGE_TICKS + 1)
    losing.start()
    lose(losing)
    assert losing.do("stop")[0]
    assert losing.do("repeat_lost") == (False, "no trial can be repeated: the block was stopped")


def test_journal_resumes_in_a_block_that_was_reopened(tmp_path: Path, context: sockets.Context) -> None:
    losing = SteppedSession(tmp_path, context, *ONLY_LATE)
    lose_block(losing)
    losing.do("repeat_lost")
    losing.tick(3)
    losing.do("resume")
    losing.succeed()
    losing.close()
    journal = losing.planned.path
    header, entries, *_ = read_lines(journal.read_bytes(), "journal")
    assert [entry for entry in entries if isinstance(entry, Repeat)] == [Repeat(1, 1), Repeat(1, 2)]
    assert [entry.repeats for entry in entries if isinstance(entry, AttemptEnded)][:3] == [0, 0, 1]
    blocks = [config.block for config in losing.planned.blocks(losing.planned.config.session)]
    progress = progress_of(header, entries, blocks, "journal")
    assert (progress.block, progress.trial, progress.extra, progress.done) == (1, 4, 2, ())
    over = next(place for place, entry in enumerate(entries) if isinstance(entry, BlockEnded))
    assert progress_of(header, entries[: over + 1], blocks, "journal").done == (1,)
