"""The parameters that are fitted, each with its prior: what was known or assumed of it before the fit.

Where nothing is published, the median is near the default, which an early search on all results of the paper found.
A parameter is a key of ``[participant]`` that acts in bimanual trials with haptic feedback off. To fit another one,
add a line. All computations use standard scores: a prior is the standard normal distribution of the score, so that
scores of all parameters are comparable.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from netboard.base.tables.simulated import Participant

Array = NDArray[np.float64]

FARTHEST = 3.0
"""Largest distance of a parameter from the median of its prior, in standard scores [1]."""


@dataclass(frozen=True, slots=True)
class Prior:
    """A log-normal prior, above a floor.

    - `median`: median of the parameter [its unit].
    - `spread`: standard deviation of the logarithm of its distance from the floor [1].
    - `floor`: smallest possible value [its unit].
    """

    median: float
    spread: float
    source: str
    floor: float = 0.0

    def value(self, score: Array) -> Array:
        """Return the parameter at a standard score [its unit]."""
        return np.asarray(self.floor + (self.median - self.floor) * np.exp(self.spread * score))

    def score(self, value: Array) -> Array:
        """Return the standard score of a value of the parameter [1]."""
        return np.asarray(np.log((value - self.floor) / (self.median - self.floor)) / self.spread)


_GAINS = "assumed: the ball comes to rest within seconds, without many oscillations"

PRIORS: dict[str, Prior] = {
    "kp": Prior(2.2, 0.2, _GAINS),
    "kd": Prior(2.5, 0.2, _GAINS),
    "max_tilt_deg": Prior(3.0, 0.2, "assumed: hands move by some 13 mm"),
    "lookahead": Prior(2.0, 0.15, "assumed: the prediction covers the visual delay and half a submovement"),
    "threshold_deg": Prior(1.0, 0.2, "assumed; dead zones in tracking, of another angle: 1 degree, Miall et al. 1993"),
    "threshold_cv": Prior(0.4, 0.2, "assumed"),
    "refractory": Prior(0.28, 0.15, "0.25 to 0.55 s for plants of order 0 to 2: van de Kamp et al. 2013"),
    "movement_time": Prior(0.3, 0.15, "assumed: submovements of 0.2 to 0.4 s"),
    "amplitude_cv": Prior(0.07, 0.3, "signal-dependent noise of 2 to 10 % of a movement"),
    "reaction_time": Prior(0.3, 0.2, "assumed: visual reactions of 0.2 to 0.45 s"),
    "position_noise": Prior(0.0025, 0.3, "assumed: some 0.3 degrees of visual angle at the display"),
    "velocity_noise": Prior(0.008, 0.3, "assumed"),
    "tilt_noise_deg": Prior(0.2, 0.3, "assumed: a fifteenth of the largest tilt"),
    "bimanual_async": Prior(0.045, 0.3, "assumed: some tens of milliseconds between two hands of one person"),
    "bimanual_amplitude_cv": Prior(0.2, 0.3, "assumed"),
    "novice": Prior(1.3, 0.5, "assumed: a novice is up to twice as noisy as a trained participant", floor=1.0),
}
"""Prior of each fitted parameter."""

NAMES = tuple(PRIORS)


def values_of(scores: Array, priors: Mapping[str, Prior] = PRIORS) -> Array:
    """Return the parameters at standard scores; the last axis is that of the parameters."""
    each = [prior.value(scores[..., place]) for place, prior in enumerate(priors.values())]
    return np.stack(each, axis=-1)


def participant_at(scores: Array, usual: Participant) -> Participant:
    """Return a participant with the fitted parameters at standard scores, and all others as usual."""
    return replace(usual, **dict(zip(NAMES, values_of(scores).tolist(), strict=True)))


def drawn_scores(rng: np.random.Generator, count: int) -> Array:
    """Draw standard scores from the prior, none of them beyond `FARTHEST`."""
    scores = rng.standard_normal((count, len(NAMES)))
    while (far := np.abs(scores) > FARTHEST).any():
        scores[far] = rng.standard_normal(int(far.sum()))
    return scores
