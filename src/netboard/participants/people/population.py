"""Simulated participants that differ as real ones do, and stay the same in all blocks of a session.

Gains, thresholds and noise of each participant are those of ``[participant]`` times log-normal factors. The factors of
a participant depend neither on those of others nor on the blocks that are rehearsed. Practice does: a participant has
done the trials of its own blocks before.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from netboard.base.config import SIDES, Config
from netboard.base.tables.simulated import Participant

SPREAD = 0.15
"""Standard deviation of the logarithm of most factors [1]."""

VARIED = {
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
        for names, spread in VARIED.items()
        for factor in (np.exp(spread * rng.standard_normal()),)
        for name in names
    }
    return replace(usual, **{name: getattr(usual, name) * factor for name, factor in factors.items()})


def people_of(blocks: Sequence[Config], seed: int, dyad: int) -> Iterator[dict[str, Participant]]:
    """Yield the participants A and B of each block.

    By default their practice is the trials of their own blocks before, their acquaintance those of dyadic ones, and
    their felt trials those of dyadic ones with the full force.
    """
    done, together, felt = Counter[str](), Counter[str](), Counter[str]()
    for config in blocks:
        people = {letter: person_of(config.participant, seed, dyad, letter) for letter in LETTERS}
        counters = {"practice": done, "acquaintance": together, "felt_trials": felt}
        planned = {name: counter for name, counter in counters.items() if getattr(config.participant, name) == "plan"}
        for letter, one in people.items():
            counts: dict[str, Any] = {name: float(counter[letter]) for name, counter in planned.items()}
            people[letter] = replace(one, **counts)
        yield people
        trials = dict.fromkeys(performers(config), config.block.trials)
        done.update(trials)
        if config.block.configuration == "dyadic":
            together.update(trials)
            if config.block.force == "full":
                felt.update(trials)


def performers(config: Config) -> tuple[str, ...]:
    """Return the letters of the participants who perform a block."""
    block = config.block
    if block.configuration == "bimanual":
        return (block.performer,)
    moved = {"left": block.left, "right": block.right}
    seats = SIDES if config.session.seat_a == "left" else SIDES[::-1]
    return tuple(letter for letter, side in zip(LETTERS, seats, strict=True) if moved[side] == "person")
