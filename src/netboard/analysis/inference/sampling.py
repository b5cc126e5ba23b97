"""The posterior of the scores: a synthetic likelihood, and Markov chains of emcee that sample it.

The likelihood is that of Wood (2010): summaries are normal around the emulator, with the covariance of virtual studies
around it. This covariance comes from simulations with other random numbers than the emulator's, so that it holds both
the scatter of studies of this size and the error of the emulator.
"""

from dataclasses import dataclass

import emcee
import numpy as np
from numpy.typing import NDArray

from netboard.analysis.inference.emulator import Emulator
from netboard.analysis.inference.priors import FARTHEST

Array = NDArray[np.float64]

WALKERS_PER_PARAMETER = 4
STEPS = 2500
"""Steps of each walker [1]."""

SETTLED = 0.25
"""Share of the steps that is discarded, because the walkers have not settled [1]."""


@dataclass(frozen=True, slots=True)
class Likelihood:
    """Synthetic likelihood of summaries.

    - `offset` (shape (m,)): mean of the summaries with other random numbers, minus the emulator's [1].
    - `precision` (shape (m, m)): inverse of the covariance of summaries [1].
    """

    emulator: Emulator
    offset: Array
    precision: Array
    summaries: Array

    def __call__(self, scores: Array) -> Array:
        """Return the logarithm of the posterior's density at scores, shape (n,), but for a constant."""
        apart = self.emulator(scores) + self.offset - self.summaries
        density = -0.5 * (np.einsum("ni,ij,nj->n", apart, self.precision, apart) + (scores**2).sum(axis=1))
        return np.where((np.abs(scores) <= FARTHEST).all(axis=1), density, -np.inf)


@dataclass(frozen=True, slots=True)
class Chains:
    """Samples of a posterior.

    - `scores` (shape (n, k)): samples, autocorrelated [1].
    - `steps_apart`: largest autocorrelation time of a parameter [steps].
    """

    scores: Array
    steps_apart: float

    def draws(self, count: int, rng: np.random.Generator) -> Array:
        """Return distinct samples in random order."""
        return self.scores[rng.choice(len(self.scores), count, replace=False)]


def sampled(density: Likelihood, start: Array, seed: int, steps: int = STEPS) -> Chains:
    """Sample a posterior.

    - `start` (shape (walkers, k)): where the walkers start, within the prior [1].
    """
    moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]
    sampler = emcee.EnsembleSampler(*start.shape, density, moves=moves, vectorize=True)
    sampler.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(start, steps)
    discarded = round(SETTLED * steps)
    apart = float(np.max(sampler.get_autocorr_time(discard=discarded, tol=0)))
    return Chains(sampler.get_chain(discard=discarded, flat=True), apart)
