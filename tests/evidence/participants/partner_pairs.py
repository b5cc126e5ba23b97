"""``make evidence ARGS=partner-pairs``: each two robots, and a robot beside a hand that is held still.

Robots have no noise, so a few trials are enough, and nothing has a confidence interval. Haptic feedback is on. The
measures are those of ``make evidence ARGS=partners``.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations_with_replacement
from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory

from evidence.participants.partner_figures import draw_pairs
from evidence.participants.partners import (
    OWN,
    PERSON,
    PLAYBACK,
    SEED,
    STILL,
    Blocks,
    chosen,
    kinds,
    performed,
    recorded_hand,
    shown,
)
from netboard.analysis.topics.measures import Levels, Measure, levels_of
from netboard.base.config import parse
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.nodes.rehearsal.jobs import RehearsalJob, jobs_of

TRIALS = 4
"""Successful trials in each block [1]."""

QUICK_KINDS = (STILL, "leader")
"""Kinds of the quick form."""


def jobs_of_robots(names: Sequence[str], recorded: Path) -> list[RehearsalJob]:
    """Return a block of each two robots; the two are the dyad."""
    jobs = []
    for left, right in combinations_with_replacement(names, 2):
        files = [
            f"partners.{side}.file={recorded}" for side, one in (("left", left), ("right", right)) if one == PLAYBACK
        ]
        pair = (f"block.left={left}", f"block.right={right}", f"session.dyad={left}-{right}", *files)
        if left != STILL or right not in (STILL, PLAYBACK):
            config = parse("", overrides=(*pair, f"block.trials={TRIALS}"))
            jobs += jobs_of([config], SEED, 1, None)
    return jobs


def matrix_part(times: Mapping[frozenset[str], str], names: Sequence[str]) -> ResultPart:
    """Tabulate completion times of each kind beside each other."""
    part = ResultPart("matrix", "Mean completion time of each two kinds [s]", ("", *map(shown, names)))
    for one in names:
        part.add(shown(one), *(times.get(frozenset((one, other)), "-") for other in names))
    return part


def pairs_part(robots: Blocks) -> ResultPart:
    """Tabulate the measures of each two robots."""
    names = [one for one in chosen() if one not in OWN]
    part = ResultPart(
        "pairs",
        f"Measures of each two kinds: means of {TRIALS} trials, which differ little",
        ("left", "right", "given up", *(f"{one.name} [{one.unit}]" for one in names)),
        on_screen=False,
    )
    every = levels_of(robots.study, names)
    for dyad in dict.fromkeys(robots.study.blocks["dyad"]):
        left, right = dyad.split("-")
        part.add(left, right, dyad in robots.given_up, *(_value_of(every, measure, dyad) for measure in names))
    return part


def _value_of(every: Sequence[Levels], measure: Measure, dyad: str) -> float:
    """Return the level of a dyad in its only condition; NaN if it has none."""
    own = [one.values[one.dyads.index(dyad)] for one in every if one.measure == measure and dyad in one.dyads]
    return float(own[0]) if own else nan


def times_of(pairs: ResultPart) -> dict[frozenset[str], str]:
    """Return the mean completion time of each two kinds, in words; a block that was given up has none."""
    return {
        frozenset((str(left), str(right))): "given up" if given_up else f"{completion:.2f}"
        for left, right, given_up, completion, *_ in pairs.rows
    }


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run each two robots."""
    names = QUICK_KINDS if quick else tuple(one for one in kinds() if one != PERSON)
    with TemporaryDirectory() as recordings:
        recorded = recorded_hand(Path(recordings)) if PLAYBACK in names else Path()
        pairs = pairs_part(performed(jobs_of_robots(names, recorded), tell, "pairs"))
    times = times_of(pairs)
    yield matrix_part(times, names)
    yield pairs
    folder.save("partner-pairs", lambda: draw_pairs(times, names))
