"""Synthetic timing of a session with known stalls, from the rules of the manual.

Agents read a stylus each millisecond and make up for what they missed; a tick begins when both samples are there, at
most half a millisecond before its deadline, and at the deadline otherwise. Processes do nothing within their stalls,
and nothing arrives over a line while it is held. All times are in nanoseconds after `START`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from netboard.base.tick import RENDERED, TICK
from netboard.network.protocol.records import BackfillRecord
from netboard.task.trials.state_machine import Phase

START = 5_000_000_000
MS = 1_000_000
WAY, WORK, BURST = 150_000, 100_000, 60_000
SIDES = ("left", "right")

Spans = Sequence[tuple[int, int]]


def after(spans: Spans, time: int) -> int:
    """When something can happen that is due at a time: then, or at the end of the span that it is in."""
    return next((end for begin, end in spans if begin <= time < end), time)


@dataclass
class Staged:
    """The faults of a session: spans in which a process stalls, or a link holds back its messages."""

    ticks: int = 1000
    server: Spans = ()
    agents: Mapping[str, Spans] = field(default_factory=dict)
    up: Mapping[str, Spans] = field(default_factory=dict)
    drift: Mapping[str, int] = field(default_factory=dict)  # shift of each of 80 samples, the other way in the next 80

    def rows(self) -> NDArray[np.void]:
        """Return the ticks."""
        rows = np.zeros(self.ticks, TICK)
        rows["phase"], rows["trial"] = Phase.RUNNING, 3
        samples = {side: self._samples(side) for side in SIDES}
        newest = dict.fromkeys(SIDES, -1)
        rendered: dict[str, list[tuple[int, int]]] = {side: [(-START, 0)] for side in SIDES}
        due, free = 0, 0
        for k, row in enumerate(rows):
            awake = max(free, after(self.server, max(free, due)))
            come = {side: self._come(samples[side], newest[side], free, due) for side in SIDES}
            if all(one is not None for one in come.values()):
                soon = max(one for one in come.values() if one is not None)
                awake = min(awake, max(soon, due - MS // 2, free))
            taken = {side: self._taken(samples[side], newest[side], awake) for side in SIDES}
            old = due
            due += (awake - due) // MS * MS if awake - due > 20 * MS else 0
            row["tick"], row["time_ns"], row["late_ns"] = 70 + k, START + due, awake - due
            for side in SIDES:
                self._fill(row, rows[k - 1], side, samples[side], newest[side], taken[side], old, rendered[side])
                newest[side] = taken[side]
                if not k or rows[k - 1][f"{side}_seq"] != row[f"{side}_seq"]:
                    at = after(self.agents.get(side, ()), awake + WAY) + k % 97  # no two loops take as long
                    rendered[side].append((at, at - samples[side][taken[side]][0]))
            free, due = awake + WORK, due + MS
        return rows

    def backfill(self, rows: NDArray[np.void], offset_ns: int = 0) -> list[BackfillRecord]:
        """Backfill records: the samples that no tick used while the newest one was more than 3 ms old."""
        records = []
        for side in SIDES:
            samples, seq = self._samples(side), rows[f"{side}_seq"]
            skipped = [k for a, b in pairwise(seq) if samples[b][0] - samples[a][0] > 3 * MS for k in range(a + 1, b)]
            reported = np.zeros(len(skipped), RENDERED)
            reported["seq"] = skipped
            reported["stamp_ns"] = [START + offset_ns + samples[k][0] for k in skipped]
            records.append(BackfillRecord(len(records), side, offset_ns, reported.tobytes()))
        return records

    def _samples(self, side: str) -> list[tuple[int, int]]:
        """When each sample is read, and when it is there to be taken."""
        stalls, held, due, free = self.agents.get(side, ()), self.up.get(side, ()), -450_000, -MS
        found: list[tuple[int, int]] = []
        while due < (self.ticks + 200) * MS:
            read = max(free, after(stalls, due)) + len(found) % 2  # no clock is even to the nanosecond
            if read - due > 20 * MS:
                due += (read - due) // MS * MS
            found.append((read, after(self.server, after(held, read + WAY))))
            shift = self.drift.get(side, 0) * ((300 <= len(found) < 380) - (380 <= len(found) < 460))
            due, free = due + MS + shift, read + BURST
        return found

    @staticmethod
    def _come(samples: list[tuple[int, int]], newest: int, free: int, due: int) -> int | None:
        """When the next sample comes, if that is before the deadline."""
        arrived = samples[newest + 1][1]
        return max(arrived, free) if arrived <= due else None

    @staticmethod
    def _taken(samples: list[tuple[int, int]], newest: int, now: int) -> int:
        """The newest sample that has arrived."""
        while samples[newest + 1][1] <= now:
            newest += 1
        return newest

    @staticmethod
    def _fill(
        row: np.void,
        before: np.void,
        side: str,
        samples: list[tuple[int, int]],
        newest: int,
        taken: int,
        due: int,
        rendered: list[tuple[int, int]],
    ) -> None:
        """Write a side's part of a row."""
        row[f"{side}_live"], row[f"{side}_seq"] = 1, taken
        row[f"{side}_stamp_ns"] = START + samples[taken][0]
        fresh = taken != newest
        row[f"{side}_lead_ns"] = due - samples[taken][1] if fresh else before[f"{side}_lead_ns"]
        row[f"{side}_loop_ns"] = next(loop for at, loop in reversed(rendered) if at <= samples[taken][0])
