"""The simulated participants beside whom a partner learns, and those held out, beside whom it is evaluated.

Each is drawn from a posterior of the fit to the paper (`netboard.analysis.cohort.posterior`), and varied as the members
of a cohort are. The seeds of the two groups never meet.
"""

from typing import NamedTuple

from netboard.analysis.cohort.posterior import Posterior
from netboard.base.tables.simulated import Participant
from netboard.participants.people.population import person_of

HELD_OUT = 1_000_000
"""Seeds of held-out participants begin here; those of the others end before [1]."""


class Population(NamedTuple):
    """Where participants are drawn from; ``usual``: their parameters that were not fitted."""

    posterior: Posterior
    usual: Participant

    def learning(self, seed: int, number: int) -> list[Participant]:
        """Return participants to learn beside; ``seed``: of the training."""
        return [self._drawn((seed * number + place) % HELD_OUT) for place in range(number)]

    def held_out(self, number: int) -> list[Participant]:
        """Return the participants to evaluate beside, which are the same for each training."""
        return [self._drawn(HELD_OUT + place) for place in range(number)]

    def _drawn(self, seed: int) -> Participant:
        """Return one participant."""
        return person_of(self.posterior.participant(self.usual, seed), seed, 1, "A")
