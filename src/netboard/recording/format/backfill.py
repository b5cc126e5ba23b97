"""What an agent has told of the ticks that had no sample of it, put where it belongs in the ticks.

At such a tick the recorded force is NaN. The row that an agent remembers of the newest sample before the tick fills it
in, if that was read at most `netboard.base.tick.KNOWN_NS` before, or if the agent remembers the next sample too: then
it was held up, and its device kept the force. What nobody remembers stays NaN. The safeguards of a filled tick are
those of all samples since the tick before. No other column is touched, and no tick that had a sample.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES
from netboard.base.errors import RecordingError
from netboard.base.tick import KNOWN_NS, RENDERED, TICK_NS
from netboard.network.protocol.records import BackfillRecord

_MOST_A_TICK = KNOWN_NS // TICK_NS
"""So many samples before a tick are looked at [1]."""


class Backfilled:
    """Everything that the agents of a recording have told of ticks without a sample."""

    def __init__(self, records: Iterable[BackfillRecord]) -> None:
        told: dict[str, list[NDArray[Any]]] = {side: [] for side in SIDES}
        for record in records:
            if record.side not in told or len(record.rows) % RENDERED.itemsize:
                raise RecordingError(f"backfill record {record.seq}: not made of whole rows of one side")
            rows = np.frombuffer(record.rows, RENDERED).copy()
            rows["stamp_ns"] -= record.offset_ns
            told[record.side].append(rows)
        self._rows = {side: _sorted(parts) for side, parts in told.items()}

    def fill(self, ticks: Mapping[str, NDArray[Any]] | NDArray[Any]) -> None:
        """Fill in the rendered forces and safeguards that are known.

        Parameters
        ----------
        ticks : ndarray of TICK, or dict of its columns, shape (n,)
            Ticks, changed in place; ``time_ns`` and of each side ``rendered`` and ``safeguards`` must be there.
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
            for back in range(1, _MOST_A_TICK):
                before = np.maximum(newest - back, 0)
                within = (newest >= back) & (rows["stamp_ns"][before] > times - TICK_NS)
                bits = bits | np.where(within, rows["safeguards"][before], 0)
            ticks[f"{side}_safeguards"][places] = bits


def unknown_ticks(rendered: NDArray[np.float64], within: NDArray[np.bool_] | None = None) -> int:
    """Count the ticks at which nobody knows what a device rendered, from the first one on at which it is known.

    Parameters
    ----------
    rendered : ndarray, shape (n,)
        The rendered force of one side at every tick, filled in as far as agents have told it [N].

    Returns
    -------
    int
        How many; before the first known force there was no agent yet [1].
    """
    unknown = np.isnan(rendered)
    began = int(np.argmin(unknown)) if not unknown.all() else unknown.size
    unknown[:began] = False
    return int(np.count_nonzero(unknown if within is None else unknown & within))


def _sorted(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """Rows of one side in the order of their times."""
    rows = np.concatenate([np.empty(0, RENDERED), *parts])
    return rows[np.argsort(rows["stamp_ns"], kind="stable")]
