"""The numbers to which participants are fitted: nine results of one person with both hands, haptic feedback off.

They are the means and standard deviations of the completion times and of the numbers of velocity peaks, in the first
and in the last 30 trials, and the delay between the hands. Measures are those of an analysis, with its default
settings. Everything is on a logarithmic scale, on which effects of parameters and errors are nearly additive.

The paper pools both haptic conditions in these numbers, which the fit takes as uncertainty.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.cohort.block import rehearse
from netboard.analysis.cohort.virtual import jobs_of_dyad
from netboard.analysis.extraction.attempts import peaks_of
from netboard.analysis.extraction.details import delays_of
from netboard.analysis.extraction.trials import BlockData
from netboard.analysis.measures.performance import ENDS
from netboard.analysis.topics.delay import OVER_ALL
from netboard.analysis.topics.paper import REPORTED, Reported
from netboard.base.config import Config
from netboard.nodes.rehearsal.jobs import RehearsalJob
from netboard.participants.people.population import LETTERS
from netboard.task.studies.study import paper_study

Array = NDArray[np.float64]

End = Literal["first", "last"]

EACH_END: tuple[End, ...] = ("first", "last")

DYADS = 4
"""Dyads of the paper; both participants of each work alone, too [1]."""

QUANTITIES = {"completion": "completion time", "peaks": "number of velocity peaks"}
"""Measures of a trial, with their names in the analysis."""


@dataclass(frozen=True, slots=True)
class Summary:
    """One number of people.

    - `value`: the number that the paper reports [unit].
    - `tolerance`: standard deviation of the logarithm that its definition leaves open [1].
    """

    name: str
    unit: str
    value: float
    tolerance: float


POOLED = 0.05
"""Tolerance of numbers that pool both haptic conditions: half of an effect of haptic feedback of 10 % [1]."""

ROUNDED = 0.1
"""Tolerance of a delay of "about 40 ms" [1]."""


def reported(quantity: str, group: str) -> Reported:
    """Return what the paper prints about a quantity, in SI units."""
    return next(one for one in REPORTED if (one.quantity, one.group) == (quantity, group))


def _summaries() -> Iterator[Summary]:
    for (measure, quantity), end in product(QUANTITIES.items(), EACH_END):
        found, unit = reported(quantity, f"bimanual, {end} {{ends}}"), "s" if measure == "completion" else "1"
        yield Summary(f"{quantity}, {end} {ENDS}", unit, found.reported, POOLED)
        yield Summary(f"{quantity}, {end} {ENDS}, SD", unit, found.reported_sd, POOLED)
    yield Summary("delay between the hands", "s", reported(f"delay, {OVER_ALL}", "bimanual").reported, ROUNDED)


SUMMARIES = tuple(_summaries())
"""The numbers, in the order of every array of them."""


def ends_of(config: Config, seed: int, dyad: int) -> Iterator[tuple[End, RehearsalJob]]:
    """Yield the first and the last trials of both participants of a dyad, alone with haptic feedback off.

    The last trials are the end of the last block, so that the trials of it before them count as practice.
    """
    blocks = [(job.config.block, job) for job in jobs_of_dyad(config, paper_study(), seed, dyad)]
    for letter in LETTERS:
        own = [job for block, job in blocks if block.configuration == "bimanual" and block.performer == letter]
        off = [job for job in own if not job.config.block.haptics]
        yield "first", _part(off[0], letter, 0)
        yield "last", _part(off[-1], letter, off[-1].config.block.trials - ENDS)


def _part(job: RehearsalJob, letter: str, before: int) -> RehearsalJob:
    """Return some trials of a block, with those before them as practice."""
    person = job.people[letter]
    people = {letter: replace(person, practice=float(person.practice) + before)}
    return replace(job, config=replace(job.config, block=replace(job.config.block, trials=ENDS)), people=people)


def summarised(blocks: Sequence[tuple[End, BlockData]]) -> Array:
    """Return the logarithms of the numbers of some blocks; NaN for those that they do not determine."""
    trials: dict[End, list[tuple[float, float]]] = {end: [] for end in EACH_END}
    delays = []
    for end, block in blocks:
        for take in block.takes():
            if take.source:  # a success
                trials[end].append((take.completion, peaks_of(take, block.readings.peaks.window).count))
                delays.append(delays_of(take)[1].absolute)
    values = []
    for column, end in product(range(len(QUANTITIES)), EACH_END):
        own = np.array(trials[end])[:, column]
        values += [own.mean(), own.std(ddof=1)]
    return np.log([*values, np.nanmean(np.concatenate(delays), axis=0).mean()])


def simulated(config: Config, seed: int, dyads: int) -> Array:
    """Return the logarithms of the numbers of a virtual study; all NaN if a block is given up.

    - `dyads`: dyads of the study, whose participants are simulated alone [1].
    """
    found = []
    for dyad in range(1, dyads + 1):
        for end, job in ends_of(config, seed, dyad):
            rehearsed = rehearse(job)
            if rehearsed.given_up:
                return np.full(len(SUMMARIES), np.nan)
            found.append((end, rehearsed.block))
    return summarised(found)


def observed() -> Array:
    """Return the logarithms of the numbers that the paper reports."""
    return np.log([one.value for one in SUMMARIES])


def tolerance() -> Array:
    """Return the covariance of what the definitions of the paper's numbers leave open [1]."""
    return np.diag([one.tolerance**2 for one in SUMMARIES])
