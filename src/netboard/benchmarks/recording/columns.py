"""Cost of each column of the ticks: the bytes saved without it, and its bytes by itself.

A column that equals others, or follows from them, costs nothing in addition, so the costs of all columns do not add up
to the total.
"""

from typing import Any

import numpy as np
import zstandard
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.benchmarks.harness.results import Part
from netboard.recording.format.batches import pack
from netboard.recording.format.channels import TICK_FIELDS
from netboard.recording.format.predictions import PREDICTIONS, constants_of

BATCH = 200
"""Ticks in a batch [1]."""

SAMPLED = 100
"""Batches whose columns are measured, spread over the recording [1]."""

LISTED_BYTES = 0.05
"""A column that costs less, alone and in addition to the others, is not listed [1]."""

_WORD = 8


def columns_part(rows: NDArray[Any], config: Config) -> Part:
    """Tabulate what each column costs, the most expensive first."""
    starts = np.linspace(0, len(rows) - BATCH, min(SAMPLED, len(rows) // BATCH)).astype(np.int64)
    constants = constants_of(config)
    batches = [
        np.frombuffer(pack(rows[start : start + BATCH], constants), np.uint8).reshape(len(TICK_FIELDS), -1)
        for start in starts
    ]
    whole = _bytes_a_tick(batches)
    found = []
    for place, field in enumerate(TICK_FIELDS):
        beside = whole - _bytes_a_tick([np.delete(batch, place, axis=0) for batch in batches])
        alone = _bytes_a_tick([batch[place] for batch in batches])
        if max(beside, alone - _empty()) > LISTED_BYTES:
            found.append((field.name, "yes" if field.name in PREDICTIONS else "no", field.differences, beside, alone))
    found.sort(key=lambda row: -row[3])
    return Part(
        "columns",
        f"What each column of {len(batches)} batches costs; {len(TICK_FIELDS) - len(found)} others cost nothing",
        ("column", "predicted", "differences", "beside the others: bytes a tick [1]", "alone: bytes a tick [1]"),
        [*found, ("all", "", "", whole, whole)],
    )


def _bytes_a_tick(batches: list[NDArray[np.uint8]]) -> float:
    """Return the compressed size of some columns [1]."""
    compressor = zstandard.ZstdCompressor()
    return sum(len(compressor.compress(batch.tobytes())) for batch in batches) / (BATCH * len(batches))


def _empty() -> float:
    """Return the compressed size of a column of zeros by itself [1]."""
    return _bytes_a_tick([np.zeros(BATCH * _WORD, np.uint8)])
