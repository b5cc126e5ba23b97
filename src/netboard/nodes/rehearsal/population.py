"""Simulated participants that differ as real ones do, and stay the same in all blocks of a session.

Gains, thresholds and noise of each participant are those of ``[participant]`` times log-normal factors. The factors of
a participant depend neither on those of others nor on the blocks that are rehearsed.
"""

from dataclasses import replace

import numpy as np

from netboard.base.tables.simulated import Participant

SPREAD = 0.15
"""Standard deviation of the logarithm of most factors [1]."""

_VARIED = {
    ("kp", "kd"): SPREAD / 2,  # together: a participant that moves the ball faster also brakes harder
    ("threshold_deg",): SPREAD,
    ("refractory", "movement_time"): SPREAD / 2,
    ("reaction_time",): SPREAD,
    ("position_noise", "velocity_noise", "tilt_noise_deg"): SPREAD,
    ("partner_noise",): SPREAD,
    ("force_noise",): SPREAD,
}
"""Parameters that differ between participants, grouped by common factor, with the standard deviations."""

LETTERS = ("A", "B")
"""Names of the two participants of a session."""


def person_of(usual: Participant, seed: int, dyad: int, letter: str) -> Participant:
    """Make one participant of a dyad."""
    rng = np.random.default_rng((seed, dyad, LETTERS.index(letter)))
    factors = {
        name: float(factor)
        for names, spread in _VARIED.items()
        for factor in (np.exp(spread * rng.standard_normal()),)
        for name in names
    }
    return replace(usual, **{name: getattr(usual, name) * factor for name, factor in factors.items()})
