"""How what could bias a study is spread: over dyads by their number, over blocks and trials by the seed.

Over dyads nothing is left to chance: the number of a dyad is written in digits, one for everything that must be spread,
so that all combinations come up in turn. Within a dyad, what participants must not foresee is drawn. Draws use the raw
bits of a PCG64 generator alone, whose stream numpy promises not to change, so that a seed means the same plan on any
machine and in any year.

This module knows of numbers only; `netboard.task.plans.plan` knows what they stand for.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

Row = tuple[int, ...]


class Draw(IntEnum):
    """What is drawn; each has a stream of its own."""

    LEVELS = 1
    SPARE_SIDES = 2
    SIDES = 3
    CATCH = 4
    BLOCKS = 5
    TRIALS = 6


def bits(number: int, *words: int) -> tuple[int, ...]:
    """Draw numbers.

    Parameters
    ----------
    *words : int
        The seed, and what the draw is for; none negative [1].
    """
    return tuple(int(word) for word in np.random.PCG64(np.random.SeedSequence(words)).random_raw(number))


def shuffled(number: int, *words: int) -> Row:
    """Draw an order of the numbers from 0.

    Parameters
    ----------
    *words : int
        The seed, and what the draw is for; none negative [1].

    Returns
    -------
    tuple of int
        The numbers in an order of which each is equally likely [1].
    """
    drawn = bits(number, *words) if number else ()
    return tuple(sorted(range(number), key=lambda index: drawn[index]))


def rows(levels: int, order: str) -> tuple[Row, ...]:
    """Make the rows in which levels can follow each other.

    Parameters
    ----------
    order : {"alternate", "latin", ...}
        In turn, from each level; or a latin square in which each level also follows each other equally often
        (Williams 1949; with an odd number of levels that takes twice as many rows). Any other order has none.

    Returns
    -------
    tuple of tuple of int
        Rows of level numbers; empty if the order is not by rows [1].
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
    """What falls to one dyad by its number.

    Attributes
    ----------
    group : int
        How many dyads with the same order and the same levels between came before it [1].
    seat : int
        0: participant A sits left if their hands do not decide; 1: right [1].
    starts : tuple of tuple of int
        For each factor that goes by rows, the row with which each of its sequences begins [1].
    """

    order: int
    between: tuple[int, ...]
    group: int
    seat: int
    starts: tuple[Row, ...]


def turn_of(dyad: int, orders: int, between: Sequence[int], factors: Sequence[tuple[int, Sequence[int]]]) -> Turn:
    """Find what falls to a dyad.

    The digits, the fastest first: order of blocks; level of each factor between dyads; for each factor that goes by
    rows, the shift of all its sequences; then, for each of these, how its sequences differ from each other. For the
    paper (two levels; sequences of A, B and the dyad) dyads 1 to 4 begin with (on, off, on), (off, on, off),
    (on, off, off), (off, on, on), and 1 to 8 with all combinations (reading C2). Seats follow the sequence of Thue and
    Morse, two dyads at a time: even after every four, and in step with none of the digits.

    Parameters
    ----------
    factors : sequence of (int, sequence of int)
        For each factor that goes by rows, the number of its rows, and the offset of each of its sequences [1].
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
        own = [0, *reversed(digits)]
        starts.append(tuple((digit + offset + shift) % number for digit, offset in zip(own, offsets, strict=True)))
    return Turn(order, tuple(levels), group, seat, tuple(starts))


def first_sides(number: int, spare: int, *words: int) -> Row:
    """Draw the side of the first target of blocks that are alike: as many left as right, or one more of a side.

    Parameters
    ----------
    spare : int
        The side of which there is one more if the number is odd: 0 left, 1 right [1].
    *words : int
        The seed, and what the draw is for; none negative [1].
    """
    sides = [index % 2 for index in range(number - number % 2)] + [spare] * (number % 2)
    return tuple(sides[index] for index in shuffled(number, *words))


def catch_trials(number: int, trials: int, after: int, *words: int) -> Row:
    """Draw the catch trials of a block: half of them with either target, as far as that goes.

    Parameters
    ----------
    *words : int
        The seed, and what the draw is for; none negative [1].
    """
    if number == 0:
        return ()
    order = [after + 1 + index for index in shuffled(max(trials - after, 0), *words)]
    odd, even = ([trial for trial in order if trial % 2 == parity] for parity in (1, 0))
    half = number // 2 + (number % 2 if order and order[0] % 2 else 0)
    odds = min(max(half, number - len(even)), len(odd))
    return tuple(sorted(odd[:odds] + even[: number - odds]))


def trial_levels(levels: int, trials: int, *words: int) -> Row:
    """Draw the level of each trial of a block: each as often as the others, with either target, as far as that goes.

    Parameters
    ----------
    *words : int
        The seed, and what the draw is for; none negative [1].
    """
    order = shuffled(levels, *words, 0)
    odd = trials - trials // 2
    drawn = [0] * trials
    for parity, (first, count) in enumerate(((0, odd), (odd, trials // 2))):
        own = [order[(first + index) % levels] for index in range(count)]
        drawn[parity::2] = [own[index] for index in shuffled(count, *words, 1 + parity)]
    return tuple(drawn)
