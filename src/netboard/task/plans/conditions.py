"""Assign conditions, first targets, catch trials and seats from the seed and the number of a dyad.

A *sequence* is all blocks of one kind by one performer (participant A, participant B, or the dyad), in order. Factors
vary along sequences (reading C1); blocks of another kind in between do not interrupt a sequence (C4). This module
decides which condition each block has; `netboard.task.plans.plan` makes the blocks.
"""

import math
from itertools import product
from typing import Literal

from netboard.base.config import SIDES, Side
from netboard.base.errors import ConfigError
from netboard.base.tables.perturbations import MAX_PERTURBED
from netboard.task.plans.counterbalance import (
    Draw,
    bits,
    drawn_trials,
    first_sides,
    rows,
    shuffled,
    trial_levels,
    turn_of,
)
from netboard.task.studies.parts import Factor
from netboard.task.studies.study import Study

Performer = Literal["A", "B", "dyad"]
Sequence = tuple[str, Performer]
"""A kind of block, and its performer."""

MAX_CATCH = 1000
"""Most catch trials in a block [1]."""


def sequences_of(study: Study, factor: str = "") -> tuple[Sequence, ...]:
    """List the sequences (of a factor, if given); A always comes before B."""
    return tuple(
        (name, performer)
        for name, kind in study.kinds.items()
        for performer in sorted(kind.people())
        if not factor or factor in study.factors_of(name)
    )


class Conditions:
    """The assignments of one dyad."""

    def __init__(self, study: Study, seed: int, dyad: int) -> None:
        self._study, self._seed, self._dyad = study, seed, dyad
        self._sequences = sequences_of(study)
        self._between = [name for name, factor in study.factors.items() if factor.order == "between"]
        self._rows = {name: rows(len(factor.levels), factor.order) for name, factor in study.factors.items()}
        self._by_rows = [name for name in study.factors if self._rows[name] and sequences_of(study, name)]
        self._turn = turn_of(
            dyad,
            len(study.taken()),
            [len(study.factors[name].levels) for name in self._between],
            [
                (len(self._rows[name]), [int(performer == "B") for _, performer in sequences_of(study, name)])
                for name in self._by_rows
            ],
        )

    @property
    def order(self) -> str:
        """Name of the order of blocks."""
        return self._study.taken()[self._turn.order]

    @property
    def seat(self) -> Side:
        """Seat of participant A if both have the same dominant hand (reading C5)."""
        return SIDES[self._turn.seat]

    def at(self, sequence: Sequence, place: int) -> tuple[tuple[str, str], ...]:
        """Return the conditions of a block; the last factor varies fastest, the first slowest."""
        found: list[tuple[str, str]] = []
        for name, factor in reversed(self._study.factors_of(sequence[0]).items()):
            if factor.order == "between":
                level = self._turn.between[self._between.index(name)]
            else:
                place, within = divmod(place, len(factor.levels))
                level = self._row(name, factor, sequence, place)[within]
            found.append((name, list(factor.levels)[level]))
        return tuple(reversed(found))

    def _row(self, name: str, factor: Factor, sequence: Sequence, cycle: int) -> tuple[int, ...]:
        """Return the order of a factor's levels in one cycle of a sequence."""
        if factor.order == "random":
            which = list(self._study.factors).index(name), self._sequences.index(sequence)
            return shuffled(len(factor.levels), self._seed, self._dyad, Draw.LEVELS, *which, cycle)
        rows_of_factor = self._rows[name]
        start = self._turn.starts[self._by_rows.index(name)][sequences_of(self._study, name).index(sequence)]
        return rows_of_factor[(start + (cycle if factor.order == "latin" else 0)) % len(rows_of_factor)]

    def first_targets(
        self, sequence: Sequence, conditions: tuple[tuple[str, str], ...], number: int
    ) -> tuple[Side, ...]:
        """Draw the first targets of all blocks of a sequence with the same conditions (reading C7).

        If the number of blocks is odd, one side comes once more than the other. That side alternates over conditions,
        sequences and the two dyads of a pair; each pair of dyads begins with a drawn side.
        """
        cells = list(product(*(factor.levels for factor in self._study.factors_of(sequence[0]).values())))
        cell, which = cells.index(tuple(level for _, level in conditions)), self._sequences.index(sequence)
        pair, second = divmod(self._turn.group, 2)
        (drawn,) = bits(1, self._seed, Draw.SPARE_SIDES, pair)
        spare = (cell + which + second + (drawn >> 63)) % 2
        sides = first_sides(number, spare, self._seed, self._dyad, Draw.SIDES, which, cell)
        return tuple(SIDES[side] for side in sides)

    def catch(self, kind: str, trials: int, place: int) -> tuple[int, ...]:
        """Draw the catch trials of a block."""
        share, after = self._study.kinds[kind].catch, self._study.kinds[kind].catch_after
        number, most = _number_of(share, trials), min(max(trials - after, 0), MAX_CATCH)
        if number > most:
            raise ConfigError(
                f"[kinds.{kind}] catch: {number} catch trials do not fit into {trials} trials of which the first "
                f"{after} are none; expected at most {most}"
            )
        return drawn_trials(number, range(after + 1, trials + 1), self._seed, self._dyad, Draw.CATCH, place)

    def perturbed(
        self, kind: str, trials: int, catch: tuple[int, ...], place: int
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Draw the perturbation trials of a block among those that are no catch trials, and those of opposite sign."""
        of = self._study.kinds[kind]
        free = [trial for trial in range(of.perturbed_after + 1, trials + 1) if trial not in catch]
        number, most = _number_of(of.perturbed, trials), min(len(free), MAX_PERTURBED)
        if number > most:
            raise ConfigError(
                f"[kinds.{kind}] perturbed: {number} perturbation trials do not fit into {trials} trials, of which the "
                f"first {of.perturbed_after} and the catch trials are none; expected at most {most}"
            )
        drawn = drawn_trials(number, free, self._seed, self._dyad, Draw.PERTURBED, place)
        if not of.perturbed_both_ways:
            return drawn, ()
        return drawn, drawn_trials(number // 2, drawn, self._seed, self._dyad, Draw.OPPOSITE, place)

    def within(self, kind: str, trials: int, place: int) -> dict[str, tuple[str, ...]]:
        """Draw the levels of the trial factors of a block; all combinations are equally frequent."""
        factors = self._study.trial_factors_of(kind)
        cells = list(product(*(factor.levels for factor in factors.values())))
        drawn = trial_levels(len(cells), trials, self._seed, self._dyad, Draw.TRIALS, place) if factors else ()
        return {name: tuple(cells[cell][which] for cell in drawn) for which, name in enumerate(factors)}

    def seed_at(self, place: int) -> int:
        """Draw the seed of a block, below 2^31 [1]."""
        (drawn,) = bits(1, self._seed, self._dyad, Draw.BLOCKS, place)
        return drawn >> 33


def _number_of(share: float, trials: int) -> int:
    """Return how many trials of a block a share (below 1) or a number of them is [1]."""
    return math.floor(share * trials + 0.5) if share < 1 else round(share)
