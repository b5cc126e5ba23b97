"""Fills in the rendered force at ticks for which the server had no sample from an agent.

At such a tick the recorded force is NaN. Later, the agent reports the samples that it remembers. The newest sample
before the tick fills in the force in two cases: it was read at most `netboard.base.tick.KNOWN_NS` before the tick, or
the agent also reports the next sample. In the second case the agent was delayed and the device held a force: that of
this sample, or that of the next one if it was handed over before the delay. The rows do not tell which. A force that
no agent remembers stays NaN. The safeguards of a filled tick are those of all samples since the previous tick. No
other column changes, and no tick that had a sample.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES
from netboard.base.errors import RecordingError
from netboard.base.tick import KNOWN_NS, RENDERED, TICK_NS
from netboard.network.protocol.records import BackfillRecord

_MAX_A_TICK = KNOWN_NS // TICK_NS
"""Largest number of samples before a tick that are searched [1]."""


class Backfilled:
    """All reports of a recording's agents on ticks without a sample."""

    def __init__(self, records: Iterable[BackfillRecord]) -> None:
        reported: dict[str, list[NDArray[Any]]] = {side: [] for side in SIDES}
        for record in records:
            if record.side not in reported or len(record.rows) % RENDERED.itemsize:
                raise RecordingError(f"backfill record {record.seq}: not made of whole rows of one side")
            rows = np.frombuffer(record.rows, RENDERED).copy()
            rows["stamp_ns"] -= record.offset_ns
            reported[record.side].append(rows)
        self._rows = {side: _sorted(parts) for side, parts in reported.items()}

    def fill(self, ticks: Mapping[str, NDArray[Any]] | NDArray[Any]) -> None:
        """Fill in the known rendered forces and safeguards, in place.

        ``time_ns`` and each side's ``rendered`` and ``safeguards`` are required.
        """
        for side, rows in self._rows.items():
            unknown = np.flatnonzero(np.isnan(ticks[f"{side}_rendered"]))
            if not (unknown.size and rows.size):
                continue
            times = ticks["time_ns"][unknown]
            newest = np.searchsorted(rows["stamp_ns"], times, side="right") - 1
            after = np.minimum(newest + 1, rows.size - 1)
            kept = rows["seq"][after] == rows["seq"][newest] + 1
            known = (newest >= 0) & (kept | (times - rows["stamp_ns"][newest] <= KNOWN_NS))
            places, newest, times = unknown[known], newest[known], times[known]
            ticks[f"{side}_rendered"][places] = rows["rendered"][newest]
            bits = rows["safeguards"][newest]
            for back in range(1, _MAX_A_TICK):
                before = np.maximum(newest - back, 0)
                within = (newest >= back) & (rows["stamp_ns"][before] > times - TICK_NS)
                bits = bits | np.where(within, rows["safeguards"][before], 0)
            ticks[f"{side}_safeguards"][places] = bits


def unknown_ticks(rendered: NDArray[np.float64], within: NDArray[np.bool_] | None = None) -> int:
    """Count the ticks with an unknown rendered force, from the first known one on.

    ``rendered``: rendered force of one side at every tick, after `Backfilled.fill` [N]. Before the first known force
    there was no agent yet.
    """
    unknown = np.isnan(rendered)
    began = int(np.argmin(unknown)) if not unknown.all() else unknown.size
    unknown[:began] = False
    return int(np.count_nonzero(unknown if within is None else unknown & within))


def _sorted(parts: list[NDArray[Any]]) -> NDArray[Any]:
    rows = np.concatenate([np.empty(0, RENDERED), *parts])
    return rows[np.argsort(rows["stamp_ns"], kind="stable")]
