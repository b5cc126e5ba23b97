"""Counterbalancing over dyads by their number, and randomisation over blocks and trials by the seed.

Over dyads nothing is random: the number of a dyad is decomposed into mixed-radix digits, one per property to be
counterbalanced, so that all combinations come up in turn. Within a dyad, what participants must not foresee is random.
Random draws use only the raw bits of a PCG64 generator, a stream that numpy guarantees not to change. So a seed gives
the same plan on every computer and with every version of numpy.

``words`` are the entropy of a draw: the seed and the purpose of the draw, none negative.

This module handles only numbers; `netboard.task.plans.conditions` knows what they stand for.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

Row = tuple[int, ...]


class Draw(IntEnum):
    """Purpose of a random draw; each has its own stream."""

    LEVELS = 1
    SPARE_SIDES = 2
    SIDES = 3
    CATCH = 4
    BLOCKS = 5
    TRIALS = 6
    PERTURBED = 7
    OPPOSITE = 8


def bits(number: int, *words: int) -> tuple[int, ...]:
    """Draw 64-bit random numbers."""
    return tuple(int(word) for word in np.random.PCG64(np.random.SeedSequence(words)).random_raw(number))


def shuffled(number: int, *words: int) -> Row:
    """Draw a random permutation of 0 to ``number - 1``; all are equally likely."""
    drawn = bits(number, *words) if number else ()
    return tuple(sorted(range(number), key=lambda index: drawn[index]))


def rows(levels: int, order: str) -> tuple[Row, ...]:
    """Return the rows of levels of a counterbalanced order, as level numbers; an order other than these has none.

    ``alternate``: the levels in turn, one row per first level. ``latin``: a balanced Latin square, in which each level
    follows every other equally often (Williams 1949; an odd number of levels needs twice as many rows).
    """
    if order == "alternate":
        return tuple(tuple((start + step) % levels for step in range(levels)) for start in range(levels))
    if order != "latin":
        return ()
    zigzag = [0] + [(step + 1) // 2 if step % 2 else levels - step // 2 for step in range(1, levels)]
    square = tuple(tuple((level + row) % levels for level in zigzag) for row in range(levels))
    return square if levels % 2 == 0 else square + tuple(row[::-1] for row in square)


@dataclass(frozen=True, slots=True)
class Turn:
    """The counterbalanced assignments of one dyad."""

    order: int
    between: tuple[int, ...]  # level of each between-dyads factor
    group: int  # number of earlier dyads with the same order and the same between-dyads levels
    seat: int  # seat of participant A if both have the same dominant hand; 0: left, 1: right
    starts: tuple[Row, ...]  # for each factor with rows, the first row of each of its sequences


def turn_of(dyad: int, orders: int, between: Sequence[int], factors: Sequence[tuple[int, Sequence[int]]]) -> Turn:
    """Return the assignments of a dyad.

    The digits, fastest first, are: the order of blocks; the level of each between-dyads factor; for each factor with
    rows, the shift of all its sequences; then, for each of these factors, the differences between its sequences. For
    the paper (two levels; sequences of A, B and the dyad) dyads 1 to 4 begin with (on, off, on), (off, on, off),
    (on, off, off), (off, on, on), and 1 to 8 with all combinations (reading C2). Seats follow the Thue-Morse sequence,
    two dyads per term: they are balanced after every four dyads, and not aligned with any of the digits.

    ``factors``: for each factor with rows, the number of rows, and the offset of each of its sequences.
    """
    rest, order = divmod(dyad - 1, orders)
    levels = []
    for number in between:
        rest, level = divmod(rest, number)
        levels.append(level)
    group, shifts = rest, []
    for number, _ in factors:
        rest, shift = divmod(rest, number)
        shifts.append(shift)
    seat = ((dyad - 1) // 2).bit_count() % 2
    starts = []
    for shift, (number, offsets) in zip(shifts, factors, strict=True):
        digits = []
        for _ in offsets[1:]:
            rest, digit = divmod(rest, number)
            digits.append(digit)
        differences = [0, *reversed(digits)]
        starts.append(tuple((d + offset + shift) % number for d, offset in zip(differences, offsets, strict=True)))
    return Turn(order, tuple(levels), group, seat, tuple(starts))


def first_sides(number: int, spare: int, *words: int) -> Row:
    """Draw the first target sides of blocks with the same conditions, balanced over left (0) and right (1).

    ``spare``: the side that comes once more if the number of blocks is odd.
    """
    sides = [index % 2 for index in range(number - number % 2)] + [spare] * (number % 2)
    return tuple(sides[index] for index in shuffled(number, *words))


def drawn_trials(number: int, free: Sequence[int], *words: int) -> Row:
    """Draw some of the free trials of a block, balanced over the two targets as far as possible."""
    if number == 0:
        return ()
    order = [free[index] for index in shuffled(len(free), *words)]
    odd, even = ([trial for trial in order if trial % 2 == parity] for parity in (1, 0))
    half = number // 2 + (number % 2 if order and order[0] % 2 else 0)
    odds = min(max(half, number - len(even)), len(odd))
    return tuple(sorted(odd[:odds] + even[: number - odds]))


def trial_levels(levels: int, trials: int, *words: int) -> Row:
    """Draw the level of each trial of a block, balanced over levels and targets as far as possible."""
    order = shuffled(levels, *words, 0)
    odd = trials - trials // 2
    drawn = [0] * trials
    for parity, (first, count) in enumerate(((0, odd), (odd, trials // 2))):
        balanced = [order[(first + index) % levels] for index in range(count)]
        drawn[parity::2] = [balanced[index] for index in shuffled(count, *words, 1 + parity)]
    return tuple(drawn)
