"""A trained partner in whole blocks beside participants that were held out, by the strict kernel and the real task.

The same participants also play beside each other, so that there is a time to compare with. What a simulated human
shows, and what not, `docs/explanation/robots.md` says.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import Any

from netboard.base.config import SIDES, Config, Side
from netboard.base.tables.rig import Options
from netboard.base.tables.simulated import Participant
from netboard.participants.seat.block import BlockSummary, Rehearsal

LONGEST = 20.0
"""A trial counts as finished if it is completed within this time of the release [s]."""

Tell = Callable[[str, float, float], None]
"""Shows progress: current step, done, total."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Results beside held-out participants, with haptic feedback.

    ``trials``: attempts. ``finished``: share of them completed within `LONGEST` [1]. ``failures``: the ball fell.
    ``seconds``, ``pair_seconds``: mean completion time of the partner's trials, and of pairs of the participants; None
    if no trial was completed [s].
    """

    participants: int
    trials: int
    finished: float
    failures: int
    seconds: float | None
    longest_seconds: float | None
    pair_trials: int
    pair_finished: float
    pair_seconds: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return it as a card has it, rounded."""
        return {name: round(value, 4) if isinstance(value, float) else value for name, value in asdict(self).items()}

    def lines(self) -> tuple[str, ...]:
        """Return it in words."""
        longest = "" if self.longest_seconds is None else f", longest {self.longest_seconds:.2f} s"
        return (
            f"{self.finished:.1%} of {self.trials} trials beside {self.participants} held-out participants were"
            f" finished within {LONGEST:g} s; {self.failures} falls",
            _mean_in_words(self.seconds) + longest,
            f"pairs of the same participants: {self.pair_finished:.1%} of {self.pair_trials} trials,"
            f" {_mean_in_words(self.pair_seconds)}",
        )


def evaluate(weights: Path | str, people: Sequence[Participant], config: Config, trials: int, tell: Tell) -> Evaluation:
    """Play blocks of some trials beside each participant, with the partner at each side.

    ``weights``: a file of weights, or the name of the packaged one.
    """
    total = len(people) * (len(SIDES) + 1)
    own: list[BlockSummary] = []
    pairs: list[BlockSummary] = []
    for summary in beside(weights, people, config, trials):
        own.append(summary)
        tell("evaluation", len(own), total)
    for summary in _pairs(people, config, trials):
        pairs.append(summary)
        tell("evaluation", len(own) + len(pairs), total)
    return evaluation_of(len(people), own, pairs)


def _mean_in_words(seconds: float | None) -> str:
    """Return a mean completion time in words."""
    return "no trial was completed" if seconds is None else f"mean completion time {seconds:.2f} s"


def evaluation_of(participants: int, own: Sequence[BlockSummary], pairs: Sequence[BlockSummary]) -> Evaluation:
    """Return the results of the partner's blocks, and of the blocks of pairs of the same participants."""
    times = [time for block in own for time in block.completions]
    pair_times = [time for block in pairs for time in block.completions]
    return Evaluation(
        participants=participants,
        trials=_attempts(own),
        finished=_finished(own),
        failures=sum(block.failures for block in own),
        seconds=fmean(times) if times else None,
        longest_seconds=max(times, default=None),
        pair_trials=_attempts(pairs),
        pair_finished=_finished(pairs),
        pair_seconds=fmean(pair_times) if pair_times else None,
    )


def beside(weights: Path | str, people: Sequence[Participant], config: Config, trials: int) -> Iterator[BlockSummary]:
    """Play blocks of some trials beside each participant, with the partner at each side."""
    for place, person in enumerate(people):
        for side in SIDES:
            yield _played(seated(config, side, weights, trials, place + 1), person, person)


def _pairs(people: Sequence[Participant], config: Config, trials: int) -> Iterator[BlockSummary]:
    """Play a block of each participant and the next one."""
    for place, person in enumerate(people):
        other = people[(place + 1) % len(people)]
        yield _played(_block(config, "person", "person", trials, place + 1), person, other)


def _block(config: Config, left: str, right: str, trials: int, seed: int) -> Config:
    """Return a block of a dyad, in which a robot may move a hand."""
    block = replace(config.block, configuration="dyadic", left=left, right=right, trials=trials, seed=seed)
    return replace(config, block=block)


def seated(config: Config, side: Side, weights: Path | str, trials: int, seed: int) -> Config:
    """Return a block in which a learned partner has a seat."""
    options: Options = {"weights": str(weights)}
    if side == "left":
        config = replace(config, partners=replace(config.partners, left=options))
        return _block(config, "learned", "person", trials, seed)
    config = replace(config, partners=replace(config.partners, right=options))
    return _block(config, "person", "learned", trials, seed)


def _played(config: Config, one: Participant, other: Participant) -> BlockSummary:
    """Run a block and return its results."""
    rehearsal = Rehearsal(config, {"A": one, "B": other})
    for _ in rehearsal.pieces():
        pass
    return rehearsal.summary()


def _attempts(blocks: Sequence[BlockSummary]) -> int:
    """Return the attempts of some blocks: a block that was given up ends within one."""
    return sum(len(block.completions) + block.failures + block.given_up for block in blocks)


def mean_with_misses(blocks: Sequence[BlockSummary]) -> float:
    """Return the mean completion time of all attempts; one that was not completed in time counts `LONGEST` [s]."""
    times = [min(time, LONGEST) for block in blocks for time in block.completions]
    attempts = _attempts(blocks)
    return (sum(times) + LONGEST * (attempts - len(times))) / attempts


def _finished(blocks: Sequence[BlockSummary]) -> float:
    """Return the share of attempts that were completed in time."""
    done = sum(time <= LONGEST for block in blocks for time in block.completions)
    return done / _attempts(blocks)
