"""Sequence of the ticks in a recording: what tells one recording from several that were joined.

The ticks of a recording have rising numbers. They follow one clock, so their times differ by whole ticks, stalls
included. The time that the block has taken never falls, and rises by at most the ticks that passed. In a recording
that was computed instead of logged, log time and server time differ by one constant. Pure: arrays in, words out.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.tick import TICK_NS
from netboard.network.protocol.records import BLOCK_BEGAN, EventRecord

EVIDENCE = ("tick", "time_ns", "block_ticks")
"""Columns of the ticks by which two parts of a recording are compared."""

NUMBERED = ("/event", "/clock", "/backfill", "/logger")
"""Topics on which a recording gives a number once, and in order; a restarted display numbers its frames anew."""

_STEADY = 3
"""Batches whose log times must have the same distance from their server times to count as computed [1]."""

_SEAMS = 8
"""Contradictions up to which they are where recordings were joined; an imported table may have any number [1]."""


class Excerpt(NamedTuple):
    """What a part of a recording says of its clock and its block."""

    first: int
    last: int
    phase: int | None  # server time of its ticks modulo one tick, if it is the same for all [ns]
    block: tuple[int, int] | None  # ticks of the block at its first and its last tick, if they count as they should
    offsets: frozenset[int]  # differences between log time and server time of its batches [ns]
    steady: bool  # whether it has several batches with the same difference


def excerpt_of(ticks: dict[str, NDArray[np.int64]], offsets: Sequence[int] = ()) -> Excerpt:
    """Return the excerpt of ticks with rising numbers, from the columns of `EVIDENCE`."""
    numbers, block = ticks["tick"], ticks["block_ticks"]
    phases = np.unique(ticks["time_ns"] % TICK_NS)
    counts = _follows(np.diff(numbers), np.diff(block)) and int(block[0]) >= 0
    return Excerpt(
        first=int(numbers[0]),
        last=int(numbers[-1]),
        phase=int(phases[0]) if len(phases) == 1 else None,
        block=(int(block[0]), int(block[-1])) if counts else None,
        offsets=frozenset(offsets),
        steady=len(offsets) >= _STEADY and len(set(offsets)) == 1,
    )


def _follows(passed: NDArray[np.int64], counted: NDArray[np.int64]) -> bool:
    """Return whether a count of ticks is possible, from its steps and those of the tick numbers."""
    return bool(np.all((counted >= 0) & (counted <= passed)))


def contradiction(one: Excerpt, other: Excerpt) -> str:
    """Return why two excerpts without a common tick cannot be of one recording; empty if they can."""
    before, after = sorted((one, other))
    if before.phase is not None and after.phase is not None and before.phase != after.phase:
        return "their ticks follow two clocks"
    if before.block and after.block:
        passed, counted = after.first - before.last, after.block[0] - before.block[1]
        if not 0 <= counted <= passed:
            return "their blocks have not taken the same time"
    computed = before.offsets if before.steady else after.offsets if after.steady else frozenset[int]()
    if computed and before.offsets and after.offsets and before.offsets | after.offsets != computed:
        return "they were computed at different times"
    return ""


def misplaced(numbers: NDArray[np.int64], first: int, last: int) -> str:
    """Return which tick is out of order or outside the stated range, in words; empty if none is."""
    falls = np.flatnonzero(np.diff(numbers) <= 0)
    if len(falls):
        return _follows_in_words(numbers[falls[0] + 1], numbers[falls[0]])
    if len(numbers) and (numbers[0] < first or numbers[-1] > last):
        return f"ticks {numbers[0]} to {numbers[-1]} are listed as {first} to {last}"
    return ""


def misplaced_chunk(places: NDArray[Any]) -> str:
    """Return the first chunk with misplaced ticks, from the first and last number and the count of each; or nothing."""
    first, last = places["first"], places["last"]
    crowded = np.flatnonzero(last - first + 1 < places["count"])
    if len(crowded):
        one = places[crowded[0]]
        return _follows_in_words(one["last"], one["first"])
    falls = np.flatnonzero(first[1:] <= last[:-1])
    return _follows_in_words(first[falls[0] + 1], last[falls[0]]) if len(falls) else ""


def _follows_in_words(number: int, before: int, what: str = "tick") -> str:
    return f"{what} {number} comes after {what} {before}"


def misnumbered(numbers: Sequence[int], topic: str) -> str:
    """Return which message of a topic of `NUMBERED` has no higher number than the one before; empty if none has."""
    for before, number in pairwise(numbers):
        if number <= before:
            return _follows_in_words(number, before, topic.removeprefix("/"))
    return ""


def several(
    ticks: dict[str, NDArray[np.int64]],
    events: Sequence[EventRecord],
    opened: Mapping[str, str],
    end: Mapping[str, str],
) -> str:
    """Return why a recording with rising tick numbers is made of several ones; empty if it seems to be one.

    ``ticks``: the columns of `EVIDENCE`. ``opened``, ``end``: metadata. Only for files that may have been joined: a
    stall moves no clock by a part of a tick, and a block begins once.
    """
    began = {event.details["config"] for event in events if event.name == BLOCK_BEGAN and "config" in event.details}
    if len(began) > 1:
        return f"{len(began)} blocks begin in it"
    numbers, jumps = ticks["tick"], np.flatnonzero(np.diff(ticks["time_ns"] % TICK_NS))
    if 0 < len(jumps) <= _SEAMS:
        return f"tick {numbers[jumps[0] + 1]} follows another clock than tick {numbers[jumps[0]]}"
    counted = np.diff(ticks["block_ticks"])
    back = np.flatnonzero((counted < 0) | (counted > np.diff(numbers)))
    if 0 < len(back) <= _SEAMS:
        return f"at tick {numbers[back[0] + 1]} its block has taken another time than at tick {numbers[back[0]]}"
    if len(numbers) and _computed(opened) and {"opened_log_ns", "welcome_server_ns", "log_ns"} <= {*opened, *end}:
        began_ns = int(opened["opened_log_ns"]) - int(opened["welcome_server_ns"])
        if (int(end["log_ns"]) - int(ticks["time_ns"][-1]) - began_ns) % TICK_NS:
            return "it does not end at the time at which the recording with which it begins would"
    return ""


def _computed(opened: Mapping[str, str]) -> bool:
    """Return whether a recording was computed, so that log time and server time differ by one constant."""
    return opened.get("rehearsed") == "true" or "imported" in opened
