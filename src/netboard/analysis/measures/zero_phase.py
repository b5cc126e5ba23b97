"""Zero-phase filtering of several signals at once: a cascade of second-order sections, forward and backward.

A recursive filter waits for its own last output, so a processor filters four signals in the time of one. The pieces of
all signals are laid one after the other onto the four lanes of a vector register, and each pass runs along the lanes.
At the first sample of a piece the lane's state is set to the steady state of that sample, so pieces do not see each
other. Between two of these samples, the states of all sections stay in registers.

Every lane computes what `scipy.signal.sosfiltfilt` computes, to the bit: which signals are filtered together has no
influence on any of them.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import composed, inlined, kernel
from netboard.physics.arithmetic.simd import gathered, lane, lanes_at, put

Array = NDArray[np.float64]

LANES = 4
"""Signals that are filtered side by side [1]."""

PADDINGS = ("none", "constant", "even", "odd")
"""Kinds of padding, by their numbers in the kernels."""


def zero_phase(
    pieces: Sequence[Array], sections: Array, steady: Array, longest: int, padding: str
) -> list[NDArray[np.float64]]:
    """Filter pieces of signals forward and backward, each alone, and return them [as given].

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n,)
        Signals without missing samples, each of at least one sample.
    sections, steady : ndarray, shape (k, 6) and (k, 2)
        Second-order sections, and their steady state for an input of one [1].
    longest : int
        Length of the padding at each end; a piece has at most one sample less than its own length [1].
    padding : {"none", "constant", "even", "odd"}
        Assumed signal beyond the ends, as for `netboard.analysis.measures.signals.LowPass`.
    """
    pads = [min(longest, piece.size - 1) for piece in pieces]
    lanes, firsts, ends = _placed([piece.size + 2 * pad for piece, pad in zip(pieces, pads, strict=True)])
    tape = np.empty((LANES, max(ends)))  # not `np.zeros`, which asks the system for new memory each time
    for lane_number, end in enumerate(ends):
        tape[lane_number, end:] = 0.0
    places = np.array([lanes, firsts, pads, [piece.size for piece in pieces]], np.int64).T.copy()
    for piece, place in zip(pieces, places, strict=True):
        _lay(tape, place, piece, PADDINGS.index(padding))
    state = np.zeros(len(sections) * 2 * LANES)
    run = _pass_of(len(sections))
    run(tape, sections, steady, state, _turns(places, backward=False), 1)
    run(tape, sections, steady, state, _turns(places, backward=True), -1)
    return [tape[lane, first + pad : first + pad + size] for lane, first, pad, size in places.tolist()]


def _placed(lengths: Sequence[int]) -> tuple[list[int], list[int], list[int]]:
    """Return the lane and the first sample of each piece, the longest ones first, and the end of each lane [1]."""
    ends = [0] * LANES
    lanes, firsts = [0] * len(lengths), [0] * len(lengths)
    for k in sorted(range(len(lengths)), key=lambda k: -lengths[k]):
        lanes[k] = ends.index(min(ends))
        firsts[k] = ends[lanes[k]]
        ends[lanes[k]] += lengths[k]
    return lanes, firsts, ends


def _turns(places: NDArray[np.int64], *, backward: bool) -> NDArray[np.int64]:
    """Return the samples at which a pass enters another piece or leaves the last one, with the lanes, in its order."""
    lanes, firsts, lasts = places[:, 0], places[:, 1], places[:, 1] + 2 * places[:, 2] + places[:, 3] - 1
    # Beyond its last piece a lane has zeros; entering them sets the state to zero, which never decays to a denormal.
    beyond = [] if backward else [(lasts[lanes == lane].max(initial=-1) + 1, lane) for lane in range(LANES)]
    turns = np.array([*zip(lasts if backward else firsts, lanes, strict=True), *beyond], np.int64)
    order = np.argsort(-turns[:, 0] if backward else turns[:, 0], kind="stable")
    return turns[order]


@kernel
def _lay(tape: Array, place: NDArray[np.int64], piece: Array, padding: int) -> None:
    """Write a piece onto its lane, with the padding at both ends."""
    first, pad, size = place[1], place[2], place[3]
    lane = tape[place[0]]
    start, end = piece[0], piece[size - 1]
    for k in range(pad):
        before, after = start, end
        if padding >= 2:
            before, after = piece[pad - k], piece[size - 2 - k]
        if padding == 3:
            before, after = 2 * start - before, 2 * end - after
        lane[first + k], lane[first + pad + size + k] = before, after
    lane[first + pad : first + pad + size] = piece


@inlined
def _load(state: Array, sections: Array) -> tuple[Any, ...]:
    """Return the state of no section."""
    return ()


@inlined
def _store(state: Array, loaded: tuple[Any, ...]) -> None:
    """Store the state of no section."""


@inlined
def _cascade(x: Array, loaded: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Filter a sample of all lanes by no section."""
    return x, ()


