"""Byte planes: how a batch stores a column of words, the lowest byte of all of them first and the highest last."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import waiting

WORD = 8
"""Size of a word, in bytes [1]."""


def split(words: NDArray[np.int64]) -> bytes:
    """Return the byte planes of columns of words, shape (columns, n), with their signs in the lowest bits."""
    folded = (words << 1) ^ (words >> 63)
    return folded.view(np.uint8).reshape(*words.shape, WORD).transpose(0, 2, 1).tobytes()


@waiting
def join(planes: Any, places: Any, orders: Any, folded: bool, words: Any, first: int) -> None:
    """Read some columns of a batch: join their byte planes, unfold the signs, and undo the differences.

    Parameters
    ----------
    planes : ndarray of uint8, shape (columns, WORD, n)
        Byte planes of all columns of the batch.
    places : ndarray of int64, shape (k,)
        The columns to read [1].
    orders : ndarray of int64, shape (k,)
        How often each was differenced [1].
    folded : bool
        Whether the signs are in the lowest bits.
    words : ndarray of int64, shape (k, m)
        Where to write them.
    first : int
        Where to write the first word of each column [1].
    """
    count = planes.shape[2]
    for c in range(len(places)):
        column = planes[places[c]]
        for k in range(count):
            word = np.uint64(0)
            for byte in range(WORD):
                word |= np.uint64(column[byte, k]) << np.uint64(8 * byte)
            words[c, first + k] = np.int64(word)
        if folded:
            for k in range(first, first + count):
                word = np.uint64(words[c, k])
                words[c, k] = np.int64(word >> np.uint64(1)) ^ -np.int64(word & np.uint64(1))
        for _ in range(orders[c]):
            for k in range(first + 1, first + count):
                words[c, k] += words[c, k - 1]
