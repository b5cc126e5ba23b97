"""Predictive intervals of the paper's results over virtual studies of four dyads, and ablations of the model.

A pool of dyads performs the paper's plan. A virtual study draws four of them as the paper counterbalanced its own: one
dyad of each starting state. The 95 % predictive interval lies between the 2.5th and 97.5th percentile over many virtual
studies. Dyads of the pool appear in several studies, so a small pool makes the intervals
uncertain, and too narrow by a factor of about ``sqrt(1 - 1/n)`` for n dyads of each state.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.tables.simulated import Participant
from netboard.benchmarks.participants.paper import EXTRA, STATEMENTS, Sample, Statement
from netboard.benchmarks.participants.trials import SEED

STATES = 4
"""Starting states of the paper's plan, one for each of its dyads [1]."""

LIKELY = 0.8
"""Share of studies with the paper's direction from which a direction counts as reproduced [1]."""

USUAL = Participant()

ABLATIONS = {
    "full model": USUAL,
    "friction at rest": replace(USUAL, rest_skill=0.0),
    "no load skill": replace(USUAL, load_skill=0.0),
    "no information": replace(USUAL, haptic_gain=0.0),
    "fixed partner": replace(USUAL, mirror_rate=0.0),
    "no learning": replace(USUAL, novice=1.0),
    "with yielding": replace(USUAL, reflex_gain=1.0),
    "with impedance": replace(USUAL, impedance_gain=20_000.0),
    "with goal": replace(USUAL, partner_prediction="goal"),
}
"""Variants of the model: each is without one part, or ("with") has a part that the model leaves out."""


def studies(dyads: Sequence[NDArray[Any]], count: int) -> list[Sample]:
    """Draw virtual studies from the attempts of dyads 1, 2, ...; dyads four apart share a starting state."""
    if len(dyads) % STATES:
        raise ValueError(f"found {len(dyads)} dyads, expected a multiple of {STATES}, as many of each starting state")
    rng = np.random.default_rng((SEED, count))
    chosen = rng.integers(0, len(dyads) // STATES, (count, STATES)) * STATES + np.arange(STATES)
    return [Sample(np.concatenate([dyads[k] for k in row])) for row in chosen]


@dataclass(frozen=True)
class Prediction:
    """Prediction of the model for a statement of the paper.

    - `values`: the quantity in each virtual study.
    """

    statement: Statement
    values: NDArray[np.float64]

    @property
    def interval(self) -> tuple[float, float, float]:
        """Median and limits of the 95 % predictive interval."""
        low, middle, high = np.percentile(self.values, (2.5, 50, 97.5))
        return float(middle), float(low), float(high)

    @property
    def inside(self) -> bool | None:
        """Whether the paper's value lies in the interval; None without a value."""
        _, low, high = self.interval
        value = self.statement.value
        return None if value is None else low <= value <= high

    @property
    def probability(self) -> float | None:
        """Share of studies with the paper's direction; None without one [1]."""
        sense = self.statement.sense
        return float(np.mean(sense * self.values > 0)) if sense else None

    @property
    def reproduced(self) -> str:
        """Whether the model reproduces the result: "yes", "NO", "unclear" or "not reported"."""
        if self.inside is not None:
            return "yes" if self.inside else "NO"
        if self.probability is None:
            return "not reported"
        return "yes" if self.probability >= LIKELY else "unclear" if self.probability >= 0.5 else "NO"


def predictions(samples: Sequence[Sample]) -> list[Prediction]:
    """Evaluate all statements in virtual studies."""
    return [Prediction(one, np.array([one.of(sample) for sample in samples], float)) for one in (*STATEMENTS, *EXTRA)]
