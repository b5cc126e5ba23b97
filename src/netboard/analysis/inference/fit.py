"""The fit of simulated participants to the paper's bimanual results with haptic feedback off, and its checks.

Three sets of designs are drawn from the prior and simulated. The first, all with the same random numbers, gives the
emulator; the second, each with its own, the covariance of virtual studies around it; the third, each with its own
again, are the truths that the fit has to recover. The posterior's own draws are simulated at last, as a check.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.cohort.virtual import SPACING, compile_kernels
from netboard.analysis.cohort.workers import Runner
from netboard.analysis.inference.emulator import Emulator, fitted
from netboard.analysis.inference.priors import NAMES, drawn_scores, participant_at
from netboard.analysis.inference.sampling import WALKERS_PER_PARAMETER, Chains, Likelihood, sampled
from netboard.analysis.inference.summaries import DYADS, SUMMARIES, ends_of, observed, simulated, tolerance
from netboard.base.config import Config
from netboard.base.errors import NetboardError

Array = NDArray[np.float64]

DESIGN_DYADS = 1
"""Dyads of a virtual study to which the emulator is fitted; all others have as many as the paper's [1]."""

LEVELS = (0.5, 0.8, 0.95)
"""Levels of the credible intervals whose coverage is checked [1]."""

KEPT = 400
"""Draws of the posterior that are kept [1]."""


@dataclass(frozen=True, slots=True)
class FitRequest:
    """Size of a fit.

    - `designs`, `calibrations`, `truths`: parameter sets for the emulator, for the covariance, and to recover [1].
    - `predictions`: draws of the posterior that are simulated [1].
    """

    config: Config
    seed: int
    designs: int
    calibrations: int
    truths: int
    predictions: int


class VirtualStudy(NamedTuple):
    """Random numbers and size of a virtual study."""

    seed: int
    dyads: int


@dataclass(frozen=True, slots=True)
class Simulated:
    """Simulated parameter sets, without those whose participants cannot do the task.

    - `scores` (shape (n, k)), `summaries` (shape (n, m)): parameters and results [1].
    - `given_up`: how many were left out [1].
    """

    scores: Array
    summaries: Array
    given_up: int

    @classmethod
    def of(cls, scores: Array, summaries: Array) -> "Simulated":
        """Leave out sets without results."""
        known = np.isfinite(summaries).all(axis=1)
        return cls(scores[known], summaries[known], int((~known).sum()))


@dataclass(frozen=True, slots=True)
class Recovery:
    """Posteriors of simulated truths.

    - `truths`, `means`, `deviations` (shape (n, k)): true scores, and mean and standard deviation of the posterior [1].
    - `covered` (shape (levels, n, k)): whether the central interval of each of `LEVELS` has the truth.
    """

    truths: Array
    means: Array
    deviations: Array
    covered: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Fit:
    """A fit, with all that its checks need.

    - `covariance`: that of the summaries of virtual studies around the emulator [1].
    - `kept` (shape (n, k)): independent draws of the posterior [1].
    - `predicted`: simulations of some of them, with random numbers of their own.
    """

    request: FitRequest
    designs: Simulated
    emulator: Emulator
    offset: Array
    covariance: Array
    chains: Chains
    kept: Array
    predicted: Simulated
    recovery: Recovery


def fit(request: FitRequest, runner: Runner) -> Fit:
    """Fit the participants, and check the fit."""
    rng = np.random.default_rng(request.seed)
    sizes = (request.designs, request.calibrations, request.truths)
    scores = drawn_scores(rng, sum(sizes))
    first = request.seed * SPACING
    common = [VirtualStudy(first, DESIGN_DYADS)] * request.designs
    others = [VirtualStudy(first + place, DYADS) for place in range(request.designs, len(scores))]
    results = _simulated(request.config, scores, [*common, *others], "parameter sets", runner)
    cuts = np.cumsum(sizes)[:-1]
    designs, calibrations, truths = (
        Simulated.of(*both) for both in zip(np.split(scores, cuts), np.split(results, cuts), strict=True)
    )
    emulator = _emulator(designs, calibrations)
    apart = calibrations.summaries - emulator(calibrations.scores)
    offset, covariance = apart.mean(axis=0), np.cov(apart, rowvar=False)
    people = Likelihood(emulator, offset, _inverse(covariance + tolerance()), observed())
    chains = _posterior(people, request.seed)
    kept = chains.draws(KEPT, rng)
    checked = kept[: request.predictions]
    studies = [VirtualStudy(first + len(scores) + place, DYADS) for place in range(len(checked))]
    predicted = _simulated(request.config, checked, studies, "draws of the posterior", runner)
    virtual = replace(people, precision=_inverse(covariance))
    recovery = _recovered(virtual, truths, request.seed, runner)
    return Fit(
        request,
        designs,
        emulator,
        offset,
        covariance,
        chains,
        kept,
        Simulated.of(checked, predicted),
        recovery,
    )