def _pass(tape: Array, sections: Array, steady: Array, state: Array, turns: NDArray[np.int64], step: int) -> None:
    """Filter all lanes in place, in the direction of `step`, which is 1 or -1."""
    height = tape.shape[1]
    n, stop = (0, height) if step > 0 else (height - 1, -1)
    state[:] = 0.0
    turn = 0
    while n != stop:
        while turn < len(turns) and turns[turn, 0] == n:
            _enter(tape, steady, state, n, turns[turn, 1])
            turn += 1
        # A turn at the very end of the tape lies at no sample of it.
        until = turns[turn, 0] if turn < len(turns) and turns[turn, 0] < height else stop
        loaded = _load(state, sections)
        while n != until:
            x, loaded = _cascade(_sample(tape, n), loaded)
            _put_sample(tape, n, x)
            n += step
        _store(state, loaded)


@cache
def _pass_of(count: int) -> Callable[..., None]:
    """Compile the pass of a filter with some sections."""
    return composed(_pass, **dict(zip(("_load", "_store", "_cascade"), _sections_from(0, count), strict=True)))


def _sections_from(SECTION: int, COUNT: int) -> tuple[Callable[..., Any], ...]:
    """Return kernels that load and store the states of the sections from one on, and that filter a sample by them.

    A section is direct form II, transposed. What is loaded: its state and coefficients, and those of all further ones.
    """
    if SECTION == COUNT:
        return _load, _store, _cascade
    load_others, store_others, filter_others = _sections_from(SECTION + 1, COUNT)
    FIRST, SECOND = 2 * SECTION * LANES, (2 * SECTION + 1) * LANES

    @inlined
    def load(state: Array, sections: Array) -> tuple[Any, ...]:
        of = sections[SECTION]
        kept = lanes_at(state, FIRST, LANES), lanes_at(state, SECOND, LANES)
        return kept, (of[0], of[1], of[2], of[4], of[5]), load_others(state, sections)

    @inlined
    def store(state: Array, loaded: tuple[Any, ...]) -> None:
        kept, _, others = loaded
        put(state, FIRST, kept[0])
        put(state, SECOND, kept[1])
        store_others(state, others)

    @inlined
    def cascade(x: Array, loaded: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
        (first, second), (b0, b1, b2, a1, a2), others = loaded
        y = b0 * x + first
        kept = b1 * x - a1 * y + second, b2 * x - a2 * y
        passed, others = filter_others(y, others)
        return passed, (kept, (b0, b1, b2, a1, a2), others)

    return load, store, cascade


@inlined
def _enter(tape: Array, steady: Array, state: Array, n: int, lane: int) -> None:
    """Set the state of a lane to the steady state of its next sample."""
    for s in range(len(steady)):
        for j in range(2):
            state[(2 * s + j) * LANES + lane] = steady[s, j] * tape[lane, n]


@inlined
def _sample(tape: Array, n: int) -> Any:
    """Return a sample of all lanes."""
    return gathered((tape[0, n], tape[1, n], tape[2, n], tape[3, n]), LANES)


@inlined
def _put_sample(tape: Array, n: int, x: Array) -> None:
    """Store a sample of all lanes."""
    tape[0, n], tape[1, n], tape[2, n], tape[3, n] = lane(x, 0), lane(x, 1), lane(x, 2), lane(x, 3)
