"""A model of a server that only writes a journal, driven by random choices through a session."""

import random
from collections.abc import Iterator
from dataclasses import dataclass

from netboard.base.tables.experiment import Quality
from netboard.task.journal.entries import (
    AttemptBegan,
    AttemptEnded,
    BlockBegan,
    BlockEnded,
    Ended,
    Entry,
    Header,
    Note,
    Opened,
    Repeat,
    Resumed,
    Veto,
)
from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.journal.progress import SessionProgress, progress_of
from netboard.task.trials.repeats import wants_repeat
from netboard.task.trials.state_machine import Outcome

HEADER = Header(
    format=1,
    study="paper",
    study_digest="5f" * 32,
    plan_digest="3a" * 32,
    seed=7,
    dyad="D03",
    name="S01",
    session=1,
    participants=("P05", "P06"),
    pilot=False,
    consent=True,
    netboard="0.1.0",
    config_digest="c0" * 32,
)


@dataclass(frozen=True)
class Planned:
    number: int
    trials: int


PLAN = (Planned(1, 3), Planned(2, 1), Planned(3, 4))

ENDS: tuple[Outcome, ...] = ("success", "success", "success", "fell", "timed_out", "aborted", "paused", "skipped")


class Server:
    """One run of the server, from the progress that a journal records."""

    def __init__(
        self, chance: random.Random, run: str, progress: SessionProgress, rules: Quality, plan: tuple[Planned, ...]
    ) -> None:
        self.chance, self.run, self.rules, self.plan = chance, run, rules, plan
        self.start = progress
        self.tick = 0

    def entries(self) -> Iterator[Entry]:
        """Yield the entries until the session is complete or is ended."""
        yield Resumed(self.run) if self.start.runs else Opened(self.run, {"dyad": "D03", "ü": 'a "b"\n'})
        now = self.start
        for block in self.plan:
            if block.number in self.start.done:
                continue
            if block.number != self.start.block:
                now = progress_of(HEADER, (), [block])
            for entry in self._block(block, now):
                yield entry
                if self.chance.random() < 0.05:
                    yield Note("a näte", self.run, self.tick)
            if self.chance.random() < 0.05:
                break
        yield Ended("the session is over")

    def _block(self, block: Planned, now: SessionProgress) -> Iterator[Entry]:
        trial, attempt, repeats, ticks = now.trial, now.attempt, now.repeats, now.block_ticks
        yield BlockBegan(block.number, trial, attempt, self.run, self.tick)
        while trial <= block.trials + repeats.extra:
            if self.chance.random() < 0.02:
                yield BlockEnded(block.number, "given_up")
                return
            if self.chance.random() < 0.1 and not repeats.why_not_ask(wanted := self.chance.randint(1, 5), trial):
                repeats = repeats.ask(wanted)
                yield Repeat(block.number, wanted)
            if self.chance.random() < 0.1 and (newest := repeats.newest(trial)):
                repeats = repeats.veto(newest)
                yield Veto(block.number, newest)
                continue
            yield AttemptBegan(block.number, trial, attempt, self.run, self.tick)
            self.tick += 1000
            ticks += 1000
            outcome = self.chance.choice(ENDS)
            flags = ("late_ticks", "clipped") if self.chance.random() < 0.2 else ()
            again = wants_repeat(self.rules, outcome, flags, trial, repeats)
            yield AttemptEnded(
                block.number,
                trial,
                attempt,
                outcome,
                self.chance.uniform(0.3, 5.0) if outcome == "success" else None,
                flags,
                repeats.repeated_by(trial),
                again,
                self.run,
                self.tick,
                ticks,
            )
            if again:
                repeats = repeats.ask(trial)
            trial, attempt = (trial + 1, 1) if outcome in ("success", "skipped") else (trial, attempt + 1)
        yield BlockEnded(block.number, "finished")


def entries_of_run(
    chance: random.Random, run: str, so_far: list[Entry], rules: Quality, plan: tuple[Planned, ...] = PLAN
) -> Iterator[Entry]:
    """Return the entries that a server that is started now adds to a journal."""
    return Server(chance, run, progress_of(HEADER, so_far, plan), rules, plan).entries()


def was_skipped_in_a_pause(before: tuple[AttemptOutcome, ...], row: AttemptOutcome) -> bool:
    """Whether a trial was skipped of which no attempt was under way."""
    return row.outcome == "skipped" and (row.attempt == 0 or row[:3] in [other[:3] for other in before])


def check(entries: list[Entry], progress: SessionProgress, plan: tuple[Planned, ...] = PLAN) -> None:
    """Check what must hold wherever a journal ends."""
    begun = [(e.block, e.trial, e.attempt) for e in entries if isinstance(e, AttemptBegan)]
    assert len(set(begun)) == len(begun), "numbers were given twice"
    ended = [e for e in entries if isinstance(e, AttemptEnded)]
    passed = [row for k, row in enumerate(progress.outcomes) if was_skipped_in_a_pause(progress.outcomes[:k], row)]
    recorded = [row[:3] for row in progress.outcomes if row not in passed]
    assert recorded == begun, "an attempt has no outcome, or two"
    assert len(progress.incomplete) == len(begun) - len(ended) + len(passed)
    for block in plan:
        done = [e.trial for e in ended if e.block == block.number and e.outcome in ("success", "skipped")]
        assert done == list(range(1, len(done) + 1)), "trials were left out, or done twice"
        if progress.block == block.number:
            mine = [e for e in ended if e.block == block.number]
            assert progress.trial == len(done) + 1 <= block.trials + progress.extra
            assert progress.successes == sum(e.outcome == "success" for e in mine) == len(progress.completions)
            assert progress.skipped == sum(e.outcome == "skipped" for e in mine)
            assert progress.failures == sum(e.outcome in ("fell", "timed_out") for e in mine)
            used = [place[2] for place in begun if place[:2] == (block.number, progress.trial)]
            assert progress.attempt == max(used, default=0) + 1
            assert progress.block_ticks == (mine[-1].block_ticks if mine else 0)
