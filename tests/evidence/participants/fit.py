"""Fit of the model's free parameters to one condition of the paper: one person with both hands, haptic feedback off.

    python -m evidence.participants.fit

The targets are completion times (mean and standard deviation) and velocity peaks of the first and last 30 trials, and
a delay between the hands of about 40 ms. The paper prints the first two with both haptic conditions pooled. Seeds are
fixed, so the loss is a function of the parameters alone; it is still rough, because a small change of a parameter
changes each single trial. The optimiser is therefore Nelder and Mead's, on logarithms. The values found are the
defaults of ``[participant]``, rounded; nothing else was fitted.
"""

import sys
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from evidence.participants.paper import ENDS, QUANTITIES, printed
from evidence.participants.trials import PAPER_TRIALS, Performance, Population, perform
from netboard.analysis.topics.delay import OVER_ALL
from netboard.base.tables.simulated import Participant
from netboard.benchmarks.harness.processes import fresh_processes
from netboard.nodes.rehearsal.jobs import RehearsalJob

DYADS = 4
"""Number of simulated dyads [1]."""

EVALUATIONS = 16
"""Largest number of evaluations of the loss [1]."""

_ENDS = [printed(quantity, f"bimanual, {which} {{ends}}") for quantity in QUANTITIES.values() for which in ENDS]

TARGETS = (
    *(number for times in _ENDS[:2] for number in (times.reported, times.reported_sd)),
    *(peaks.reported for peaks in _ENDS[2:]),
    printed(f"delay, {OVER_ALL}", "bimanual").reported,
)
"""Values of the paper to which the model is fitted.

Mean and standard deviation of the completion times, and then mean number of peaks, each of the first and of the last
30 trials; and the mean delay over the portions of the peak [s, 1, s].
"""

START = Participant(
    novice=1.5,
    position_noise=0.003,
    velocity_noise=0.010,
    tilt_noise_deg=0.25,
    threshold_deg=0.93,
    refractory=0.296,
    movement_time=0.313,
    bimanual_async=0.045,
)
"""Initial parameters of the fit."""

FREE: dict[str, tuple[str, ...]] = {
    "novice": ("novice",),
    "noise": ("position_noise", "velocity_noise", "tilt_noise_deg"),
    "threshold": ("threshold_deg",),
    "pace": ("refractory", "movement_time"),
    "asynchrony": ("bimanual_async",),
}
"""Free parameters, each a factor on some keys of ``[participant]``."""


def scaled(factors: Sequence[float], start: Participant) -> Participant:
    """Return a participant with the free parameters multiplied, and `novice` at least 1."""
    keys = {key: getattr(start, key) * f for f, keys in zip(factors, FREE.values(), strict=True) for key in keys}
    return replace(start, **(keys | {"novice": max(1.0, keys["novice"])}))


def ends_of(population: Population, dyad: int) -> list[RehearsalJob]:
    """Return the first and the last 30 trials of both participants alone with haptic feedback off.

    The last 30 trials are the second half of the last block, so as many trials of it count as practice.
    """
    half = PAPER_TRIALS // 2
    jobs = []
    for performer in ("A", "B"):
        blocks = [job for job in population.bimanual_jobs(dyad) if job.config.block.performer == performer]
        for job, before in ((blocks[0], 0), (blocks[-1], half)):
            person = job.people[performer]
            practised = replace(person, practice=float(person.practice) + before)
            block = replace(job.config.block, trials=half)
            jobs.append(replace(job, config=replace(job.config, block=block), people={performer: practised}))
    return jobs


def results(performances: Sequence[Performance]) -> NDArray[np.float64]:
    """Return the quantities of `TARGETS` for some dyads."""
    rows = np.concatenate([one.attempts for one in performances])
    rows = rows[rows["success"]]
    early = np.concatenate([_early(one) for one in performances])
    values: list[float] = []
    first, last = rows[early], rows[~early]
    for trials in (first, last):
        values += [trials["completion"].mean(), trials["completion"].std(ddof=1)]
    values += [first["peaks"].mean(), last["peaks"].mean()]
    return np.array([*values, (rows["delay"].sum(axis=0) / rows["delays"].sum(axis=0)).mean()])


def _early(performance: Performance) -> NDArray[np.bool_]:
    """Return which successful trials of a dyad are in the first block of their performer."""
    rows = performance.attempts[performance.attempts["success"]]
    first = {who: rows["block"][rows["performer"] == who].min() for who in ("A", "B")}
    return np.array([block == first[who] for block, who in zip(rows["block"], rows["performer"], strict=True)])


def loss(log_factors: NDArray[np.float64], start: Participant, pool: Executor) -> float:
    """Return the sum of squared logarithmic errors of the quantities in `TARGETS`."""
    population = Population(scaled(np.exp(log_factors).tolist(), start))
    dyads = range(1, DYADS + 1)
    found = results(list(pool.map(perform, [ends_of(population, dyad) for dyad in dyads], dyads)))
    error = float(np.sum(np.log(found / TARGETS) ** 2))
    factors = " ".join(f"{name} {factor:.3f}" for name, factor in zip(FREE, np.exp(log_factors), strict=True))
    sys.stdout.write(f"{error:.4f}  {factors}  {np.round(found, 3).tolist()}\n")
    sys.stdout.flush()
    return error


def fit(start: Participant, workers: int, evaluations: int) -> Participant:
    """Return the participant with the smallest loss that was found."""
    simplex = np.vstack([np.zeros(len(FREE)), 0.25 * np.eye(len(FREE))])
    options = {"maxfev": evaluations, "initial_simplex": simplex, "xatol": 0.02, "fatol": 0.002}
    with fresh_processes(workers) as pool:
        found = minimize(loss, simplex[0], (start, pool), method="Nelder-Mead", options=options)
    return scaled(np.exp(found.x).tolist(), start)


if __name__ == "__main__":
    sys.stdout.write(f"{fit(START, workers=2, evaluations=EVALUATIONS)}\n")