def _emulator(designs: Simulated, calibrations: Simulated) -> Emulator:
    """Fit the emulator, if enough participants can do the task."""
    least = 4 * len(NAMES)
    for what, found in (("--designs", designs), ("--calibrations", calibrations)):
        if len(found.scores) < least:
            raise NetboardError(
                f"{what}: participants of {found.given_up} parameter sets cannot do the task, and {len(found.scores)} "
                f"sets are left; expected at least {least}: ask for more"
            )
    return fitted(designs.scores, designs.summaries)


def _simulated(config: Config, scores: Array, studies: Sequence[VirtualStudy], what: str, runner: Runner) -> Array:
    """Simulate a virtual study of each parameter set."""
    runner.progress("compiling (only once)", 0, len(scores))
    compile_kernels([job for _, job in ends_of(config, studies[0].seed, 1)][:1])
    results = np.empty((len(scores), len(SUMMARIES)))
    task = partial(_simulate, config, scores, studies)
    for done, (number, found) in enumerate(runner.run_all(task, range(len(scores))), start=1):
        results[number] = found
        runner.progress(f"{done} of {len(scores)} {what}", done, len(scores))
    return results


def _simulate(config: Config, scores: Array, studies: Sequence[VirtualStudy], number: int) -> Array:
    participant, study = participant_at(scores[number], config.participant), studies[number]
    return simulated(replace(config, participant=participant), study.seed, study.dyads)


def _inverse(covariance: Array) -> Array:
    return np.asarray(np.linalg.inv(covariance), np.float64)


def _posterior(likelihood: Likelihood, seed: int) -> Chains:
    """Sample the posterior of the scores."""
    start = drawn_scores(np.random.default_rng(seed), WALKERS_PER_PARAMETER * len(NAMES))
    return sampled(likelihood, start, seed)


def _recovered(likelihood: Likelihood, truths: Simulated, seed: int, runner: Runner) -> Recovery:
    """Fit virtual studies whose participants are known."""
    count = len(truths.scores)
    means, deviations = np.empty(truths.scores.shape), np.empty(truths.scores.shape)
    covered = np.empty((len(LEVELS), *truths.scores.shape), bool)
    task = partial(_recover, likelihood, truths, seed)
    for done, (number, found) in enumerate(runner.run_all(task, range(count)), start=1):
        means[number], deviations[number], covered[:, number] = found
        runner.progress(f"{done} of {count} truths recovered", done, count)
    return Recovery(truths.scores, means, deviations, covered)


def _recover(
    likelihood: Likelihood, truths: Simulated, seed: int, number: int
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return mean and standard deviation of the posterior of a virtual study, and which intervals have the truth."""
    own = replace(likelihood, summaries=truths.summaries[number])
    found, truth = _posterior(own, seed + 1 + number).scores, truths.scores[number]
    covered = [_covers(found, truth, level) for level in LEVELS]
    return found.mean(axis=0), found.std(axis=0), np.array(covered)


def _covers(samples: Array, truth: Array, level: float) -> NDArray[np.bool_]:
    """Return for each parameter whether its central credible interval has the truth."""
    low, high = np.quantile(samples, ((1.0 - level) / 2.0, (1.0 + level) / 2.0), axis=0)
    return np.asarray((low <= truth) & (truth <= high))
