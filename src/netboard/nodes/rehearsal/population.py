"""Who rehearses: people who differ, as real ones do, and are the same persons in all blocks of a session.

Gains, thresholds and noise of each person are those of ``[participant]`` times log-normal factors; what a person draws
does not depend on what is drawn for others, nor on the blocks that are rehearsed.
"""

from dataclasses import replace

import numpy as np

from netboard.base.tables.simulated import Participant

SPREAD = 0.15
"""Standard deviation of the logarithm of most factors [1]."""

_VARIED = {
    ("kp", "kd"): SPREAD / 2,  # together: who wants the ball quicker brakes harder
    ("threshold_deg",): SPREAD,
    ("refractory", "movement_time"): SPREAD / 2,
    ("reaction_time",): SPREAD,
    ("position_noise", "velocity_noise", "tilt_noise_deg"): SPREAD,
    ("partner_noise",): SPREAD,
    ("force_noise",): SPREAD,
}
"""What differs between people, what of it goes together, and by how much."""

LETTERS = ("A", "B")
"""Names of the two participants of a session."""


def person_of(usual: Participant, seed: int, dyad: int, letter: str) -> Participant:
    """Make one person of a dyad."""
    rng = np.random.default_rng((seed, dyad, LETTERS.index(letter)))
    factors = {
        name: float(factor)
        for names, spread in _VARIED.items()
        for factor in (np.exp(spread * rng.standard_normal()),)
        for name in names
    }
    return replace(usual, **{name: getattr(usual, name) * factor for name, factor in factors.items()})
